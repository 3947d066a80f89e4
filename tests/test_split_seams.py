"""A seam whose two sides have different vertices is joined: edges are split where the other side has one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from meshfiles import write_panels

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.loading import load_mesh
from warp_cloth.loading.split_seams import split_seams
from warp_cloth.shapes import sphere

Strip = tuple[np.ndarray, np.ndarray]


def strip(columns: int, low: float, high: float, first: float = 0.0, last: float = 1.0) -> Strip:
    """A strip in the plane z = 0 from ``first`` to ``last``, of one row with this number of columns [m]."""
    x, y = np.meshgrid(np.linspace(first, last, columns + 1), [low, high])
    a = np.arange(columns)
    b = a + columns + 1
    triangles = np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1), triangles


def together(*strips: Strip) -> Strip:
    starts = np.cumsum([0, *(len(points) for points, _ in strips)])
    faces = [triangles + start for (_, triangles), start in zip(strips, starts, strict=False)]
    return np.concatenate([points for points, _ in strips]), np.concatenate(faces)


@pytest.mark.parametrize("columns", [(7, 4), (8, 4), (1, 5), (5, 5)])
def test_strips_of_different_columns_become_one_sheet(columns: tuple[int, int]) -> None:
    points, triangles = together(strip(columns[0], 0.0, 0.1), strip(columns[1], 0.1, 0.2))
    split = split_seams(points, triangles)
    assert split is not None
    assert split.joints == sum(columns) + 2
    (rim,) = build_topology(split.triangles.astype(np.int32), len(points)).boundary_loops
    assert len(rim) == sum(columns) + 4
    corners = points[split.triangles]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(0.2)
    before = np.einsum("fkc,fcd->fkd", split.weights, points[triangles[split.source]])
    assert before == pytest.approx(corners, abs=1e-12)


def test_a_corner_of_rims_is_split_on_both_sides() -> None:
    below, above = strip(1, 0.0, 0.1), strip(3, 0.1, 0.2)
    beside = strip(3, -0.1, 0.0)
    turned = beside[0][:, [1, 0, 2]], beside[1][:, ::-1]  # along the left of the strip below, from y = 0 to 1
    turned = turned[0] * [1.0, 0.1, 1.0], turned[1]
    points, triangles = together(below, above, turned)
    split = split_seams(points, triangles)
    assert split is not None
    assert len(build_topology(split.triangles.astype(np.int32), len(points)).boundary_loops) == 1


@pytest.mark.parametrize(
    "others",
    [
        [strip(4, 0.10011, 0.2)],  # off the seam
        [strip(4, 0.1, 0.2, 1.0, 2.0)],  # touches a corner alone
        [strip(4, 0.1, 0.2), strip(5, 0.1, 0.3)],  # three would meet: layers
        [strip(4, 0.1, 0.05)],  # lies on it
    ],
)
def test_what_touches_otherwise_stays_apart(others: list[Strip]) -> None:
    assert split_seams(*together(strip(7, 0.0, 0.1), *others)) is None


def test_closed_pieces_have_no_rims() -> None:
    ball = sphere(radius=0.1, centre=(0.0, 0.0, 0.0), edge=0.05)
    assert (
        split_seams(*together(*((ball.points + np.array([off, 0.0, 0.0]), ball.triangles) for off in (0.0, 0.2))))
        is None
    )


def test_a_garment_in_two_pieces_is_read_as_one_with_its_panels(tmp_path: Path) -> None:
    points, triangles = together(strip(7, 0.0, 0.5), strip(4, 0.5, 1.0))
    mesh = Mesh("apron", points, triangles.astype(np.int32), texcoords=points[triangles][:, :, :2])
    path = write_panels(tmp_path / "apron.obj", points, mesh, 1.0)
    read = load_mesh(path, role="garment", key="garment", units="m", rest="auto")
    assert any(note.startswith("13 vertices joined with another piece") for note in read.notes)
    assert not any("separate pieces" in note for note in read.notes)
    assert read.texcoords == pytest.approx(read.points[read.triangles][:, :, :2], abs=1e-6)
    assert read.triangle_source is not None
    assert len(read.triangle_source) == read.triangle_count > len(triangles)
