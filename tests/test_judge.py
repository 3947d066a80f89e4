"""The word on a given shape: a shirt cut from the mannequin's own skin is worn, and spoiled in seven ways it is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import write_obj
from numpy.typing import NDArray

import warp_cloth
from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import LEGS, Limbs, openings_of
from warp_cloth.anatomy.shoulders import Shoulders, height_over_shoulders
from warp_cloth.anatomy.skeleton import LEFT_ARM, RIGHT_ARM, TRUNK, Skeleton, skeleton_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.base.topology import build_topology
from warp_cloth.dressing.straps import TUG, tugged
from warp_cloth.fitting.judge import Judgement, judged_shape
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.scene import load_scene
from warp_cloth.shapes import mannequin

Floats = NDArray[np.float64]
OFF = 0.006  # [m] of the shirt from the skin
ELBOW, HEM = 0.62, -0.05  # of an arm's curve, where sleeves end; [m] above the middle of the trunk

LIMBS: Sequence[Limbs] = ((0,), (RIGHT_ARM,), (LEFT_ARM,), (3, 4))  # of a shirt's neckline, sleeves and hem


@dataclass(frozen=True)
class Shirt:
    """A shirt of the skin's own triangles, where it is worn, on its body."""

    points: Floats
    triangles: NDArray[np.int32]
    of_body: NDArray[np.int64]  # the body's vertex under each of its own
    body: Mesh
    skeleton: Skeleton
    folder: Path
    meshes: MeshCache

    def word(self, worn: Floats, rest: Floats | None = None) -> Judgement:
        """The word on a shape of it; ``rest``: how it is cut and starts."""
        path = self.folder / "shirt.obj" if rest is None else self.folder / f"shirt_{rest.std():.6f}.obj"
        write_obj(path, self.points if rest is None else rest, self.triangles)
        scene = load_scene(
            {
                "garment": {"mesh": str(path), "units": "m", "rest": "mesh"},
                "avatar": {"mesh": str(self.folder / "body.obj"), "units": "m"},
            }
        )
        return judged_shape(scene, load_outfit(scene, self.meshes), worn, "cpu")

    def codes(self, worn: Floats, rest: Floats | None = None) -> set[str]:
        found = self.word(worn, rest)
        assert found.worn == (not found.problems)
        return {problem.code.value for problem in found.problems}

    def on(self, limb: int) -> NDArray[np.bool_]:
        return np.asarray(self.skeleton.limb[self.of_body] == limb)


@pytest.fixture(scope="module")
def shirt(tmp_path_factory: pytest.TempPathFactory) -> Shirt:
    body, folder = mannequin(edge=0.015), tmp_path_factory.mktemp("shirt")
    skeleton = skeleton_of(body)
    up = (body.points - skeleton.middle) @ skeleton.up
    arm = np.isin(skeleton.limb, (RIGHT_ARM, LEFT_ARM))
    mine = ((skeleton.limb == TRUNK) & (up > HEM)) | (arm & (skeleton.station < ELBOW))
    faces = body.triangles[mine[body.triangles].all(axis=1)]
    kept, corners = np.unique(faces, return_inverse=True)
    points = body.points[kept] + OFF * vertex_normals(body.points, body.triangles)[kept]
    write_obj(folder / "body.obj", body.points, body.triangles)
    return Shirt(points, corners.reshape(-1, 3).astype(np.int32), kept, body, skeleton, folder, MeshCache())


def test_the_shirt_is_worn_as_it_was_cut(shirt: Shirt) -> None:
    found = shirt.word(shirt.points)
    assert (found.worn, found.problems) == (True, ())
    assert found.message == "Worn, if it is at rest."


@pytest.mark.parametrize("sideways", [0.0, 0.1])
def test_a_hole_that_is_cut_out_of_it(shirt: Shirt, tmp_path: Path, sideways: float) -> None:
    """As in lace; it was taken for an opening of the legs that encloses nothing."""
    write_obj(tmp_path / "body.obj", shirt.body.points, shirt.body.triangles)
    place = shirt.skeleton.middle + 0.3 * shirt.skeleton.forward + 0.1 * shirt.skeleton.up
    away = (shirt.points - place - sideways * shirt.skeleton.left) @ np.stack(
        [shirt.skeleton.left, shirt.skeleton.up]
    ).T
    is_front = (shirt.points - shirt.skeleton.middle) @ shirt.skeleton.forward > 0.03
    distance = np.linalg.norm(away, axis=1)
    hole = (distance < 0.015) & is_front
    off = np.where(is_front, 0.1 * np.exp(-((distance / 0.06) ** 2)), 0.0)  # its rim is clear of the skin
    points = shirt.points + off[:, None] * shirt.skeleton.forward
    faces = shirt.triangles[~hole[shirt.triangles].any(axis=1)]
    used, corners = np.unique(faces, return_inverse=True)
    lace = replace(shirt, points=points[used], triangles=corners.reshape(-1, 3).astype(np.int32), folder=tmp_path)
    assert lace.codes(lace.points) == set()


def test_an_arm_outside_its_sleeve(shirt: Shirt) -> None:
    """The sleeve lies before the arm, clear of it."""
    worn = shirt.points.copy()
    worn[shirt.on(LEFT_ARM)] += 0.2 * shirt.skeleton.forward
    assert "wrong_opening" in shirt.codes(worn)


def test_a_seam_that_is_held_open(shirt: Shirt) -> None:
    worn = shirt.points.copy()
    front = (worn - shirt.skeleton.middle) @ shirt.skeleton.forward > 0.05
    low = front & ((worn - shirt.skeleton.middle) @ shirt.skeleton.up < 0.05)
    worn[low] += 0.03 * shirt.skeleton.forward - 0.03 * shirt.skeleton.up
    assert "seam_open" in shirt.codes(worn)


def test_a_garment_cut_too_small(shirt: Shirt) -> None:
    """Its cloth is stretched by a third all over."""
    about = shirt.skeleton.middle
    found = shirt.codes(shirt.points, about + 0.74 * (shirt.points - about))
    assert "too_small" in found


@pytest.mark.parametrize(("longer", "told"), [(1.5, False), (3.8, True)])
def test_sleeves_that_hands_do_not_come_out_of_are_too_large(shirt: Shirt, longer: float, told: bool) -> None:
    """Both sleeves go straight on from their roots, wide enough for hands."""
    worn = shirt.points.copy()
    for arm in (RIGHT_ARM, LEFT_ARM):
        curve, joint = shirt.skeleton.curves[arm], shirt.skeleton.joints[arm]
        root, way = curve[joint], curve[-1] - curve[joint]
        way = way / np.linalg.norm(way)
        own = shirt.on(arm)
        along = (worn[own] - root) @ way
        worn[own] += np.maximum(along, 0.0)[:, None] * (longer - 1.0) * way
    found = shirt.word(worn, worn)
    codes = {problem.code.value for problem in found.problems}
    assert ("too_large" in codes) == told
    if told:
        (problem,) = (each for each in found.problems if each.code.value == "too_large")
        assert "right arm and left arm" in problem.message


@pytest.mark.parametrize("step", [(0.0, 0.0, 0.5), (0.35, -0.3, 0.35), (1.5, 0.0, 0.0)])
def test_a_garment_dropped_beside_the_body(shirt: Shirt, step: tuple[float, float, float]) -> None:
    assert {"fell_off", "wrong_opening"} & shirt.codes(shirt.points + np.array(step))


def test_sleeves_swapped(shirt: Shirt) -> None:
    """The shirt is mirrored, so that only the arms in its sleeves are wrong: the mannequin is symmetric."""
    mirrored = shirt.points.copy()
    off = (mirrored - shirt.skeleton.middle) @ shirt.skeleton.left
    mirrored -= 2.0 * off[:, None] * shirt.skeleton.left
    assert {"wrong_opening"} <= shirt.codes(mirrored) <= {"wrong_opening", "shown_through", "inside_body"}


def test_a_crossing_left_in(shirt: Shirt) -> None:
    """A fold of the hem's front is turned through the cloth above it."""
    worn = shirt.points.copy()
    forward = (worn - shirt.skeleton.middle) @ shirt.skeleton.forward
    up = (worn - shirt.skeleton.middle) @ shirt.skeleton.up
    at = int(np.argmax(np.where(np.abs(up - 0.1) < 0.01, forward, -np.inf)))
    near = np.linalg.norm(worn - worn[at], axis=1)
    order = np.argsort(near)
    worn[order[0]] = worn[order[12]] + 0.01 * shirt.skeleton.forward
    worn[order[1]] = worn[order[12]] - 0.002 * shirt.skeleton.forward
    assert "crossing" in shirt.codes(worn)


@pytest.fixture(scope="module")
def shoulders(shirt: Shirt) -> Shoulders:
    return Shoulders.of(LIMBS, shirt.points, shirt.triangles, shirt.skeleton)


def test_straps_that_hang_on_the_arms_have_slipped_off_the_shoulders(shirt: Shirt) -> None:
    """All cloth over the shoulders is gone but a ring round each arm."""
    down = shirt.points - 0.25 * shirt.skeleton.up

    def slipped(limbs: Sequence[Limbs], start: Floats, worn: Floats) -> Limbs:
        return Shoulders.of(limbs, start, shirt.triangles, shirt.skeleton).slipped(worn, shirt.triangles)

    assert slipped(LIMBS, shirt.points, shirt.points) == ()
    assert slipped(LIMBS, shirt.points, down) == (RIGHT_ARM, LEFT_ARM)
    assert slipped(LIMBS, down, down) == (), "it began there"
    assert slipped(((0, 1, 2), (3, 4)), shirt.points, down) == (), "a strapless one"


def test_straps_that_moved_out_beyond_the_root_of_the_arm_have_slipped(shirt: Shirt, shoulders: Shoulders) -> None:
    """They reach as high there as on the shoulder."""
    aside = np.sign((shirt.points - shirt.skeleton.middle) @ shirt.skeleton.left)
    for place, slips in ((0.95, False), (1.1, True)):
        inner = shoulders.begun[LEFT_ARM].inner
        out = (place - inner) * shoulders.sides[LEFT_ARM].width
        worn = shirt.points + out * aside[:, None] * shirt.skeleton.left
        assert bool(shoulders.slipped(worn, shirt.triangles)) == slips


def test_cloth_between_the_neck_and_a_raised_arm_lies_on_the_shoulder(shirt: Shirt, shoulders: Shoulders) -> None:
    """The arm's muscle stands higher there than the cloth beside it."""
    higher = replace(shoulders, skin={arm: 1.9 * top for arm, top in shoulders.skin.items()})
    assert higher.placed == [RIGHT_ARM, LEFT_ARM]
    assert higher.slipped(shirt.points, shirt.triangles) == ()


def test_only_cloth_on_the_shoulder_tells_how_high_a_garment_is(shirt: Shirt) -> None:
    """Not the lower half of a sleeve, beside a strap that is narrow."""
    skeleton = shirt.skeleton
    roots = [skeleton.curves[arm][skeleton.joints[arm]] for arm in (RIGHT_ARM, LEFT_ARM)]
    width, root = float((roots[1] - roots[0]) @ skeleton.left) / 2.0, float(np.mean(roots, axis=0) @ skeleton.up)
    aside = np.abs((shirt.points - skeleton.middle) @ skeleton.left)
    off = (aside > 0.75 * width) & (shirt.points @ skeleton.up > root)
    narrow = shirt.triangles[~off[shirt.triangles].any(axis=1)]
    whole = height_over_shoulders(LIMBS, shirt.points, shirt.triangles, skeleton)
    assert height_over_shoulders(LIMBS, shirt.points, narrow, skeleton) == pytest.approx(whole, abs=0.02)


def test_a_hood_that_stands_on_a_narrow_shoulder_does_not_tell_its_height(shirt: Shirt) -> None:
    """An adult's hood on a child: its sides stand where the child's shoulders are, and the garment's lie outside it."""
    skeleton = shirt.skeleton
    roots = [skeleton.curves[arm][skeleton.joints[arm]] for arm in (RIGHT_ARM, LEFT_ARM)]
    width = float((roots[1] - roots[0]) @ skeleton.left) / 2.0

    def height(outside: float) -> float:
        """``outside``: how high shoulders lie above the roots of the arms [m], outside a hood of 0.6 m."""
        across = width * np.array([-1.4, -1.02, -1.0, 1.0, 1.02, 1.4])
        up = np.array([outside, outside, 0.6, 0.6, outside, outside])
        row = np.mean(roots, axis=0) + across[:, None] * skeleton.left + up[:, None] * skeleton.up
        points = np.concatenate([row - 0.2 * skeleton.forward, row + 0.2 * skeleton.forward])
        first = np.arange(5)
        triangles = np.concatenate([[first, first + 1, first + 6], [first + 1, first + 7, first + 6]], axis=1).T
        return height_over_shoulders(LIMBS, points, triangles.astype(np.int32), skeleton)

    assert height(0.3) - height(0.2) == pytest.approx(0.1, abs=0.001)
    assert height(-0.2) > 0.4  # cloth so low is no shoulder


def test_a_wide_skirt_round_the_shoulders_is_lowered_to_the_waist(shirt: Shirt) -> None:
    """It was placed for one who is taller; a cape with such a neckline would fall off."""
    body, count = shirt.skeleton, 24
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    around = np.cos(angles)[:, None] * body.left + np.sin(angles)[:, None] * body.forward
    points = body.shoulders + np.concatenate([0.22 * around + 0.05 * body.up, 0.5 * around - 0.35 * body.up])
    step, after = np.arange(count), (np.arange(count) + 1) % count
    halves = [np.stack([step, after, step + count], 1), np.stack([after, after + count, step + count], 1)]
    triangles = np.concatenate(halves).astype(np.int32)
    topology = build_topology(triangles, len(points))
    lengths = np.linalg.norm(np.diff(points[topology.edges], axis=1)[:, 0], axis=1)
    wearing = Wearing.of(openings_of(topology, triangles, lengths, len(points)), points, triangles, body)
    assert wearing.limbs == (LEGS, LEGS)
    assert wearing.start_fault  # so that it is dressed there
    assert float((wearing.onto[:count].mean(axis=0) - body.waist) @ body.up) == pytest.approx(0.0, abs=1e-6)


def test_straps_are_tugged_inwards_along_the_shoulders_until_they_lie_there(shirt: Shirt, shoulders: Shoulders) -> None:
    assert tugged(shoulders, shirt.points, shirt.triangles) is None, "they lie there"
    aside = np.sign((shirt.points - shirt.skeleton.middle) @ shirt.skeleton.left)
    worn, steps = shirt.points + 0.08 * aside[:, None] * shirt.skeleton.left, 0
    off = [strap.off for strap in shoulders.straps(worn, shirt.triangles)]
    assert len(off) == 2
    assert min(off) > 0.02
    while (moved := tugged(shoulders, worn, shirt.triangles)) is not None:
        step = np.linalg.norm(moved - worn, axis=1)
        low = (worn - shirt.skeleton.shoulders) @ shirt.skeleton.up < -0.3
        assert step.max() < TUG + 1e-9, "little by little"
        assert not step[low].any()
        worn, steps = moved, steps + 1
        assert steps < 30
    assert steps > 1


def test_shapes_are_given_as_arrays_files_or_fits(shirt: Shirt) -> None:
    scene = {"garment": {"shape": {"kind": "square", "vertices_per_side": 5}, "pin": {"loop": "top"}}}
    fit = warp_cloth.fit(scene, overrides=["solver.iterations=20"], device="cpu")
    saved = fit.save(shirt.folder / "square")
    points = fit.garments[0].points
    stage = next(path for path in saved if path.suffix == ".usdc")
    for shape in (points, points.tolist(), [points], fit, stage):
        assert warp_cloth.judge(scene, shape, device="cpu").worn
    torn = points * [1.7, 1.0, 1.0]
    found = warp_cloth.judge(scene, torn, device="cpu")
    assert not found.worn
    assert found.message.startswith("Not worn.")


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (np.zeros((24, 3)), r"needs an array of \(25, 3\)"),
        (np.full((25, 3), np.nan), "not finite"),
        ("nothing.usdc", "no such file"),
        ([np.zeros((25, 3)), np.zeros((25, 3))], "needs an array"),
        (None, "needs an array"),
    ],
)
def test_what_is_no_shape_of_the_garment_is_refused(shape: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        warp_cloth.judge({"garment": {"shape": {"kind": "square", "vertices_per_side": 5}}}, shape, device="cpu")


def test_a_shape_of_another_mesh_is_refused() -> None:
    scenes = [{"garment": {"shape": {"kind": "square", "vertices_per_side": count}}} for count in (5, 6)]
    fit = warp_cloth.fit(scenes[0], overrides=["solver.iterations=10"], device="cpu")
    with pytest.raises(InputError, match="other vertices or triangles"):
        warp_cloth.judge(scenes[1], replace(fit), device="cpu")


@pytest.mark.parametrize(("degrees", "side"), [(20.0, ""), (28.0, "right"), (-28.0, "left")])
@pytest.mark.parametrize("scene_name", ["skirt", "trousers"])
def test_what_slopes_down_to_one_side_hangs_from_one_hip(scene_name: str, degrees: float, side: str) -> None:
    scene = load_scene(scene_name, ["garment.edge_mm=60"])
    outfit = load_outfit(scene)
    (wearing,), points = outfit.wearing, outfit.garments[0].points
    assert wearing is not None
    up, left, top = wearing.skeleton.up, wearing.skeleton.left, wearing.onto[wearing.top.loop].mean(axis=0)
    across = (wearing.onto - top) @ left
    sheared = wearing.onto + np.tan(np.radians(degrees)) * across[:, None] * up
    assert sheared.shape == points.shape
    assert wearing.sunk(sheared) == (side != "")
    assert not wearing.sunk(wearing.onto)
    slid = [each for each in judged_shape(scene, outfit, sheared, "cpu").problems if "slope" in each.figures]
    assert [each.code.value for each in slid] == ["slid_off"] * (side != "")
    if side:
        assert f"slid down on the {side}: its top opening slopes by 28 degrees" in slid[0].message
        assert set(slid[0].vertices) == set(wearing.top.loop.tolist())


@pytest.mark.parametrize("height", [1.5, 2.1], ids=("neck", "over_the_head"))
def test_a_cape_that_starts_as_a_flat_disc_hangs_from_its_neck_and_not_from_its_hem(
    tmp_path: Path, height: float
) -> None:
    """However far it fell through the air, that is no sliding."""
    sides, radii = 48, np.linspace(0.09, 0.6, 10)
    turn = 2.0 * np.pi * np.arange(sides) / sides
    around = np.stack([np.sin(turn), np.zeros(sides), np.cos(turn)], axis=1)
    ring, side = np.meshgrid(np.arange(len(radii) - 1) * sides, np.arange(sides), indexing="ij")
    a, b = (ring + side).ravel(), (ring + (side + 1) % sides).ravel()
    faces = np.concatenate([np.stack([a, b, a + sides], axis=1), np.stack([b, b + sides, a + sides], axis=1)])
    disc = np.concatenate([radius * around for radius in radii])
    write_obj(tmp_path / "cape.obj", disc + np.array([0.0, height, 0.0]), faces)
    garment = {"mesh": str(tmp_path / "cape.obj"), "units": "m", "rest": "mesh"}
    scene = load_scene({"garment": garment, "avatar": {"shape": {"kind": "mannequin"}}})
    outfit = load_outfit(scene, divides=False)
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert wearing.top.girth < 0.6
    fall = 0.9 * (radii - radii[0])  # a cone
    worn = 0.44 * disc + np.array([0.0, 1.44, 0.0])
    worn[:, 1] -= np.repeat(fall, sides)
    codes = [each.code.value for each in judged_shape(scene, outfit, worn, "cpu").problems]
    assert "slid_off" not in codes
    lower = [each.code.value for each in judged_shape(scene, outfit, worn - [0.0, 0.5, 0.0], "cpu").problems]
    assert "slid_off" in lower
