"""Fronts and backs of briefs: hollow as bodices are, but for legs, and sewn at their crotches."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import Drafted, Point, band, bezier, half_body, length, line, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted

SEAMS = Counter({"side": 2, "crotch": 1})


def brief(name: str, rise: float, deep: float, crotch: float = 3.5, is_full: bool = False) -> Drafted:
    """Half of one on the fold; ``deep``: how far up its opening is hollow; ``is_full``: it is hardly hollow."""
    hip, waist, low = (25.0, rise - 8.0), (24.0, rise), (0.0, rise - 1.0)
    by = ((8.0, 3.0), (18.0, 18.0)) if is_full else ((crotch + 0.5, deep), (12.0, rise - 15.0))
    leg = bezier((crotch, 0.0), *by, hip)
    top = bezier(waist, (15.0, rise - 0.6), (7.0, low[1]), low)
    edges = [leg, line(hip, waist), top, line(low, (0.0, 0.0)), line((0.0, 0.0), (crotch, 0.0))]
    return Drafted(name, edges, "1", (low, (0.0, 0.0)))


def turned(piece: Drafted) -> Drafted:
    """The piece drawn upside down."""
    edges = [[(-x, -y) for x, y in edge] for edge in piece.edges]
    fold = None if piece.fold is None else ((0.0, -piece.fold[0][1]), (0.0, 0.0))
    return replace(piece, edges=edges, fold=fold)


def halved(piece: Drafted) -> Drafted:
    return replace(piece, fold=None, quantity="1,1")


@pytest.mark.parametrize("is_full", [False, True])
@pytest.mark.parametrize("is_turned", [False, True])
def test_openings_for_legs_are_no_armholes(is_turned: bool, is_full: bool, tmp_path: Path) -> None:
    """Before, it hung upside down from the shoulders, its crotch open, and was called worn."""
    pieces = [brief("SLIP DAVANTI", 30.0, 10.0), brief("SLIP DIETRO", 34.0, 5.0, is_full=is_full)]
    path = write(tmp_path / "a.dxf", {"M": [turned(each) for each in pieces] if is_turned else pieces})
    draft = read_drafted(path)
    assert kinds(draft) == SEAMS
    assert not draft.unsewn
    assert boundary_loops(path, DraftOptions()) == 3  # waist and legs


def test_briefs_of_halves_are_closed_in_the_middle(tmp_path: Path) -> None:
    pieces = [halved(brief("FRONT", 30.0, 10.0)), halved(brief("BACK", 34.0, 5.0))]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    assert kinds(read_drafted(path)) == SEAMS + Counter({"centre front": 1, "centre back": 1})
    assert boundary_loops(path, DraftOptions()) == 3


def test_a_gusset_goes_between_the_crotches(tmp_path: Path) -> None:
    pieces = [brief("FRONT", 28.0, 10.0), brief("BACK", 31.0, 5.0)]
    ring = 2.0 * sum(length(piece.edges[2]) for piece in pieces)
    path = write(tmp_path / "a.dxf", {"M": [*pieces, band("GUSSET", 7.0, 10.0), band("WAISTBAND", 0.9 * ring, 2.0)]})
    draft = read_drafted(path)
    assert kinds(draft) == Counter({"side": 2, "gusset": 2, "waistband": 1, "waistband ends": 1})
    assert boundary_loops(path, DraftOptions()) == 3


@pytest.mark.parametrize("crotches", [(3.5, 5.0), (8.0, 8.0)])
def test_what_may_be_a_halter_top_is_not_sewn(crotches: tuple[float, float], tmp_path: Path) -> None:
    """Narrow ends of two lengths, or as wide as the top of one."""
    pieces = [brief(name, 30.0, 10.0, crotch) for name, crotch in zip(("FRONT", "BACK"), crotches, strict=True)]
    assert not read_drafted(write(tmp_path / "a.dxf", {"M": pieces})).joints


@pytest.mark.parametrize("middle", [((4.0, 10.0), (25.5, 12.0)), ((3.6, 16.0), (25.0, 12.0))])
def test_openings_without_a_corner_at_the_side_are_not_sewn_up(middle: tuple[Point, Point], tmp_path: Path) -> None:
    """Before, they were sides of a skirt, and briefs a bag with an opening of 7 cm below."""
    pieces = []
    for name, rise in (("FRONT", 30.0), ("BACK", 33.0)):
        plain = brief(name, rise, 10.0)
        leg = bezier((3.5, 0.0), *middle, (25.0, rise - 8.0))
        pieces.append(replace(plain, edges=[leg, line(leg[-1], plain.edges[1][-1]), *plain.edges[2:]]))
    assert not read_drafted(write(tmp_path / "a.dxf", {"M": pieces})).joints


def test_a_name_tells_wide_crotches(tmp_path: Path) -> None:
    pieces = [brief("NAPPY FRONT", 30.0, 10.0, 8.0), brief("NAPPY BACK", 30.0, 10.0, 8.0)]
    assert kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))) == SEAMS


def test_a_neck_tells_a_bodice(tmp_path: Path) -> None:
    """A halter's front is as narrow at its top; its back has shoulders."""
    front, back = turned(brief("FRONT", 60.0, 40.0)), half_body("BACK", 25.0, 60.0, 8.0, 3.0, 19.0)
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, back]}))
    assert [part.kind for part in draft.parts] == ["front", "back"]
