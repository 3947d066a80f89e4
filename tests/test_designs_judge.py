"""The judge of the designs study finds what is wrong with made results, and nothing wrong with good ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from designs.geometry import Body, Floats, Mesh, crossings, read_obj, segments_hit
from designs.judge import Judgement, Wearer, Word, judge, limb_names
from designs.limbs import boundary_loops, opening_class, ways_out
from designs.measures import chord_ratios, edge_strains, face_depths, stretches

AROUND, UP = 48, 16  # vertices of a tube
TRUNK = (0.16, 0.12)  # [m] half axes of a tube about the made body's trunk, which is 0.2 by 0.14
BOXES = {  # centre and size [m] of the made body's boxes
    "trunk": ((0.0, 1.1, 0.0), (0.2, 0.7, 0.14)),
    "belly": ((0.0, 1.05, 0.0), (0.22, 0.2, 0.16)),
    "head": ((0.0, 1.6, 0.0), (0.12, 0.4, 0.12)),
    "right arm": ((-0.4, 1.35, 0.0), (0.7, 0.08, 0.08)),
    "left arm": ((0.4, 1.35, 0.0), (0.7, 0.08, 0.08)),
    "right leg": ((-0.06, 0.4, 0.0), (0.07, 0.8, 0.1)),
    "left leg": ((0.06, 0.4, 0.0), (0.07, 0.8, 0.1)),
}


@pytest.fixture(scope="module")
def wearer() -> Wearer:
    """A body of overlapping boxes, arms spread."""
    boxes = [trimesh.creation.box(size) for _, size in BOXES.values()]
    for box, (centre, _) in zip(boxes, BOXES.values(), strict=True):
        box.apply_translation(centre)
    fine = [box.subdivide_to_size(0.05) for box in boxes]
    joined = trimesh.util.concatenate(fine)
    joined.merge_vertices()
    return Wearer.of(Mesh(np.asarray(joined.vertices, float), np.asarray(joined.faces, np.int64)))


def tube(centre: tuple[float, float, float], axes: tuple[float, float], length: float, along: int = 1) -> Mesh:
    """A tube of one panel, sewn where it closes."""
    turn, step = np.meshgrid(np.arange(AROUND) / AROUND, np.linspace(-0.5, 0.5, UP))
    angle = 2.0 * np.pi * turn
    ring = np.stack([axes[0] * np.cos(angle), length * step, axes[1] * np.sin(angle)], axis=-1).reshape(-1, 3)
    points = np.array(centre) + (ring if along == 1 else ring[:, [1, 0, 2]])
    i, j = np.meshgrid(np.arange(AROUND), np.arange(UP - 1))
    a, b = j * AROUND + i, j * AROUND + (i + 1) % AROUND
    triangles = np.stack([a, b, b + AROUND, a, b + AROUND, a + AROUND], axis=-1).reshape(-1, 3)
    ends = np.vstack([points[:AROUND], points[:1]])
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])
    u = np.stack([run[i], run[i + 1], run[i + 1], run[i], run[i + 1], run[i]], axis=-1).reshape(-1, 3)
    v = (length / (UP - 1) * np.stack([j, j, j + 1, j, j + 1, j + 1], axis=-1)).reshape(-1, 3)
    return Mesh(points, triangles, np.stack([u, v], axis=-1))


def skirt() -> Mesh:
    return tube((0.0, 0.85, 0.0), TRUNK, 0.3)


def judged(garment: Mesh, points: Floats, wearer: Wearer) -> Judgement:
    return judge(garment, points, wearer, at_rest=True)


def test_a_skirt_as_it_was_sewn_is_good(wearer: Wearer) -> None:
    found = judged(skirt(), skirt().points, wearer)
    assert found.good
    assert str(found) == "good"


def test_what_the_report_says_of_rest_is_passed_on(wearer: Wearer) -> None:
    assert judge(skirt(), skirt().points, wearer, at_rest=False).words == (Word.NOT_AT_REST,)


@pytest.mark.parametrize(
    ("move", "word"),
    [
        ((1.5, 0.0, 0.0), Word.LIMB_OUTSIDE),
        ((0.0, -0.2, 0.0), Word.SLID),
        ((0.0, -0.7, 0.0), Word.FELL),
        ((0.15, 0.0, 0.0), Word.PENETRATION),
        ((np.nan, 0.0, 0.0), Word.NOT_A_SHAPE),
    ],
)
def test_a_skirt_that_moved_is_not_good(wearer: Wearer, move: tuple[float, float, float], word: Word) -> None:
    assert word in judged(skirt(), skirt().points + np.array(move), wearer).words


def test_one_vertex_pulled_away_tears_its_edges(wearer: Wearer) -> None:
    points = skirt().points.copy()
    points[5 * AROUND] += (0.1, 0.0, 0.0)
    assert judged(skirt(), points, wearer).words == (Word.TORN,)


def test_a_vertex_pulled_through_the_body_runs_through_a_limb(wearer: Wearer) -> None:
    points = skirt().points.copy()
    points[5 * AROUND] = (-0.3, 0.85, 0.0)
    assert Word.THROUGH_LIMB in judged(skirt(), points, wearer).words


def test_cloth_stretched_by_half_everywhere_is_too_small(wearer: Wearer) -> None:
    worn = skirt()
    small = Mesh(worn.points, worn.triangles, None if worn.panels is None else worn.panels / 1.4)
    assert judged(small, worn.points, wearer).words == (Word.TOO_SMALL,)


def test_cloth_short_in_all_directions_is_bunched(wearer: Wearer) -> None:
    worn = skirt()
    wide = Mesh(worn.points, worn.triangles, None if worn.panels is None else 2.5 * worn.panels)
    assert judged(wide, worn.points, wearer).words == (Word.BUNCHED,)


def test_folds_are_not_bunched() -> None:
    worn = skirt()
    wide = Mesh(worn.points, worn.triangles, None if worn.panels is None else worn.panels * (2.5, 1.0))
    assert np.nanmin(chord_ratios(wide, worn.points)) > 0.9


def test_a_face_between_clear_vertices_shows_the_body(wearer: Wearer) -> None:
    corners = np.array([[-0.3, 1.2, 0.06], [0.3, 1.2, 0.06], [0.0, 0.7, 0.2]])
    mesh = Mesh(corners, np.array([[0, 1, 2]]))
    depth = face_depths(wearer.body, mesh, corners, wearer.body.closest(corners))
    assert not wearer.body.inside(corners).any()
    assert 0.0 < depth[0] <= 0.01


@pytest.mark.parametrize(
    ("garment", "names"),
    [
        (tube((0.0, 0.85, 0.0), TRUNK, 0.3), "right leg and left leg"),
        (tube((-0.5, 1.35, 0.0), (0.06, 0.06), 0.2, along=0), "right arm"),
        (tube((0.06, 0.3, 0.0), (0.05, 0.07), 0.2), "left leg"),
        (tube((0.0, 1.6, 0.0), (0.1, 0.1), 0.1), "head"),
        (tube((1.0, 2.5, 0.5), (0.1, 0.1), 0.1), "nothing"),
    ],
)
def test_openings_know_their_limbs(wearer: Wearer, garment: Mesh, names: str) -> None:
    assert wearer.skeleton is not None
    ways = ways_out(wearer.skeleton, garment.points[garment.triangles])
    loops = boundary_loops(garment)
    assert [len(loop) for loop in loops] == [AROUND, AROUND]
    assert {limb_names(opening_class(garment.points[loop], ways)) for loop in loops} == {names}


def test_a_sleeve_on_the_other_arm_is_on_a_wrong_limb(wearer: Wearer) -> None:
    sleeve = tube((-0.5, 1.35, 0.0), (0.06, 0.06), 0.2, along=0)
    assert judged(sleeve, sleeve.points, wearer).good
    assert Word.WRONG_LIMB in judged(sleeve, sleeve.points + np.array((1.0, 0.0, 0.0)), wearer).words


@pytest.mark.parametrize(("middle", "told"), [(-0.6, False), (-0.75, True)])
def test_a_hand_that_does_not_come_out_of_its_sleeve_is_in_one_too_large(
    wearer: Wearer, middle: float, told: bool
) -> None:
    """The arm ends 0.75 m from the middle, the sleeve 0.1 m farther out than its own middle."""
    sleeve = tube((middle, 1.35, 0.0), (0.06, 0.06), 0.2, along=0)
    assert (Word.TOO_LARGE in judged(sleeve, sleeve.points, wearer).words) == told


def test_a_hand_inside_a_long_sleeve_leaves_by_the_cuff(wearer: Wearer) -> None:
    sleeve = tube((-0.75, 1.35, 0.0), (0.06, 0.06), 0.4, along=0)
    points = sleeve.points.copy()
    beyond = points[:, 0] < -0.8
    points[beyond, 1] -= -0.8 - points[beyond, 0]  # it hangs down beyond the hand
    assert wearer.skeleton is not None
    ways = ways_out(wearer.skeleton, points[sleeve.triangles])
    assert {limb_names(opening_class(points[loop], ways)) for loop in boundary_loops(sleeve)} == {"right arm"}


def test_loops_that_touch_at_a_vertex_stay_apart() -> None:
    ring = np.array([[0, 1, 2], [0, 2, 3], [3, 4, 5], [3, 5, 6]])
    assert sorted(len(loop) for loop in boundary_loops(Mesh(np.zeros((7, 3)), ring))) == [4, 4]


def test_crossings_are_those_of_brute_force() -> None:
    random = np.random.default_rng(3)
    corners = (random.uniform(size=(60, 1, 3)) + random.uniform(-0.3, 0.3, size=(60, 3, 3))).reshape(-1, 3)
    mesh = Mesh(corners, np.arange(180).reshape(-1, 3))
    edges = mesh.edges[0]
    edge, face = (index.ravel() for index in np.indices((len(edges), 60)))
    hit = segments_hit(corners[edges[edge, 0]], corners[edges[edge, 1]], corners[mesh.triangles[face]])
    hit &= edges[edge, 0] // 3 != face
    found = crossings(mesh, corners)
    assert len(found[0]) > 20
    assert set(zip(*map(list, found), strict=True)) == set(zip(edge[hit], face[hit], strict=True))


def test_faces_that_share_a_vertex_do_not_cross() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1], [-1, -1, -1]], dtype=float)
    assert len(crossings(Mesh(points, np.array([[0, 1, 2], [0, 3, 4]])), points)[0]) == 0


@pytest.mark.parametrize("closed", [True, False])
def test_depth_in_a_ball_is_radius_less_distance(closed: bool) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    triangles = np.asarray(ball.faces, np.int64)
    body = Body(Mesh(np.asarray(ball.vertices, float), triangles if closed else triangles[1:]))
    samples = np.random.default_rng(1).uniform(-0.6, 0.6, size=(2000, 3))
    expected = np.maximum(0.5 - np.linalg.norm(samples, axis=1), 0.0)
    assert body.closed is closed
    assert np.abs(body.depth(samples) - expected).max() < 2e-3  # facets lie up to 1.4 mm inside the ball


def test_an_edge_on_a_seam_takes_the_mean_of_both_panels() -> None:
    points = np.array([[0, 0, 0], [3, 0, 0], [0, 1, 0], [0, -1, 0]], dtype=float)
    panels = np.array([[[0, 0], [1, 0], [0, 1]], [[9, 0], [9, -1], [12, 0]]], dtype=float)
    mesh = Mesh(points, np.array([[0, 1, 2], [0, 3, 1]]), panels)
    seam = np.flatnonzero((mesh.edges[0] == (0, 1)).all(1))
    assert edge_strains(mesh, points)[seam] == pytest.approx(3.0 / 2.0 - 1.0)


def test_the_largest_stretch_is_that_of_the_cloth_as_pulled() -> None:
    panels = np.array([[[0, 0], [1, 0], [0, 1]]], dtype=float)
    points = np.array([[0, 0, 0], [0, 1.5, 0], [0, 0, -1.0]])
    stretch, area = stretches(Mesh(points, np.array([[0, 1, 2]]), panels), points)
    assert (stretch[0], area[0]) == pytest.approx((0.5, 0.5))


def test_an_obj_is_read_with_its_panels(tmp_path: Path) -> None:
    path = tmp_path / "square.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n")
    mesh = read_obj(path)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.panels is not None
    assert np.allclose(mesh.panels, mesh.points[mesh.triangles][:, :, :2])
