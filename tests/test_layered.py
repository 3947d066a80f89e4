"""Layers of a garment that are sewn to it within its cloth: pockets, doubled hems, flaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cloths import tube
from meshfiles import written_garment

from warp_cloth.base.errors import InputError
from warp_cloth.base.topology import build_topology

AROUND, ROWS = 24, 9
SKIRT = tube(0.15, 0.4, 0.8, AROUND, ROWS)


def layered(rows: range, columns: range, away: float, sewn: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """A skirt, and a second layer [m] off a part of it, which shares the vertices of the sewn sides of that part."""
    number = np.arange(len(SKIRT.points)).reshape(ROWS, AROUND)
    there = np.zeros((ROWS, AROUND), dtype=bool)
    there[rows.start : rows.stop, columns.start : columns.stop] = True
    sides = {"first": (rows.start, slice(None)), "last": (rows.stop - 1, slice(None))}
    sides |= {"left": (slice(None), columns.start), "right": (slice(None), columns.stop - 1)}
    shared = np.zeros_like(there)
    for side in sewn:
        shared[sides[side]] = True
    new = number.copy()
    own = there & ~shared
    new[own] = len(SKIRT.points) + np.arange(own.sum())
    outwards = SKIRT.points[own.ravel()] * [1.0, 0.0, 1.0]
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    chosen = there.ravel()[SKIRT.triangles].all(axis=1) & own.ravel()[SKIRT.triangles].any(axis=1)
    points = np.concatenate([SKIRT.points, SKIRT.points[own.ravel()] + away * outwards])
    return points, np.concatenate([SKIRT.triangles, new.ravel()[SKIRT.triangles[chosen]]])


PARTS = {
    "pocket": (range(3, 7), range(4, 9), ("first", "left", "right")),
    "pocket of one row": (range(3, 5), range(4, 9), ("first", "left", "right")),
    "flap": (range(3, 6), range(4, 9), ("last",)),
    "belt loop": (range(3, 6), range(4, 6), ("first", "last")),
    "doubled hem": (range(0, 3), range(0, AROUND), ("first", "last")),
    "doubled hem above": (range(6, 9), range(0, AROUND), ("first", "last")),
}


@pytest.mark.parametrize("part", PARTS)
def test_what_is_sewn_onto_cloth_is_read_and_the_openings_stay(tmp_path: Path, part: str) -> None:
    points, faces = layered(*PARTS[part][:2], 0.004, PARTS[part][2])
    mesh = written_garment(tmp_path / "skirt.obj", points, faces)
    assert mesh.triangle_count == len(faces)
    assert [len(loop) for loop in build_topology(mesh.triangles, mesh.vertex_count).boundary_loops] == [AROUND, AROUND]


def test_what_stands_off_the_cloth_by_more_than_a_pocket_is_refused(tmp_path: Path) -> None:
    rows, columns, sewn = PARTS["flap"]
    written_garment(tmp_path / "near.obj", *layered(rows, columns, 0.03, sewn))
    with pytest.raises(InputError, match="has 3 faces"):
        written_garment(tmp_path / "far.obj", *layered(rows, columns, 0.1, sewn))


def test_a_sheet_that_is_pinched_at_one_edge_is_read(tmp_path: Path) -> None:
    """Two layers whose vertices were merged at one edge, as by merging what is near."""
    points, faces = layered(range(0, ROWS), range(0, AROUND), 0.004, ("last",))
    number = np.arange(len(points))
    number[len(SKIRT.points) + AROUND * 4 + np.arange(2)] = AROUND * 4 + np.arange(2)
    assert written_garment(tmp_path / "pinched.obj", points, number[faces]).triangle_count == len(faces)
