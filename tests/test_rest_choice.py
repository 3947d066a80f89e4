"""Rest shape "auto": panels are recognised, atlases are not, and the scale of texture space is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cloths import grid
from meshfiles import write_obj

import warp_cloth
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.units import METRES_PER
from warp_cloth.fitting.fit import fit
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.garment.panel_fit import fit_panels
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.garment.rest_choice import RestSource, choose_rest
from warp_cloth.material.fabric import Fabric
from warp_cloth.scene import load_scene
from warp_cloth.shapes.tshirt import tshirt

SHIRT = tshirt(edge=0.03)
FLAT = 1e-9  # lengths of panels that lie flat, through a few divisions and a median


def panels_of(mesh: Mesh) -> np.ndarray:
    assert mesh.texcoords is not None
    return mesh.texcoords


def chosen(mesh: Mesh, stated: float | None = None) -> RestSource:
    return choose_rest(mesh, "auto", stated, "garment")


def per_panel(mesh: Mesh, low: float, high: float) -> np.ndarray:
    """A factor for each panel, shape [F, 1, 1]."""
    factors = np.linspace(low, high, int(mesh.panels.max()) + 1)
    return factors[mesh.panels][:, None, None]


def warped(texcoords: np.ndarray) -> np.ndarray:
    """Texture coordinates as an unwrapping of a doubly curved surface has them: squeezed here, drawn out there."""
    u, v = texcoords[..., 0], texcoords[..., 1]
    return texcoords + 0.04 * np.stack([np.sin(9.0 * v) + np.sin(11.0 * u), np.sin(10.0 * u) + np.sin(8.0 * v)], axis=2)


def tube(columns: int = 40, rows: int = 20, radius: float = 0.15, height: float = 0.5) -> Mesh:
    """A closed tube, and its flat pattern in metres, with one seam."""
    angle, up = np.meshgrid(2.0 * np.pi * np.arange(columns) / columns, np.linspace(0.0, height, rows))
    points = np.column_stack([(radius * np.sin(angle)).ravel(), up.ravel(), (radius * np.cos(angle)).ravel()])
    row, column = (each.ravel() for each in np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij"))
    right = (column + 1) % columns
    a, b = row * columns + column, row * columns + right
    c, d = b + columns, a + columns
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    width = 2.0 * radius * np.sin(np.pi / columns)  # chords: the pattern of the tube's own polygon
    far = column + 1
    u = np.concatenate([np.column_stack([column, far, far]), np.column_stack([column, far, column])])
    v = points[triangles][..., 1]
    return Mesh("tube", points, triangles, texcoords=np.stack([width * u, v], axis=2))


def box(count: int = 15, width: float = 0.6, gap: float = 0.4) -> Mesh:
    """Front and back panel of a top, flat, this far apart [m], and sewn at both sides to the front's vertices."""
    front = grid(count, width)
    back = front.points + np.array([0.0, 0.0, -gap])
    number = np.arange(count**2).reshape(count, count) + count**2
    number[:, [0, -1]] -= count**2
    triangles = np.concatenate([front.triangles, number.ravel()[front.triangles[:, ::-1]]])
    used, compact = np.unique(triangles, return_inverse=True)
    points = np.concatenate([front.points, back])[used]
    flat = front.points[front.triangles][..., :2]
    texcoords = np.concatenate([flat, flat[:, ::-1] + np.array([1.1 * width, 0.03])])
    panels = np.repeat([0, 1], len(front.triangles)).astype(np.int32)
    return Mesh("box", points, compact.reshape(-1, 3).astype(np.int32), texcoords=texcoords, panels=panels)


def test_the_panels_of_the_generated_shirt_are_its_rest_shape() -> None:
    source = chosen(SHIRT)
    assert (source.kind, source.metres_per_uv) == ("uv", 1.0)
    (choice,) = source.choices
    assert (choice.key, choice.value) == ("garment.rest", "uv")
    stated, found = (build_rest_shape(SHIRT, Fabric(), rest=rest, metres_per_uv=None) for rest in ("uv", "auto"))
    assert np.array_equal(stated.edge_length, found.edge_length)


@pytest.mark.parametrize("unit", METRES_PER)
def test_panels_in_any_unit_are_recognised_and_the_unit_is_exact(unit: str) -> None:
    metres = METRES_PER[unit]  # type: ignore[index]
    source = chosen(replace(SHIRT, texcoords=panels_of(SHIRT) / metres))
    assert (source.kind, source.metres_per_uv) == ("uv", metres)
    assert [choice.value for choice in source.choices] == (["uv"] if unit == "m" else ["uv", unit])


@pytest.mark.parametrize("each_axis", [False, True])
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_the_scale_of_panels_in_the_unit_square_is_found(each_axis: bool, margin: float) -> None:
    texcoords = panels_of(box())
    low, extent = texcoords.min(axis=(0, 1)), np.ptp(texcoords, axis=(0, 1))
    extent = extent if each_axis else np.full(2, extent.max())
    mesh = replace(box(), texcoords=margin + (1.0 - 2.0 * margin) * (texcoords - low) / extent)
    source = chosen(mesh)
    assert source.kind == "uv"
    assert np.broadcast_to(source.metres_per_uv, 2) == pytest.approx(extent / (1.0 - 2.0 * margin), rel=FLAT)
    assert source.choices[1].key == "garment.uv_units"
    found = build_rest_shape(mesh, Fabric(), rest="auto", metres_per_uv=None)
    true = build_rest_shape(box(), Fabric(), rest="uv")
    assert found.edge_length == pytest.approx(true.edge_length, rel=FLAT)
    assert found.notes == true.notes


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_panels_placed_a_little_scaled_keep_their_unit(scale: float) -> None:
    source = chosen(replace(SHIRT, points=scale * SHIRT.points))
    assert (source.kind, source.metres_per_uv) == ("uv", 1.0)


def test_single_panels_may_be_a_little_scaled() -> None:
    mesh = replace(box(), texcoords=per_panel(box(), 0.93, 1.07) * panels_of(box()))
    assert (chosen(mesh).kind, chosen(mesh).metres_per_uv) == ("uv", 1.0)


@pytest.mark.parametrize("case", ["scaled one by one", "distorted", "both"])
def test_an_atlas_for_pictures_is_no_panels(case: str) -> None:
    texcoords = panels_of(box())
    texcoords = texcoords if case == "scaled one by one" else warped(texcoords)
    texcoords = texcoords if case == "distorted" else per_panel(box(), 0.4, 1.6) * texcoords
    source = chosen(replace(box(), texcoords=texcoords / texcoords.max()))
    assert source.kind == "mesh"
    assert "no panels" in source.choices[0].reason


def test_a_mesh_that_is_its_pattern_bent_is_its_own_rest_shape() -> None:
    """Both have the same lengths, but the mesh's need no scale."""
    for texcoords in (panels_of(tube()), panels_of(tube()) / panels_of(tube()).max(axis=(0, 1))):
        source = chosen(replace(tube(), texcoords=texcoords))
        assert source.kind == "mesh"
        assert "the mesh's lengths" in source.choices[0].reason


@pytest.mark.parametrize("scale", [1.0, 0.37])
def test_panels_of_a_worn_garment_are_its_rest_shape(scale: float) -> None:
    """A tube that its wearer stretches by up to 4 %: whichever unit its pattern is in, the pattern is unstretched."""
    mesh = tube()
    girth = 1.02 + 0.02 * np.sin(12.0 * mesh.points[:, 1])
    points = mesh.points * np.column_stack([girth, np.ones_like(girth), girth])
    source = chosen(replace(mesh, points=points, texcoords=panels_of(mesh) / scale))
    assert source.kind == "uv"
    assert np.broadcast_to(source.metres_per_uv, 2) == pytest.approx([scale, scale], rel=0.05)


def test_a_stated_unit_overrides_the_one_that_the_mesh_shows() -> None:
    source = chosen(SHIRT, 1.1)
    assert (source.kind, source.metres_per_uv) == ("uv", 1.1)
    assert [choice.key for choice in source.choices] == ["garment.rest"]
    assert (chosen(tube(), 1.1).kind, chosen(tube(), 1.0).kind) == ("uv", "mesh")


@pytest.mark.parametrize("rest", ["mesh", "uv", "physics"])
def test_a_stated_rest_shape_is_no_choice(rest: str) -> None:
    assert choose_rest(SHIRT, rest, None, "garment") == RestSource(rest, 1.0)  # type: ignore[arg-type]


def test_without_texture_coordinates_the_mesh_is_the_rest_shape() -> None:
    source = chosen(replace(SHIRT, texcoords=None))
    assert source.kind == "mesh"
    assert source.choices[0].reason == "there are no texture coordinates"
    assert fit_panels(replace(SHIRT, texcoords=np.zeros_like(panels_of(SHIRT)))) is None


def test_a_stated_rest_shape_of_a_stage_comes_before_panels() -> None:
    corners = 0.5 * SHIRT.points[SHIRT.triangles]
    assert chosen(replace(SHIRT, rest_corners=corners)).kind == "physics"


def test_panels_drawn_together_at_a_seam_keep_their_triangles(tmp_path: Path) -> None:
    """Triangles without area in the mesh are cloth only where panels give them one."""
    mesh = grid(9, 0.5)
    points = mesh.points.copy()
    points[:9, 1] = points[9:18, 1]  # the first row is drawn up to the second
    texcoords = mesh.points[:, :2]
    counts = {}
    for name, rows in (("panels", texcoords), ("atlas", warped(8.0 * texcoords[:, None])[:, 0])):
        write_obj(tmp_path / f"{name}.obj", points, mesh.triangles, rows)
        scene = {"garment": {"mesh": str(tmp_path / f"{name}.obj"), "units": "m", "pin": {"vertices": [80]}}}
        worn = fit(load_scene(scene, ["solver.iterations=0"]), device="cpu")
        counts[name] = worn.report["faces"], worn.report["choices"][0]["value"]
    assert counts == {"panels": (128, "uv"), "atlas": (112, "mesh")}


def test_the_report_and_the_summary_say_what_was_chosen() -> None:
    from warp_cloth.cli.fit import summary

    worn = warp_cloth.fit("tshirt", overrides=["solver.iterations=0", "garment.shape.edge_mm=60"], device="cpu")
    rests = [choice for choice in worn.report["choices"] if choice["key"] == "garment.rest"]
    assert [choice["value"] for choice in rests] == ["uv"]
    assert any("chosen" in line and "garment.rest = uv" in line for line in summary("tshirt", worn.report, []))


def test_the_shipped_shirt_is_cut_from_its_panels_on_any_body() -> None:
    """A small shirt drawn round a large body has other lengths there; they are not its own."""
    small = {"garment.shape": {"kind": "tshirt", "size": "S", "edge_mm": 40}}
    large = {"avatar.shape.chest": 1.15, "avatar.shape.waist": 1.1}
    lengths = [
        load_outfit(load_scene("tshirt", {**small, **body})).garments[0].rest.edge_length for body in ({}, large)
    ]
    assert lengths[0].sum() == pytest.approx(lengths[1].sum(), rel=0.01)
