"""The anisotropic step: vertices go further where hardly anything resists, against the slopes of the forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from cloths import cloth_forces, deformed_model, grid, model_of, slopes
from test_clearance import ball, layers
from test_reaction import FRICTION, OFFSET, floor

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.options import Accumulate, YarnField
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.symmetric import inverse
from warp_cloth.kernels.passes.step import compliant_descent
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.vertices import allocate_steps
from warp_cloth.solver.anisotropic_step import AnisotropicStep
from warp_cloth.solver.relax import LIMIT_ON_CLOTH, LIMIT_WHEN_SWUNG, Relaxation
from warp_cloth.solver.step_options import StepOptions

MOST = 100.0
SLOWED = 1e-5  # of a displacement: inverses keep a millionth of their size, and rounding
CAP = 1e6  # [m]; falling then bounds nothing
LARGEST = 2.0 * (1.0 + 1e-6)  # of a step that still goes downhill
MESH = grid(5, 0.2)
STEEP = Fabric(stretch_warp=2e5, stretch_weft=1e5, bending_warp=1e-7, bending_weft=1e-7)
WOVEN = Fabric(stretch_warp=2e5, stretch_weft=1e5, shear=100.0, bending_warp=1e-7, bending_weft=1e-7)


def with_compliance(model: ClothModel) -> AnisotropicStep:
    """What updates the compliance of a model that has no iterations."""
    allocate_steps(model.state, model.precision, stiffness=False, compliance=True, in_contact=False, clearance=False)
    return AnisotropicStep(model)


def compliance_of(model: ClothModel, *, most: float = MOST, horizon: float = 20.0) -> np.ndarray:
    """The compliance of each vertex as a matrix, shape [V, 3, 3]."""
    step = cloth_types(model.precision).Step()
    step.allowance, step.horizon = 1.0, horizon
    rows = model.vertices.items.numpy().copy()
    rows["cap"], rows["anisotropy_limit"] = CAP, most
    model.vertices.items.assign(rows)
    with_compliance(model).update(model.vertices, model.state, step)
    return matrices(model.state.compliance.numpy())


def matrices(compliance: np.ndarray) -> np.ndarray:
    """Compliances, six numbers a vertex, as matrices, shape [V, 3, 3]."""
    xx, yy, zz, xy, xz, yz = compliance.astype(np.float64).T
    return np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)


def told(model: ClothModel) -> np.ndarray:
    """Six numbers a vertex of what iterations read, which those that gather have packed as patches own vertices."""
    compliance = model.state.compliance.numpy()
    if model.patches is None:
        return compliance
    fours, twos = np.split(compliance.ravel(), [4 * len(compliance)])
    found = np.empty_like(compliance)
    found[model.patches.order.numpy()] = np.column_stack([fours.reshape(-1, 4), twos.reshape(-1, 2)])
    return found


def shaken(share: float, size: float) -> np.ndarray:
    return MESH.points * share + np.random.default_rng(5).normal(scale=size, size=MESH.points.shape)


@pytest.mark.parametrize("fabric", [STEEP, WOVEN], ids=["edges", "woven"])
@pytest.mark.parametrize(("share", "size"), [(1.02, 1e-3), (1.0, 1e-4), (0.97, 5e-3)], ids=["taut", "slack", "folded"])
def test_the_longer_step_still_goes_downhill(fabric: Fabric, share: float, size: float) -> None:
    model = deformed_model(MESH, shaken(share, size), fabric)
    compliance = compliance_of(model)
    bound = cloth_forces(model, Accumulate.STIFFNESS)[:, 3]  # nothing has moved yet: it allows for no reach
    roots = np.zeros((3 * MESH.vertex_count, 3 * MESH.vertex_count))
    for vertex, (matrix, stiffness) in enumerate(zip(compliance, bound, strict=True)):
        roots[3 * vertex : 3 * vertex + 3, 3 * vertex : 3 * vertex + 3] = np.linalg.cholesky(matrix / stiffness)
    hessian = slopes(model)
    assert np.linalg.eigvalsh(roots.T @ (0.5 * (hessian + hessian.T)) @ roots).max() <= LARGEST


def test_taut_cloth_is_compliant_across_itself_only() -> None:
    compliance = compliance_of(deformed_model(MESH, MESH.points * 1.01, WOVEN))[MESH.vertex_count // 2]
    assert compliance[2, 2] > 0.5 * MOST
    assert np.linalg.eigvalsh(compliance[:2, :2]).max() < 4.0


def test_items_forget_theirs_and_leave_the_others_alone() -> None:
    garment = Garment(MESH.points, MESH.triangles, build_rest_shape(MESH, WOVEN, rest="mesh"), np.zeros(0, np.int32))
    model = build_model([garment] * 6, device="cpu", precision="float64", garment_counts=[1] * 6)
    compliance = with_compliance(model)
    model.state.compliance.fill_(7.0)
    compliance.forget([4, 1, 2])
    found = model.state.compliance.numpy().reshape(6, -1, 6)
    assert (found[[0, 3, 5]] == 7.0).all()
    assert (found[[1, 2, 4]] == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).all()


def test_it_turns_with_the_cloth() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    here = compliance_of(deformed_model(MESH, shaken(1.0, 1e-3), WOVEN))
    there = compliance_of(deformed_model(MESH, shaken(1.0, 1e-3) @ turn.T, WOVEN))
    assert there == pytest.approx(turn @ here @ turn.T, rel=1e-6, abs=1e-6 * MOST)


def test_cloth_that_turns_fast_has_none() -> None:
    model = deformed_model(MESH, MESH.points * 1.01, WOVEN)
    moves = np.zeros((MESH.vertex_count, 3))
    moves[::2, 2] = 5e-3  # [m], a tenth of an edge
    model.state.displacement.assign(moves)
    assert np.linalg.eigvalsh(compliance_of(model)).max() < 2.0


def test_threads_drag_across_themselves_by_what_acts_there() -> None:
    viscosity, buckling, horizon = 0.02, 0.1, 20.0
    model = deformed_model(MESH, shaken(1.0, 2e-3), replace(WOVEN, bending_warp=0.0, bending_weft=0.0))
    moves = np.random.default_rng(6).normal(scale=1e-4, size=MESH.points.shape)
    model.state.displacement.assign(moves)
    step = cloth_types(model.precision).Step()
    step.allowance, step.horizon, step.viscosity, step.buckling = 1.0, horizon, viscosity, buckling
    wanted = np.zeros_like(moves)
    weave, points = model.weave, model.points()
    for corners, slope, yarns in zip(weave.corners.numpy(), weave.slope.numpy(), weave.yarns.numpy(), strict=True):
        weft, warp, shear, compression = (yarns[field] for field in YarnField)
        for garment, pull in (((1, 0), weft), ((0, 1), warp), ((1, 1), shear), ((1, -1), shear)):
            along = (garment[0] * slope[:2] + garment[1] * slope[2:]) / np.hypot(*garment)
            slopes_of = np.array([-along.sum(), *along])
            thread, change = slopes_of @ points[corners], slopes_of @ moves[corners]
            length, size = np.linalg.norm(thread), np.linalg.norm(change)
            stretch = length - 1.0
            bound = 2.0 * pull * (1.0 if stretch + size > 0.0 else compression) * (abs(stretch) + size)
            force = pull * (1.0 if stretch > 0.0 else compression) * stretch**2
            share = force / (length * bound) + (horizon * size / length) ** 2
            if stretch < 0.0:
                share = max(share, buckling)
            held = thread * (thread @ change) / length**2
            drag = viscosity * bound * (held + min(share, 1.0) * (change - held))
            wanted[corners] -= slopes_of[:, None] * drag
    forces = [
        cloth_forces(model, accumulate, step)[:, :3]
        for accumulate in (Accumulate.ANISOTROPIC_STIFFNESS, Accumulate.NONE)
    ]
    assert forces[0] - forces[1] == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())


SPARED = 1e-4  # of a matrix that is turned round, a millionth of its size is added: directions 20 times apart feel it
SYMMETRIC = cloth_types("float64").vec6


@wp.kernel
def find_ways(
    compliance: SYMMETRIC,
    force: wp.vec3d,
    own: wp.array(dtype=wp.float64),
    stiffness: wp.float64,
    way_out: wp.array(dtype=wp.vec3d),
):
    row = wp.tid()
    way_out[row] = compliant_descent(inverse(compliance), force, own[row], stiffness)


def test_what_is_pressed_hard_has_none() -> None:
    compliance, force, stiffness = SYMMETRIC(20.0, 1.0, 5.0, 2.0, 0.5, 0.1), np.array([0.3, -1.0, 0.5]), 40.0
    matrix = np.array([[20.0, 2.0, 0.5], [2.0, 1.0, 0.1], [0.5, 0.1, 5.0]])
    own = np.array([40.0, 10.0, 0.0])
    found = wp.zeros(3, dtype=wp.vec3d, device="cpu")
    given = [compliance, wp.vec3d(*force), wp.array(own, dtype=wp.float64, device="cpu"), wp.float64(stiffness)]
    wp.launch(find_ways, dim=3, inputs=given, outputs=[found], device="cpu")
    wanted = [
        np.linalg.solve(garment * np.linalg.inv(matrix) + (stiffness - garment) * np.eye(3), force) for garment in own
    ]
    assert found.numpy() == pytest.approx(np.array(wanted), rel=SPARED)
    assert found.numpy()[0] == pytest.approx(matrix @ force / stiffness, rel=SPARED)
    assert found.numpy()[2] == pytest.approx(force / stiffness, rel=SPARED)


def lying(gathers: bool = False, contact: bool = True) -> Relaxation:
    """A sheet some millimetres above a floor that wears it."""
    flat = Mesh("sheet", MESH.points[:, [0, 2, 1]] + np.array([0.0, 5e-3, 0.0]), MESH.triangles)
    rest = build_rest_shape(flat, WOVEN, rest="mesh")
    model = model_of(flat, rest, precision="mixed", gathers=gathers, avatar_friction=FRICTION, offset=OFFSET)
    relaxation = Relaxation(model, floor() if contact else Collider(), StepOptions())
    wp.force_load("cpu", modules=[kernel.module for kernel in relaxation.kernels() + relaxation.seldom_kernels()])
    return relaxation


@pytest.mark.parametrize("gathers", [False, True])
def test_it_is_looked_up_after_the_same_iterations_in_whatever_chunks(gathers: bool) -> None:
    def ended(bursts: list[int]) -> np.ndarray:
        relaxation = lying(gathers)
        relaxation.update_anisotropy(np.zeros(1))
        for count in bursts:
            relaxation.run(count)
        assert not (told(relaxation.model) == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).all()
        return relaxation.model.points()

    assert (ended([60]) == ended([7, 13, 25, 15])).all()
    assert (ended([60]) == ended([20, 20, 20])).all()


@pytest.mark.parametrize("gathers", [False, True])
@pytest.mark.parametrize("way", [1e-4, -1e-4])  # [m], against what pulls it down, and along with it
@pytest.mark.parametrize("loose", [False, True])
def test_loose_cloth_is_damped_alike_whether_it_fights_its_forces_or_not(
    gathers: bool, way: float, loose: bool
) -> None:
    relaxation, options = lying(gathers), StepOptions()
    state = relaxation.model.state
    state.displacement.assign(np.full((MESH.vertex_count, 3), [0.0, way, 0.0]))
    state.stiffness.fill_(1e9)  # [N/m]: forces themselves move nothing
    relaxation.update_anisotropy(np.array([0.0 if loose else np.inf]))
    before = relaxation.model.points()
    relaxation.run(1)
    falling = options.momentum * (options.damping if way > 0.0 else 1.0)
    kept = (options.momentum_loose if loose else falling) * way
    assert relaxation.model.points() - before == pytest.approx(np.full_like(before, [0.0, kept, 0.0]), abs=1e-5 * 1e-4)


def test_only_cloth_that_is_worn_has_any() -> None:
    relaxation = lying(contact=False)
    relaxation.update_anisotropy(np.zeros(1))
    assert not relaxation.model.state.compliance
    assert (relaxation.model.vertices.items.numpy()["anisotropy_limit"] == 0.0).all()


@pytest.mark.parametrize(
    ("residuals", "loose"), [([0.06], False), ([0.05], True), ([0.05, 0.19], True), ([0.05, 0.21], False)]
)
def test_cloth_is_loose_from_when_its_forces_balance_till_they_are_far_from_it(
    residuals: list[float], loose: bool
) -> None:
    relaxation = lying()
    for residual in residuals:
        relaxation.update_anisotropy(np.array([residual]))
    assert (relaxation.model.vertices.items.numpy()["anisotropy_limit"][0] > 0.0) == loose


def test_cloth_that_meets_cloth_must_be_nearer_to_balance_and_goes_less_far() -> None:
    relaxation = layers(ball())
    limits = []
    for residual in (0.06, 0.05):
        relaxation.update_anisotropy(np.array([residual]))
        limits.append(float(relaxation.model.vertices.items.numpy()["anisotropy_limit"][0]))
    assert limits == [0.0, LIMIT_ON_CLOTH]


def test_cloth_that_meets_cloth_and_stays_balanced_for_long_goes_less_far_by_turns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("warp_cloth.solver.relax.SWUNG", 40)
    relaxation = layers(ball())
    limits = []
    for residual in (0.05, 0.05, 0.05, 0.05, 0.05, 0.21, 0.05):
        relaxation.update_anisotropy(np.array([residual]))
        limits.append(float(relaxation.model.vertices.items.numpy()["anisotropy_limit"][0]))
        relaxation.run(20)
    less = LIMIT_WHEN_SWUNG
    assert limits == [LIMIT_ON_CLOTH, LIMIT_ON_CLOTH, less, less, LIMIT_ON_CLOTH, 0.0, LIMIT_ON_CLOTH]


@pytest.mark.parametrize("gathers", [False, True])
@pytest.mark.parametrize("loose", [False, True])
def test_what_comes_to_be_held_is_slowed_as_if_it_had_become_heavier(loose: bool, gathers: bool) -> None:
    relaxation = lying(gathers)
    state = relaxation.model.state
    relaxation.model.set_points(relaxation.model.points() * [1.01, 1.0, 1.01])  # taut, so that it is compliant
    relaxation.update_anisotropy(np.zeros(1) if loose else np.ones(1))
    state.displacement.assign(np.tile([1e-3, -3e-3, 0.0], (MESH.vertex_count, 1)))  # [m]; friction halves it
    state.stiffness.fill_(1e6)  # [N/m], so that hardly anything else moves it
    before = relaxation.model.points()
    relaxation.run(1)
    assert (state.in_contact.numpy() == 1).all()
    moved, kept = relaxation.model.points() - before, state.displacement.numpy()
    compliance = matrices(told(relaxation.model))
    assert loose == (np.linalg.eigvalsh(compliance).max() > 2.0)
    slowed = np.linalg.solve(0.5 * (compliance + np.eye(3)), moved[:, :, None])[:, :, 0]
    assert kept == pytest.approx(slowed if loose else moved, abs=SLOWED * np.abs(moved).max())


@pytest.mark.parametrize("gathers", [False, True])
def test_it_ends_with_the_relaxation(gathers: bool) -> None:
    relaxation = lying(gathers)
    relaxation.update_anisotropy(np.zeros(1))
    relaxation.run(20)
    relaxation.restart()
    assert relaxation.model.vertices.items.numpy()["anisotropy_limit"][0] == 0.0
    assert (told(relaxation.model) == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).all()
