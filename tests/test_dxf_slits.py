"""Slits that look like darts stay open until a person says so; a narrow pointed neckline is neither."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import Drafted, Point, half_body, line, write
from test_dxf import kinds

from warp_cloth.pattern import read_drafted

SEWN = {"shoulder": 2, "side": 2}


def necked(neck: list[Point], wide: float = 8.0) -> Drafted:
    """Half a body on the fold, its neckline of straight lines from the shoulder through these points to the fold."""
    piece = half_body("BACK", 25.0, 62.0, wide, 14.0, 19.0)
    *before, _, _ = piece.edges
    path = [before[-1][-1], *neck]
    edges = [*before, *(line(a, b) for a, b in zip(path, neck, strict=False)), line(neck[-1], (0.0, 0.0))]
    return Drafted("BACK", edges, "1", (neck[-1], (0.0, 0.0)))


def hemmed(name: str) -> Drafted:
    """Half a skirt on the fold, with a vent from the middle of its hem."""
    path = [(1.5, 0.0), (26.0, 0.0), (20.0, 55.0), (0.0, 55.0), (0.0, 20.0)]
    edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    return Drafted(name, edges, "1", (path[3], path[4]))


def test_a_keyhole_is_not_sewn_shut(tmp_path: Path) -> None:
    back = necked([(2.0, 58.0), (0.5, 57.0), (0.0, 48.0)])
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [half_body("FRONT", 25.0, 62.0, 8.0, 10.0, 19.0), back]}))
    assert kinds(draft) == SEWN
    assert [joint.reason.split(",")[0] for joint in draft.unsewn] == ["dart"]
    assert any("a slit that stays open" in note for note in draft.notes)


@pytest.mark.parametrize("wide", [3.0, 5.0])
def test_a_narrow_pointed_neckline_is_no_dart(wide: float, tmp_path: Path) -> None:
    back = necked([(0.0, 40.0)], wide)
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [half_body("FRONT", 25.0, 62.0, wide, 9.0, 19.0), back]}))
    assert kinds(draft) == SEWN
    assert not draft.unsewn


def test_a_vent_in_a_hem_is_not_sewn_shut(tmp_path: Path) -> None:
    pieces = [hemmed("SKIRT FRONT"), hemmed("SKIRT BACK")]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == {"side": 2}
    assert len(draft.unsewn) == 2
