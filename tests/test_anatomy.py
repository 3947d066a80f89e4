"""A body's limbs, a garment's openings, and which limb passes through which, on shapes where all is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import EdgeGraph, level_lines
from warp_cloth.anatomy.linking import Wearing, curve_crossings, limbs_through
from warp_cloth.anatomy.openings import ARMS, LEGS, Opening, limbs_for, openings_of
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, TRUNK, Skeleton, skeleton_of
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.scene import load_scene

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def tshirt() -> Outfit:
    """The shipped T-shirt on the mannequin."""
    return load_outfit(load_scene("tshirt"))


@pytest.fixture(scope="module")
def skeleton(tshirt: Outfit) -> Skeleton:
    (wearing,) = tshirt.wearing
    assert wearing is not None
    return wearing.skeleton


def cylinder(radius: float, height: float, around: int = 48, rows: int = 20) -> tuple[Floats, NDArray[np.int32]]:
    """An open cylinder about the y axis: points [m] and triangles."""
    angle, level = np.meshgrid(2.0 * np.pi * np.arange(around) / around, np.linspace(0.0, height, rows + 1))
    points = np.stack([radius * np.cos(angle), level, radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    here = np.arange(rows * around)
    right = here // around * around + (here + 1) % around
    quads = np.stack([here, right, right + around, here + around], axis=1)
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


def ring(radius: float, at: float, around: int = 24) -> tuple[Floats, Floats]:
    """A circle about the y axis as segments: their ends [m]."""
    angle = 2.0 * np.pi * np.arange(around) / around
    points = np.stack([radius * np.cos(angle), np.full(around, at), radius * np.sin(angle)], axis=1)
    return points, np.roll(points, -1, axis=0)


def openings_in(points: Floats, triangles: NDArray[np.int32]) -> tuple[tuple[Opening, ...], NDArray[np.int32]]:
    """The openings of cloth at rest at ``points`` [m], and its triangles."""
    topology = build_topology(triangles, len(points))
    lengths = np.linalg.norm(np.diff(points[topology.edges], axis=1)[:, 0], axis=1)
    return openings_of(topology, triangles, lengths, len(points)), triangles


def test_level_lines_of_a_cylinder_are_its_circles() -> None:
    points, triangles = cylinder(0.1, 1.0)
    lines = level_lines(points, triangles, points[:, 1], np.array([0.111, 0.503]))
    girth = 48 * 2.0 * 0.1 * np.sin(np.pi / 48)
    assert lines.girths() == pytest.approx([girth, girth], rel=1e-3)
    assert lines.centres() == pytest.approx(np.array([[0.0, 0.111, 0.0], [0.0, 0.503, 0.0]]), abs=1e-4)


def test_distances_along_a_cylinder_are_heights_above_its_lower_rim() -> None:
    points, triangles = cylinder(0.1, 1.0)
    edges = build_topology(triangles, len(points)).edges
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    distances = EdgeGraph(edges, lengths, len(points)).distances(np.flatnonzero(points[:, 1] == 0.0).astype(np.int32))
    assert distances == pytest.approx(points[:, 1], abs=1e-9)


def test_limbs_pass_through_a_ring_by_parity() -> None:
    inside, outside, through_twice = (
        np.array([[0.0, -1.0, 0.01], [0.0, 1.0, 0.01]]),
        np.array([[0.5, -1.0, 0.0], [0.5, 1.0, 0.0]]),
        np.array([[0.02, -1.0, 0.01], [0.02, 1.0, 0.01], [0.03, -1.0, 0.02]]),
    )
    assert limbs_through(*ring(0.1, 0.0), [inside, outside, through_twice]) == (0,)
    points, triangles = cylinder(0.1, 0.5)
    across = np.array([[-1.0, 0.201, 0.013], [1.0, 0.207, 0.011]])
    assert [curve_crossings(points, triangles, curve) for curve in (inside, across)] == [0, 2]


def test_the_mannequin_has_five_limbs(skeleton: Skeleton) -> None:
    assert skeleton.up == pytest.approx([0.0, 1.0, 0.0], abs=0.05)
    assert skeleton.forward == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    tips = np.array([curve[-1] for curve in skeleton.curves])
    assert tips[HEAD][1] == tips[:, 1].max()
    assert tips[RIGHT_ARM][0] < -0.5 < 0.5 < tips[LEFT_ARM][0]
    assert tips[RIGHT_LEG][0] < 0.0
    assert tips[RIGHT_LEG][1] < 0.05
    assert set(np.unique(skeleton.limb)) == {*range(TRUNK), TRUNK}


def test_limbs_are_told_wherever_and_however_the_body_stands(tshirt: Outfit, skeleton: Skeleton) -> None:
    assert tshirt.avatar is not None
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # z up, facing x
    moved = replace(tshirt.avatar, points=0.6 * tshirt.avatar.points @ turn.T + [3.0, -2.0, 1.0])
    found = skeleton_of(moved)
    assert found is not None
    for curve, expected in zip(found.curves, skeleton.curves, strict=True):
        assert curve[-1] == pytest.approx(0.6 * expected[-1] @ turn.T + [3.0, -2.0, 1.0], abs=0.02)


def test_a_hole_in_an_arm_does_not_end_it(tshirt: Outfit, skeleton: Skeleton) -> None:
    """Level lines through a scan's hole are shorter, and widen again where it ends."""
    assert tshirt.avatar is not None
    points, triangles = tshirt.avatar.points, tshirt.avatar.triangles
    curve = skeleton.curves[LEFT_ARM]
    elbow = curve[(skeleton.joints[LEFT_ARM] + len(curve)) // 2]
    spot = points[np.linalg.norm(points - elbow - 0.05 * skeleton.forward, axis=1).argmin()]
    hole = np.linalg.norm(points[triangles].mean(axis=1) - spot, axis=1) < 0.04
    assert hole.any()
    found = skeleton_of(Mesh("scan", points, triangles[~hole]))
    assert found is not None
    assert len(found.limb) == len(found.skin) == len(points)
    joints = [each.curves[LEFT_ARM][each.joints[LEFT_ARM]] for each in (found, skeleton)]
    assert joints[0] == pytest.approx(joints[1], abs=0.02)


def test_who_has_no_feet_faces_the_way_of_most_files(tshirt: Outfit, skeleton: Skeleton) -> None:
    """What a cut leaves of a foot may lie behind the leg."""
    assert tshirt.avatar is not None
    points, triangles = tshirt.avatar.points.copy(), tshirt.avatar.triangles
    cut = points[:, 1].min() + 0.12
    kept = triangles[(points[triangles, 1] > cut).all(axis=1)]
    points[points[:, 1] < cut + 0.05, 2] -= 0.08
    found = skeleton_of(Mesh("form", points, kept))
    assert found is not None
    assert found.forward @ skeleton.forward > 0.99


def test_what_is_no_person_has_no_limbs(tshirt: Outfit) -> None:
    points, triangles = cylinder(0.1, 1.7)
    assert skeleton_of(Mesh("post", points, triangles)) is None
    assert tshirt.avatar is not None
    low, high = tshirt.avatar.bounds()
    upper = (tshirt.avatar.points[tshirt.avatar.triangles, 1] > 0.5 * (low[1] + high[1])).all(axis=1)
    used, corners = np.unique(tshirt.avatar.triangles[upper], return_inverse=True)
    half = Mesh("half", tshirt.avatar.points[used], corners.reshape(-1, 3).astype(np.int32))
    assert skeleton_of(half) is None


def test_a_tshirt_is_for_head_arms_and_legs_and_starts_right(tshirt: Outfit) -> None:
    (wearing,) = tshirt.wearing
    assert wearing is not None
    assert sorted(wearing.limbs) == [(HEAD,), (RIGHT_ARM,), (LEFT_ARM,), LEGS]
    assert wearing.start_fault == ""


@pytest.mark.parametrize("shift", [(0.0, 0.0, -0.4), (1.0, 0.0, 0.0), (0.0, -0.25, 0.0)])
def test_a_tshirt_beside_its_body_has_limbs_outside_their_openings(
    tshirt: Outfit, shift: tuple[float, float, float]
) -> None:
    (wearing,), (garment,) = tshirt.wearing, tshirt.garments
    assert wearing is not None
    points = garment.points + np.array(shift)
    assert wearing.misplaced(points) or wearing.pierced(points)
    assert wearing.started_at(points).start_fault != ""


def test_a_tshirt_that_starts_badly_below_the_shoulders_is_sewn_on_them(tshirt: Outfit) -> None:
    """It would stay below: nothing falls up. One that starts right is left where it is."""
    (garment,), (wearing,) = tshirt.garments, tshirt.wearing
    assert wearing is not None
    up = wearing.skeleton.up
    below = garment.points - (wearing.over_shoulders(garment.points) + 0.15) * up
    for fault in ("cloth starts on both sides of an arm", ""):
        low = wearing.started_at(below)
        vars(low)["start_fault"] = fault
        vars(low)["misplaced_at_start"] = []
        assert low.over_shoulders(low.onto) == pytest.approx(0.0 if fault else -0.15, abs=0.01)


@pytest.mark.parametrize(("span", "moved"), [(2.0, False), (1.4, True)], ids=("adult", "child"))
def test_what_starts_far_above_the_shoulders_for_who_wears_it_is_sewn_on_them(
    tshirt: Outfit, span: float, moved: bool
) -> None:
    """What falls 25 cm onto an adult's shoulders would be sewn round the head of a child."""
    (garment,), (wearing,) = tshirt.garments, tshirt.wearing
    assert wearing is not None
    skeleton = replace(wearing.skeleton, span=span)
    above = garment.points + (0.25 - wearing.over_shoulders(garment.points)) * skeleton.up
    high = replace(wearing, skeleton=skeleton).started_at(above)
    vars(high)["misplaced_at_start"] = []
    assert high.over_shoulders(high.onto) == pytest.approx(0.0 if moved else 0.25, abs=0.01)


def test_a_tshirt_cut_open_in_front_is_for_both_arms_and_all_the_rest(tshirt: Outfit) -> None:
    """Neckline and hem are then one opening, that is for neither head nor legs alone."""
    (wearing,), (garment,) = tshirt.wearing, tshirt.garments
    assert wearing is not None
    middle = garment.points[garment.triangles].mean(axis=1) - wearing.skeleton.middle
    at_front = (np.abs(middle @ wearing.skeleton.left) < 0.02) & (middle @ wearing.skeleton.forward > 0.0)
    openings, triangles = openings_in(garment.points, garment.triangles[~at_front])
    jacket = Wearing.of(openings, garment.points, triangles, wearing.skeleton)
    assert sorted(jacket.limbs) == [(HEAD, *LEGS), (RIGHT_ARM,), (LEFT_ARM,)]
    assert jacket.start_fault == ""


@pytest.mark.parametrize("strap", [True, False])
def test_a_halter_is_for_head_arms_and_legs(tshirt: Outfit, strap: bool) -> None:
    """The T-shirt without its sides and the cloth behind the shoulders, but for a strip at the neck."""
    (wearing,), (garment,) = tshirt.wearing, tshirt.garments
    assert wearing is not None
    skeleton = wearing.skeleton
    middle = garment.points[garment.triangles].mean(axis=1) - skeleton.middle
    across, ahead, up = np.abs(middle @ skeleton.left), middle @ skeleton.forward, middle @ skeleton.up
    under_arms = float((skeleton.shoulders - skeleton.middle) @ skeleton.up) - 0.2
    is_behind = (ahead < np.median(ahead)) & (up < up[(across < 0.02) & (ahead < np.median(ahead))].max() - 0.04)
    kept = (up < under_arms) & (across < 0.3)
    if strap:
        kept |= (across < 0.12) & ~is_behind
    triangles = garment.triangles[kept]
    topology = build_topology(triangles, len(garment.points))
    lengths = np.linalg.norm(np.diff(garment.points[topology.edges], axis=1)[:, 0], axis=1)
    openings = openings_of(topology, triangles, lengths, len(garment.points))
    found = limbs_for(openings, garment.points, skeleton)
    assert sorted(found) == (sorted([(HEAD,), ARMS, LEGS]) if strap else [LEGS, LEGS])


def test_a_pair_of_openings_near_the_middle_is_for_the_legs(skeleton: Skeleton) -> None:
    """Those of briefs are at the crotch for most of their length, so that their means are near the middle."""
    angle = 2.0 * np.pi * np.arange(24) / 24
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def placed(across: float, wide: float, up: float) -> Floats:
        aside = np.outer(across + wide * circle[:, 0], skeleton.left) + up * skeleton.up
        return np.asarray(skeleton.middle + aside + np.outer(wide * circle[:, 1], skeleton.forward))

    points = np.concatenate([placed(0.0, 0.18, -0.1), placed(0.06, 0.05, -0.3), placed(-0.06, 0.05, -0.3)])
    loops = np.arange(72, dtype=np.int32).reshape(3, 24)
    openings = [Opening(loop, girth, np.zeros(72), 0.0) for loop, girth in zip(loops, (1.1, 0.6, 0.6), strict=True)]
    assert limbs_for(openings, points, skeleton) == [LEGS, (LEFT_LEG,), (RIGHT_LEG,)]


def test_sleeves_that_hang_lower_than_the_hem_are_for_arms(tshirt: Outfit) -> None:
    (wearing,) = tshirt.wearing
    assert wearing is not None
    lower = wearing.start.copy()
    for opening, limbs in zip(wearing.openings, wearing.limbs, strict=True):
        if limbs in ((RIGHT_ARM,), (LEFT_ARM,)):
            lower[opening.loop] -= 0.6 * wearing.skeleton.up
    assert limbs_for(wearing.openings, lower, wearing.skeleton) == list(wearing.limbs)


def test_a_lining_and_its_shirt_have_the_same_openings(tshirt: Outfit) -> None:
    """Each of two separate pieces is read by itself: of four sleeves none is a leg."""
    (wearing,), (garment,) = tshirt.wearing, tshirt.garments
    assert wearing is not None
    count = len(garment.points)
    points = np.concatenate([garment.points, garment.points - 0.004 * wearing.skeleton.up])
    both = openings_in(points, np.concatenate([garment.triangles, garment.triangles + count]))
    lined = Wearing.of(both[0], points, both[1], wearing.skeleton)
    assert sorted(lined.limbs) == sorted(2 * wearing.limbs)
    assert lined.start_fault == ""
    for distances in lined.distances().values():
        assert np.isfinite(distances).all()


def test_gloves_and_sleeves_by_themselves_tell_no_limb(skeleton: Skeleton) -> None:
    """They would be for a leg as well; two tubes that are one at either side of a skirt leave it a skirt."""
    tube, faces = cylinder(0.06, 0.3)
    at = [tube + side * 0.25 * skeleton.span * skeleton.left + skeleton.middle for side in (-1.0, 1.0)]
    skirt = cylinder(0.2, 0.3)[0] + skeleton.middle - 0.3 * skeleton.up
    points = np.concatenate([*at, skirt])
    openings, _ = openings_in(points, np.concatenate([faces + shift * len(tube) for shift in range(3)]))
    limbs = limbs_for(openings, points, skeleton)
    assert [each for each, opening in zip(limbs, openings, strict=True) if opening.girth > 1.0] == [LEGS, LEGS]
    assert [each for each, opening in zip(limbs, openings, strict=True) if opening.girth < 1.0] == 4 * [()]
