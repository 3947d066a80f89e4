"""The avatar's reaction: the residual of a vertex is what its own next step leaves of it, in contact or hovering."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from cloths import bare_rest, grid, model_of

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.material.fabric import Fabric
from warp_cloth.shapes import sphere
from warp_cloth.solver.certificate.certifier import CONTACT_SLACK, Certifier
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

OFFSET = 0.003  # [m]
ROUNDING = 1e-5  # of forces and distances in float32, which contact answers
# steps of the force of now, by a stiffness that stays
STILL = StepOptions(momentum=0.0, memory=1.0, memory_falling=1.0, viscosity=0.0)
MANY = 20  # vertices
STEEP = 1.05  # slope of a distance that grows too fast, as a smoothed field's does beside an arm


@wp.struct
class Floor:
    """The plane y = 0, whose distance grows by ``slope`` a metre."""

    slope: float


@wp.func
def floor_contact(floor: Floor, p: wp.vec3d):
    """Normal and distance [m]."""
    return wp.vec4f(0.0, 1.0, 0.0, floor.slope * wp.float32(p[1]))


FRICTION = 0.5  # of the floor


def floor(slope: float = 1.0) -> Collider:
    data = Floor()
    data.slope = slope
    return Collider(floor_contact, data, Floor)


def raised(points: np.ndarray, height: float) -> np.ndarray:
    return points + np.array([0.0, height, 0.0])


def residual_and_normal_force(relaxation: Relaxation) -> tuple[np.ndarray, np.ndarray]:
    """Residual in weights and relative, shape [V, 2], and normal force on the avatar [N], shape [V]."""
    certifier = Certifier(relaxation)
    certifier.measure(0)
    return certifier._residual.numpy().astype(np.float64), np.asarray(certifier.normal_forces())


def hovering(height: float) -> Relaxation:
    """An unstrained sheet that lies so far above the offset of a floor, after a step of its weight [m]."""
    mesh = grid(4, 0.1)
    flat = Mesh("sheet", mesh.points[:, [0, 2, 1]], mesh.triangles)
    model = model_of(flat, build_rest_shape(flat, Fabric(), rest="mesh"), avatar_friction=FRICTION, offset=OFFSET)
    relaxation = Relaxation(model, floor(), STILL)
    relaxation.iterate()
    model.set_points(raised(flat.points, OFFSET + height))
    return relaxation


@pytest.mark.parametrize("height", [1e-4, 1e-3, 4e-3])
def test_a_sheet_that_hovers_has_the_share_of_its_weight_left_that_it_would_fall(height: float) -> None:
    """Nothing but its weight moves it, by the cap of 5 mm: from 1 mm it falls by a fifth of that."""
    relaxation = hovering(height)
    cap = float(relaxation.model.vertices.items.numpy()["cap"][0])
    residual, normal_force = residual_and_normal_force(relaxation)
    weight = relaxation.model.vertices.weight.numpy()
    assert np.allclose(residual[:, 0], height / cap, rtol=0.0, atol=1e-3)
    assert np.allclose(normal_force / weight, 1.0 - height / cap, rtol=0.0, atol=1e-3)


def test_a_sheet_that_the_next_step_does_not_bring_down_has_all_of_its_weight_left() -> None:
    residual, normal_force = residual_and_normal_force(hovering(6e-3))
    assert np.allclose(residual[:, 0], 1.0, atol=ROUNDING)
    assert not normal_force.any()


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_what_is_left_of_a_force_is_what_its_next_step_moves(friction: float) -> None:
    """Of every vertex above the offset, of a taut net over a ball and cloth beside it: stiffness times displacement."""
    radius, noise = 0.2, np.random.default_rng(5)
    net = sphere(radius=0.5 * radius, centre=(0.0, 0.0, 0.0), edge=0.02)  # stretched to twice its size
    model = model_of(net, build_rest_shape(net, Fabric(), rest="mesh"), avatar_friction=friction, offset=OFFSET)
    exact = build_exact_collider(sphere(radius=radius, centre=(0.0, 0.0, 0.0), edge=0.01), "cpu")
    relaxation = Relaxation(model, Collider(mesh_contact, exact.collider, MeshCollider), STILL)
    high = noise.uniform(0.0, 0.01, len(net.points)) ** 2 / 0.01  # up to 10 mm, mostly less
    before = 2.0 * net.points * (1.0 + (OFFSET + high) / radius)[:, None] + noise.normal(0.0, 2e-4, net.points.shape)
    for _ in range(2):  # the first step finds the stiffness
        model.set_points(before)
        bound = model.state.stiffness.numpy()
        residual, normal_force = residual_and_normal_force(relaxation)
        relaxation.iterate()
    moved = np.linalg.norm(model.points() - before, axis=1)
    seen = exact.sample(before)[:, 3] > OFFSET + 2.0 * CONTACT_SLACK
    seen &= model.state.stiffness.numpy() == bound  # the step was by the stiffness that the certificate had
    assert (seen & (normal_force > 0.0)).sum() > MANY  # some come down on the ball
    assert (seen & (normal_force == 0.0)).sum() > MANY  # and others do not
    force = residual[:, 0] * model.vertices.weight.numpy()
    assert np.allclose(force[seen], (bound * moved)[seen], rtol=1e-3, atol=1e-4 * force.max())


def hanging_on(slope: float, sideways: float = 0.0) -> Relaxation:
    """A light vertex over a floor, pulled down by a taut thread to a pin that is 0.1 m under it, let go till it rests.

    ``sideways``: how far the pin stands to the side [m].
    """
    points = np.array([[0.0, OFFSET + 1e-3, 0.0], [sideways, -0.1, 0.0]])
    rest = bare_rest(points, edges=[[0, 1]], length=[0.05], pull=4e4, weight=1e-3)
    mesh = Mesh("thread", points, np.zeros((0, 3), dtype=np.int32))
    model = model_of(mesh, rest, pins=np.array([1], dtype=np.int32), avatar_friction=FRICTION, offset=OFFSET)
    relaxation = Relaxation(model, floor(slope), StepOptions())
    relaxation.iterate(2000)
    return relaxation


def test_a_taut_vertex_that_a_steep_field_leaves_above_the_offset_is_held() -> None:
    relaxation = hanging_on(STEEP)
    height = STEEP * float(relaxation.model.points()[0, 1]) - OFFSET
    before = relaxation.model.points()
    residual, normal_force = residual_and_normal_force(relaxation)
    relaxation.iterate(1000)
    assert height > CONTACT_SLACK  # it does stand above
    assert np.abs(relaxation.model.points() - before).max() < 1e-9  # and stays there
    assert residual[0, 1] < 1e-4
    pull = 4e4 * (np.linalg.norm(before[0] - before[1]) - 0.05) ** 2
    assert normal_force[0] == pytest.approx(pull + 1e-3, rel=0.01)


def test_a_taut_vertex_beyond_the_cone_of_friction_is_not_held() -> None:
    """Pulled at 45 degrees, on a floor with friction 0.5: half of the force along it is left while it slides."""
    points = np.array([[0.0, OFFSET, 0.0], [0.1, OFFSET - 0.1, 0.0]])
    rest = bare_rest(points, edges=[[0, 1]], length=[0.05], pull=4e4, weight=1e-6)
    mesh = Mesh("thread", points, np.zeros((0, 3), dtype=np.int32))
    for lifted in (0.0, 2.0 * CONTACT_SLACK):
        model = model_of(mesh, rest, pins=np.array([1], dtype=np.int32), avatar_friction=FRICTION, offset=OFFSET)
        relaxation = Relaxation(model, floor(), STILL)
        relaxation.iterate()
        model.set_points(raised(points, lifted))
        residual, _ = residual_and_normal_force(relaxation)
        assert residual[0, 1] == pytest.approx(0.5 * 0.5**0.5, abs=0.02)


def test_the_direct_rule_holds_what_stands_in_the_offset_only() -> None:
    mesh = grid(4, 0.1)
    flat = Mesh("sheet", mesh.points[:, [0, 2, 1]], mesh.triangles)
    for height, left_over in ((0.5 * CONTACT_SLACK, 0.0), (2.0 * CONTACT_SLACK, 1.0)):
        model = model_of(flat, build_rest_shape(flat, Fabric(), rest="mesh"), avatar_friction=FRICTION, offset=OFFSET)
        model.set_points(raised(flat.points, OFFSET + height))
        residual, _ = residual_and_normal_force(Relaxation(model, floor(), StepOptions(method="direct")))
        assert np.allclose(residual[:, 0], left_over, atol=ROUNDING)
