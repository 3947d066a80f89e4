"""The specification that `warp-cloth pattern` writes: the same garment again, and our mesh of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dxf_patterns import GARMENTS, STYLES, write
from test_fuzz_patterns import sound
from test_pattern import area_of, specification, topology
from test_pattern_seams import fish_eye

from warp_cloth.export.pattern_json import PER_METRE, meshed_specification
from warp_cloth.pattern import read_pattern, sewn_pattern
from warp_cloth.pattern.garmentcode import read_specification

EDGE = 0.03  # [m]; coarse, for speed


def again(tree: dict[str, Any]) -> Any:
    return sewn_pattern(read_specification("again.json", json.dumps(tree).encode()), "again", edge=EDGE)


def test_a_specification_is_written_as_it_was() -> None:
    first = sewn_pattern(read_specification("s.json", json.dumps(sound()).encode()), "s", edge=EDGE)
    second = again(meshed_specification(first))
    np.testing.assert_array_equal(second.mesh.triangles, first.mesh.triangles)
    np.testing.assert_allclose(second.mesh.points, first.mesh.points, atol=1e-9)
    assert second.mesh.notes == ()


def test_darts_within_panels_are_written_as_they_were() -> None:
    stitches = [("back", 4, "back", 7), ("back", 5, "back", 6)]
    spec = specification({"back": fish_eye(0.1)}, stitches)
    first = sewn_pattern(read_specification("s.json", spec), "s", edge=EDGE)
    second = again(meshed_specification(first))
    assert topology(second.mesh) == topology(first.mesh) == (1, 1)
    assert area_of(second.mesh) == pytest.approx(area_of(first.mesh), rel=1e-3)


@pytest.mark.parametrize("garment", GARMENTS)
def test_a_dxf_file_becomes_a_specification(garment: str, tmp_path: Path) -> None:
    path = write(tmp_path / f"{garment}.dxf", {"M": GARMENTS[garment](0.0)}, STYLES[garment])
    first = sewn_pattern(read_pattern(path), garment, edge=EDGE)
    second = again(meshed_specification(first))
    assert topology(second.mesh) == topology(first.mesh)
    assert area_of(second.mesh) == pytest.approx(area_of(first.mesh), rel=2e-3)
    middle, there = (np.mean(np.stack(each.mesh.bounds()), axis=0) for each in (first, second))
    assert np.linalg.norm(middle - there) < 0.1  # each panel lies flat where it was laid round the body


def test_the_mesh_is_ours(tmp_path: Path) -> None:
    path = write(tmp_path / "tshirt.dxf", {"M": GARMENTS["tshirt"](0.0)}, STYLES["tshirt"])
    sewn = sewn_pattern(read_pattern(path), "tshirt", edge=EDGE)
    written = json.loads(json.dumps(meshed_specification(sewn)))["mesh"]
    points = np.array(written["vertices"])
    np.testing.assert_allclose(points, PER_METRE * sewn.mesh.points)
    triangles = [
        np.array(panel["garment_vertex"])[np.array(panel["triangles"])] for panel in written["panels"].values()
    ]
    order = [np.flatnonzero(sewn.mesh.panels == index) for index in range(len(sewn.pattern.panels))]
    np.testing.assert_array_equal(np.concatenate(triangles), sewn.mesh.triangles[np.concatenate(order)])
    for seam in written["seams"]:  # both sides are one
        one, other = (
            np.array(written["panels"][side["panel"]]["garment_vertex"])[side["vertices"]] for side in seam["sides"]
        )
        np.testing.assert_array_equal(one, other)
