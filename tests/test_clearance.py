"""Clearance: vertices that cannot have come near the avatar are not queried, at the same bits."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import warp as wp
from cloths import grid, model_of
from sheets import FABRIC, iterate

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.depth import build_depth_buffers
from warp_cloth.avatar.field import FieldBuild, build_contact_field
from warp_cloth.base.mesh import Mesh
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.sheets import SheetKind
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.avatar.field import ContactField, field_clearance, field_contact
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import build_model
from warp_cloth.model.patches.on_device import CutOptions
from warp_cloth.model.vertices import AvatarSkin
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

RADIUS = 0.1  # of the avatar, a ball [m]
PIXEL = 0.002  # [m]
OFFSET = 0.003  # [m]
WOVEN = Fabric(stretch_warp=2e4, stretch_weft=1e4, shear=100.0, bending_warp=1e-6, bending_weft=1e-6)


def ball(height: float = 0.0) -> FieldBuild:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    points = np.asarray(mesh.vertices, dtype=np.float64) + np.array([0.0, height, 0.0])
    low, high = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    return build_contact_field(build_depth_buffers(points, np.asarray(mesh.faces), low, high, PIXEL, "cpu"))


def collider(field: FieldBuild, *, saves: bool = True) -> Collider:
    """The avatar's contact; without a steepest slope no clearance is sure."""
    data = field.limited_to(OFFSET)
    data.steepest = data.steepest if saves else 0.0
    return Collider(field_contact, data, ContactField)


@wp.kernel
def clear(
    field: ContactField,
    points: wp.array(dtype=wp.vec3d),  # [m], shape [N]
    clearance_out: wp.array(dtype=float),  # [m], shape [N]
):
    """Clearances from a contact query."""
    point = wp.tid()
    answer = field_contact(field, points[point])
    clearance_out[point] = field_clearance(field, points[point], answer[3], OFFSET)


def clearances(field: FieldBuild, points: np.ndarray) -> np.ndarray:
    found = wp.zeros(len(points), dtype=float, device="cpu")
    asked = [field.limited_to(OFFSET), wp.array(points, dtype=wp.vec3d, device="cpu"), found]
    wp.launch(clear, dim=len(points), inputs=asked, device="cpu")
    return np.array(found.numpy(), dtype=np.float64)


def test_within_its_clearance_nothing_comes_as_near_as_the_offset() -> None:
    field, random = ball(), np.random.default_rng(1)
    ways = random.normal(size=(2, 20_000, 3))
    ways /= np.linalg.norm(ways, axis=2)[:, :, None]
    gap = random.uniform(-0.01, 0.04, 20_000)
    points = ways[0] * (RADIUS + gap)[:, None]
    clearance = clearances(field, points)
    assert (clearance[gap < OFFSET - 1e-3] == 0.0).all()
    outside = (gap > 0.006) & (gap < 0.009)
    assert np.median(clearance[outside] / (gap[outside] - OFFSET)) > 0.4
    toward = 0.8 * -ways[0] + 0.2 * ways[1]  # most of them to where contact is
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    for way in (toward, ways[1]):
        reached = field.sample(points + clearance[:, None] * way)[:, 3]
        assert reached[clearance > 0.0].min() >= OFFSET


def test_outside_the_grid_nothing_is_sure() -> None:
    assert (clearances(ball(), np.array([[0.0, 1.0, 0.0], [0.0, RADIUS + 0.06, 0.0]])) == 0.0).all()


def falling(field: FieldBuild, *, gathers: bool, saves: bool) -> tuple[Relaxation, np.ndarray]:
    """A sheet some millimetres above the ball, scattered or gathered."""
    square = grid(12, 0.3)
    points = square.points[:, [0, 2, 1]]
    points = points - points.mean(axis=0) + np.array([0.0, RADIUS + 0.01, 0.0])
    flat = Mesh("sheet", points, square.triangles)
    rest = build_rest_shape(flat, WOVEN, rest="mesh")
    model = model_of(flat, rest, precision="mixed", gathers=gathers, avatar_friction=0.5, offset=OFFSET)
    if model.patches is not None:
        model.patches.few = False  # as in large batches
    relaxation = Relaxation(model, collider(field, saves=saves), StepOptions())
    wp.force_load("cpu", modules=[kernel.module for kernel in relaxation.kernels() + relaxation.seldom_kernels()])
    relaxation.restart()
    return relaxation, points


@pytest.mark.parametrize("gathers", [False, True])
def test_queries_are_saved_without_a_change_of_bits(gathers: bool) -> None:
    field, higher = ball(), ball(0.004)  # whose arrays they hold
    saving, points = falling(field, gathers=gathers, saves=True)
    everywhere, _ = falling(field, gathers=gathers, saves=False)
    for relaxation in (saving, everywhere):
        relaxation.run(100)
    clear = saving.model.state.clearance.numpy()
    assert (clear > 0.0).any()
    assert (clear == 0.0).any()
    assert (everywhere.model.state.clearance.numpy() == 0.0).all()
    assert (saving.model.points() == everywhere.model.points()).all()
    for relaxation, saves in ((saving, True), (everywhere, False)):
        relaxation.set_collider(0, collider(higher, saves=saves))  # comes nearer to what was sure to be clear
        relaxation.run(60)
    assert (saving.model.points() == everywhere.model.points()).all()
    for relaxation in (saving, everywhere):
        relaxation.model.set_points(points - np.array([0.0, 0.006, 0.0]))
        relaxation.run(60)
    assert (saving.model.points() == everywhere.model.points()).all()


def layers(field: FieldBuild, *, gathers: bool = False, saves: bool = True, threads: int = 1) -> Relaxation:
    """Two sheets above the ball, the lower one held at a corner, the upper one lifted off the ball."""
    garments = []
    for height, held in ((0.0035, [0]), (0.006, [])):
        square = grid(12, 0.3)
        points = square.points[:, [0, 2, 1]]
        points = points - points.mean(axis=0) + np.array([0.0, RADIUS + height, 0.0])
        rest = build_rest_shape(Mesh("sheet", points, square.triangles), FABRIC, rest="mesh")
        garments.append(Garment(points, square.triangles, rest, np.array(held, dtype=np.int32)))
    model = build_model(
        garments,
        device="cpu",
        precision="mixed",
        gathers=gathers,
        avatars=[AvatarSkin(0.5, OFFSET)],
        cut=CutOptions(layered=True),
    )
    kinds = [SheetKind(FABRIC.thickness, FABRIC.friction, layer=layer) for layer in (0, 1)]
    cloth_contact = ClothContact(model, garments, kinds)
    cloth_contact.lift(1e-3)
    cloth_contact.untangles = False
    relaxation = Relaxation(model, collider(field, saves=saves), StepOptions(threads=threads), cloth_contact)
    wp.force_load("cpu", modules=[kernel.module for kernel in relaxation.kernels() + relaxation.seldom_kernels()])
    relaxation.restart()
    cloth_contact.awaken(relaxation.contact_state())
    return relaxation


def test_cloth_on_cloth_is_moved_in_packets_at_the_bits_of_one_vertex_after_another() -> None:
    field = ball()
    packets, queried, alone = (
        layers(field, gathers=gathers, saves=saves) for gathers, saves in ((False, True), (False, False), (True, True))
    )
    for balanced in (1.0, 0.0, 1.0):
        shapes = []
        for relaxation in (packets, queried, alone):
            relaxation.update_anisotropy(np.array([balanced]))
            shapes.append(iterate(relaxation, 100))
        assert (shapes[0] == shapes[1]).all()
        assert (shapes[0] == shapes[2]).all()
    contact = packets.cloth_contact
    assert contact.data.pairs.count.numpy()[0] > 50
    assert (packets.model.state.clearance.numpy() > 0.0).any()
    assert (packets.model.state.in_contact.numpy() > 0).any()
    assert not alone.model.state.clearance  # nor are queries saved where each vertex is moved alone
