"""Grain: angles and images say the same, and what is wrong with one is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from swatches import swatch

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import fabric_named
from warp_cloth.scene import load_scene

HUE_STEP = np.radians(180 / 255)  # an 8-bit image's


def two_panels() -> Mesh:
    """A strip whose upper half is a panel of its own."""
    mesh = swatch(0.1, 0.2, 0.01, "alternating")
    upper = mesh.texcoords.mean(axis=1)[:, 1] > 0.1
    return replace(mesh, panels=upper.astype(np.int32), panel_names=("lower", "upper"))


def painted(path: Path) -> Path:
    """Upper half cyan (90 degrees), lower half red (0)."""
    pixels = np.zeros((20, 10, 3), dtype=np.uint8)
    pixels[:10] = (0, 255, 255)
    pixels[10:] = (255, 0, 0)
    Image.fromarray(pixels).save(path)
    return path


def test_a_painted_garment_equals_the_one_with_angles(tmp_path: Path) -> None:
    mesh, fabric = two_panels(), fabric_named("denim")
    by_angle = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(panels={"upper": 90.0}))
    by_image = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(texture=painted(tmp_path / "grain.png")))
    plain = build_rest_shape(mesh, fabric, rest="uv")
    for name in ("slope", "packed"):
        angle, image = (getattr(rest.yarns, name) for rest in (by_angle, by_image))
        assert image == pytest.approx(angle, abs=HUE_STEP * np.abs(angle).max())
    assert np.abs(by_angle.yarns.slope - plain.yarns.slope).max() > 0.5 * np.abs(plain.yarns.slope).max()
    assert by_image.hinge_stiffness == pytest.approx(by_angle.hinge_stiffness, rel=0.02)


def test_a_grey_image_turns_nothing(tmp_path: Path) -> None:
    Image.new("L", (8, 8), 128).save(tmp_path / "grey.png")
    turns = Grain(30.0, texture=tmp_path / "grey.png").of_triangles(two_panels(), "garment")
    assert turns == pytest.approx(np.radians(30.0))


def test_turning_the_grain_by_a_right_angle_exchanges_warp_and_weft() -> None:
    mesh, fabric = swatch(0.05, 0.05, 0.01, "random"), fabric_named("denim")
    exchanged = replace(
        fabric,
        stretch_warp=fabric.stretch_weft,
        stretch_weft=fabric.stretch_warp,
        bending_warp=fabric.bending_weft,
        bending_weft=fabric.bending_warp,
    )
    turned = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(90.0))
    other = build_rest_shape(mesh, exchanged, rest="uv")
    assert turned.hinge_stiffness == pytest.approx(other.hinge_stiffness, rel=1e-9)
    assert turned.yarns.packed[:, [1, 0, 2]] == pytest.approx(other.yarns.packed[:, :3], rel=1e-9)


def test_what_is_wrong_with_a_grain_is_told(tmp_path: Path) -> None:
    mesh = two_panels()
    (tmp_path / "text.png").write_text("no image")
    for grain, problem in (
        (Grain(panels={"uper": 3.0}), 'garment.grain_panels: the mesh has no panel "uper"; there are lower, upper'),
        (Grain(texture=tmp_path / "absent.png"), "absent.png: No such file or directory"),
        (Grain(texture=tmp_path / "text.png"), "text.png: is not a readable image; give a PNG"),
    ):
        with pytest.raises(InputError) as refused:
            grain.of_triangles(mesh, "garment")
        assert problem in str(refused.value)
    with pytest.raises(InputError, match="has no texture coordinates"):
        Grain(texture=tmp_path / "text.png").of_triangles(replace(mesh, texcoords=None), "garment")


@pytest.mark.parametrize("grain", [Grain(30.0), Grain(texture=Path("gone.png"))])
def test_grain_of_a_mesh_that_has_no_warp_is_refused(grain: Grain) -> None:
    mesh = two_panels()
    bent = replace(mesh, points=mesh.points + np.sin(30.0 * mesh.points[:, :1]) * (0.0, 0.1, 0.1), texcoords=None)
    assert not build_rest_shape(bent, fabric_named("denim"), rest="mesh").sheet.directed
    with pytest.raises(InputError, match=r"garment\.grain_degrees: the mesh has no texture coordinates"):
        build_rest_shape(bent, fabric_named("denim"), rest="mesh", grain=grain)


def test_a_scene_states_grain_by_panel_and_by_image(tmp_path: Path) -> None:
    painted(tmp_path / "grain.png")
    (tmp_path / "scene.toml").write_text(
        '[garment]\nshape = {kind = "square", vertices_per_side = 5}\nfabric = "denim"\n'
        'grain_degrees = 30\ngrain_panels = {square = 45}\ngrain_texture = "grain.png"\n'
    )
    scene = load_scene(tmp_path / "scene.toml")
    garment = load_outfit(scene).garments[0]
    mesh = load_outfit(scene).meshes[0]
    wanted = build_rest_shape(
        mesh, fabric_named("denim"), rest="mesh", grain=Grain(30.0, {"square": 45.0}, tmp_path / "grain.png")
    )
    assert (garment.rest.yarns.slope == wanted.yarns.slope).all()
    assert scene.settings()["garment"][0]["grain_panels"] == {"square": 45.0}
