"""The T-shirt: pattern, triangulation, sewing, and where it starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.shapes import SIZE_BODIES, MannequinMeasures, tshirt
from warp_cloth.shapes.body import calibrated_form
from warp_cloth.shapes.pattern import SIZE_MEASURES, Panel, Pattern, curve_length, tshirt_pattern
from warp_cloth.shapes.triangulate import contains, triangulate

EDGE = 0.012  # [m] the generator's default
SIZES = ("S", "M", "L")
CAP_MISMATCH = 0.05  # sleeve cap against armhole: what a tailor can ease in without pleats
CHORD = 0.005  # relative: a curve against the polyline of its edges


@pytest.fixture(scope="session")
def shirts() -> dict[str, Mesh]:
    return {size: tshirt(size=size) for size in SIZES}


@pytest.fixture(scope="session")
def patterns() -> dict[str, Pattern]:
    return {size: tshirt_pattern(SIZE_MEASURES[size], EDGE, Cache()) for size in SIZES}


def seam_length(panel: Panel, seam: str) -> float:
    return curve_length(panel.points[panel.seams[seam]])


def area(panel: Panel) -> float:
    one, two = (panel.points[panel.triangles[:, k]] - panel.points[panel.triangles[:, 0]] for k in (1, 2))
    return float((one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2)


def angles(corners: np.ndarray) -> np.ndarray:
    """Smallest angle of each triangle [degrees] of corners [F, 3, 2]."""
    flat = np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=2)
    return np.degrees(trimesh.triangles.angles(flat).min(axis=1))


def boundary_loops(mesh: Mesh) -> list[np.ndarray]:
    """Vertices of each boundary loop, in order."""
    one, other = mesh.triangles.ravel().astype(int), np.roll(mesh.triangles, -1, axis=1).ravel().astype(int)
    inner = set(zip(other.tolist(), one.tolist(), strict=True))
    follow = {a: b for a, b in zip(one.tolist(), other.tolist(), strict=True) if (a, b) not in inner}
    loops = []
    while follow:
        loop = [next(iter(follow))]
        while loop[-1] in follow:
            loop.append(follow.pop(loop[-1]))
        loops.append(np.array(loop[:-1]))
    return loops


def flat_edge_lengths(mesh: Mesh) -> dict[tuple[int, int], float]:
    """Panel length [m] of each directed edge of a triangle."""
    lengths = np.linalg.norm(mesh.texcoords - np.roll(mesh.texcoords, -1, axis=1), axis=2)
    pairs = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    return dict(zip(map(tuple, pairs.tolist()), lengths.ravel().tolist(), strict=True))


# triangulation


def test_square_outline_is_filled_exactly() -> None:
    side = np.linspace(0, 1, 11)[:-1]
    zero, one = np.zeros(10), np.ones(10)
    outline = np.concatenate(
        [np.column_stack(pair) for pair in ((side, zero), (one, side), (1 - side, one), (zero, 1 - side))]
    )
    points, triangles = triangulate(outline, 0.1)
    assert area(Panel("square", points, triangles, {})) == pytest.approx(1.0, abs=1e-12)
    assert np.array_equal(points[:40], outline)
    assert angles(points[triangles]).min() > 20


def test_triangulation_is_delaunay_away_from_a_hollow_outline() -> None:
    turn = np.linspace(0, 2 * np.pi, 121)[:-1]
    radius = 1 + 0.3 * np.cos(3 * turn)
    outline = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    points, triangles = triangulate(outline, 0.06)
    assert len(np.unique(triangles)) == len(points)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    twice = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert twice.min() > 0
    uu, vv = (u**2).sum(axis=1), (v**2).sum(axis=1)
    offset = np.column_stack([v[:, 1] * uu - u[:, 1] * vv, u[:, 0] * vv - v[:, 0] * uu]) / twice[:, None]
    radius = np.linalg.norm(offset, axis=1)
    away = np.linalg.norm(points[None] - (a + offset)[:, None], axis=2)
    margin = 1e-4 * 0.06  # ties within the jitter may go either way
    assert (away > radius[:, None] - margin).all()


def test_contains_agrees_with_a_hollow_square() -> None:
    outline = np.array([[0, 0], [2, 0], [2, 2], [1, 1], [0, 2]], float)
    spots = np.array([[1, 0.5], [1, 1.5], [0.3, 1.2], [3, 1], [1.9, 1.5]])
    assert contains(outline, spots).tolist() == [True, False, True, False, True]


# pattern


@pytest.mark.parametrize("size", SIZES)
def test_seam_partners_have_as_many_vertices_and_nearly_the_same_length(
    patterns: dict[str, Pattern], size: str
) -> None:
    pattern = patterns[size]
    assert len(pattern.sewing) == 10  # a shoulder, a side, two armhole halves, an underarm on either side
    for (one, seam), (other, partner) in pattern.sewing:
        first, second = pattern.panel(one), pattern.panel(other)
        assert len(first.seams[seam]) == len(second.seams[partner])
        lengths = seam_length(first, seam), seam_length(second, partner)
        assert lengths[1] == pytest.approx(lengths[0], rel=CAP_MISMATCH)
        if "armhole" in seam:
            assert lengths[1] >= lengths[0]  # eased in, never stretched


@pytest.mark.parametrize("size", SIZES)
def test_panels_have_the_finished_measures(patterns: dict[str, Pattern], size: str) -> None:
    measures, pattern = SIZE_MEASURES[size], patterns[size]
    front, back, sleeve = (pattern.panel(name) for name in ("front", "back", "left_sleeve"))
    hem = sum(seam_length(p, f"{side}_hem") for p in (front, back) for side in ("left", "right"))
    assert hem == pytest.approx(measures.hem, rel=1e-9)
    assert np.ptp(front.points[:, 1]) == pytest.approx(measures.length, rel=1e-9)
    assert seam_length(sleeve, "cuff") == pytest.approx(measures.cuff, rel=1e-9)
    tips = front.points[[front.seams[f"{side}_shoulder"][0] for side in ("left", "right")]]
    assert abs(tips[0, 0] - tips[1, 0]) == pytest.approx(measures.shoulder_width, rel=1e-9)
    low_front, low_back = (p.points[p.seams["left_neckline"][-1], 1] for p in (front, back))
    assert low_back - low_front == pytest.approx(measures.front_neck_drop - measures.back_neck_drop, rel=1e-9)


@pytest.mark.parametrize("size", SIZES)
def test_left_and_right_are_alike(patterns: dict[str, Pattern], size: str) -> None:
    pattern = patterns[size]
    left, right = pattern.panel("left_sleeve"), pattern.panel("right_sleeve")
    assert area(left) == pytest.approx(area(right), rel=1e-12)
    for name in ("front", "back"):
        panel = pattern.panel(name)
        mean = panel.points[panel.triangles].mean(axis=1)[:, 0]
        sides = [area(replace(panel, triangles=panel.triangles[chosen])) for chosen in (mean > 0, mean < 0)]
        assert sides[0] == pytest.approx(sides[1], rel=1e-12)


@pytest.mark.parametrize("edge", [0.008, 0.012, 0.025, 0.06])
def test_panel_triangles_are_well_shaped(edge: float) -> None:
    for panel in tshirt_pattern(SIZE_MEASURES["M"], edge, Cache()).panels:
        smallest = angles(panel.points[panel.triangles])
        assert (smallest > 20).mean() > 0.98
        assert smallest.min() > 12
        corners = panel.points[panel.triangles]
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        assert lengths.mean() == pytest.approx(edge, rel=0.25)  # a side has a whole number of edges


# sewn


@pytest.mark.parametrize("size", SIZES)
def test_shirt_is_one_manifold_with_four_openings(shirts: dict[str, Mesh], size: str) -> None:
    mesh = shirts[size]
    solid = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
    assert solid.is_winding_consistent
    assert solid.body_count == 1
    edges, faces_per_edge = np.unique(solid.edges_sorted, axis=0, return_counts=True)
    assert faces_per_edge.max() == 2
    assert mesh.vertex_count - len(edges) + mesh.triangle_count == -2  # a sphere with four holes
    loops = boundary_loops(mesh)
    assert len(loops) == 4
    assert len(np.unique(np.concatenate(loops))) == sum(map(len, loops))  # no vertex in two loops


@pytest.mark.parametrize("size", SIZES)
def test_openings_are_hem_neck_and_cuffs(shirts: dict[str, Mesh], size: str) -> None:
    mesh, measures = shirts[size], SIZE_MEASURES[size]
    flat = flat_edge_lengths(mesh)
    girths = {}
    for loop in boundary_loops(mesh):
        middle = mesh.points[loop].mean(axis=0)
        girth = sum(flat[a, b] for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
        name = "cuff" if abs(middle[0]) > 0.1 else ("hem" if middle[1] < 1.2 else "neck")
        girths.setdefault(name, []).append(girth)
    assert girths["hem"] == pytest.approx([measures.hem], rel=CHORD)
    assert girths["cuff"] == pytest.approx([measures.cuff] * 2, rel=CHORD)
    assert 0.55 < girths["neck"][0] < 0.62  # over the head, not over the shoulders
    assert girths["neck"][0] < 2 * measures.shoulder_width


@pytest.mark.parametrize("size", SIZES)
def test_texture_is_the_panels_side_by_side(shirts: dict[str, Mesh], patterns: dict[str, Pattern], size: str) -> None:
    mesh = shirts[size]
    assert mesh.panels is not None
    assert mesh.panel_names == ("front", "back", "left_sleeve", "right_sleeve")
    right_edge = -1.0
    for number, name in enumerate(mesh.panel_names):
        corners = mesh.texcoords[mesh.panels == number]
        panel = patterns[size].panel(name)
        expected = panel.points[panel.triangles]
        assert np.allclose(corners - corners[0, 0], expected - expected[0, 0], atol=1e-12)
        assert corners[..., 0].min() > right_edge
        right_edge = corners[..., 0].max()
    one, two = (mesh.texcoords[:, k] - mesh.texcoords[:, 0] for k in (1, 2))
    assert (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).min() > 0


@pytest.mark.parametrize("size", SIZES)
def test_shirt_starts_outside_its_body_facing_outwards(shirts: dict[str, Mesh], size: str) -> None:
    mesh, form = shirts[size], calibrated_form(SIZE_BODIES[size])
    assert form.value(mesh.points).min() > 0.006  # [m] nominally 8 mm, the distance is approximate
    corners = mesh.points[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert mesh.panels is not None
    forward = normals[:, 2] * np.where(mesh.panels == 0, 1, -1)
    assert (forward[mesh.panels < 2] > 0).mean() > 0.9
    centre = corners.mean(axis=1)
    assert (centre[mesh.panels == 2, 0] > 0).all()  # the body's left is +x
    assert (centre[mesh.panels == 3, 0] < 0).all()


@pytest.mark.parametrize("size", SIZES)
def test_seams_start_short(shirts: dict[str, Mesh], size: str) -> None:
    mesh = shirts[size]
    corners = mesh.points[mesh.triangles]
    ratio = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    ratio /= np.linalg.norm(mesh.texcoords - np.roll(mesh.texcoords, 1, axis=1), axis=2)
    assert ratio.max() < 4
    assert ratio.min() > 0.15
    assert 0.95 < np.median(ratio) < 1.05


def test_shirt_goes_round_another_body() -> None:
    body = MannequinMeasures(1.65, 0.88, 0.68, 0.96, 60.0)
    mesh = tshirt(size="L", edge=0.02, body=body)
    assert calibrated_form(body).value(mesh.points).min() > 0.006
    assert len(boundary_loops(mesh)) == 4


def test_shirt_is_the_same_every_time(shirts: dict[str, Mesh]) -> None:
    again = tshirt(size="M")
    assert np.array_equal(again.points, shirts["M"].points)
    assert np.array_equal(again.triangles, shirts["M"].triangles)


def test_unknown_size_and_absurd_edge_are_refused() -> None:
    with pytest.raises(InputError, match="use S, M, L"):
        tshirt(size="XXL")
    with pytest.raises(InputError, match="edge"):
        tshirt(edge=12.0)
