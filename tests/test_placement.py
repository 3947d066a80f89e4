"""Placement by hand: scale, rotate and translate of a garment as it is loaded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import write_obj

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.units import METRES_PER
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.loading.placement import Placement
from warp_cloth.scene import load_scene
from warp_cloth.shapes.tshirt import tshirt

SHIRT = tshirt(edge=0.04)
ROUNDING = 1e-12  # of a few products of lengths about 1 m


def shirt_file(folder: Path, times: float = 1.0, mesh: Mesh = SHIRT) -> Path:
    """The T-shirt as an OBJ file, its lengths and its panels' times this."""
    path = folder / "shirt.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (mesh.points * times).tolist()]
    lines += [f"vt {u!r} {v!r}" for u, v in (mesh.texcoords.reshape(-1, 2) * times).tolist()]
    corners = (mesh.triangles + 1).tolist()
    lines += ["f " + " ".join(f"{v}/{3 * face + k + 1}" for k, v in enumerate(row)) for face, row in enumerate(corners)]
    path.write_text("\n".join(lines) + "\n")
    return path


def loaded(path: Path, **keys: Any) -> Garment:
    return load_outfit(load_scene({"garment": {"mesh": str(path), **keys}})).garments[0]


@pytest.mark.parametrize("units", [None, "m"])
def test_scaled_by_its_unit_a_mesh_is_the_garment_in_that_unit(tmp_path: Path, units: str | None) -> None:
    path = shirt_file(tmp_path, 1.0 / METRES_PER["in"])
    stated, scaled = loaded(path, units="in"), loaded(path, scale=METRES_PER["in"], units=units)
    assert np.array_equal(stated.points, scaled.points)
    assert scaled.rest.edge_length == pytest.approx(stated.rest.edge_length, rel=ROUNDING)


def test_panels_that_are_in_metres_already_stay_so(tmp_path: Path) -> None:
    mesh = replace(SHIRT, points=SHIRT.points / METRES_PER["in"])
    path = shirt_file(tmp_path, mesh=mesh)
    assert loaded(path, scale=METRES_PER["in"]).rest.edge_length == pytest.approx(
        loaded(shirt_file(tmp_path)).rest.edge_length, rel=1e-6
    )


@pytest.mark.parametrize("rest", ["auto", "uv", "mesh"])
@pytest.mark.parametrize("scale", [0.9, 1.05, 2.0])
def test_the_rest_shape_is_scaled_too(tmp_path: Path, rest: str, scale: float) -> None:
    path = shirt_file(tmp_path)
    before, after = (loaded(path, units="m", rest=rest, scale=each) for each in (1.0, scale))
    assert after.rest.edge_length == pytest.approx(before.rest.edge_length * scale, rel=ROUNDING)
    assert after.points == pytest.approx(before.points * scale, rel=ROUNDING)


def test_stated_units_of_the_panels_are_before_the_scale(tmp_path: Path) -> None:
    path = shirt_file(tmp_path)
    before, after = (loaded(path, units="m", uv_units="m", scale=each) for each in (1.0, 1.2))
    assert after.rest.edge_length == pytest.approx(before.rest.edge_length * 1.2, rel=ROUNDING)


def test_shapes_are_placed_too() -> None:
    def shaped(**keys: Any) -> Garment:
        shape = {"kind": "tshirt", "edge_mm": 40}
        return load_outfit(load_scene({"garment": {"shape": shape, **keys}})).garments[0]

    before, after = shaped(), shaped(scale=1.5, translate=[0.0, 0.25, -1.0])
    assert after.points == pytest.approx(before.points * 1.5 + [0.0, 0.25, -1.0], rel=ROUNDING)
    assert after.rest.edge_length == pytest.approx(before.rest.edge_length * 1.5, rel=ROUNDING)


def test_turns_are_about_x_then_y_then_z_then_moved() -> None:
    point = np.array([[0.0, 1.0, 0.0]])
    assert np.array_equal(Placement(rotate=(90.0, 0.0, 0.0)).moved(point), [[0.0, 0.0, 1.0]])
    assert np.array_equal(Placement(rotate=(90.0, 90.0, 0.0)).moved(point), [[1.0, 0.0, 0.0]])
    moved = Placement((0.5, 0.0, 0.0), (90.0, 90.0, 90.0)).moved(point)
    assert np.array_equal(moved, [[0.5, 1.0, 0.0]])
    assert np.array_equal(Placement(rotate=(0.0, 180.0, 0.0)).moved(np.array([[0.1, 0.2, 0.3]])), [[-0.1, 0.2, -0.3]])


def test_a_turn_keeps_lengths() -> None:
    turned = Placement(rotate=(17.0, -123.0, 310.0)).moved(SHIRT.points)
    before, after = (np.linalg.norm(np.diff(each, axis=0), axis=1) for each in (SHIRT.points, turned))
    assert after == pytest.approx(before, rel=1e-9)


def test_nothing_set_changes_no_bit() -> None:
    assert Placement().moved(SHIRT.points) is SHIRT.points


def test_pins_and_a_far_file_see_the_garment_where_it_is_put(tmp_path: Path) -> None:
    points, faces = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.5, 0.0]]), [[0, 1, 2, 3]]
    write_obj(tmp_path / "far.obj", points + np.array([5000.0, 0.0, 0.0]), faces)
    keys = {"units": "m", "translate": [-5000.0, 1.0, 0.0], "pin": {"box": [[-1, 1.4, -1], [1, 2, 1]]}}
    garment = loaded(tmp_path / "far.obj", **keys)
    assert garment.pins.tolist() == [2, 3]
    with pytest.raises(InputError, match="from the origin"):
        loaded(tmp_path / "far.obj", units="m")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("scale", 0.0),
        ("scale", -1.0),
        ("scale", float("nan")),
        ("scale", 1e300),
        ("translate", [0.0, 1.0]),
        ("translate", [0.0, float("inf"), 0.0]),
        ("translate", 1.0),
        ("rotate", [0.0, 0.0, 400.0]),
        ("rotate", "90"),
    ],
)
def test_nonsense_is_refused_by_its_key(tmp_path: Path, key: str, value: Any) -> None:
    with pytest.raises(InputError, match=rf"garment\.{key}"):
        loaded(shirt_file(tmp_path), **{key: value})


def test_an_impossible_size_names_the_scale(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"times garment\.scale"):
        loaded(shirt_file(tmp_path), units="m", scale=1000.0)
