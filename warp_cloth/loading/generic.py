"""STL, GLB and glTF by trimesh; files that it would silently read wrongly are refused here."""

from __future__ import annotations

import base64
import json
import struct
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8
from warp_cloth.loading.decimals import float32_doubt
from warp_cloth.loading.raw import CUT_OFF, EXPORT_AGAIN, LISTED, POSED, RawMesh, joined

_GLB_HEADER, _GLB_CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")
_TRIANGLE_MODES = (4, 5)  # triangles and strips, which trimesh reads; a missing mode is 4
_FAN_MODE = 6
_INSTANCING = "EXT_mesh_gpu_instancing"
_UV = "_TEXCOORD"  # custom attribute under which trimesh hands texture coordinates on without a material


def read_stl(file: str, data: bytes) -> RawMesh:
    """Triangles of an STL, each with three vertices of its own; several solids become panels."""
    data = data if _is_binary_stl(data) else to_utf8(data)
    text = data[:512].lstrip().lower().startswith(b"solid") and b"vertex" in data[:4096].lower()
    if len(data) < 84 and not text:
        raise InputError(file, "is not an STL file: too short for one triangle", CUT_OFF)
    if not text and not _is_binary_stl(data):
        size = _stl_size(data)
        problem = f"is not an STL file, or cut off: its header declares {size:,} bytes, it has {len(data):,}"
        raise InputError(file, problem, CUT_OFF)
    if text and not _is_binary_stl(data):
        _check_stl_text(file, data)
    return _read(file, data, "stl", None)


def _is_binary_stl(data: bytes) -> bool:
    """Whether a file is as long as its count of triangles says."""
    return len(data) == _stl_size(data)


def _stl_size(data: bytes) -> int:
    """Of a binary STL that counts its triangles as this one does."""
    return 84 + 50 * int.from_bytes(data[80:84], "little")


def _check_stl_text(file: str, data: bytes) -> None:
    """Refuses a text STL with incomplete facets: trimesh would shift or skip vertices."""
    facet = 0
    vertices = 0
    opened = closed = 0
    for number, line in enumerate(data.splitlines(), start=1):
        tokens = line.split()
        word = tokens[0].lower() if tokens else b""
        if word == b"vertex":
            vertices += 1
            if len(tokens) != 4 or not _are_numbers(tokens[1:]):
                text = line.strip()[:60].decode("utf-8", errors="backslashreplace")
                raise InputError(f"{file}:{number}", f"{text!r} is not a vertex of three numbers", EXPORT_AGAIN)
        elif word == b"endloop":
            facet += 1
            if vertices != 3 * facet:
                raise InputError(f"{file}:{number}", f"facet {facet} does not have three vertices", EXPORT_AGAIN)
        opened += word == b"solid"
        closed += word == b"endsolid"
    if vertices != 3 * facet or opened != closed:
        raise InputError(file, f"ends within facet {facet + 1} or before 'endsolid'", CUT_OFF)


def _are_numbers(tokens: list[bytes]) -> bool:
    try:
        return all(float(word) is not None for word in tokens)
    except ValueError:
        return False


def read_gltf(file: str, data: bytes, *, key: str = "", name: str | None = None) -> RawMesh:
    """Meshes of a glTF scene, GLB or JSON, in its nodes' places; metres, y up. ``name``: only of that node or mesh."""
    binary = data[:4] == b"glTF"
    chunk, rest = _glb_parts(file, data) if binary else (data, b"")
    try:
        tree = json.loads(to_utf8(chunk))
        _check_gltf(file, tree)
        if name is not None:
            _keep_only(tree, name, file, key)
        tree.setdefault("scenes", [{"nodes": _roots(tree)}])
        posed = any("skin" in node for node in tree.get("nodes", []) if "mesh" in node)
        for primitive in _primitives(tree):
            posed |= "targets" in primitive
            attributes = primitive["attributes"]
            if "TEXCOORD_0" in attributes:
                attributes[_UV] = attributes["TEXCOORD_0"]
            for unused in ("NORMAL", "COLOR_0"):
                attributes.pop(unused, None)
        kind = "glb" if binary else "gltf"
        chunk = json.dumps(tree).encode()
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError, OSError) as error:
        raise InputError(file, f"is not a glTF file: {_reason(error)}", "check the file's name and content") from None
    if binary:
        chunk += b" " * (-len(chunk) % 4)
        total = _GLB_HEADER.size + _GLB_CHUNK.size + len(chunk) + len(rest)
        chunk = _GLB_HEADER.pack(b"glTF", 2, total) + _GLB_CHUNK.pack(len(chunk), b"JSON") + chunk + rest
    found = _read(file, chunk, kind, 1.0)
    return replace(found, notes=(*found.notes, POSED)) if posed else found


def _glb_parts(file: str, data: bytes) -> tuple[bytes, bytes]:
    """JSON of a GLB, and the chunks after it as they are."""
    if len(data) < _GLB_HEADER.size + _GLB_CHUNK.size:
        raise InputError(file, f"the GLB ends after {len(data)} bytes, within its header", CUT_OFF)
    _, version, length = _GLB_HEADER.unpack_from(data)
    if version != 2:
        raise InputError(file, f"is glTF version {version}; only version 2 is read", "export it as glTF 2.0")
    if length > len(data):
        raise InputError(file, f"the GLB has {len(data):,} of its {length:,} bytes", CUT_OFF)
    start = _GLB_HEADER.size
    size, kind = _GLB_CHUNK.unpack_from(data, start)
    start += _GLB_CHUNK.size
    if kind != b"JSON" or start + size > length:
        raise InputError(file, "the GLB does not start with a complete JSON chunk", CUT_OFF)
    return data[start : start + size], data[start + size : length]


def gltf_mesh_names(file: str, data: bytes) -> list[str]:
    """Names of the meshes of a glTF file, as ``read_gltf`` takes them, in the file's order."""
    chunk = _glb_parts(file, data)[0] if data[:4] == b"glTF" else data
    return _mesh_names(json.loads(to_utf8(chunk)))


def _mesh_names(tree: dict[str, Any]) -> list[str]:
    """Of each node with a mesh, in the file's order: its name, or else the mesh's."""
    meshes = tree.get("meshes", [])
    names = (node.get("name") or meshes[node["mesh"]].get("name") for node in tree.get("nodes", []) if "mesh" in node)
    return [name for name in names if name]


def _keep_only(tree: dict[str, Any], name: str, file: str, key: str) -> None:
    """Removes the meshes of all nodes but those with a name, and those below them."""
    nodes, meshes = tree.get("nodes", []), tree.get("meshes", [])
    selected = {number for number, node in enumerate(nodes) if node.get("name") == name}
    below = list(selected)
    while below:
        children = [child for child in nodes[below.pop()].get("children", ()) if child not in selected]
        selected.update(children)
        below += children
    selected |= {n for n, node in enumerate(nodes) if "mesh" in node and meshes[node["mesh"]].get("name") == name}
    if not any("mesh" in nodes[number] for number in selected):
        known = ", ".join(_mesh_names(tree)[:LISTED])
        raise InputError(file, f'holds no mesh "{name}"', f"{key}.prim may be {known}" if known else EXPORT_AGAIN)
    for number, node in enumerate(nodes):
        if number not in selected:
            node.pop("mesh", None)


def _roots(tree: dict[str, Any]) -> list[int]:
    """The nodes without a parent: the scene of a file that has none."""
    nodes = tree.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", ())}
    return [number for number in range(len(nodes)) if number not in children]


def _primitives(tree: dict[str, Any]) -> list[dict[str, Any]]:
    return [primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]]


def _check_gltf(file: str, tree: dict[str, Any]) -> None:
    """Refuses what trimesh would read as zeros or skip, and missing data files."""
    if not isinstance(tree, dict) or "asset" not in tree:
        raise InputError(file, "is not a glTF file: its JSON has no 'asset'", "check the file's name and content")
    accessors = tree.get("accessors", [])
    for primitive in _primitives(tree):
        mode = primitive.get("mode", _TRIANGLE_MODES[0])
        packed = [name for name in primitive.get("extensions", {}) if name.endswith("mesh_compression")]
        if packed:
            raise InputError(file, f"is compressed with {packed[0]}", "export it without mesh compression")
        if mode == _FAN_MODE:
            raise InputError(file, "holds triangle fans, which are not supported", "export plain triangles")
        used = [primitive.get("indices"), *primitive["attributes"].values()]
        if any("sparse" in accessors[index] for index in used if index is not None):
            raise InputError(
                file, "holds sparse accessors, which are not supported", "export it without sparse accessors"
            )
    for extension in tree.get("extensionsRequired", []):
        if extension.endswith(("_compression", "_quantization")):
            raise InputError(file, f"requires {extension}, which is not supported", "export it without compression")
    if any(_INSTANCING in node.get("extensions", {}) for node in tree.get("nodes", [])):
        raise InputError(
            file, f"places meshes by {_INSTANCING}, which is not supported", "export each instance as a node"
        )
    for buffer in tree.get("buffers", []):
        uri = buffer.get("uri")
        if uri is None:
            continue
        if uri.startswith("data:"):
            base64.b64decode(uri.partition(",")[2], validate=True)
        elif not (Path(file).parent / uri).is_file():
            raise InputError(file, f"its data file {uri!r} is missing", "keep it next to the .gltf, or export a .glb")


def _read(file: str, data: bytes, kind: str, metres_per_unit: float | None) -> RawMesh:
    """Triangles of every mesh in trimesh's scene, in the file's order."""
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # numpy only warns where it stops reading numbers early
            scene = trimesh.load_scene(
                trimesh.util.wrap_as_stream(data),
                file_type=kind,
                resolver=trimesh.resolvers.FilePathResolver(file),
                process=False,
                **({} if kind == "stl" else {"skip_materials": True}),
            )
            nodes: dict[str, list[str]] = {}
            for node in scene.graph.nodes_geometry:
                nodes.setdefault(scene.graph[node][1], []).append(node)
            found = [
                (str(name), _part(file, mesh, scene.graph[node][0], metres_per_unit))
                for name, mesh in scene.geometry.items()
                for node in sorted(nodes.get(name, []))
                if isinstance(mesh, trimesh.Trimesh)
            ]
    except (Exception, RecursionError, MemoryError) as error:  # a damaged file makes trimesh raise anything
        name = "STL" if kind == "stl" else "glTF"
        raise InputError(file, f"cannot be read as {name}: {_reason(error)}", CUT_OFF) from error
    if not found:
        raise InputError(file, "holds no mesh with faces", "export the surface as triangles")
    names, parts = zip(*found, strict=True)
    return joined(parts, file, names)


def _part(file: str, mesh: Any, transform: Any, metres_per_unit: float | None) -> RawMesh:
    """One mesh of a scene, transformed to its place; a mirroring transform flips its faces."""
    matrix = np.asarray(transform, dtype=np.float64)
    points = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"positions of shape {points.shape} and triangles of shape {faces.shape}")
    doubt = float32_doubt(points)
    if not np.array_equal(matrix, np.eye(4)):
        with np.errstate(all="ignore"):  # what is not finite is refused later
            doubt = doubt @ np.abs(matrix[:3, :3]).T
            points = points @ matrix[:3, :3].T + matrix[:3, 3]
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    texcoords = mesh.vertex_attributes.get(_UV)
    if texcoords is not None and (texcoords.shape != (len(points), 2) or faces.max(initial=-1) >= len(points)):
        texcoords = None
    return RawMesh(
        file=file,
        points=points,
        counts=np.full(len(faces), 3, dtype=np.int64),
        corners=faces.reshape(-1).copy(),
        texcoords=None if texcoords is None else texcoords.astype(np.float64)[faces.reshape(-1)],
        metres_per_unit=metres_per_unit,
        doubt=doubt,
    )


def _reason(error: BaseException) -> str:
    if isinstance(error, UnicodeDecodeError):
        return "it is not text"
    if isinstance(error, json.JSONDecodeError):
        return f"its JSON is cut off or damaged in line {error.lineno}, column {error.colno}"
    text = " ".join(str(error).split())[:120]
    return f"{text} ({type(error).__name__})" if text else type(error).__name__
