"""Any file that claims to be a mesh or an image: a sound result or one line, never anything else."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from fuzzing import altered, damaged, kept
from hypothesis import example, given, settings
from hypothesis import strategies as st
from meshfiles import WRITERS, sheet, write_obj
from PIL import Image

from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.pins import select_pins
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.loading import load_mesh
from warp_cloth.material.fabric import Fabric

POINTS, TRIANGLES = sheet(4)
UV = POINTS[:, :2]
KINDS = (*(kind for kind in WRITERS if not kind.startswith("usd")), "gltf", "ascii.ply", "ascii.stl")
USD_EXAMPLES = 100  # each file is read by a process of its own, for a third of a second


@cache
def whole(kind: str) -> bytes:
    """A sound file of a kind."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"whole.{kind}"
        if kind == "obj":
            write_obj(path, POINTS, TRIANGLES, UV)
        elif kind == "ascii.ply":
            head = f"ply\nformat ascii 1.0\nelement vertex {len(POINTS)}\nproperty float x\nproperty float y\n"
            head += f"property float z\nelement face {len(TRIANGLES)}\nproperty list uchar int vertex_indices\n"
            rows = [*POINTS.tolist(), *([3, *face] for face in TRIANGLES.tolist())]
            return (head + "end_header\n" + "\n".join(" ".join(map(str, row)) for row in rows) + "\n").encode()
        elif kind == "ascii.stl":
            facets = "".join(
                "facet normal 0 0 1\nouter loop\n"
                + "".join(f"vertex {x} {y} {z}\n" for x, y, z in POINTS[face])
                + "endloop\nendfacet\n"
                for face in TRIANGLES
            )
            return f"solid sheet\n{facets}endsolid sheet\n".encode()
        elif kind == "gltf":
            return _gltf()
        else:
            WRITERS[kind](path, POINTS, TRIANGLES)
        return path.read_bytes()


def _gltf() -> bytes:
    """A glTF that holds its own data."""
    import trimesh

    parts = trimesh.Trimesh(POINTS, TRIANGLES, process=False).export(file_type="gltf", embed_buffers=True)
    return next(content for name, content in parts.items() if name.endswith("gltf"))


def is_sound(mesh: Mesh) -> None:
    assert np.isfinite(mesh.points).all()
    assert len(mesh.triangles)
    assert mesh.triangles.min() >= 0
    assert mesh.triangles.max() < mesh.vertex_count
    assert mesh.texcoords is None or np.isfinite(mesh.texcoords).all()


def holds_its_promise(mesh: Mesh, rest: str) -> None:
    """The mesh is sound; its rest shape is finite, or refused."""
    is_sound(mesh)
    shape = kept(lambda: build_rest_shape(mesh, Fabric(), rest=rest))  # type: ignore[arg-type]
    if shape is not None:
        for values in (shape.edge_length, shape.edge_pull, shape.edge_push, shape.hinge_stiffness, shape.vertex_weight):
            assert np.isfinite(values).all()
            assert (values >= 0.0).all()
        assert (shape.vertex_weight > 0.0).all()


@pytest.fixture(scope="module")
def folder() -> Path:
    with TemporaryDirectory() as name:
        yield Path(name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("error")
@given(data=st.data(), role=st.sampled_from(("garment", "avatar")), rest=st.sampled_from(("mesh", "uv")))
def test_a_damaged_mesh_file_is_a_sound_mesh_or_one_line(
    folder: Path, kind: str, data: st.DataObject, role: str, rest: str
) -> None:
    path = folder / f"damaged.{kind}"
    path.write_bytes(data.draw(damaged(whole(kind))))
    mesh = kept(lambda: load_mesh(path, role=role, key=role, rest=rest))  # type: ignore[arg-type]
    if mesh is not None:
        holds_its_promise(mesh, rest)


@pytest.mark.parametrize("kind", ["glb", "gltf"])
@pytest.mark.filterwarnings("error")
@given(data=st.data(), role=st.sampled_from(("garment", "avatar")))
def test_an_altered_gltf_tree_is_a_sound_mesh_or_one_line(
    folder: Path, kind: str, data: st.DataObject, role: str
) -> None:
    content = whole(kind)
    size = int.from_bytes(content[12:16], "little") if kind == "glb" else len(content)
    start = 20 if kind == "glb" else 0
    tree = json.dumps(data.draw(altered(json.loads(content[start : start + size])))).encode()
    tree += b" " * (-len(tree) % 4)
    if kind == "glb":
        rest = content[start + size :]
        tree = struct.pack("<4sIII", b"glTF", 2, 20 + len(tree) + len(rest), len(tree)) + b"JSON" + tree + rest
    path = folder / f"altered.{kind}"
    path.write_bytes(tree)
    mesh = kept(lambda: load_mesh(path, role=role, key=role))  # type: ignore[arg-type]
    if mesh is not None:
        holds_its_promise(mesh, "mesh")


@pytest.mark.parametrize("kind", ["usda", "usdc"])
@pytest.mark.filterwarnings("error")
@settings(max_examples=min(USD_EXAMPLES, max(settings.default.max_examples // 10, 3)))
@given(data=st.data())
def test_a_damaged_usd_file_is_a_sound_mesh_or_one_line(folder: Path, kind: str, data: st.DataObject) -> None:
    path = folder / f"damaged.{kind}"
    path.write_bytes(data.draw(damaged(whole(kind))))
    mesh = kept(lambda: load_mesh(path, role="garment", key="garment"))
    if mesh is not None:
        holds_its_promise(mesh, "mesh")


COORDINATES = st.one_of(
    st.floats(-1.0, 1.0),
    st.sampled_from((0.0, 0.1, 0.5, 0.5 + 1e-12, 1e-9, 1e-300, 1e9, 1e300, float("nan"), float("inf"))),
)


@st.composite
def soups(draw: st.DrawFn) -> bytes:
    """A text mesh of any points and any polygons over them, with texture coordinates or without."""
    points = draw(st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=1, max_size=9))
    corner = st.integers(1, len(points) + draw(st.sampled_from((0, 0, 0, 1))))
    faces = draw(st.lists(st.lists(corner, min_size=1, max_size=5), max_size=12))
    textured = draw(st.booleans())
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points]
    lines += [f"vt {draw(COORDINATES)!r} {draw(COORDINATES)!r}" for _ in points] if textured else []
    lines += ["f " + " ".join(f"{c}/{c}" if textured else str(c) for c in face) for face in faces]
    return "\n".join(lines).encode()


# texture coordinates whose squares are beyond all numbers
BEYOND = b"v 0 0 0\nv 0 0 0\nv 0 0 1\nvt 0 0\nvt 0 0\nvt 0 1e300\nf 1/1 2/2 3/3"
BEYOND_SUMS = b"v 0 0 0\nv 0 1 0\nv 0 0 1\nvt 1e308 1e308\nvt -1e308 1\nvt 1e308 -1e308\nf 1/1 2/2 3/3"


@pytest.mark.filterwarnings("error")
@given(
    content=soups(),
    role=st.sampled_from(("garment", "avatar")),
    rest=st.sampled_from(("mesh", "uv")),
    units=st.sampled_from((None, "m", "cm", "mm", "in")),
)
@example(content=BEYOND, role="garment", rest="uv", units=None)
@example(content=BEYOND_SUMS, role="garment", rest="mesh", units=None)
@example(content=BEYOND_SUMS, role="garment", rest="uv", units=None)
def test_any_polygons_are_a_sound_mesh_or_one_line(
    folder: Path, content: bytes, role: str, rest: str, units: str | None
) -> None:
    path = folder / "soup.obj"
    path.write_bytes(content)
    mesh = kept(lambda: load_mesh(path, role=role, key=role, rest=rest, units=units))  # type: ignore[arg-type]
    if mesh is not None:
        holds_its_promise(mesh, rest)


@cache
def picture(kind: str) -> bytes:
    stream = io.BytesIO()
    colours = (np.arange(6 * 5 * 3, dtype=np.uint8) * 7).reshape(6, 5, 3)
    Image.fromarray(colours).save(stream, format=kind)
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "TGA", "PPM"])
@pytest.mark.filterwarnings("error")
@given(data=st.data())
def test_a_damaged_grain_image_is_angles_or_one_line(folder: Path, kind: str, data: st.DataObject) -> None:
    path = folder / f"grain.{kind.lower()}"
    path.write_bytes(data.draw(damaged(picture(kind))))
    mesh = Mesh("sheet", POINTS, TRIANGLES.astype(np.int32), UV[TRIANGLES])
    angles = kept(lambda: Grain(texture=path).of_triangles(mesh, "garment"))
    if angles is not None:
        assert np.isfinite(angles).all()


@dataclass(frozen=True)
class Pin:
    """One entry of a scene's ``pin``."""

    vertices: list[int] | None = None
    box: list[list[float]] | None = None
    loop: str | int | None = None


BOUNDED = st.floats(-1e7, 1e7)
PINS = st.one_of(
    st.builds(Pin, vertices=st.lists(st.integers(0, 2**31 - 1) | st.integers(0, 20), max_size=4)),
    st.builds(Pin, box=st.lists(st.lists(BOUNDED, min_size=3, max_size=3), min_size=2, max_size=2)),
    st.builds(Pin, loop=st.sampled_from(("top", "bottom", "left", "right", "front", "back")) | st.integers(0, 3)),
)


@pytest.mark.filterwarnings("error")
@given(pins=st.lists(PINS, max_size=3), turned=st.booleans())
def test_any_pins_are_vertices_or_one_line(pins: list[Pin], turned: bool) -> None:
    mapped = np.where(np.arange(20) < len(POINTS), np.arange(20), -1) if turned else None
    mesh = Mesh("sheet", POINTS, TRIANGLES.astype(np.int32), vertex_map=mapped)
    chosen = kept(lambda: select_pins(mesh, pins, "garment.pin"))
    if chosen is not None and len(chosen):
        assert (np.diff(chosen) > 0).all()
        assert chosen.min() >= 0
        assert chosen.max() < len(POINTS)
