"""Square, sphere and mannequin: exact values, girths, and that the mannequin is a sound closed surface."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from warp_cloth.anatomy.levels import trunk_level
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.section import convex_girth
from warp_cloth.base.surface import is_closed_manifold, surface_nets, without_saddles
from warp_cloth.shapes import (
    SIZE_BODIES,
    MannequinMeasures,
    build_avatar,
    build_garment,
    mannequin,
    mannequin_measures,
    sphere,
    square,
)

EXACT = 1e-12  # [m] rounding of sums of a few float64 lengths near 1 m
GIRTH_TOLERANCE = 0.005  # [m] stated accuracy of the mannequin's girths; a tailor's tape is read to this
BODIES = {
    **SIZE_BODIES,
    "slim": MannequinMeasures(1.90, 0.80, 0.65, 0.80, 85.0),
    "stout": MannequinMeasures(1.70, 1.30, 1.40, 1.35, 50.0),
    "curved": MannequinMeasures(1.65, 0.88, 0.68, 0.96, 40.0),
}


@pytest.fixture(scope="session")
def bodies() -> dict[str, Mesh]:
    return {name: mannequin(measures) for name, measures in BODIES.items()}


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.points, mesh.triangles, process=False)


def crossing_count(mesh: Mesh, cell: float) -> int:
    """Pairs of an edge and a triangle without a common vertex that cross; ``cell`` is above any edge's length."""
    points, triangles = mesh.points, mesh.triangles
    edges = as_trimesh(mesh).edges_unique
    middles, centres = points[edges].mean(axis=1), points[triangles].mean(axis=1)
    low = points.min(axis=0) - 1.5 * cell
    of_edge, of_triangle = (((spots - low) / cell).astype(int) for spots in (middles, centres))
    shape = np.maximum(of_edge.max(axis=0), of_triangle.max(axis=0)) + 2
    keys = np.ravel_multi_index(tuple(of_triangle.T), tuple(shape))
    order = np.argsort(keys)
    start = np.searchsorted(keys[order], np.arange(np.prod(shape) + 1))
    count = 0
    for step in np.ndindex(3, 3, 3):
        key = np.ravel_multi_index(tuple((of_edge + np.array(step) - 1).T), tuple(shape))
        size = start[key + 1] - start[key]
        edge = np.repeat(np.arange(len(edges)), size)
        rank = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        triangle = order[np.repeat(start[key], size) + rank]
        near = np.abs(middles[edge] - centres[triangle]).max(axis=1) < cell
        edge, triangle = edge[near], triangle[near]
        apart = ~(edges[edge][:, :, None] == triangles[triangle][:, None, :]).any(axis=(1, 2))
        count += _crossings(points, edges[edge[apart]], triangles[triangle[apart]])
    return count


def _crossings(points: np.ndarray, edges: np.ndarray, triangles: np.ndarray) -> int:
    p, q = points[edges].transpose(1, 0, 2)
    a, b, c = points[triangles].transpose(1, 0, 2)

    def volume(one: np.ndarray, two: np.ndarray, three: np.ndarray, four: np.ndarray) -> np.ndarray:
        return np.einsum("ij,ij->i", np.cross(two - one, three - one), four - one)

    through = volume(a, b, c, p) * volume(a, b, c, q) < 0
    around = [volume(p, q, a, b) > 0, volume(p, q, b, c) > 0, volume(p, q, c, a) > 0]
    return int((through & (around[0] == around[1]) & (around[1] == around[2])).sum())


def test_crossing_count_finds_two_crossed_triangles() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -0.5], [0.2, 0.2, 0.5], [0.9, 0.9, 0.5]], float)
    assert crossing_count(Mesh("two", points, np.array([[0, 1, 2], [3, 4, 5]], np.int32)), 2.0) >= 1


# square


@pytest.mark.parametrize("plane", ["horizontal", "vertical"])
def test_square_has_its_side_area_and_facing(plane: str) -> None:
    mesh = square(side=0.8, vertices_per_side=5, height=1.5, plane=plane, centre=(0.1, -0.2))
    assert (mesh.vertex_count, mesh.triangle_count) == (25, 32)
    solid = as_trimesh(mesh)
    assert solid.area == pytest.approx(0.64, abs=EXACT)
    normal = (0, 1, 0) if plane == "horizontal" else (0, 0, 1)
    assert np.allclose(solid.face_normals, normal, atol=EXACT)
    low, high = mesh.bounds()
    if plane == "horizontal":
        assert np.allclose([low, high], [[-0.3, 1.5, -0.6], [0.5, 1.5, 0.2]], atol=EXACT)
    else:
        assert np.allclose([low, high], [[-0.3, 0.7, -0.2], [0.5, 1.5, -0.2]], atol=EXACT)


def test_square_texture_lengths_are_its_lengths() -> None:
    mesh = square(side=1.0, vertices_per_side=9)
    flat = np.linalg.norm(mesh.texcoords - np.roll(mesh.texcoords, 1, axis=1), axis=2)
    corners = mesh.points[mesh.triangles]
    assert np.allclose(flat, np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), atol=EXACT)


def test_square_diagonals_have_no_preferred_side() -> None:
    mesh = square(side=1.0, vertices_per_side=9)
    edges = as_trimesh(mesh).edges_unique
    across = mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]
    slope = np.sign(across[:, 0] * across[:, 2])
    assert (slope > 0).sum() == (slope < 0).sum() == 32


# sphere


def test_sphere_is_closed_round_and_outward() -> None:
    mesh = sphere(radius=0.3, centre=(0.1, 0.6, -0.2), edge=0.02)
    away = np.linalg.norm(mesh.points - (0.1, 0.6, -0.2), axis=1)
    assert np.allclose(away, 0.3, atol=EXACT)
    solid = as_trimesh(mesh)
    assert solid.is_watertight
    assert solid.euler_number == 2
    sagitta = 0.025**2 / 8 / 0.3  # [m] of the longest edges; the volume lacks at most twice such a shell
    assert 0 < 4 / 3 * math.pi * 0.3**3 - solid.volume < 4 * math.pi * 0.3**2 * 2 * sagitta


@pytest.mark.parametrize("edge", [0.4, 0.1, 0.03])
def test_sphere_edges_are_as_long_as_asked(edge: float) -> None:
    lengths = as_trimesh(sphere(radius=0.3, edge=edge)).edges_unique_length
    assert lengths.mean() == pytest.approx(edge, rel=0.25)  # a whole number of divisions
    assert lengths.max() < 1.5 * lengths.min()  # flat faces blown up to the sphere


# mannequin


@pytest.mark.parametrize("name", BODIES)
def test_mannequin_girths_are_the_measures(bodies: dict[str, Mesh], name: str) -> None:
    measures = BODIES[name]
    for height, girth in (
        (measures.chest_height, measures.chest),
        (measures.waist_height, measures.waist),
        (measures.hip_height, measures.hip),
    ):
        level = trunk_level(bodies[name], height, 0.0)
        assert level.girth == pytest.approx(girth, abs=GIRTH_TOLERANCE)


@pytest.mark.parametrize("name", BODIES)
def test_mannequin_is_one_closed_outward_surface(bodies: dict[str, Mesh], name: str) -> None:
    mesh = bodies[name]
    solid = as_trimesh(mesh)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    assert solid.euler_number == 2  # one sphere-like surface: no handle, no second part
    assert len(np.unique(mesh.triangles)) == mesh.vertex_count


@pytest.mark.parametrize("name", BODIES)
def test_mannequin_stands_on_the_floor_as_tall_as_stated(bodies: dict[str, Mesh], name: str) -> None:
    low, high = bodies[name].bounds()
    assert low[1] == 0.0
    assert high[1] == pytest.approx(BODIES[name].stature, abs=0.002)  # the top of the head is rounded by a grid
    assert high[0] == pytest.approx(-low[0], abs=0.001)  # arms alike
    assert high[0] > 0.3 * BODIES[name].stature


@pytest.mark.parametrize("name", ["S", "L", "stout"])
def test_mannequin_does_not_cross_itself(bodies: dict[str, Mesh], name: str) -> None:
    longest = as_trimesh(bodies[name]).edges_unique_length.max()
    assert crossing_count(bodies[name], longest) == 0


def test_mannequin_triangles_are_well_shaped(bodies: dict[str, Mesh]) -> None:
    solid = as_trimesh(bodies["M"])
    smallest = np.degrees(solid.face_angles.min(axis=1))
    assert np.percentile(smallest, 1) > 30
    assert solid.edges_unique_length.mean() == pytest.approx(0.011, rel=0.1)


def test_mannequin_faces_forward_with_its_chest_and_feet(bodies: dict[str, Mesh]) -> None:
    points = bodies["M"].points
    feet = points[points[:, 1] < 0.02]
    assert feet[:, 2].max() > 0.1 > -feet[:, 2].min()


def test_mannequin_is_the_same_every_time(bodies: dict[str, Mesh]) -> None:
    again = mannequin(BODIES["M"])
    assert np.array_equal(again.points, bodies["M"].points)
    assert np.array_equal(again.triangles, bodies["M"].triangles)


def test_arms_follow_their_angle() -> None:
    low, high = (mannequin(MannequinMeasures(arm_angle=angle), edge=0.015) for angle in (45.0, 80.0))
    hands = [mesh.points[np.argmax(mesh.points[:, 0])] for mesh in (low, high)]
    assert hands[1][0] > hands[0][0] + 0.1
    assert hands[1][1] > hands[0][1] + 0.3


@pytest.mark.parametrize(
    ("key", "value"),
    [("stature", 176.0), ("chest", 98.0), ("waist", -0.8), ("hip", math.nan), ("arm_angle", 0.0)],
)
def test_absurd_measure_is_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(InputError, match=key):
        MannequinMeasures(**{key: value})


def test_girths_that_make_no_body_are_refused() -> None:
    with pytest.raises(InputError, match="do not make a body"):
        MannequinMeasures(chest=1.5, waist=0.7, hip=1.0)


def test_tape_round_a_square_is_its_perimeter() -> None:
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0.0]])
    assert convex_girth(corners) == pytest.approx(4, abs=EXACT)


# surface nets


def test_surface_nets_of_a_ball_are_a_closed_manifold() -> None:
    axis = np.linspace(-1, 1, 21)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    points, quads = surface_nets(np.sqrt(x * x + y * y + z * z) - 0.7, np.full(3, -1.0), 0.1)
    assert is_closed_manifold(quads, len(points))
    assert np.linalg.norm(points, axis=1) == pytest.approx(0.7, abs=0.02)  # a chord of one cell


def test_ridge_along_the_grid_diagonal_is_made_manifold() -> None:
    """A bar whose edge runs along the diagonal, just above a grid plane: it touches every other corner only."""
    values = np.ones((8, 8, 8))
    for i in range(2, 6):
        values[i, i, 3] = values[i, i, 4] = -0.1
    points, quads = surface_nets(values, np.zeros(3), 1.0)
    assert not is_closed_manifold(quads, len(points))
    points, quads = surface_nets(without_saddles(values), np.zeros(3), 1.0)
    assert is_closed_manifold(quads, len(points))


# scene specs


def test_builders_read_scene_shapes() -> None:
    cloth = SimpleNamespace(kind="square", side=0.5, vertices_per_side=3, height=1.0, plane="vertical")
    assert build_garment(cloth).vertex_count == 9
    ball = SimpleNamespace(kind="sphere", radius=0.1, centre=(0.0, 0.0, 0.0), edge_mm=50.0)
    assert build_avatar(ball).bounds()[1][0] <= 0.1
    body = SimpleNamespace(
        kind="mannequin", stature=None, chest=1.0, waist=None, hip=None, arm_angle_degrees=45.0, size="S"
    )
    assert mannequin_measures(body) == MannequinMeasures(1.70, 1.0, 0.78, 0.94, 45.0)


def test_unknown_kind_is_refused() -> None:
    for build in (build_garment, build_avatar):
        with pytest.raises(InputError, match="kind"):
            build(SimpleNamespace(kind="cube"))


@pytest.mark.parametrize(
    ("make", "values"),
    [
        (square, {"side": -1.0}),
        (square, {"vertices_per_side": 1}),
        (square, {"plane": "slanted"}),
        (sphere, {"radius": 0.0}),
        (sphere, {"edge": math.nan}),
        (sphere, {"edge": 1e-5}),
        (mannequin, {"edge": 1.0}),
    ],
)
def test_impossible_shape_is_refused(make: object, values: dict[str, object]) -> None:
    with pytest.raises(InputError):
        make(**values)  # type: ignore[operator]
