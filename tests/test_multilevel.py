"""The multilevel method: rest shapes, work against resolution, the same bits in every arrangement."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import warp as wp
from cloths import grid

from warp_cloth.avatar.collider import Collider
from warp_cloth.fitting import problem as set_up_module
from warp_cloth.fitting.problem import collider_updates, load_problem, start_coarse
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.avatar_constraint import presses, stick_or_slip
from warp_cloth.kernels.implicit.momentum import adapt_momentum_kernel
from warp_cloth.kernels.implicit.system import system_types
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.goal import Goal, Outcome
from warp_cloth.solver.implicit.coarse_garments import build_hierarchy
from warp_cloth.solver.implicit.multilevel import CHECK_EVERY, PACE_BOUNDS, MultilevelRelaxation
from warp_cloth.solver.implicit.options import ImplicitOptions, Pace
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.reduction import launch_blocks, split_into_chunks
from warp_cloth.solver.relax import TIGHTER
from warp_cloth.solver.step_options import StepOptions

MOST_GROWTH = 2.0  # of the iterations where the vertices become 10 times as many; one level needs 3 times as many
LIMIT = 10_000
STRAY = 5e-3  # [m], a third of an edge
FIXED, SLIDING = 2, 1  # as in kernels.implicit.system
FABRIC = Fabric(stretch_warp=2e5, stretch_weft=2e5)


def hanging(count: int, fabric: Fabric = FABRIC) -> Garment:
    """A square of 0.5 m, upright, pinned by its upper corners, bulging a little."""
    mesh = grid(count, 0.5)
    rest = build_rest_shape(mesh, fabric, rest="mesh")
    points = mesh.points.copy()
    points[:, 2] += 1e-3 * np.sin(14.0 * points[:, 0]) * np.sin(10.0 * points[:, 1])
    pins = np.array([count * (count - 1), count * count - 1], dtype=np.int32)
    points[pins] = mesh.points[pins]
    return Garment(points, mesh.triangles, rest, pins)


def relaxation_of(garments: list[Garment], gathers: bool | None = None) -> MultilevelRelaxation:
    model = build_model(garments, device="cpu", precision="mixed", gathers=gathers)
    made = MultilevelRelaxation(
        model, Collider(), StepOptions(method="multilevel"), [build_hierarchy(garment) for garment in garments]
    )
    wp.force_load("cpu", modules=[kernel.module for kernel in made.kernels()])
    return made


def rest_of(garment: Garment) -> Outcome:
    relaxation = relaxation_of([garment])
    certifier = Certifier(relaxation)
    wp.force_load("cpu", modules=[kernel.module for kernel in certifier.kernels()])
    (outcome,) = relax_items(certifier, [Goal(Tolerance(), LIMIT)])
    return outcome


def shape_after(garments: list[Garment], iterations: int = 60, gathers: bool | None = None) -> np.ndarray:
    relaxation = relaxation_of(garments, gathers)
    relaxation.run(iterations)
    model: ClothModel = relaxation.model
    return model.points()


def stretch(model: ClothModel) -> float:
    """Strain of what is drawn out, rms over the edges."""
    return float(np.sqrt(np.mean(np.maximum(edge_strains(model), 0.0) ** 2)))


def test_iterations_hardly_grow_with_the_resolution() -> None:
    coarse, fine = rest_of(hanging(11)), rest_of(hanging(35))
    assert coarse.status is fine.status is Status.AT_REST
    assert fine.iterations <= MOST_GROWTH * coarse.iterations


def test_scattered_and_gathered_forces_give_the_same_bits() -> None:
    garment = hanging(25)
    assert (shape_after([garment], gathers=False) == shape_after([garment], gathers=True)).all()


def test_a_garment_moves_alone_as_beside_a_larger_one() -> None:
    garment = hanging(17)
    other = hanging(25, Fabric(stretch_warp=1e4, stretch_weft=1e4))
    count = len(other.points)
    both = shape_after([other, garment])
    assert (both[count:] == shape_after([garment])).all()
    assert (both[:count] == shape_after([other])).all()


def test_a_garment_too_small_to_be_coarsened_moves_beside_one_that_is() -> None:
    small, large = hanging(5), hanging(25)
    both = shape_after([small, large])
    assert np.isfinite(both).all()
    assert np.abs(both - np.concatenate([small.points, large.points])).max() > 1e-4


def test_overstretched_seams_are_closed_before_steps_are_implicit() -> None:
    garment = hanging(13)
    apart = garment.points.copy()
    apart[apart[:, 1] < 0.2, 1] -= 2.0  # a row of edges 40 times too long
    outcome = rest_of(Garment(apart, garment.triangles, garment.rest, garment.pins))
    assert outcome.status is Status.AT_REST
    assert np.ptp(outcome.points[:, 1]) < 0.6


@pytest.mark.parametrize("iterations", [0, 1, 7])
def test_any_number_of_iterations_can_be_asked_for(iterations: int) -> None:
    relaxation = relaxation_of([hanging(9)])
    certifier = Certifier(relaxation)
    (outcome,) = relax_items(certifier, [Goal(Tolerance(), iterations)])
    assert outcome.status is Status.ITERATION_LIMIT
    assert np.isfinite(outcome.points).all()


@pytest.mark.parametrize(
    ("tangent", "slid", "wanted_constraint", "wanted_left", "wanted_drag"),
    [
        (0.3, 0.0, FIXED, 0.0, 0.0),  # within the cone of 0.5 x 1 N, and standing
        (0.3, 2e-3, SLIDING, 0.3, 250.0),  # sliding: friction resists another 2 mm with all of its 0.5 N
        (0.8, 2e-3, SLIDING, 0.3, 0.0),  # beyond it: what friction leaves
    ],
)
def test_friction_holds_what_stands_and_slows_what_slides(
    tangent: float, slid: float, wanted_constraint: int, wanted_left: float, wanted_drag: float
) -> None:

    @wp.kernel
    def ask(force: wp.vec3d, displacement: wp.vec3d, out: wp.array(dtype=wp.float64)):
        constraint, left, drag = stick_or_slip(force, wp.vec3d(0.0, 1.0, 0.0), wp.float64(0.5), displacement)
        out[0] = wp.float64(constraint)
        out[1] = left[0]
        out[2] = drag

    out = wp.zeros(3, dtype=wp.float64, device="cpu")
    wp.launch(ask, dim=1, inputs=[wp.vec3d(tangent, -1.0, 0.0), wp.vec3d(slid, 1e-5, 0.0), out], device="cpu")
    assert out.numpy() == pytest.approx([wanted_constraint, wanted_left, wanted_drag], abs=1e-12)


@pytest.mark.parametrize(
    ("push", "gap", "wanted"), [(1e-3, 2e-5, False), (1e-3, 5e-6, True), (1e-3, -1e-6, True), (-1e-3, -1e-6, False)]
)
def test_what_is_balanced_above_the_avatar_is_not_held_by_it(push: float, gap: float, wanted: bool) -> None:
    vec6 = stiffness_types("float64").vec6

    @wp.kernel
    def ask(push: wp.float64, gap: wp.float64, stiffness: wp.float64, out: wp.array(dtype=wp.int32)):
        normal = wp.vec3d(0.0, 1.0, 0.0)
        block = vec6()
        block[1] = stiffness
        out[0] = int(presses(normal * -push, normal, gap, block))

    out = wp.zeros(1, dtype=wp.int32, device="cpu")
    # 100 N/m: a thousandth of a newton moves it by a hundredth of a millimetre
    wp.launch(ask, dim=1, inputs=[push, gap, 100.0, out], device="cpu")
    assert bool(out.numpy()[0]) is wanted


def test_cloth_at_rest_on_a_ball_stays_there() -> None:
    overrides = ["garment.shape.vertices_per_side=17", "solver.method=multilevel", "garment.fabric={stretch = 20000}"]
    overrides += ["collision.pixel_mm=10"]
    made = load_problem(load_scene("sphere", overrides), "cpu")
    (outcome,) = relax_items(made.certifier, [Goal(Tolerance(), LIMIT)], follow=collider_updates(made))
    assert outcome.status is Status.AT_REST
    for _ in range(outcome.iterations // 100):
        made.relaxation.run(100)
    way = np.linalg.norm(made.model.points() - outcome.points, axis=1)
    assert np.sqrt(np.mean(way**2)) < outcome.check.rest_error


def test_on_a_ball_scattered_and_gathered_forces_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    changes = [
        "collision.pixel_mm=10",
        "garment.shape.vertices_per_side=21",
        "solver.method=multilevel",
        "solver.iterations=900",
    ]
    shapes = []
    for gathers in (False, True):
        monkeypatch.setattr(set_up_module, "build_model", partial(build_model, gathers=gathers))
        made = load_problem(load_scene("sphere", changes), "cpu")
        start_coarse(made)
        (outcome,) = relax_items(
            made.certifier,
            [Goal(Tolerance(0.0, 0.0, 0.0), 900)],
            follow=collider_updates(made),
            ahead=gathers,
        )
        assert isinstance(made.relaxation, MultilevelRelaxation)
        assert not made.relaxation.stays_packed  # steps are implicit by now
        shapes.append(outcome.points)
    np.testing.assert_array_equal(*shapes)


def test_cloth_on_a_body_goes_on_at_another_pace_once_forces_balance() -> None:
    overrides = ["garment.shape.vertices_per_side=9", "solver.method=multilevel"]
    relaxation = load_problem(load_scene("sphere", overrides), "cpu").relaxation
    relaxation.run(10)  # nothing is overstretched
    own, balanced = ImplicitOptions(), PACE_BOUNDS[Pace.BALANCED]
    falling, calm = own.momentum_on_avatar, own.momentum_balanced
    for residual, wanted in ((1.0, falling), (0.9 * balanced, calm), (2.0 * balanced, calm),
                             (1.1 * TIGHTER * balanced, falling), (2.0 * balanced, falling)):  # fmt: skip
        relaxation.update_anisotropy(np.array([residual]))
        assert relaxation.step.momentum == pytest.approx(wanted)


def test_cloth_on_a_body_sees_forces_ahead_once_it_hardly_moves() -> None:
    overrides = ["garment.shape.vertices_per_side=9", "solver.method=multilevel"]
    relaxation = load_problem(load_scene("sphere", overrides), "cpu").relaxation
    assert isinstance(relaxation, MultilevelRelaxation)
    relaxation.run(10)
    balanced, still, resting = (PACE_BOUNDS[pace] for pace in (Pace.BALANCED, Pace.STILL, Pace.RESTING))
    for residual, pace in ((0.9 * balanced, Pace.BALANCED), (0.9 * still, Pace.STILL),
                           (0.9 * TIGHTER * still, Pace.STILL), (1.1 * TIGHTER * still, Pace.BALANCED),
                           (1.1 * still, Pace.BALANCED), (0.9 * resting, Pace.RESTING),
                           (0.9 * TIGHTER * resting, Pace.RESTING), (1.1 * TIGHTER * resting, Pace.STILL)):  # fmt: skip
        relaxation.update_anisotropy(np.array([residual]))
        state = relaxation._implicit.state
        assert relaxation.pace is pace
        assert (state.step_fraction > 0.0) is (pace >= Pace.STILL)
        assert bool(state.damps_snapping) is (pace is Pace.STILL)  # not what comes to rest


@pytest.mark.parametrize(
    ("kept", "taken", "given", "wanted"),
    [
        (0.5, 1.0, 0.0, 4.0 / 7.0),
        (0.5, -1.0, 2.0, 4.0 / 7.0),  # momentum led uphill, but the step repays it
        (0.5, -2.0, 1.0, 0.5),
        (0.99, 1.0, 0.0, 0.9),
        (0.0, -1.0, 0.0, 0.2),
    ],
)
def test_momentum_grows_till_steps_do_not_repay_it(kept: float, taken: float, given: float, wanted: float) -> None:
    state = system_types("float64").ImplicitState()
    state.momentum = wp.array([kept], dtype=wp.float64, device="cpu")
    sums = [wp.array([value], dtype=wp.float64, device="cpu") for value in (taken, given)]
    inputs = [0.2, 0.9, 0.75, split_into_chunks(np.array([0, 1]), 1, "cpu"), *sums, state]
    launch_blocks(adapt_momentum_kernel("float64"), 1, inputs, "cpu")
    assert state.momentum.numpy()[0] == pytest.approx(wanted)


def test_a_shape_carried_over_settles_vertex_by_vertex_on_a_body() -> None:
    overrides = ["solver.method=multilevel", "garment.fabric={stretch = 200000}", "garment.shape.vertices_per_side=33",
                 "garment.shape.side=0.5", "garment.shape.height=0.71", "avatar.shape.radius=0.1"]  # fmt: skip
    made = load_problem(load_scene("sphere", overrides), "cpu")
    assert start_coarse(made)
    carried, stretched = made.model.points(), stretch(made.model)
    made.relaxation.run(CHECK_EVERY)
    way = np.linalg.norm(made.model.points() - carried, axis=1)
    assert stretch(made.model) < 0.2 * stretched
    assert np.sqrt(np.mean(way**2)) < STRAY
    made.relaxation.run(20)  # of implicit steps
    assert made.relaxation.step.momentum == pytest.approx(ImplicitOptions().momentum_on_avatar)


def test_hanging_cloth_keeps_its_pace() -> None:
    relaxation = relaxation_of([hanging(9)])
    relaxation.run(10)
    relaxation.update_anisotropy(np.zeros(1))
    assert relaxation.step.momentum == pytest.approx(ImplicitOptions().momentum)


def test_steps_are_captured_from_renewal_to_renewal_and_once_for_every_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    relaxation = relaxation_of([hanging(9)])
    captured = list[int]()
    launch = relaxation._iterate
    monkeypatch.setattr(relaxation, "_iterate", lambda count: (captured.append(count), launch(count)))
    own = ImplicitOptions()
    relaxation.run(2 * own.renewal * own.iterations)
    relaxation.update_anisotropy(np.zeros(1))
    relaxation.run(own.renewal * own.iterations)
    assert captured == [own.renewal * own.iterations]
    once = relaxation_of([hanging(9)])
    once.run(3 * own.renewal * own.iterations)
    assert (relaxation.model.points() == once.model.points()).all()
