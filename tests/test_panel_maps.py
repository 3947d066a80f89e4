"""Maps on flat panels: the panels as cut, in metres, and the worn garment; pictures of maps on them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom, UsdValidation
from test_pattern import BACK, FRONT, specification

from warp_cloth import fit
from warp_cloth.export.flat_panels import VERTEX, flat_panels
from warp_cloth.loading import load_mesh
from warp_cloth.maps.colour import colours
from warp_cloth.maps.kinds import MAPS
from warp_cloth.maps.read import read_fit
from warp_cloth.model.result import FitResult


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[FitResult, Path]:
    """A tube of two panels, hung by its upper edge, with its strain."""
    folder = tmp_path_factory.mktemp("panels")
    path = folder / "tube_specification.json"
    path.write_bytes(specification({"front": FRONT, "back": BACK}, [("front", 1, "back", 2), ("front", 3, "back", 0)]))
    garment = {"pattern": str(path), "edge_mm": 30, "pin": {"loop": "top"}, "fabric": "jersey"}
    result = fit({"garment": garment, "solver": {"iterations": 100}}, device="cpu", maps="strain")
    result.save(folder / "out")
    return result, folder / "out"


def test_panels_are_as_cut_and_their_vertices_those_of_the_garment(saved: tuple[FitResult, Path]) -> None:
    worn = saved[0].garments[0]
    flat = flat_panels(worn)
    np.testing.assert_array_equal(flat.vertex[flat.triangles], worn.mesh.triangles)
    np.testing.assert_allclose(flat.points[flat.triangles], worn.mesh.texcoords, atol=1e-9)
    seams = len(flat.points) - worn.mesh.vertex_count
    assert seams == 2 * 11  # both sides of two seams of 30 cm
    for panel in range(2):
        extent = np.ptp(flat.points[np.unique(flat.triangles[flat.panels == panel])], axis=0)
        np.testing.assert_allclose(extent, [0.3, 0.3], atol=1e-9)


def test_the_stage_has_the_panels_as_a_guide_with_the_maps(saved: tuple[FitResult, Path]) -> None:
    result, out = saved
    path = next(out.glob("*.usdc"))
    stage = Usd.Stage.Open(str(path))
    worn = result.garments[0]
    prim = next(prim for prim in stage.Traverse() if prim.GetName() == "tube_panels")
    surface = UsdGeom.Mesh(prim)
    assert surface.ComputePurpose() == UsdGeom.Tokens.guide
    place = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar(VERTEX).Get())
    indices = np.array(surface.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    np.testing.assert_array_equal(place[indices], worn.mesh.triangles)
    strain = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("strain").Get())
    np.testing.assert_array_equal(strain, worn.fields["strain"][place])
    assert {"front", "back"} <= {child.GetName() for child in prim.GetChildren()}
    st = np.array(UsdGeom.PrimvarsAPI(prim.GetParent().GetChild("tube_mesh")).GetPrimvar("st").Get())
    np.testing.assert_allclose(np.array(surface.GetPointsAttr().Get())[indices.ravel(), :2], st, atol=1e-7)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_the_stage_is_still_read_as_the_worn_garment(saved: tuple[FitResult, Path]) -> None:
    result, out = saved
    path = next(out.glob("*.usdc"))
    assert load_mesh(path, role="garment", key="garment").vertex_count == result.garments[0].mesh.vertex_count
    assert [len(worn.points) for worn in read_fit(out).garments] == [result.garments[0].mesh.vertex_count]


def test_maps_are_drawn_on_the_panels(saved: tuple[FitResult, Path]) -> None:
    result, out = saved
    assert set(result.maps.ranges) == {path.stem[4:-7] for path in out.glob("map_*_panels.png")}
    svg = (out / "map_strain_panels.svg").read_text()
    assert svg.count("M") > result.garments[0].mesh.triangle_count
    for words in ("front", "back", "largest strain", 'width="', "mm"):
        assert words in svg
    image = np.asarray(Image.open(out / "map_strain_panels.png")).reshape(-1, 3).astype(int)
    kind, bounds = MAPS["strain"], result.maps.ranges["strain"]
    middle = float(np.median(result.garments[0].fields["strain"]))
    wanted = np.round(255 * colours(kind, middle, bounds)).astype(int)
    near = (np.abs(image - wanted).max(axis=1) < 12).sum()
    assert near > 1000  # of the panels' 180,000 pixels, one a millimetre
    assert json.loads((out / "report.json").read_text())["maps"]["strain"]
