"""Avatars that are no closed surfaces: met like the sound body, or refused with the reason."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from meshfiles import as_mesh, sheet, write_obj

import warp_cloth
from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.avatar.depth import build_depth_buffers
from warp_cloth.avatar.exact import build_exact_collider, penetration
from warp_cloth.avatar.field import build_contact_field
from warp_cloth.avatar.layers import build_layered_buffers
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import load_mesh
from warp_cloth.model.result import Status
from warp_cloth.report.notes import notes_of

RADIUS = 0.08  # [m]
CUT = 0.06  # height of the open neck [m]
NEAR = 4.0e-4  # [m]: mesh sag, the pixels' stairs at the silhouette, spline rounding
WORN = 0.5  # [mm] under the sound body, at an offset of 3 mm
LIMB = np.array([0.0, 0.0, RADIUS])  # middle of one that is inside out [m]
ZIGZAG = 0.2  # of a lid's area: its rim goes up and down along triangles
GAP = 0.02  # [m] from a hole, where its flat lid cannot be felt any more


def ball(radius: float = RADIUS, subdivisions: int = 4) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)


def without(shape: trimesh.Trimesh, gone: np.ndarray) -> trimesh.Trimesh:
    shape.update_faces(~gone)
    shape.remove_unreferenced_vertices()
    return shape


def open_neck() -> trimesh.Trimesh:
    shape = ball()
    return without(shape, shape.triangles_center[:, 1] > CUT)


def small_holes() -> trimesh.Trimesh:
    shape = ball()
    gone = np.zeros(len(shape.faces), dtype=bool)
    gone[::97] = True
    return without(shape, gone)


def scattered_flips() -> trimesh.Trimesh:
    shape = ball()
    faces = np.array(shape.faces)
    turn = np.random.default_rng(0).random(len(faces)) < 0.3
    faces[turn] = faces[turn][:, ::-1]
    return trimesh.Trimesh(shape.vertices, faces, process=False)


def inside_out_limb() -> trimesh.Trimesh:
    """A part of its own, inside out, that crosses the trunk."""
    limb = ball(0.03, 3).apply_translation(LIMB)
    limb.invert()
    return trimesh.util.concatenate([ball(), limb])


def inner_parts() -> trimesh.Trimesh:
    """Eyes, one of them inside out, and a tongue that pokes through the skin of the mouth's wall inside."""
    eyes = [ball(0.01, 2).apply_translation((x, 0.01, 0.06)) for x in (-0.02, 0.02)]
    eyes[0].invert()
    tongue = trimesh.creation.box((0.02, 0.01, 0.04)).apply_translation((0.0, -0.02, 0.03))
    return trimesh.util.concatenate([ball(), *eyes, tongue])


def crossing_parts() -> trimesh.Trimesh:
    """A second skin that crosses the first all over, by less than rounding matters."""
    other = ball(subdivisions=3)
    turn = trimesh.transformations.rotation_matrix(0.4, (1.0, 2.0, 3.0))
    return trimesh.util.concatenate([ball(), other.apply_transform(turn).apply_scale(1.0005)])


def loose_hair() -> trimesh.Trimesh:
    """Cards that hang round it, near and far."""
    turns = [trimesh.transformations.rotation_matrix(angle, (0, 1, 0)) for angle in np.linspace(0.0, 6.0, 30)]
    card = trimesh.Trimesh([(0, 0, 0), (0.01, 0, 0), (0.01, 0.05, 0), (0, 0.05, 0)], [(0, 1, 2), (0, 2, 3)])
    cards = [card.copy().apply_translation((0, 0, RADIUS + 0.002 * k)).apply_transform(t) for k, t in enumerate(turns)]
    return trimesh.util.concatenate([ball(), *cards])


def cape() -> trimesh.Trimesh:
    """An open sheet, curved round its back."""
    sheet = ball(0.12)
    return trimesh.util.concatenate([ball(), without(sheet, sheet.triangles_center[:, 2] > -0.09)])


def thick_skin() -> trimesh.Trimesh:
    """A second wall inside, wound the other way: a shell, as artists make it."""
    inner = ball(RADIUS - 0.004)
    inner.invert()
    return trimesh.util.concatenate([ball(), inner])


def open_parts() -> trimesh.Trimesh:
    """Cut into pieces that only touch."""
    above, below = ball(), ball()
    above = without(above, above.triangles_center[:, 1] < 0.02)
    below = without(below, below.triangles_center[:, 1] >= 0.02)
    return trimesh.util.concatenate([above, below.apply_translation((0.0, -1e-5, 0.0))])


AVATARS: dict[str, Callable[[], trimesh.Trimesh]] = {
    made.__name__: made
    for made in (
        open_neck, small_holes, scattered_flips, inside_out_limb, inner_parts, crossing_parts, loose_hair, cape,
        thick_skin, open_parts,
    )
}  # fmt: skip


def loaded(folder: Path, shape: trimesh.Trimesh) -> Mesh:
    write_obj(folder / "avatar.obj", np.asarray(shape.vertices), np.asarray(shape.faces))
    return load_mesh(folder / "avatar.obj", role="avatar", key="avatar", units="m")


@pytest.mark.parametrize("case", AVATARS)
def test_contact_is_that_of_the_sound_body(tmp_path: Path, case: str) -> None:
    mesh = loaded(tmp_path, AVATARS[case]())
    sound = build_exact_collider(as_mesh(ball()), "cpu")
    random = np.random.default_rng(1)
    way = random.normal(size=(3000, 3))
    points = way / np.linalg.norm(way, axis=1)[:, None] * (RADIUS + random.uniform(-0.003, 0.008, (3000, 1)))
    if case == "open_neck":
        points = points[points[:, 1] < CUT - GAP]
    if case == "inside_out_limb":
        points = points[np.linalg.norm(points - LIMB, axis=1) > 0.03 + GAP]
    truth = sound.sample(points)[:, 3]
    solid = closing_of(mesh).closed(mesh)
    lower, upper = solid.bounds()
    region = (solid.points, solid.triangles, lower - 0.02, upper + 0.02, 0.002, "cpu")
    colliders = [build_contact_field(build(*region)) for build in (build_depth_buffers, build_layered_buffers)]
    if case in ("open_neck", "small_holes", "scattered_flips", "loose_hair", "cape"):  # it knows inner surfaces, too
        colliders.append(build_exact_collider(solid, "cpu"))
    for collider in colliders:
        error = np.abs(collider.sample(points)[:, 3] - truth)
        assert np.percentile(error, 99.5) < NEAR
        assert error.max() < 3.0 * NEAR  # the lids of holes, and the second skin


def test_closed_mesh_is_left_as_it_is() -> None:
    mesh = as_mesh(ball())
    closing = closing_of(mesh)
    assert (closing.holes, closing.sheets, closing.lid_area) == (0, 0, 0.0)
    assert (closing.triangles == mesh.triangles).all()
    assert closing.encloses


@pytest.mark.parametrize("case", ["open_neck", "small_holes", "scattered_flips"])
def test_rays_through_a_closed_avatar_balance_whatever_was_wrong_with_it(case: str) -> None:
    """Also with faces that loading would have turned: the cones take up what does not cancel."""
    mesh = as_mesh(AVATARS[case]())
    solid = closing_of(mesh).closed(mesh)
    lower, upper = solid.bounds()
    assert (
        build_layered_buffers(solid.points, solid.triangles, lower - 0.01, upper + 0.01, 0.002, "cpu").unbalanced == 0
    )


def test_loose_sheets_are_left_out_and_counted(tmp_path: Path) -> None:
    hair, cloak = (closing_of(loaded(tmp_path, made())) for made in (loose_hair, cape))
    assert (hair.sheets, hair.holes) == (30, 0)
    assert (cloak.sheets, cloak.holes) == (1, 0)
    assert len(hair.triangles) == len(cloak.triangles) == len(ball().faces)


def test_depths_are_measured_from_what_cloth_meets(tmp_path: Path) -> None:
    """Cloth between a ball and a cape round it, which is left out, has not gone into anything."""
    write_obj(tmp_path / "avatar.obj", np.asarray(cape().vertices), np.asarray(cape().faces))
    between = 0.5 * (RADIUS + 0.12)
    points, faces = sheet(count=5, side=0.02, height=-0.01, toward=-between)
    write_obj(tmp_path / "patch.obj", points, faces)
    scene = {
        "garment": {"mesh": str(tmp_path / "patch.obj"), "units": "m", "pin": {"box": [[-1, -1, -1], [1, 0.009, 1]]}},
        "avatar": {"mesh": str(tmp_path / "avatar.obj"), "units": "m"},
    }
    worn = warp_cloth.fit(scene, device="cpu", overrides=("solver.iterations=20",), maps="gap")
    assert worn.report["penetration_mm"]["max"] < WORN
    assert worn.garments[0].fields["gap"].min() == pytest.approx(1e3 * (between - RADIUS), abs=1.0)
    assert any("1 loose sheet" in note for note in notes_of(worn.report))


def test_a_hole_is_told_by_the_area_of_its_lid(tmp_path: Path) -> None:
    closing = closing_of(loaded(tmp_path, open_neck()))
    assert (closing.holes, closing.sheets) == (1, 0)
    assert closing.lid_area == pytest.approx(np.pi * (RADIUS**2 - CUT**2), rel=ZIGZAG)


@pytest.mark.parametrize("kind", ["depth", "auto", "plain"])
def test_a_sheet_is_no_avatar_for_depth_buffers(kind: str) -> None:
    sheet = Mesh("sheet", np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1]]), np.array([[0, 2, 1], [1, 2, 3]]))
    with pytest.raises(InputError, match=r'avatar: its surface encloses nothing.*use collision.avatar = "mesh"'):
        AvatarContact(sheet, ContactOptions(kind, 0.002, 0.003, 1e-3, "cpu"))
    AvatarContact(sheet, ContactOptions("mesh", 0.002, 0.003, 1e-3, "cpu"))


def test_half_a_body_is_told_of(tmp_path: Path) -> None:
    half = ball(0.5)
    half = without(half, half.triangles_center[:, 0] > 0)
    write_obj(tmp_path / "half.obj", np.asarray(half.vertices), np.asarray(half.faces))
    scene = {
        "garment": {"shape": {"kind": "square", "side": 0.2, "vertices_per_side": 5, "height": 0.6}},
        "avatar": {"mesh": str(tmp_path / "half.obj"), "units": "m"},
    }
    worn = warp_cloth.fit(scene, device="cpu", overrides=("solver.iterations=1",))
    (told,) = (note for note in notes_of(worn.report) if "hole" in note)
    assert told.startswith("avatar: 1 hole closed, 0.8")
    assert "mirror modifier" in told


def test_a_sheet_that_is_no_avatar_is_named(tmp_path: Path) -> None:
    (tmp_path / "cape.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n")
    scene = {"garment": {"shape": {"kind": "square"}}, "avatar": {"mesh": str(tmp_path / "cape.obj"), "units": "m"}}
    with pytest.raises(InputError, match=r"cape\.obj: its surface encloses nothing"):
        warp_cloth.fit(scene, device="cpu")


def test_cloth_lies_on_a_hostile_avatar_as_on_a_sound_one(tmp_path: Path) -> None:
    """Everything at once: an open neck below, eyes, holes, flipped faces."""
    shape = small_holes()
    shape = without(shape, shape.triangles_center[:, 1] < -CUT)
    eye = ball(0.01, 2).apply_translation((0.0, 0.05, 0.0))
    shape = trimesh.util.concatenate([shape, eye]).apply_translation((0.0, 1.0, 0.0))
    faces = np.array(shape.faces)
    faces[::5] = faces[::5][:, ::-1]
    write_obj(tmp_path / "avatar.obj", np.asarray(shape.vertices), faces)
    scene = {
        "garment": {"shape": {"kind": "square", "side": 0.2, "vertices_per_side": 11, "height": 1.09}},
        "avatar": {"mesh": str(tmp_path / "avatar.obj"), "units": "m"},
    }
    worn = warp_cloth.fit(scene, device="cpu")
    assert worn.status is Status.AT_REST
    assert worn.report["contact"]["holes_closed"] > 10
    assert any(re.fullmatch(r"avatar: \d+ holes closed, [\d.]+ cm2 in all", note) for note in notes_of(worn.report))
    sound = as_mesh(ball().apply_translation((0.0, 1.0, 0.0)))
    assert penetration(worn.garments[0].points, sound, "cpu").max < WORN
