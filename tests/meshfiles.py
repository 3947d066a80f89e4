"""Writes small meshes, sound or broken, in every format that is read."""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from pxr import Sdf, Usd, UsdGeom, Vt

from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import load_mesh
from warp_cloth.shapes import sphere

Faces = Sequence[Sequence[int]] | np.ndarray
Writer = Callable[[Path, np.ndarray, Faces], None]
BOX_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))  # z varies fastest


def sheet(count: int = 5, side: float = 0.5, height: float = 1.0, toward: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """A vertical square of ``count`` vertices a side [m], its bottom at ``height``: points and triangles."""
    x, y = np.meshgrid(np.linspace(-side / 2, side / 2, count), np.linspace(0.0, side, count))
    points = np.stack([x.ravel(), y.ravel() + height, np.full(count * count, toward)], axis=1)
    corner = (np.arange(count - 1) + count * np.arange(count - 1)[:, None]).reshape(-1, 1, 1)
    pair = np.array([[0, 1, count + 1], [0, count + 1, count]])
    return points, (corner + pair).reshape(-1, 3)


def ball(radius: float = 0.25, height: float = 1.25) -> tuple[np.ndarray, np.ndarray]:
    """A coarse sphere round (0, height, 0) [m]: points and triangles."""
    mesh = sphere(radius=radius, centre=(0.0, height, 0.0), edge=radius / 3.0)
    return mesh.points, mesh.triangles


def box(low: ArrayLike, high: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """A block between two corners [m]: points and triangles, which face outwards, two for each of BOX_SIDES."""
    points = np.array(list(itertools.product(*np.stack([low, high], axis=1))), dtype=np.float64)
    return points, np.array([(side[0], *pair) for side in BOX_SIDES for pair in (side[1:3], side[2:])], dtype=np.int32)


def obj_text(points: np.ndarray, faces: Faces, texcoords: ArrayLike | None = None) -> str:
    """An OBJ; texture coordinates of each vertex, shape [V, 2], or of each corner of triangles, shape [F, 3, 2]."""
    corners = [[str(int(corner) + 1) for corner in face] for face in faces]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(points, dtype=float).tolist()]
    if texcoords is not None:
        flat, number = np.asarray(texcoords, dtype=float), itertools.count(1)
        lines += [f"vt {u!r} {v!r}" for u, v in flat.reshape(-1, 2).tolist()]
        corners = [[f"{each}/{next(number) if flat.ndim == 3 else each}" for each in face] for face in corners]
    return "\n".join([*lines, *("f " + " ".join(face) for face in corners), ""])


def write_obj(path: Path, points: np.ndarray, faces: Faces, texcoords: ArrayLike | None = None) -> None:
    path.write_text(obj_text(points, faces, texcoords))


def as_mesh(*shapes: trimesh.Trimesh) -> Mesh:
    """A shape, or several as one."""
    shape = trimesh.util.concatenate(list(shapes))
    return Mesh("shape", np.asarray(shape.vertices, dtype=np.float64), np.asarray(shape.faces, dtype=np.int32))


def written_garment(path: Path, points: np.ndarray, faces: Faces, **options: Any) -> Mesh:
    """A garment from an OBJ file of its own, in metres; ``options`` as for ``load_mesh``."""
    write_obj(path, points, faces)
    return load_mesh(path, role="garment", key="garment", **{"units": "m", **options})


def write_panels(path: Path, points: np.ndarray, mesh: Mesh, scale: float = 1.0) -> Path:
    """An OBJ file of a garment with its vertices at ``points``, and its texture coordinates, a corner each, scaled."""
    write_obj(path, points.round(7), mesh.triangles, (scale * mesh.texcoords).round(7))
    return path


def write_circle_skirt(
    path: Path, girth: float, waist: float, half: float, *, rows: int = 10, columns: int = 17
) -> Path:
    """A skirt of two fans, one 20 cm before the body and one behind it, sewn along their straight edges.

    girth of its waist [m], which starts ``waist`` high [m]; ``half`` the angle of a fan.
    """
    inner = girth / (4.0 * half)
    radius, angle = np.meshgrid(np.linspace(inner, inner + 0.5, rows), np.linspace(-half, half, columns), indexing="ij")
    across, down = radius * np.sin(angle), radius * np.cos(angle)
    seam = np.isin(np.arange(columns), (0, columns - 1))
    corner = np.arange(rows * columns).reshape(rows, columns)
    vertices, texcoords, faces = [], [], []
    for side, depth in ((0, 0.2), (1, -0.2)):
        places = np.stack([across, waist + inner - down, np.where(seam, 0.0, depth) + 0.0 * across], axis=-1)
        vertices += places.reshape(-1, 3).tolist()
        texcoords += np.stack([across + 3.0 * side, -down], axis=-1).reshape(-1, 2).tolist()
        number = corner + side * corner.size + 1
        welded = np.where(seam, corner + 1, number)  # the fan behind shares the seams' vertices
        for first, second, third in ((0, 1, 2), (0, 2, 3)):
            for i in range(rows - 1):
                for j in range(columns - 1):
                    quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    turn = [quad[first], quad[second], quad[third]][:: 1 - 2 * side]
                    faces.append("f " + " ".join(f"{welded[at]}/{number[at]}" for at in turn))
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*each) for each in vertices]
    lines += ["vt {:.6f} {:.6f}".format(*each) for each in texcoords]
    path.write_text("\n".join(lines + faces) + "\n")
    return path


def write_ply(path: Path, points: np.ndarray, faces: Faces) -> None:
    """Binary, little endian, float32."""
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = b"".join(struct.pack(f"<B{len(face)}i", len(face), *(int(corner) for corner in face)) for face in faces)
    path.write_bytes(head.encode() + np.asarray(points, dtype="<f4").tobytes() + rows)


def write_stl(path: Path, points: np.ndarray, faces: Faces) -> None:
    """Binary triangles."""
    records = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    if len(faces):
        records["corners"] = np.asarray(points)[np.asarray(faces)]
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + records.tobytes())


def gltf_of(points: np.ndarray, faces: Faces) -> tuple[dict, bytes]:
    """One primitive of triangles as glTF, float32 and uint32, and its buffer."""
    place = np.asarray(points, dtype="<f4").tobytes()
    corners = np.asarray(faces).astype("<u4").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(place) + len(corners)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(place)},
            {"buffer": 0, "byteOffset": len(place), "byteLength": len(corners)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": len(corners) // 4, "type": "SCALAR"},
        ],
    }
    return tree, place + corners


def glb(tree: dict, body: bytes) -> bytes:
    """A binary file of a glTF and its buffer."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write_glb(path: Path, points: np.ndarray, faces: Faces) -> None:
    path.write_bytes(glb(*gltf_of(points, faces)))


def write_usd(path: Path, points: np.ndarray, faces: Faces, texcoords: ArrayLike | None = None) -> None:
    """One mesh, /sheet, in metres, y up; the file's suffix says which kind of USD."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, "/sheet")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([int(corner) for face in faces for corner in face])
    if texcoords is not None:
        kind, per = Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, per)
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(texcoords, dtype=np.float32)))
    stage.GetRootLayer().Export(str(path))


WRITERS: dict[str, Writer] = {
    "obj": write_obj,
    "ply": write_ply,
    "stl": write_stl,
    "glb": write_glb,
    "usda": write_usd,
    "usdc": write_usd,
}
