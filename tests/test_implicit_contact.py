"""Contact of cloth with cloth in implicit steps: its stiffness, steps that never pass, turns of both kinds of steps."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import warp as wp
from cloths import NO_PINS, grid
from sheets import THICKNESS, contact_forces, crumpled, iterate, look, lying, moved, sheets_at

from warp_cloth.avatar.collider import Collider
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.crossing import find_crossings
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.model.attempt import CutShort
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.contact_schedule import ContactSchedule
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.implicit.coarse_garments import build_hierarchy
from warp_cloth.solver.implicit.contact_pairs import PressingPairs
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.step_options import StepOptions, build_step

SHIFT = 1e-7  # [m]; central differences of the forces


def product(model: ClothModel, cloth_contact: ClothContact, x: np.ndarray) -> np.ndarray:
    """What the pairs that press resist displacements x [m] with [N]."""
    pressing = PressingPairs(model, cloth_contact)
    load = wp.zeros(len(x), dtype=cloth_types("float64").vec4, device="cpu")
    pressing.launch(build_step(StepOptions(), "float64"), model.state, load)
    pressing.multiply(wp.array(x, dtype=wp.vec3d, device="cpu"))
    return pressing.data.product.numpy() * 2.0**-36


def test_pairs_resist_as_their_forces_change() -> None:
    low, high = lying(grid(6, 0.1)), moved(lying(grid(6, 0.1)), 0.003, 0.7 * THICKNESS, 0.004)
    model, cloth_contact, _ = sheets_at([low, high])
    apart = np.zeros((72, 3))
    apart[36:, 1] = SHIFT
    points = np.concatenate([low.points, high.points])
    look(model, cloth_contact)
    found = product(model, cloth_contact, apart)
    forces = []
    for sign in (1.0, -1.0):
        model.set_points(points + sign * apart)
        forces.append(contact_forces(model, cloth_contact)[:, :3])
    expected = 0.5 * (forces[1] - forces[0])
    assert np.abs(expected).max() > 1e-6
    error = np.abs(found - expected)[:, 1] / np.abs(expected).max()
    assert np.median(error) <= 1e-4
    assert error.max() <= 0.05  # edges that are nearest askew also turn


def test_what_moves_as_a_whole_meets_no_resistance_and_all_else_a_positive_one() -> None:
    model, cloth_contact, _ = sheets_at([grid(12, 0.22)])
    model.set_points(crumpled(1).points)
    look(model, cloth_contact)
    together = product(model, cloth_contact, np.full((model.vertex_count, 3), 1e-3))
    x = np.random.default_rng(1).normal(scale=1e-3, size=(model.vertex_count, 3))
    own = product(model, cloth_contact, x)
    assert np.abs(own).max() > 0.0
    assert np.abs(together).max() <= 1e-6 * np.abs(own).max()
    assert float((x * own).sum()) > 0.0


def dropped(*, gathers: bool) -> tuple[MultilevelRelaxation, ClothContact]:
    """A sheet over a smaller one that is pinned, about to fall on it by implicit steps."""
    low, above = lying(grid(6, 0.1)), moved(lying(grid(10, 0.16)), -0.03, 0.01, 0.03)
    pins = [np.arange(36, dtype=np.int32), NO_PINS]
    model, cloth_contact, garments = sheets_at([low, above], pins=pins, precision="mixed", gathers=gathers)
    options = StepOptions(method="multilevel")
    hierarchies = [build_hierarchy(garment) for garment in garments]
    relaxation = MultilevelRelaxation(model, Collider(), options, hierarchies, cloth_contact=cloth_contact)
    return relaxation, cloth_contact


def test_falling_cloth_is_caught_by_implicit_steps_with_the_same_bits_in_the_order_of_patches() -> None:
    shapes = []
    for gathers in (False, True):
        relaxation, cloth_contact = dropped(gathers=gathers)
        cloth_contact.awaken(relaxation.contact_state())
        cloth_contact.untangles = False
        for _ in range(20):
            points = iterate(relaxation, 20)
            assert not len(find_crossings(points, cloth_contact.sheets, "cpu").pairs)
        assert cloth_contact.implicit_steps
        shapes.append(points)
    assert shapes[0][36:, 1].min() < -0.01  # its border hangs over
    assert np.array_equal(*shapes)


@pytest.mark.parametrize("turn_after", [200, None])
def test_steps_are_implicit_once_nothing_crosses_and_end_where_it_is_another_ones_turn(turn_after: int | None) -> None:
    relaxation, cloth_contact = dropped(gathers=False)
    schedule = ContactSchedule(relaxation, cloth_contact, partial(cloth_contact.face, [1.0, 1.0]))
    goal = Goal(Tolerance(0.0, 0.0, 0.0), 500, turn_after=turn_after)
    (outcome,) = relax_items(Certifier(relaxation), [goal], schedule=schedule)
    assert cloth_contact.implicit_steps
    assert (outcome.iterations, outcome.cut_short) == ((200, CutShort.SLOW) if turn_after else (500, None))
