"""Corners that turn by little are found in outlines without marks: lines alone, as simple programs write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dxf_everyday import EVERYDAY
from dxf_panelled import PANELLED
from dxf_patterns import Drafted, Style, bezier, line, write
from dxf_sewn_in import SEWN_IN
from test_dxf import kinds

from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.marks import NO_POINTS, corners_of

LINES = Style("METRIC", entity="LINE", marks=False, allowance=1.0)
GARMENTS = {
    name: made[name]
    for made, name in (
        (EVERYDAY, "wrapped top"),
        (EVERYDAY, "dropped shoulders"),
        (PANELLED, "princess"),
        (PANELLED, "side_panelled"),
        (SEWN_IN, "gusset"),
    )
}


@pytest.mark.parametrize("name", GARMENTS)
def test_seams_are_those_of_the_file_with_marks(name: str, tmp_path: Path) -> None:
    """Necks that run into a front's end, straight armholes above straight sides, princess seams, slits."""
    pieces: list[Drafted] = GARMENTS[name]()
    marked = read_drafted(write(tmp_path / "marked.dxf", {"M": pieces}))
    assert kinds(read_drafted(write(tmp_path / "lines.dxf", {"M": pieces}, LINES))) == kinds(marked)


@pytest.mark.parametrize(("corner", "is_one"), [((30.0, 40.0), False), ((31.0, 40.0), True), ((36.0, 40.0), True)])
def test_ruled_sides_meet_in_corners(corner: tuple[float, float], is_one: bool) -> None:
    loop = 0.01 * np.array([(0.0, 0.0), (30.0, 0.0), corner, (30.0, 80.0), (0.0, 80.0)])
    assert (2 in corners_of(loop, {}, NO_POINTS)) is is_one


@pytest.mark.parametrize("count", [8, 24, 100])
def test_curves_have_none(count: int) -> None:
    """Also where they bend ever more: an armhole's, of whose points each turns as much as those beside it."""
    curve = bezier((25.0, 40.0), (20.0, 39.5), (18.5, 50.0), (19.0, 62.0), count)
    path = [*line((0.0, 0.0), (25.0, 0.0)), *curve, (0.0, 62.0)]
    corners = corners_of(0.01 * np.array(path), {}, NO_POINTS)
    assert [k for k in corners if 2 < k < len(path) - 2] == []
