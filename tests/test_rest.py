"""Edges, hinges and rest lengths: of the mesh, of its panels, and of panels that are not all there."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest
from cloths import grid

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.rest import RestShape, build_rest_shape
from warp_cloth.garment.triangles import triangle_areas
from warp_cloth.loading.sizes import GUESS_NOTE
from warp_cloth.material.fabric import Fabric, shipped_fabrics

# Lengths and areas of a few operations on float64 numbers near 1.
ROUNDING = 1e-12
MESH = grid(9, 0.5)
PANEL = MESH.points[MESH.triangles][:, :, :2]
FABRICS = shipped_fabrics()


def rest_of(texcoords: np.ndarray, metres_per_uv: float = 1.0, fabric: Fabric | None = None) -> RestShape:
    mesh = replace(MESH, texcoords=texcoords)
    return build_rest_shape(mesh, fabric or Fabric(), rest="uv", metres_per_uv=metres_per_uv)


def two_panels(scale: float, *, mirrored: bool = False) -> Mesh:
    """A square of two triangles, each a panel of its own; the second ``scale`` times as large in texture space."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    texcoords = points[triangles][:, :, :2] * np.array([1.0, scale])[:, None, None] + np.array([[[5.0, 7.0]], [[0, 0]]])
    if mirrored:
        texcoords[1, :, 0] *= -1.0
    return Mesh("square", points, triangles, texcoords=texcoords)


def assert_finite(value: Any) -> None:
    for part in fields(value):
        inner = getattr(value, part.name)
        if is_dataclass(inner):
            assert_finite(inner)
        elif isinstance(inner, np.ndarray):
            assert np.isfinite(inner).all(), part.name


def test_edges_and_hinges_of_a_grid_are_counted_right() -> None:
    topology = build_topology(MESH.triangles, MESH.vertex_count)
    assert len(topology.edges) == 2 * 8 * 9 + 8 * 8  # rows and columns, diagonals
    assert len(topology.hinges) == len(topology.edges) - 4 * 8  # all but the boundary
    assert (topology.edges[:, 0] < topology.edges[:, 1]).all()
    for axis_start, axis_end, *wings in topology.hinges:
        for wing in wings:
            assert (np.isin(MESH.triangles, [axis_start, axis_end, wing]).sum(axis=1) == 3).sum() == 1


def test_areas_from_sides_hold_for_needles() -> None:
    sides = np.array([[3.0, 4.0, 5.0], [1.0, 1.0, 1e-9], [1.0, 2.0, 3.0], [0.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    assert triangle_areas(sides) == pytest.approx([6.0, 0.5e-9, 0.0, 0.0, np.sqrt(3.0)], rel=ROUNDING, abs=1e-20)


def test_rest_lengths_are_those_of_the_mesh_or_of_its_panels() -> None:
    as_mesh = build_rest_shape(MESH, Fabric(), rest="mesh")
    ends = MESH.points[as_mesh.topology.edges]
    assert as_mesh.edge_length == pytest.approx(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), rel=ROUNDING)
    half = rest_of(0.5 * PANEL)
    assert half.edge_length == pytest.approx(0.5 * as_mesh.edge_length, rel=ROUNDING)
    assert half.area == pytest.approx(0.25 * as_mesh.area, rel=ROUNDING)
    assert half.area == pytest.approx(0.0625, rel=ROUNDING)


@pytest.mark.parametrize("metres", [1.0, 0.01, 0.001, 0.0254])
def test_texture_coordinates_in_any_unit_give_the_same_rest_shape(metres: float) -> None:
    rest = rest_of(PANEL / metres, metres)
    assert rest.edge_length == pytest.approx(rest_of(PANEL).edge_length, rel=ROUNDING)
    assert rest.notes == ()


def test_an_edge_of_two_panels_takes_their_mean_length() -> None:
    rest = build_rest_shape(two_panels(1.3), Fabric(), rest="uv")
    seam = (rest.topology.edges == [0, 2]).all(axis=1)
    assert rest.edge_length[seam] == pytest.approx(1.15 * np.sqrt(2.0), rel=ROUNDING)
    assert np.sort(rest.edge_length[~seam]) == pytest.approx([1.0, 1.0, 1.3, 1.3], rel=ROUNDING)


@pytest.mark.parametrize("fabric", FABRICS)
def test_a_mirrored_panel_is_the_same_cloth(fabric: str) -> None:
    plain, mirrored = (
        build_rest_shape(two_panels(1.0, mirrored=mirror), FABRICS[fabric], rest="uv") for mirror in (False, True)
    )
    assert mirrored.area == plain.area
    assert mirrored.edge_length == pytest.approx(plain.edge_length, rel=ROUNDING)
    assert mirrored.hinge_stiffness == pytest.approx(plain.hinge_stiffness, rel=1e-6)


def test_weight_is_the_clothes_weight_shared_by_the_vertices() -> None:
    fabric = Fabric(weight=0.2)
    rest = rest_of(PANEL, fabric=fabric)
    assert rest.vertex_weight.sum() == pytest.approx(0.2 * 0.25 * 9.80665, rel=ROUNDING)
    assert np.ptp(rest.vertex_weight) == 0.0


@pytest.mark.parametrize(
    ("across", "up", "told"),
    [
        (0.4, 0.4, "0.4 times those in the mesh"),
        (4.0, 4.0, "4 times those in the mesh"),
        (0.6, 0.6, "0.6 times as long along u and 0.6 times along v"),
        (0.9, 1.0, "0.9 times as long along u and 1 times along v"),
    ],
)
def test_panels_of_an_odd_size_are_told_of(across: float, up: float, told: str) -> None:
    """Placed panels in the unit square are near their size where a garment's panels take about a metre."""
    (note,) = rest_of(PANEL * (across, up)).notes
    assert told in note
    assert "set garment.uv_units" in note


def test_panels_near_the_size_they_are_drawn_in_are_not_told_of() -> None:
    assert rest_of(PANEL * 1.01).notes == ()
    bent = MESH.points + np.sin(8.0 * MESH.points[:, :1]) * (0.0, 0.0, 0.1)  # as worn, much stretched here and there
    assert build_rest_shape(replace(MESH, points=bent, texcoords=PANEL), Fabric(), rest="uv").notes == ()
    bent = MESH.points + 0.1 * (bent - MESH.points)
    (note,) = build_rest_shape(replace(MESH, points=bent, texcoords=0.9 * PANEL), Fabric(), rest="uv").notes
    assert "and 0.9 times along v" in note


@pytest.mark.parametrize(("notes", "told"), [((GUESS_NOTE,), 'set garment.units = "in"'), ((), "garment.uv_units")])
def test_panels_tell_that_a_guessed_unit_is_another(notes: tuple[str, ...], told: str) -> None:
    """Taken for half a metre of centimetres, a sheet of that many inches has panels 2.54 times as large."""
    mesh = replace(MESH, texcoords=2.5 * PANEL, unit="cm", notes=notes)
    (note,) = build_rest_shape(mesh, Fabric(), rest="uv").notes
    assert told in note


@pytest.mark.parametrize(("scale", "told"), [(1.3, False), (1.4, False), (1.6, True), (0.5, True)])
def test_seams_of_very_different_lengths_are_told_of(scale: float, told: bool) -> None:
    """One panel in another scale; a sleeve that is eased in is none."""
    mesh = two_panels(scale)
    notes = build_rest_shape(mesh, Fabric(), rest="uv").notes
    assert any("times as long in one panel" in note for note in notes) == told


@pytest.mark.parametrize(
    ("across", "up", "told"),
    [(1.0, 1.4, ""), (1.0, 1.6, "1.6 times as long along v as along u"), (1.5, 0.5, "3 times")],
)
def test_texture_coordinates_squeezed_along_one_axis_are_told_of(across: float, up: float, told: str) -> None:
    notes = [note for note in rest_of(PANEL * (across, up)).notes if "texture space is" in note]
    assert bool(notes) == bool(told)
    assert told in "".join(notes)


@pytest.mark.parametrize("scale", [1e-3, 0.1, 7.0, 10.0, 39.37, 100.0, 1000.0])
def test_panels_in_the_wrong_unit_are_refused(scale: float) -> None:
    with pytest.raises(InputError, match=r"times those in the mesh .*set garment\.uv_units"):
        rest_of(scale * PANEL)


def test_long_seams_alone_are_no_wrong_unit() -> None:
    mesh = replace(MESH, texcoords=PANEL.copy())
    apart = mesh.points.copy()
    apart[: 4 * 9, 1] -= 3.0  # the row of quads between is a seam that starts 48 times too long
    rest = build_rest_shape(replace(mesh, points=apart), Fabric(), rest="uv")
    assert rest.notes == ()
    assert rest.edge_length == pytest.approx(rest_of(PANEL).edge_length, rel=ROUNDING)


@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("count", [1, 3, 6])
def test_a_few_triangles_without_panel_keep_their_lengths_in_the_mesh(count: int, fabric: str) -> None:
    texcoords = PANEL.copy()
    texcoords[:count] = texcoords[0, 0]
    rest = rest_of(texcoords, fabric=FABRICS[fabric])
    assert rest.edge_length == pytest.approx(rest_of(PANEL).edge_length, rel=ROUNDING)
    assert f"{count} of 128 triangles have no area in texture space" in rest.notes[0]
    assert_finite(rest)


def test_many_triangles_without_panel_are_refused() -> None:
    texcoords = PANEL.copy()
    texcoords[:20] = 0.0
    with pytest.raises(InputError, match="20 of 128 triangles have no area in texture space"):
        rest_of(texcoords)


@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_slivers_have_finite_constants(gap: float, fabric: str) -> None:
    points = MESH.points.copy()
    points[40] = points[41] + [0.0, 0.0, gap]  # a short edge, and thin triangles
    points[20, :2] = 0.5 * (points[21, :2] + points[11, :2]) + [gap, -gap]  # nearly on its neighbours' diagonal
    mesh = replace(MESH, points=points)
    for made in (mesh, replace(mesh, texcoords=points[mesh.triangles][:, :, :2])):
        for rest in ("mesh", "uv") if made.texcoords is not None else ("mesh",):
            shape = build_rest_shape(made, FABRICS[fabric], rest=rest)
            assert_finite(shape)
            assert (shape.edge_length > 0.0).all()
