"""Strapless tops and dresses are worn under the arms; skirts whose pieces are named alike stay skirts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import Drafted, Point, band, bezier, line, write
from test_dxf import kinds

from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.drafted import drafted_pattern
from warp_cloth.pattern.figure import figure_of


def tube(name: str, *path: Point) -> Drafted:
    """Half a front or back on the fold: from its hem's middle round to its top's, of straight lines."""
    edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    return Drafted(name, edges, "1", (path[-1], path[0]))


def curved(name: str, middle: float) -> Drafted:
    """Half a dress with a curved side that is narrowest at the waist, and a top of this height in the middle."""
    side = bezier((32.0, 0.0), (22.0, 45.0), (15.0, 62.0), (23.0, 82.0))
    top = bezier((23.0, 82.0), (16.0, 84.0), (10.0, middle + 6.0), (0.0, middle))
    edges = [line((0.0, 0.0), (32.0, 0.0)), side, top, line((0.0, middle), (0.0, 0.0))]
    return Drafted(name, edges, "1", ((0.0, middle), (0.0, 0.0)))


def points(name: str) -> Drafted:
    return tube(name, (0.0, 0.0), (32.0, 0.0), (18.0, 62.0), (23.0, 82.0), (10.0, 88.0), (0.0, 84.0))


def both(*path: Point) -> list[Drafted]:
    return [tube(name, *path) for name in ("FRONT", "BACK")]


STRAPLESS = {
    "a top": [
        tube("FRONT", (0.0, 0.0), (22.0, 0.0), (24.0, 22.0), (0.0, 24.0)),
        tube("BACK", (0.0, 0.0), (22.0, 0.0), (24.0, 22.0), (0.0, 20.0)),
    ],
    "a bandeau": both((0.0, 0.0), (20.0, 0.0), (20.0, 18.0), (0.0, 18.0)),
    "a dress": [curved("FRONT", 84.0), curved("BACK", 80.0)],
    "points before and behind": [points("FRONT"), points("BACK")],
}
SKIRTS = {
    "a tube": both((0.0, 0.0), (20.0, 0.0), (20.0, 60.0), (0.0, 60.0)),
    "upside down": both((0.0, 0.0), (18.0, 0.0), (24.0, 32.0), (0.0, 32.0)),
    "a high waist": both((0.0, 0.0), (24.0, 0.0), (25.0, 40.0), (17.0, 60.0), (18.0, 68.0), (0.0, 68.0)),
}


@pytest.mark.parametrize("name", STRAPLESS)
def test_strapless_tops_are_worn_under_the_arms(name: str, tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": STRAPLESS[name]}))
    assert [part.kind for part in draft.parts] == ["front", "back"]
    assert kinds(draft) == {"side": 2}
    pattern = drafted_pattern(draft, None)
    for part, panel in zip(draft.parts, pattern.panels, strict=True):
        assert panel.wrap is not None
        high = part.edges[part.roles["side+"][-1]].end
        assert panel.wrap.placed(high[None])[0, 1] == pytest.approx(figure_of(None).armpit, abs=0.01)


@pytest.mark.parametrize("name", SKIRTS)
def test_skirts_stay_skirts(name: str, tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": SKIRTS[name]}))
    assert [part.kind for part in draft.parts] == ["skirt_front", "skirt_back"]


def mermaid(name: str) -> Drafted:
    """Half a skirt that is hollow at the knee, as the sides of a bodice are at the armhole."""
    side = bezier((30.0, 0.0), (14.0, 30.0), (26.0, 50.0), (17.0, 80.0))
    edges = [line((0.0, 0.0), (30.0, 0.0)), side, line((17.0, 80.0), (0.0, 80.0)), line((0.0, 80.0), (0.0, 0.0))]
    return Drafted(name, edges, "1", ((0.0, 80.0), (0.0, 0.0)))


@pytest.mark.parametrize("is_halved", [False, True])
def test_skirts_with_hollow_sides_are_no_bodices(is_halved: bool, tmp_path: Path) -> None:
    """Their waistband was sewn round their hems, which is no waist."""
    front, back = mermaid("FRONT"), mermaid("BACK")
    back = replace(back, quantity="2", fold=None) if is_halved else back
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, back, band("WAISTBAND", 68.0, 4.0)]}))
    middle = {"centre back": 1} if is_halved else {}
    assert kinds(draft) == {"side": 2, "waistband": 1, "waistband ends": 1, **middle}
    (around,) = (joint for joint in draft.joints if joint.reason.startswith("waistband,"))
    assert all(side.edge in draft.parts[side.panel].roles["waist"] for side in around.other)
