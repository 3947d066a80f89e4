"""What crosses is found, comes undone, and is told where it does not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from cloths import NO_PINS, grid
from meshfiles import write_obj
from sheets import THICKNESS, crumpled, iterate, look, moved, sheets_at

import warp_cloth
from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.exact import build_exact_collider, signed_distances
from warp_cloth.avatar.placement import DEEP, clear_shift, shift_text
from warp_cloth.base.mesh import Mesh
from warp_cloth.contact.box_tree import candidate_lists
from warp_cloth.contact.crossing import find_crossings
from warp_cloth.contact.facing import Facing
from warp_cloth.contact.sheets import sheets_of
from warp_cloth.kernels.contact.arrays import NEVER
from warp_cloth.kernels.contact.broad_phase import COUNTER_STRIDE
from warp_cloth.kernels.contact.untangle import LONGEST, PATIENCE, exclude_tangled
from warp_cloth.model.permutation import Permutation
from warp_cloth.scene import SphereShape
from warp_cloth.shapes import build_avatar
from warp_cloth.solver.contact_schedule import MOST_LIFTED, ContactSchedule
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions


@pytest.mark.parametrize("room", [(1000, 100000), (1000, 50), (3, 100000), (3, 50)])
def test_lists_of_any_room_find_the_same(room: tuple[int, int]) -> None:
    upper = moved(crumpled(3), 0.0, 0.0, 0.3 * THICKNESS)  # crosses the other, whose vertices are beyond it
    model, cloth_contact, _ = sheets_at([crumpled(1), upper])
    cloth_contact.awaken(model.state)

    def found() -> tuple[list[list[int]], list[np.ndarray]]:
        cloth_contact.grow()
        cloth_contact.search(model.state)
        count = int(cloth_contact.data.pairs.count.numpy()[0])
        rows = np.column_stack([cloth_contact.data.pairs.corners.numpy(), cloth_contact.data.pairs.kind.numpy()])[
            :count
        ]
        parting = cloth_contact.untangling
        return sorted(rows.tolist()), [
            each.numpy() for each in (parting.count, parting.nearest, cloth_contact.data.shift)
        ]

    pairs, parted = found()  # with no lists at all
    assert parted[0].min() > 0
    with wp.ScopedDevice("cpu"):
        cloth_contact.pair_search.near_candidates, cloth_contact.pair_search.crossing_candidates = (
            candidate_lists(*room),
            candidate_lists(*room),
        )
    again, parted_again = found()
    assert again == pairs
    groups, *leaves = cloth_contact.pair_search.crossing_candidates.count.numpy()[::COUNTER_STRIDE].tolist()
    assert groups > 3  # more than the smaller lists have room for
    assert sum(leaves) > 50
    assert all(np.array_equal(one, other) for one, other in zip(parted, parted_again, strict=True))


def test_what_crosses_is_found_from_what_was_tangled_as_from_all() -> None:
    upper = moved(crumpled(3), 0.0, 0.0, 0.3 * THICKNESS)
    model, cloth_contact, _ = sheets_at([crumpled(1), upper])
    cloth_contact.awaken(model.state)  # looks everywhere

    def parted(whole: int) -> list[np.ndarray]:
        cloth_contact.pair_search.geometry.whole.fill_(whole)
        cloth_contact.search(model.state)
        assert cloth_contact.pair_search.geometry.whole.numpy()[0] == 0
        parting = cloth_contact.untangling
        return [each.numpy() for each in (parting.count, parting.crosses, cloth_contact.data.shift)]

    everywhere, near = parted(1), parted(0)
    assert everywhere[0][0] > 0
    assert all(np.array_equal(one, other) for one, other in zip(everywhere, near, strict=True))


def test_an_edge_of_a_modelled_garment_is_no_seam_however_long() -> None:
    """Taken for one yet to close it passed through all, and each crossing search was for all."""
    mesh = grid(5, 0.08)
    model, cloth_contact, garments = sheets_at([mesh, moved(mesh, 0.003, 0.004, 0.01)])
    points = model.points()
    pulled = len(mesh.points) // 2
    points[pulled, 2] += 0.05  # through the other sheet, its edges nearly three times as long as at rest
    model.set_points(points)
    cloth_contact.awaken(model.state)
    cloth_contact.search(model.state)
    crossing = find_crossings(points, sheets_of(garments), "cpu").pierced
    assert cloth_contact.untangling.count.numpy()[0] == len(crossing) > 0
    assert cloth_contact.pair_search.geometry.whole.numpy()[0] == 0


def test_what_is_tangled_is_pressed_again_once_it_is_not() -> None:
    upper = moved(crumpled(3), 0.0, 0.0, 0.3 * THICKNESS)
    model, cloth_contact, _ = sheets_at([crumpled(1), upper])
    look(model, cloth_contact)
    data = cloth_contact.data
    count = int(data.pairs.count.numpy()[0])

    def due(gone: int) -> np.ndarray:
        return np.asarray(data.pairs.due.numpy()[:count] <= gone)

    tangled = (cloth_contact.pair_search.geometry.tangled.numpy() > 0)[data.pairs.corners.numpy()[:count]].any(axis=1)
    assert tangled.any()
    assert due(0)[~tangled].any()
    assert not due(int(NEVER))[tangled].any()
    assert due(int(NEVER))[~tangled].all()
    cloth_contact.pair_search.geometry.tangled.zero_()
    wp.launch(
        exclude_tangled, dim=len(data.pairs.corners), inputs=[cloth_contact.pair_search.geometry, data], device="cpu"
    )
    assert due(0)[tangled].all()


def test_a_fold_that_passes_through_itself_comes_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    for most in ("MOST_SEWING", "MOST_CLOSING"):
        monkeypatch.setattr(f"warp_cloth.solver.contact_schedule.{most}", 0)  # no edge is a seam, however long
    mesh = grid(25, 0.24)
    points = mesh.points.copy()
    u = (points[:, 0] - 0.12) / 0.06
    looped = np.abs(u) < 1.0
    points[:, 0] -= 0.03 * np.clip(u, -1.0, 1.0)
    points[looped, 0] = 0.12 + 0.06 * (u**3 - 0.5 * u)[looped]
    points[looped, 2] = 0.03 * (1.0 - u**2)[looped]
    points += np.random.default_rng(1).normal(scale=1e-4, size=points.shape)
    model, cloth_contact, _ = sheets_at([mesh], precision="mixed")
    model.set_points(points)
    assert len(find_crossings(points, cloth_contact.sheets, "cpu").pairs) > 20
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0]))
    for step in range(10):
        schedule.advance(100 * step)
        points = iterate(relaxation, 100)
        cloth_contact.read_crossings(relaxation.contact_state())
        if not cloth_contact.crossings():
            break
    assert not len(find_crossings(points, cloth_contact.sheets, "cpu").pairs)


def tube(radius: float, rows: int = 9) -> Mesh:
    """A sheet bent round the y axis, almost closed, its front inward."""
    mesh = grid(rows, 0.16)
    angle = mesh.points[:, 0] / 0.16 * 6.2
    return replace(mesh, points=np.stack([radius * np.cos(angle), mesh.points[:, 1], radius * np.sin(angle)], axis=1))


def test_garments_are_told_whether_they_face_the_body() -> None:
    inward = tube(0.06)
    outward = replace(tube(0.07), triangles=np.ascontiguousarray(tube(0.07).triangles[:, ::-1]))
    model, cloth_contact, _ = sheets_at([inward, outward], precision="mixed")
    ball = build_avatar(SphereShape(kind="sphere", radius=0.05))
    body = build_exact_collider(moved(ball, *(-ball.points.mean(axis=0) + [0.0, 0.08, 0.0])), "cpu").within(1.0)
    with wp.ScopedDevice("cpu"):
        facing = Facing("mixed", cloth_contact.sheets, Permutation(None), body)
    facing.update(model.state, cloth_contact.pair_search.geometry, cloth_contact.untangling.outward)
    faces = np.split(cloth_contact.untangling.outward.numpy(), [inward.vertex_count])
    assert (faces[0] == -1.0).all()
    assert (faces[1] == 1.0).all()


def test_an_outer_layer_inside_the_inner_one_comes_out() -> None:
    inner, outer = tube(0.05, 13), tube(0.056, 13)
    pins = np.arange(inner.vertex_count, dtype=np.int32)
    model, cloth_contact, _ = sheets_at([inner, outer], pins=[pins, NO_PINS], precision="mixed")
    model.set_points(np.concatenate([inner.points, outer.points * [0.8, 1.0, 0.8]]))
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [-1.0, -1.0]))
    for step in range(6):
        schedule.advance(100 * step)
        points = iterate(relaxation, 100)
    assert not len(find_crossings(points, cloth_contact.sheets, "cpu").pairs)
    worn = points[len(pins) :]
    beside = (worn[:, 1] > 0.01) & (worn[:, 1] < 0.15)
    assert beside.any()
    assert (np.linalg.norm(worn[beside][:, [0, 2]], axis=1) > 0.05 * np.cos(0.27)).all()  # the chord of an edge


@pytest.mark.parametrize("apart", [True, False])
def test_the_lift_of_modelled_layers_ends_once_they_are_apart(apart: bool) -> None:
    """It would go on to hold a hem tangled between the thighs."""
    inner, folded = grid(12, 0.22), crumpled(1)
    points = folded.points
    points[points[:, 2] > 0.5 * THICKNESS, 2] -= THICKNESS  # half of the fold through the sheet
    points[:, 2] += 0.05 if apart else 0.0
    model, cloth_contact, _ = sheets_at([inner, folded], precision="mixed")
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
    schedule.advance(0)  # awakens
    cloth_contact.search(relaxation.contact_state())
    assert cloth_contact.data.model.lift.numpy().any()
    schedule.advance(MOST_LIFTED - 100)
    assert cloth_contact.data.model.lift.numpy().any()
    schedule.advance(MOST_LIFTED)
    assert schedule.calm
    assert cloth_contact.crossings() > 0
    assert cloth_contact.layers_apart() == apart
    assert cloth_contact.data.model.lift.numpy().any() != apart


def test_layers_that_do_not_come_apart_are_shifted_further_and_again_less_once_they_have() -> None:
    inner, outer = tube(0.05, 13), tube(0.048, 13)
    model, cloth_contact, _ = sheets_at([inner, outer], precision="mixed")
    model.set_points(np.concatenate([inner.points, outer.points * [1.0, 1.0, 1.0] + [0.004, 0.0, 0.0]]))
    cloth_contact.face([-1.0, -1.0])
    look(model, cloth_contact)
    longest = []
    for count in (1, 2 * int(PATIENCE), 6 * int(PATIENCE)):  # nothing moves
        for _ in range(count):
            cloth_contact.search(model.state)
        longest.append(float(np.abs(cloth_contact.data.shift.numpy()).max()))
    assert longest[0] > 0.0
    assert 1.9 < longest[1] / longest[0] < 2.2
    assert longest[2] / longest[0] == pytest.approx(float(LONGEST), rel=1e-4)
    model.set_points(np.concatenate([inner.points, outer.points * [1.5, 1.0, 1.5]]))
    cloth_contact.search(model.state)
    assert 0 < cloth_contact.untangling.next_age.numpy().max() == cloth_contact.untangling.age.numpy().max() - 1
    assert not cloth_contact.data.shift.numpy().any()


UNTANGLED = 1000  # iterations that the shared T-shirt is given; it takes about 800


def test_the_shared_tshirt_is_sewn_and_nothing_crosses(shared_data: Path) -> None:
    folder = shared_data / "garmentcode"
    scene = {
        "garment": {"mesh": str(folder / "tshirt.obj"), "rest": "uv"},
        "avatar": {"mesh": str(folder / "mean_all.obj")},
        "collision": {"cloth": True},
        "solver": {"iterations": UNTANGLED},
    }
    worn = warp_cloth.fit(scene, device="cpu")
    assert worn.report["crossings"]["pairs"] == 0
    assert worn.report["strain"]["max"] < 0.3  # every seam closed


def test_a_garment_to_be_sewn_starts_clear_of_a_body_that_is_taller() -> None:
    body = build_avatar(SphereShape(kind="sphere", radius=0.2, centre=(0.0, 0.1, 0.0)))
    around = build_avatar(SphereShape(kind="sphere", radius=0.24, centre=(0.0, 0.0, 0.0))).points
    assert signed_distances(around, body, "cpu").min() < -DEEP
    shift = clear_shift(around, body, "cpu")
    assert signed_distances(around + shift, body, "cpu").min() > 0.0
    assert clear_shift(around + shift, body, "cpu") is None


def test_no_garment_is_moved_down_unless_that_clears_it() -> None:
    """Trousers would hang lower for inseams that are drawn into the legs at any height."""
    leg = build_avatar(SphereShape(kind="sphere", radius=0.2, centre=(0.0, 0.2, 0.0)))
    up = np.arange(0.0, 0.1, 0.01)
    seam = np.stack([np.zeros_like(up), up, np.zeros_like(up)], axis=1)
    assert clear_shift(seam, leg, "cpu") is None
    shift = clear_shift(seam - [0.0, 0.06, 0.0], leg, "cpu")
    assert shift[1] == pytest.approx(-0.03)


def test_no_garment_is_moved_far_up_for_what_is_in_the_body_there_as_well() -> None:
    """Of a tight one some is inside wherever it starts; moved as far as helps most, it would be worn too high."""
    body = build_avatar(SphereShape(kind="sphere", radius=0.28, centre=(0.0, 0.28, 0.0)))
    shoulders, tight = np.tile([0.0, 0.49, 0.0], (2, 1)), np.array([[0.0, 0.3, 0.0]])
    shift = clear_shift(np.concatenate([shoulders, tight]), body, "cpu")
    assert shift[1] == pytest.approx(0.08)
    taller = clear_shift(shoulders - [0.0, 0.07, 0.0], body, "cpu")
    assert taller[1] > 0.13


def test_a_garment_is_moved_onto_the_middle_of_a_form_that_stands_elsewhere() -> None:
    """A form without limbs does not tell where it stands; moved up until it was clear, a shirt began round the face."""
    form = build_avatar(SphereShape(kind="sphere", radius=0.2, centre=(0.06, 0.1, 0.12)))
    around = build_avatar(SphereShape(kind="sphere", radius=0.24, centre=(0.0, 0.1, 0.0))).points
    shift = clear_shift(around, form, "cpu", may_be_elsewhere=True)
    assert shift == pytest.approx([0.06, 0.0, 0.12], abs=0.011)
    assert clear_shift(around, form, "cpu") != pytest.approx(shift, abs=0.05)
    near = around + np.array([0.05, 0.0, 0.1])
    assert clear_shift(near, form, "cpu", may_be_elsewhere=True) is None


@pytest.mark.parametrize(
    ("shift", "told"),
    [
        ((-0.05, 0.0, 0.11), "110 mm forward and 50 mm to the right"),
        ((0.0, 0.04, 0.02), "40 mm up and 20 mm forward"),
        ((0.0, -0.01, 0.0), "10 mm down"),
        ((0.0, 0, -0.04), "40 mm back"),
    ],
)
def test_a_shift_is_told_by_where_it_goes(shift: tuple[float, float, float], told: str) -> None:
    assert shift_text(np.array(shift)) == told


def test_what_crosses_is_reported_and_marked(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.6, 0.8, 0.6], [0.5, 0.4, -0.5]])
    write_obj(tmp_path / "crossed.obj", points, [[0, 1, 2], [2, 1, 3], [2, 3, 4]])  # the last through the first
    scene = {
        "garment": {"mesh": str(tmp_path / "crossed.obj"), "units": "m", "pin": {"vertices": [0]}},
        "solver": {"iterations": 0},
    }
    worn = warp_cloth.fit(scene, device="cpu")
    faces = worn.report["garments"][0]["crossing_faces"]
    assert worn.report["crossings"] == {"pairs": len(faces) // 2, "between_garments": 0, "faces": len(faces)}
    marked = np.flatnonzero(worn.garments[0].fields["crossing"])
    assert set(marked) == set(worn.garments[0].mesh.triangles[faces].ravel())
