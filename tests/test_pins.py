"""Pins: by the file's vertex number, by box, by boundary loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.pins import boundary_loops, select_pins


@dataclass
class Pin:
    vertices: list[int] | None = None
    box: list[list[float]] | None = None
    loop: str | int | None = None


@pytest.fixture
def tube() -> Mesh:
    """A cone's frustum: 8 vertices at y = 0 (radius 1), 8 at y = 1 (radius 0.5)."""
    angle = np.arange(8) * np.pi / 4
    ring = np.stack([np.cos(angle), np.zeros(8), np.sin(angle)], axis=1)
    points = np.concatenate([ring, ring * 0.5 + [0, 1, 0]])
    a, b = np.arange(8), (np.arange(8) + 1) % 8
    triangles = np.concatenate([np.stack([a, b, a + 8], 1), np.stack([b, b + 8, a + 8], 1)]).astype(np.int32)
    return Mesh(name="tube", points=points, triangles=triangles)


def test_nothing_pinned_is_an_empty_array(tube: Mesh) -> None:
    chosen = select_pins(tube, [], "garment.pin")
    assert chosen.dtype == np.int32
    assert chosen.shape == (0,)


def test_pins_are_joined_and_sorted(tube: Mesh) -> None:
    chosen = select_pins(tube, [Pin(vertices=[9, 2]), Pin(vertices=[2, 0])], "garment.pin")
    assert chosen.tolist() == [0, 2, 9]


def test_vertices_are_those_of_the_file(tube: Mesh) -> None:
    mapped = Mesh(tube.name, tube.points, tube.triangles, vertex_map=np.array([-1, *range(16), 3]))
    assert select_pins(mapped, [Pin(vertices=[1, 17])], "garment.pin").tolist() == [0, 3]
    with pytest.raises(InputError, match=r"garment.pin\[0\].vertices: vertex 0 belongs to no face"):
        select_pins(mapped, [Pin(vertices=[0])], "garment.pin")


def test_box_takes_what_lies_in_it_whichever_corner_comes_first(tube: Mesh) -> None:
    low, high = [-2.0, 0.5, -2.0], [2.0, 1.0, 2.0]
    for box in ([low, high], [high, low]):
        assert select_pins(tube, [Pin(box=box)], "garment.pin").tolist() == list(range(8, 16))


def test_loops_by_side_and_by_length(tube: Mesh) -> None:
    assert select_pins(tube, [Pin(loop="top")], "p").tolist() == list(range(8, 16))
    assert select_pins(tube, [Pin(loop="bottom")], "p").tolist() == list(range(8))
    assert select_pins(tube, [Pin(loop=0)], "p").tolist() == list(range(8))
    assert select_pins(tube, [Pin(loop=1)], "p").tolist() == list(range(8, 16))
    assert [len(loop) for loop in boundary_loops(tube)] == [8, 8]


@pytest.mark.parametrize(("side", "shift"), [("left", [3, 0, 0]), ("right", [-3, 0, 0]), ("front", [0, 0, 3])])
def test_sides_are_the_wearers(tube: Mesh, side: str, shift: list[float]) -> None:
    moved = Mesh(
        "two",
        np.concatenate([tube.points, tube.points * 0.5 + shift]),
        np.concatenate([tube.triangles, tube.triangles + 16]),
    )
    assert select_pins(moved, [Pin(loop=side)], "p").min() >= 16


@pytest.mark.parametrize(
    ("pin", "words"),
    [
        (Pin(vertices=[16]), "vertex 16 does not exist: tube has 16 vertices; use 0 to 15"),
        (Pin(vertices=[-1]), "vertex -1 does not exist"),
        (Pin(box=[[5, 5, 5], [6, 6, 6]]), r"contains no vertex of tube; the mesh spans \[-1, 0, -1\] to \[1, 1, 1\]"),
        (Pin(loop=2), "loop 2 does not exist: tube has 2 boundary loops; use 0 to 1"),
        (Pin(loop=-1), "loop -1 does not exist"),
        (Pin(loop="upwards"), "'upwards' is not a side; use top, bottom"),
    ],
)
def test_pin_that_selects_nothing_is_refused(tube: Mesh, pin: Pin, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        select_pins(tube, [Pin(vertices=[0]), pin], "garment.pin")
    assert caught.value.place.startswith("garment.pin[1].")


def test_a_loop_that_another_reaches_beyond_is_refused() -> None:
    """A waistcoat that is open in front: neck, fronts and hem are one loop, and an armhole lies higher than that."""
    rows, columns = 9, 24
    angle = np.linspace(0.1, 2 * np.pi - 0.1, columns)  # open at the front, where the angle is 0
    ring = np.stack([np.sin(angle), np.zeros(columns), np.cos(angle)], axis=1)
    points = np.concatenate([ring + np.array([0.0, height / 2, 0.0]) for height in range(rows)])
    quads = [(r * columns + c) for r in range(rows - 1) for c in range(columns - 1)]
    armhole = {r * columns + c for r in (5, 6) for c in (5, 6)}
    faces = [(q, q + 1, q + columns) for q in quads if q not in armhole]
    faces += [(q + 1, q + columns + 1, q + columns) for q in quads if q not in armhole]
    waistcoat = Mesh("waistcoat", points, np.array(faces, dtype=np.int32))
    with pytest.raises(
        InputError, match="loop 1 of waistcoat is furthest to the top on average, but loop 0 reaches further"
    ):
        select_pins(waistcoat, [Pin(loop="top")], "garment.pin")
    assert len(select_pins(waistcoat, [Pin(loop=1)], "garment.pin")) == 8


def test_closed_mesh_has_no_loop() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    closed = Mesh("ball", points, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32))
    with pytest.raises(InputError, match="ball is closed"):
        select_pins(closed, [Pin(loop="top")], "garment.pin")
