"""Skirts cut as parts of a ring: quarters and halves of a circle, however they lie in the drawing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, Point, band, line, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.drafted import drafted_pattern

WAIST, HEM = 12.5, 60.0  # [cm] radii
BAND = band("WAISTBAND", 2.0 * math.pi * WAIST * 0.99, 4.0)


def arc(radius: float, first: float, last: float) -> list[Point]:
    return [(radius * math.cos(a), radius * math.sin(a)) for a in np.radians(np.linspace(first, last, 41)).tolist()]


def quarter(name: str, quantity: str, on_fold: bool = False, first: float = 0.0) -> Drafted:
    inner, outer = arc(WAIST, first + 90.0, first), arc(HEM, first, first + 90.0)
    edges = [inner, line(inner[-1], outer[0]), outer, line(outer[-1], inner[0])]
    return Drafted(name, edges, quantity, (outer[-1], inner[0]) if on_fold else None)


SKIRTS = {
    "gores": [quarter("SKIRT", "4")],
    "aslant": [quarter("SKIRT", "4", first=200.0)],
    "folded": [quarter("SKIRT FRONT", "1", True), quarter("SKIRT BACK", "1", True)],
    "upside_down": [quarter(name, "1", True, 180.0) for name in ("SKIRT FRONT", "SKIRT BACK")],
    "pairs": [quarter("SKIRT FRONT", "1,1"), quarter("SKIRT BACK", "1,1")],
}
TRUE = {
    **{name: {"gore": 4} for name in ("gores", "aslant")},
    **{name: {"side": 2} for name in ("folded", "upside_down")},
    "pairs": {"side": 2, "centre front": 1, "centre back": 1},
}


@pytest.mark.parametrize("name", SKIRTS)
def test_a_circle_skirt_is_sewn_and_starts_as_a_cone_with_its_waist_on_top(name: str, tmp_path: Path) -> None:
    path = write(tmp_path / "round.dxf", {"M": [*SKIRTS[name], BAND]})
    draft = read_drafted(path)
    assert kinds(draft) == TRUE[name] | {"waistband": 1, "waistband ends": 1}
    assert boundary_loops(path, DraftOptions()) == 2
    pattern = drafted_pattern(draft, None)
    for stitch in pattern.stitches:  # seams start closed, and so the panels follow each other round the body
        ends = []
        for side in stitch.sides:
            curve = pattern.panels[side.panel].edges[side.edge].curve
            ends.append(pattern.panels[side.panel].placed(np.stack([curve.start, curve.end])))
        assert np.linalg.norm(ends[0] - ends[1][::-1], axis=1).max() < 0.2
    skirts = [panel for panel in pattern.panels if panel.name.startswith("SKIRT")]
    for part, panel in zip(draft.parts, skirts, strict=False):
        height = {
            role: np.mean([panel.placed(panel.edges[k].curve.at(np.array([0.5])))[0, 1] for k in part.roles[role]])
            for role in ("waist", "hem")
        }
        assert height["waist"] > height["hem"] + 0.4
