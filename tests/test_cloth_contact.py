"""Contact of cloth with cloth: forces against every pair, steps that never pass, friction."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import warp as wp
from cloths import NO_PINS, grid
from sheets import FABRIC, THICKNESS, contact_forces, crumpled, iterate, look, lying, moved, sheets_at
from touching import brute_energy, brute_forces, touching_pairs

from warp_cloth.avatar.collider import Collider
from warp_cloth.contact.arrays import LEAST_THICKNESS
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.crossing import find_crossings
from warp_cloth.model.attempt import CutShort, Patience
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.contact_schedule import ContactSchedule
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import ASTRAY, relax_items
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

# The sums are kept in units of 2^-36 N and 2^-16 N/m; a vertex of these sheets adds up at most 100 pairs.
FORCE_ROUNDING = 100 * 2.0**-36  # [N]
RELATIVE_ROUNDING = {"float64": 1e-6, "mixed": 2e-6}  # thickness and modulus are float32
GRADIENT_STEP = 1e-7  # [m]; central differences of the energy
GRADIENT_ERROR = 1e-5  # of the largest force: the force's third derivative over the step, and rounding


@pytest.mark.parametrize("gathers", [False, True])
@pytest.mark.parametrize("precision", [pytest.param("float64", marks=pytest.mark.long), "mixed"])
@pytest.mark.parametrize("seed", [1, 2])
def test_forces_are_those_of_every_pair(seed: int, precision: str, gathers: bool) -> None:
    flat, mesh = grid(12, 0.22), crumpled(seed)
    model, cloth_contact, _ = sheets_at([flat], precision=precision, gathers=gathers)
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)  # knows the patches' order
    model.set_points(mesh.points)
    look(model, cloth_contact, relaxation)
    pairs = touching_pairs(mesh.points, cloth_contact)
    assert len(pairs) > 100
    expected = brute_forces(mesh.points, pairs, cloth_contact)
    found = contact_forces(model, cloth_contact, relaxation)
    bound = FORCE_ROUNDING + RELATIVE_ROUNDING[precision] * np.abs(expected).max()
    assert np.abs(found[:, :3] - expected).max() <= bound


def test_pairs_stay_known_until_the_next_search() -> None:
    flat, mesh = grid(12, 0.22), crumpled(3)
    model, cloth_contact, _ = sheets_at([flat])
    # not touching yet, but each side goes almost as far as vertices may before another search is due
    way = np.where(flat.points[:, 0] > 0.11, 1.0, -1.0)[:, None] * [0.0, 0.0, 0.98 * cloth_contact.least_skin]
    model.set_points(mesh.points + way)
    look(model, cloth_contact)
    assert not np.abs(contact_forces(model, cloth_contact)).any()
    model.set_points(mesh.points)
    expected = brute_forces(mesh.points, touching_pairs(mesh.points, cloth_contact), cloth_contact)
    assert np.abs(expected).any()
    found = contact_forces(model, cloth_contact)
    assert (
        np.abs(found[:, :3] - expected).max() <= FORCE_ROUNDING + RELATIVE_ROUNDING["float64"] * np.abs(expected).max()
    )


def test_a_search_says_which_pairs_are_to_be_looked_at_at_once() -> None:
    flat, mesh = grid(12, 0.22), crumpled(3)
    model, cloth_contact, _ = sheets_at([flat])
    model.set_points(mesh.points)
    look(model, cloth_contact)
    count = int(cloth_contact.data.pairs.count.numpy()[0])
    due = cloth_contact.data.pairs.due.numpy()[:count] <= 0  # nothing has gone any way
    touching = {tuple(pair.corners.tolist()) for pair in touching_pairs(mesh.points, cloth_contact)}
    asked = {tuple(corners) for corners in cloth_contact.data.pairs.corners.numpy()[:count][due].tolist()}
    assert touching <= asked
    assert 0 < due.sum() < count  # and not all


def test_what_moves_has_more_room_than_what_stands_still() -> None:
    mesh = grid(12, 0.22)
    model, cloth_contact, _ = sheets_at([mesh])
    look(model, cloth_contact)
    cloth_contact.search(model.state)  # from where it was at the last one it has not moved
    still = np.float32(cloth_contact.least_skin)
    assert (cloth_contact.data.trigger.skin.numpy() == still).all()
    moves = mesh.points[:, 0] > 0.11
    for _ in range(3):
        model.set_points(
            model.points() + 0.9 * cloth_contact.data.trigger.skin.numpy()[:, None] * moves[:, None] * [0.0, 0.0, 1.0]
        )
        cloth_contact.search(model.state)
    assert (cloth_contact.data.trigger.skin.numpy() > still)[moves].all()
    assert (cloth_contact.data.trigger.skin.numpy() == still)[~moves].all()


def test_few_that_have_used_up_their_skins_wait_for_a_search_and_many_do_not() -> None:
    mesh = grid(12, 0.22)
    model, cloth_contact, _ = sheets_at([mesh])
    look(model, cloth_contact)
    cloth_contact.untangles = False
    data = cloth_contact.data

    def searched(asked: int, turn: int) -> bool:
        """Whether a look finds that it is time, after so many iterations and requests."""
        data.trigger.requests.assign([data.trigger.requests.numpy()[0] + asked, data.trigger.requests.numpy()[1]])
        data.bounds.iteration.fill_(turn)
        before = int(cloth_contact.pair_search.memory.search.numpy()[0])
        cloth_contact.search_where_due(model.state)
        return int(cloth_contact.pair_search.memory.search.numpy()[0]) > before

    assert not searched(0, 1000)
    assert searched(data.model.request_limit + 1, 1001)  # now
    assert not searched(1, 1001 + data.model.longest_wait - 1)
    assert not searched(0, 1001 + data.model.longest_wait - 1)
    assert searched(0, 1001 + data.model.longest_wait)  # which that one has waited for
    assert not searched(0, 1001 + 10 * data.model.longest_wait)


def test_forces_are_the_gradient_of_the_energy_and_balance() -> None:
    flat, mesh = grid(12, 0.22), crumpled(5)
    model, cloth_contact, _ = sheets_at([flat])
    model.set_points(mesh.points)
    look(model, cloth_contact)
    forces = contact_forces(model, cloth_contact)[:, :3]
    assert np.abs(forces.sum(axis=0)).max() <= FORCE_ROUNDING * len(forces)
    largest = np.abs(forces).max()
    for vertex in np.argsort(-np.abs(forces).max(axis=1))[:4].tolist():
        for axis in range(3):
            energies = []
            for way in (-GRADIENT_STEP, GRADIENT_STEP):
                points = mesh.points.copy()
                points[vertex, axis] += way
                energies.append(brute_energy(points, touching_pairs(points, cloth_contact, vertex), cloth_contact))
            slope = (energies[1] - energies[0]) / (2.0 * GRADIENT_STEP)
            assert forces[vertex, axis] == pytest.approx(-slope, abs=GRADIENT_ERROR * largest)


def test_a_flat_sheet_does_not_touch_itself_however_fine() -> None:
    for count in (4, 12, 60):  # the finest has edges of twice the thickness
        mesh = grid(count, 0.22)
        model, cloth_contact, _ = sheets_at([mesh])
        look(model, cloth_contact)
        assert not np.abs(contact_forces(model, cloth_contact)).any()


def dropped(momentum: float, gathers: bool | None = None) -> tuple[Relaxation, ClothContact]:
    """A sheet held over a smaller one that is pinned, to fall on it."""
    low_bits, above = lying(grid(6, 0.1)), moved(lying(grid(10, 0.16)), -0.03, 0.01, 0.03)
    model, cloth_contact, _ = sheets_at(
        [low_bits, above], pins=[np.arange(36, dtype=np.int32), NO_PINS], precision="mixed", gathers=gathers
    )
    relaxation = Relaxation(model, Collider(), StepOptions(momentum=momentum), cloth_contact)
    cloth_contact.awaken(relaxation.contact_state())
    return relaxation, cloth_contact


def test_falling_cloth_is_caught_and_never_passes() -> None:
    relaxation, cloth_contact = dropped(0.9995)
    lowest = 0.0
    for _ in range(15):
        points = iterate(relaxation, 20)
        assert not len(find_crossings(points, cloth_contact.sheets, "cpu").pairs)
        lowest = min(lowest, float(points[36:, 1].min()))
    assert lowest < -0.01  # its border hangs over
    middle = np.linalg.norm(points[36:, [0, 2]] - [0.05, -0.05], axis=1) < 0.03
    assert middle.any()
    assert (points[36:][middle, 1] > 0.2 * THICKNESS).all()


def test_worn_cloth_gets_room_for_more_pairs_at_the_same_iteration_whether_or_not_the_loop_runs_ahead() -> None:
    ends = []
    for ahead in (False, True):
        relaxation, cloth_contact = dropped(0.9995)
        schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
        seen = []

        def squeeze(
            iteration: int, relaxation: Relaxation, cloth_contact: ClothContact = cloth_contact, seen: list[int] = seen
        ) -> None:
            seen.append(len(cloth_contact.data.pairs.corners))
            if iteration == 640:
                cloth_contact.pair_search.allocate_pairs(cloth_contact.data, 5)
                relaxation.drop_graphs()

        goal = Goal(Tolerance(0.0, 0.0, 0.0), 900)
        (outcome,) = relax_items(Certifier(relaxation), [goal], schedule=schedule, on_burst=squeeze, ahead=ahead)
        assert 5 in seen
        assert seen[-1] > 5
        ends.append((outcome.points, seen))
    assert np.array_equal(ends[0][0], ends[1][0])
    assert ends[0][1] == ends[1][1]


def test_contact_of_cloth_with_cloth_is_not_relaxed_without_its_schedule() -> None:
    relaxation, _ = dropped(0.9995)
    with pytest.raises(ValueError, match="schedule"):
        relax_items(Certifier(relaxation), [Goal(Tolerance(), 100)])


def test_what_is_measured_at_the_end_is_the_same_whether_or_not_the_loop_ran_ahead() -> None:
    loads = []
    for ahead in (False, True):
        relaxation, cloth_contact = dropped(0.9995)
        schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
        anything = Goal(Tolerance(np.inf, np.inf, np.inf, np.inf), 2000)
        goal = Goal(Tolerance(0.0, 0.0, 0.0), 700)
        relax_items(Certifier(relaxation), [goal], schedule=schedule, ahead=ahead)  # till it is through
        (outcome,) = relax_items(Certifier(relaxation), [anything], schedule=schedule, ahead=ahead)
        assert outcome.iterations % 500
        loads.append(contact_forces(relaxation.model, cloth_contact, relaxation))
        assert loads[-1].any()
    assert np.array_equal(*loads)


def test_cloth_stands_still_while_there_is_no_room_for_all_that_is_near_it() -> None:
    relaxation, cloth_contact = dropped(0.9995)
    iterate(relaxation, 200)  # till it is near
    cloth_contact.pair_search.allocate_pairs(cloth_contact.data, 5)
    relaxation.drop_graphs()
    cloth_contact.data.trigger.due.fill_(1)
    relaxation.run(20)
    first = relaxation.model.points()
    relaxation.run(20)
    assert np.array_equal(relaxation.model.points(), first)
    assert cloth_contact.grow()
    relaxation.drop_graphs()
    assert not np.array_equal(iterate(relaxation, 20), first)


@pytest.mark.parametrize(("patience", "asked"), [(Patience.SHORT, 1), (Patience.LONG, 0)])
@pytest.mark.parametrize("astray", [False, True])
def test_what_stays_tangled_round_a_limb_ends_where_another_attempt_may_do_better(
    patience: Patience, asked: int, astray: bool
) -> None:
    class Tangled(ContactSchedule):
        def advance(self, iteration: int) -> bool:
            super().advance(iteration)
            self.tangled_for = iteration
            return False

    relaxation, cloth_contact = dropped(0.99)
    schedule = Tangled(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
    questions: list[bool] = []

    def ask() -> bool:
        questions.append(astray)
        return astray

    goal = Goal(Tolerance(0.0, 0.0, 0.0), ASTRAY + 300, patience)
    (outcome,) = relax_items(Certifier(relaxation), [goal], schedule=schedule, astray=ask)
    is_cut = astray and asked > 0
    assert len(questions) == asked
    assert outcome.cut_short is (CutShort.CROSSING if is_cut else None)
    assert outcome.iterations == ASTRAY + (0 if is_cut else 300)


def test_scattered_and_gathered_forces_meet_cloth_with_the_same_bits() -> None:
    shapes = [iterate(dropped(0.99, gathers)[0], 100) for gathers in (False, True)]
    assert np.array_equal(shapes[0], shapes[1])


def test_cloth_that_goes_on_unseen_between_two_checks_ends_in_the_same_shape() -> None:
    """Where patches own it, and its compliance is looked up in their order."""
    shapes = []
    for gathers in (False, True):
        relaxation, cloth_contact = dropped(0.9995, gathers)
        schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
        goal = Goal(Tolerance(0.0, 0.0, 0.0), 950)
        (outcome,) = relax_items(Certifier(relaxation), [goal], schedule=schedule, ahead=gathers)
        shapes.append(outcome.points)
    assert np.array_equal(*shapes)


def test_nothing_is_launched_nor_kept_where_cloth_does_not_meet_cloth() -> None:
    mesh = grid(5, 0.2)
    model, cloth_contact, _ = sheets_at([mesh])
    # by the paper's rule: the accelerated one is another where cloth may meet cloth
    options = StepOptions(method="direct")
    without, asleep = (Relaxation(model, Collider(), options, given) for given in (None, cloth_contact))
    assert without.cloth_contact is None
    assert not any(isinstance(value, wp.array) for value in vars(without.contact_data).values())
    own = {kernel.key for kernel in cloth_contact.kernels()}
    assert own
    assert not own & {kernel.key for kernel in without.kernels()}
    shapes = []
    for relaxation in (without, asleep):  # asleep it changes nothing, either
        model.set_points(mesh.points)
        relaxation.run(20)
        shapes.append(model.points())
    assert np.array_equal(shapes[0], shapes[1])


def test_a_fabric_of_no_thickness_still_meets_itself() -> None:
    fabric = replace(FABRIC, thickness=0.0)
    low_bits, above = lying(grid(6, 0.1)), moved(lying(grid(6, 0.1)), 0.0, 0.5 * LEAST_THICKNESS, 0.0)
    model, cloth_contact, _ = sheets_at([low_bits, above], fabric=fabric)
    look(model, cloth_contact)
    assert np.isfinite(contact_forces(model, cloth_contact)).all()
    assert np.abs(contact_forces(model, cloth_contact)).any()


SLOPES = ((0.7, False), (1.3, True))  # tangent of the incline over the friction, and whether cloth slides on it
SLIP = 2e-3  # [m] in 600 iterations; what leans without sliding moves 0.2 of a thickness times the friction


def on_a_slope(share: float) -> tuple[Relaxation, ClothContact, int]:
    """A piece of cloth on cloth that is held on an incline, and how many vertices are held."""
    angle = np.arctan(share * FABRIC.friction)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    low_bits, above = lying(grid(14, 0.26)), moved(lying(grid(5, 0.08)), 0.09, 0.98 * THICKNESS, -0.09)
    tilted = [replace(mesh, points=mesh.points @ turn.T) for mesh in (low_bits, above)]
    held = np.arange(low_bits.vertex_count, dtype=np.int32)
    model, cloth_contact, _ = sheets_at(tilted, pins=[held, NO_PINS], precision="mixed")
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    cloth_contact.awaken(relaxation.contact_state())
    iterate(relaxation, 100)
    return relaxation, cloth_contact, len(held)


@pytest.mark.parametrize(("share", "slides"), SLOPES)
def test_cloth_on_sloping_cloth_holds_below_the_friction_and_slides_above(share: float, slides: bool) -> None:
    relaxation, _, held = on_a_slope(share)
    first = relaxation.model.points()[held:].mean(axis=0)
    last = iterate(relaxation, 600)[held:].mean(axis=0)
    assert (np.linalg.norm(last - first) > SLIP) == slides


def test_friction_holds_however_often_it_is_looked_for_what_touches() -> None:
    relaxation, cloth_contact, held = on_a_slope(SLOPES[0][0])
    iterate(relaxation, 600)
    first = relaxation.model.points()[held:].mean(axis=0)
    for _ in range(30):
        cloth_contact.data.trigger.due.fill_(1)
        last = iterate(relaxation, 20)[held:].mean(axis=0)
    assert np.linalg.norm(last - first) < 0.1 * SLIP


def test_the_certificate_counts_what_contact_carries() -> None:
    relaxation, _ = dropped(0.9995)
    iterate(relaxation, 1500)
    certifier = Certifier(relaxation)
    check = certifier.check(certifier.measure(1500), 0)
    assert check.residual.relative_rms < 0.02  # balanced, though gravity pulls everywhere
