"""Contact of cloth with cloth: forces against every pair, steps that never pass, untangling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from cloths import NO_PINS, grid
from touching import brute_energy, brute_forces, touching_pairs

import warp_cloth
from warp_cloth.collide.cloth import LEAST_THICKNESS, ClothTouch, SheetKind, lists_of
from warp_cloth.collide.crossing import find_crossings
from warp_cloth.collide.exact import signed_distances
from warp_cloth.collide.placing import DEEP, clear_shift
from warp_cloth.fabric import Fabric
from warp_cloth.garment_part import GarmentPart
from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.meeting import APART
from warp_cloth.mesh import Mesh, Points
from warp_cloth.model import ClothModel, build_model
from warp_cloth.rest import build_rest_shape
from warp_cloth.scene import SphereShape
from warp_cloth.shapes import build_avatar
from warp_cloth.solver.certificate import Certifier
from warp_cloth.solver.course import Course
from warp_cloth.solver.relax import Collider, Relaxation, StepOptions

THICKNESS = 2e-3  # [m]; thick beside the meshes' 20 mm edges, so that small sheets touch in many places
FABRIC = Fabric(thickness=THICKNESS, friction=0.4)
# The sums are kept in units of 2^-36 N and 2^-16 N/m; a vertex of these sheets adds up at most 100 pairs.
FORCE_ROUNDING = 100 * 2.0**-36  # [N]
RELATIVE_ROUNDING = 1e-6  # thickness and modulus are float32
GRADIENT_STEP = 1e-7  # [m]; central differences of the energy
GRADIENT_ERROR = 1e-5  # of the largest force: the force's third derivative over the step, and rounding


def sheets_at(
    meshes: Sequence[Mesh],
    *,
    pins: Sequence[np.ndarray] | None = None,
    fabric: Fabric = FABRIC,
    kinds: Sequence[SheetKind] | None = None,
    precision: str = "float64",
    gathers: bool | None = None,
) -> tuple[ClothModel, ClothTouch, list[GarmentPart]]:
    """Garments in contact, where they are; inner to outer."""
    held = pins or [NO_PINS] * len(meshes)
    parts = [
        GarmentPart(mesh.points, mesh.triangles, build_rest_shape(mesh, fabric, rest="mesh"), pinned)
        for mesh, pinned in zip(meshes, held, strict=True)
    ]
    model = build_model(parts, device="cpu", precision=precision, gathers=gathers)
    chosen = kinds or [SheetKind(fabric.thickness, fabric.friction, layer=k) for k in range(len(meshes))]
    return model, ClothTouch(model, parts, chosen), parts


def moved(mesh: Mesh, *offset: float) -> Mesh:
    return replace(mesh, points=mesh.points + np.array(offset))


def lying(mesh: Mesh) -> Mesh:
    """The sheet turned to lie, its front up."""
    x, y, z = mesh.points.T
    return replace(mesh, points=np.stack([x, z, -y], axis=1))


def crumpled(seed: int) -> Mesh:
    """A sheet folded over itself with a thickness between, shaken a little."""
    mesh = grid(12, 0.22)
    points = mesh.points.copy()
    over = points[:, 0] > 0.11
    points[over, 2] = 0.7 * THICKNESS
    points[over, 0] = 0.22 - points[over, 0] + 0.003
    points += np.random.default_rng(seed).normal(scale=0.1 * THICKNESS, size=points.shape)
    return replace(mesh, points=points)


def look(model: ClothModel, touch: ClothTouch) -> None:
    """Searches, with room for all that is found."""
    touch.awaken()
    touch.search(model.cloth)
    if touch.grow():
        touch.search(model.cloth)


def contact_forces(model: ClothModel, touch: ClothTouch) -> np.ndarray:
    """Contact's share of each vertex's load, shape [V, 4], as the certificate sums it."""
    types = cloth_types(model.precision)
    load = wp.zeros(model.vertex_count, dtype=types.vec4, device="cpu")
    touch.measure(types.Step(), load)
    return np.array(load.numpy(), dtype=np.float64)


@pytest.mark.parametrize("room", [(1000, 100000), (1000, 50), (3, 100000), (3, 50)])
def test_lists_of_any_room_find_the_same(room: tuple[int, int]) -> None:
    upper = moved(crumpled(3), 0.0, 0.0, 0.3 * THICKNESS)  # crosses the other, whose vertices are beyond it
    model, touch, _ = sheets_at([crumpled(1), upper])
    touch.awaken()

    def found() -> tuple[list[list[int]], list[np.ndarray]]:
        touch.grow()
        touch.search(model.cloth)
        count = int(touch.data.count.numpy()[0])
        rows = np.column_stack([touch.data.corners.numpy(), touch.data.kind.numpy()])[:count]
        parting = touch._untangling
        return sorted(rows.tolist()), [each.numpy() for each in (parting.count, parting.beyond, touch.data.shift)]

    pairs, parted = found()  # with no lists at all
    assert parted[0].min() > 0
    with wp.ScopedDevice("cpu"):
        touch._meetings = lists_of(*room)
    again, parted_again = found()
    assert again == pairs
    groups, *leaves = touch._meetings.count.numpy()[::APART].tolist()
    assert groups > 3  # more than the smaller lists have room for
    assert sum(leaves) > 50
    assert all(np.array_equal(one, other) for one, other in zip(parted, parted_again, strict=True))


def test_what_crosses_is_found_from_what_was_tangled_as_from_all() -> None:
    upper = moved(crumpled(3), 0.0, 0.0, 0.3 * THICKNESS)
    model, touch, _ = sheets_at([crumpled(1), upper])
    touch.awaken()  # looks everywhere

    def parted(whole: int) -> list[np.ndarray]:
        touch._search.whole.fill_(whole)
        touch.search(model.cloth)
        assert touch._search.whole.numpy()[0] == 0
        parting = touch._untangling
        return [each.numpy() for each in (parting.count, parting.crosses, touch.data.shift)]

    everywhere, near = parted(1), parted(0)
    assert everywhere[0][0] > 0
    assert all(np.array_equal(one, other) for one, other in zip(everywhere, near, strict=True))


@pytest.mark.parametrize("seed", [1, 2])
def test_forces_are_those_of_every_pair(seed: int) -> None:
    flat, mesh = grid(12, 0.22), crumpled(seed)
    model, touch, _ = sheets_at([flat])
    model.set_points(mesh.points)
    look(model, touch)
    pairs = touching_pairs(mesh.points, touch)
    assert len(pairs) > 100
    expected = brute_forces(mesh.points, pairs, touch)
    found = contact_forces(model, touch)
    bound = FORCE_ROUNDING + RELATIVE_ROUNDING * np.abs(expected).max()
    assert np.abs(found[:, :3] - expected).max() <= bound


def test_pairs_stay_known_until_the_next_search() -> None:
    flat, mesh = grid(12, 0.22), crumpled(3)
    model, touch, _ = sheets_at([flat])
    # not touching yet, but each side goes almost as far as vertices may before another search is due
    way = np.where(flat.points[:, 0] > 0.11, 1.0, -1.0)[:, None] * [0.0, 0.0, 0.98 * touch.leeway]
    model.set_points(mesh.points + way)
    look(model, touch)
    assert not np.abs(contact_forces(model, touch)).any()
    model.set_points(mesh.points)
    expected = brute_forces(mesh.points, touching_pairs(mesh.points, touch), touch)
    assert np.abs(expected).any()
    found = contact_forces(model, touch)
    assert np.abs(found[:, :3] - expected).max() <= FORCE_ROUNDING + RELATIVE_ROUNDING * np.abs(expected).max()


def test_forces_are_the_gradient_of_the_energy_and_balance() -> None:
    flat, mesh = grid(12, 0.22), crumpled(5)
    model, touch, _ = sheets_at([flat])
    model.set_points(mesh.points)
    look(model, touch)
    forces = contact_forces(model, touch)[:, :3]
    assert np.abs(forces.sum(axis=0)).max() <= FORCE_ROUNDING * len(forces)
    largest = np.abs(forces).max()
    for vertex in np.argsort(-np.abs(forces).max(axis=1))[:4].tolist():
        for axis in range(3):
            energies = []
            for way in (-GRADIENT_STEP, GRADIENT_STEP):
                points = mesh.points.copy()
                points[vertex, axis] += way
                energies.append(brute_energy(points, touching_pairs(points, touch, vertex), touch))
            slope = (energies[1] - energies[0]) / (2.0 * GRADIENT_STEP)
            assert forces[vertex, axis] == pytest.approx(-slope, abs=GRADIENT_ERROR * largest)


def test_a_flat_sheet_does_not_touch_itself_however_fine() -> None:
    for count in (4, 12, 60):  # the finest has edges of twice the thickness
        mesh = grid(count, 0.22)
        model, touch, _ = sheets_at([mesh])
        look(model, touch)
        assert not np.abs(contact_forces(model, touch)).any()


def test_garments_of_different_items_pass_through_each_other() -> None:
    below, above = lying(grid(6, 0.1)), moved(lying(grid(6, 0.1)), 0.003, 0.5 * THICKNESS, 0.002)
    for items, touches in (((0, 0), True), ((0, 1), False)):
        kinds = [SheetKind(THICKNESS, 0.3, item=item) for item in items]
        model, touch, _ = sheets_at([below, above], kinds=kinds)
        look(model, touch)
        assert np.abs(contact_forces(model, touch)).any() == touches


def iterate(relaxation: Relaxation, count: int) -> Points:
    """Shape after some iterations, with room made for pairs where it is needed."""
    for _ in range(count // 20):
        relaxation.run(20)
        if relaxation.touch is not None and relaxation.touch.grow():
            relaxation.forget_graphs()
    return relaxation.model.points()


def dropped(momentum: float, gathers: bool | None = None) -> tuple[Relaxation, ClothTouch]:
    """A sheet held over a smaller one that is pinned, to fall on it."""
    below, above = lying(grid(6, 0.1)), moved(lying(grid(10, 0.16)), -0.03, 0.01, 0.03)
    model, touch, _ = sheets_at(
        [below, above], pins=[np.arange(36, dtype=np.int32), NO_PINS], precision="mixed", gathers=gathers
    )
    relaxation = Relaxation(model, Collider(), StepOptions(momentum=momentum), touch)
    touch.awaken()
    return relaxation, touch


def test_falling_cloth_is_caught_and_never_passes() -> None:
    relaxation, touch = dropped(0.9995)
    lowest = 0.0
    for _ in range(15):
        points = iterate(relaxation, 20)
        assert not len(find_crossings(points, touch.sheets, "cpu").pairs)
        lowest = min(lowest, float(points[36:, 1].min()))
    assert lowest < -0.01  # its border hangs over
    middle = np.linalg.norm(points[36:, [0, 2]] - [0.05, -0.05], axis=1) < 0.03
    assert middle.any()
    assert (points[36:][middle, 1] > 0.2 * THICKNESS).all()


def test_cloth_stands_still_while_there_is_no_room_for_all_that_is_near_it() -> None:
    relaxation, touch = dropped(0.9995)
    touch._hold_pairs(touch.data, 5)
    touch.data.moved.fill_(1)
    relaxation.run(20)
    first = relaxation.model.points()
    relaxation.run(20)
    assert np.array_equal(relaxation.model.points(), first)
    assert touch.grow()
    relaxation.forget_graphs()
    assert not np.array_equal(iterate(relaxation, 20), first)


def test_scattered_and_gathered_forces_meet_cloth_with_the_same_bits() -> None:
    shapes = [iterate(dropped(0.99, gathers)[0], 100) for gathers in (False, True)]
    assert np.array_equal(shapes[0], shapes[1])


def test_nothing_is_launched_nor_kept_where_cloth_does_not_meet_cloth() -> None:
    mesh = grid(5, 0.2)
    model, touch, _ = sheets_at([mesh])
    without, asleep = (Relaxation(model, Collider(), StepOptions(), given) for given in (None, touch))
    assert without.touch is None
    assert not any(isinstance(value, wp.array) for value in vars(without.touch_data).values())
    own = {kernel.key for kernel in touch.kernels()}
    assert own
    assert not own & {kernel.key for kernel in without.kernels()}
    shapes = []
    for relaxation in (without, asleep):  # asleep it changes nothing, either
        model.set_points(mesh.points)
        model.cloth.stiffness.zero_()
        relaxation.run(20)
        shapes.append(model.points())
    assert np.array_equal(shapes[0], shapes[1])


def test_a_fabric_of_no_thickness_still_meets_itself() -> None:
    fabric = replace(FABRIC, thickness=0.0)
    below, above = lying(grid(6, 0.1)), moved(lying(grid(6, 0.1)), 0.0, 0.5 * LEAST_THICKNESS, 0.0)
    model, touch, _ = sheets_at([below, above], fabric=fabric)
    look(model, touch)
    assert np.isfinite(contact_forces(model, touch)).all()
    assert np.abs(contact_forces(model, touch)).any()


SLOPES = ((0.7, False), (1.3, True))  # tangent of the incline over the friction, and whether cloth slides on it
SLIP = 2e-3  # [m] in 600 iterations; what leans without sliding moves 0.2 of a thickness times the friction


def on_a_slope(share: float) -> tuple[Relaxation, ClothTouch, int]:
    """A piece of cloth on cloth that is held on an incline, and how many vertices are held."""
    angle = np.arctan(share * FABRIC.friction)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    below, above = lying(grid(14, 0.26)), moved(lying(grid(5, 0.08)), 0.09, 0.98 * THICKNESS, -0.09)
    tilted = [replace(mesh, points=mesh.points @ turn.T) for mesh in (below, above)]
    held = np.arange(below.vertex_count, dtype=np.int32)
    model, touch, _ = sheets_at(tilted, pins=[held, NO_PINS], precision="mixed")
    relaxation = Relaxation(model, Collider(), StepOptions(), touch)
    touch.awaken()
    iterate(relaxation, 100)
    return relaxation, touch, len(held)


@pytest.mark.parametrize(("share", "slides"), SLOPES)
def test_cloth_on_sloping_cloth_holds_below_the_friction_and_slides_above(share: float, slides: bool) -> None:
    relaxation, _, held = on_a_slope(share)
    first = relaxation.model.points()[held:].mean(axis=0)
    last = iterate(relaxation, 600)[held:].mean(axis=0)
    assert (np.linalg.norm(last - first) > SLIP) == slides


def test_friction_holds_however_often_it_is_looked_for_what_touches() -> None:
    relaxation, touch, held = on_a_slope(SLOPES[0][0])
    iterate(relaxation, 600)
    first = relaxation.model.points()[held:].mean(axis=0)
    for _ in range(30):
        touch.data.moved.fill_(1)
        last = iterate(relaxation, 20)[held:].mean(axis=0)
    assert np.linalg.norm(last - first) < 0.1 * SLIP


def test_a_fold_that_passes_through_itself_comes_undone() -> None:
    mesh = grid(25, 0.24)
    points = mesh.points.copy()
    u = (points[:, 0] - 0.12) / 0.06
    looped = np.abs(u) < 1.0
    points[:, 0] -= 0.03 * np.clip(u, -1.0, 1.0)
    points[looped, 0] = 0.12 + 0.06 * (u**3 - 0.5 * u)[looped]
    points[looped, 2] = 0.03 * (1.0 - u**2)[looped]
    points += np.random.default_rng(1).normal(scale=1e-4, size=points.shape)
    model, touch, parts = sheets_at([mesh], precision="mixed")
    model.set_points(points)
    assert len(find_crossings(points, touch.sheets, "cpu").pairs) > 20
    relaxation = Relaxation(model, Collider(), StepOptions(), touch)
    course = Course(relaxation, touch, 5.0 * parts[0].rest.edge_length, lambda _: [1.0])
    for step in range(10):
        course.advance(100 * step, model.points())
        points = iterate(relaxation, 100)
        if not touch.crossing_count():
            break
    assert not len(find_crossings(points, touch.sheets, "cpu").pairs)


def tube(radius: float, rows: int = 9) -> Mesh:
    """A sheet bent round the y axis, almost closed, its front inward."""
    mesh = grid(rows, 0.16)
    angle = mesh.points[:, 0] / 0.16 * 6.2
    return replace(mesh, points=np.stack([radius * np.cos(angle), mesh.points[:, 1], radius * np.sin(angle)], axis=1))


def test_an_outer_layer_inside_the_inner_one_comes_out() -> None:
    inner, outer = tube(0.05, 13), tube(0.056, 13)
    pins = np.arange(inner.vertex_count, dtype=np.int32)
    model, touch, parts = sheets_at([inner, outer], pins=[pins, NO_PINS], precision="mixed")
    model.set_points(np.concatenate([inner.points, outer.points * [0.8, 1.0, 0.8]]))
    lengths = np.concatenate([part.rest.edge_length for part in parts])
    relaxation = Relaxation(model, Collider(), StepOptions(), touch)
    course = Course(relaxation, touch, lengths, lambda _: [-1.0, -1.0])
    for step in range(6):
        course.advance(100 * step, model.points())
        points = iterate(relaxation, 100)
    assert not len(find_crossings(points, touch.sheets, "cpu").pairs)
    worn = points[len(pins) :]
    beside = (worn[:, 1] > 0.01) & (worn[:, 1] < 0.15)
    assert beside.any()
    assert (np.linalg.norm(worn[beside][:, [0, 2]], axis=1) > 0.05 * np.cos(0.27)).all()  # the chord of an edge


def test_the_certificate_counts_what_contact_carries() -> None:
    relaxation, _ = dropped(0.9995)
    iterate(relaxation, 1500)
    certifier = Certifier(relaxation)
    check = certifier.check(certifier.look(1500), 0)
    assert check.residual.relative_rms < 0.02  # balanced, though gravity pulls everywhere


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
    body = build_avatar(SphereShape(kind="sphere", radius=0.2, centre=(0.0, 0.1, 0.0)), size="M")
    around = build_avatar(SphereShape(kind="sphere", radius=0.24, centre=(0.0, 0.0, 0.0)), size="M").points
    assert signed_distances(around, body, "cpu").min() < -DEEP
    shift = clear_shift(around, body, "cpu")
    assert shift is not None
    assert signed_distances(around + shift, body, "cpu").min() > 0.0
    assert clear_shift(around + shift, body, "cpu") is None


def test_what_crosses_is_reported_and_marked(tmp_path: Path) -> None:
    write_crossing(tmp_path / "crossed.obj")
    scene = {
        "garment": {"mesh": str(tmp_path / "crossed.obj"), "units": "m", "pin": {"vertices": [0]}},
        "solver": {"iterations": 0},
    }
    worn = warp_cloth.fit(scene, device="cpu")
    faces = worn.report["garments"][0]["crossing_faces"]
    assert worn.report["crossings"] == {"pairs": len(faces) // 2, "between_garments": 0, "faces": len(faces)}
    marked = np.flatnonzero(worn.garments[0].fields["crossing"])
    assert set(marked) == set(worn.garments[0].mesh.triangles[faces].ravel())


def write_crossing(path: Path) -> None:
    """A strip of three triangles whose last passes through its first."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.6, 0.8, 0.6], [0.5, 0.4, -0.5]])
    faces = [[1, 2, 3], [3, 2, 4], [3, 4, 5]]
    lines = [f"v {x} {y} {z}\n" for x, y, z in points] + [f"f {a} {b} {c}\n" for a, b, c in faces]
    path.write_text("".join(lines))
