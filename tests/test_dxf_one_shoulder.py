"""Tops with one shoulder are sewn as they are drawn, and what slants as they do is never mirrored."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import Drafted, bezier, half_body, line, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted

SEWN = {"shoulder": 1, "side": 2}


def asymmetric(name: str, is_hollow: bool, long: float = 38.0) -> Drafted:
    """A whole front with its shoulder at +x, on straight lines or cut out for arm and neck."""
    under, tip, high, low = (25.0, 38.0), (19.0, 57.0), (10.0, 60.0), (-25.0, long)
    arm = bezier(under, (18.0, 39.0), (16.0, 50.0), tip) if is_hollow else line(under, tip)
    neck = bezier(high, (6.0, 45.0), (-10.0, 39.0), low) if is_hollow else line(high, low)
    foot = ((-25.0, 0.0), (25.0, 0.0))
    return Drafted(name, [line(*foot), line(foot[1], under), arm, line(tip, high), neck, line(low, foot[0])])


def mirrored(piece: Drafted, name: str) -> Drafted:
    return replace(piece, name=name, edges=[[(-x, y) for x, y in edge[::-1]] for edge in piece.edges[::-1]])


@pytest.mark.parametrize("is_hollow", [False, True])
@pytest.mark.parametrize("is_on_left", [False, True])
def test_one_shoulder_is_sewn_once(is_hollow: bool, is_on_left: bool, tmp_path: Path) -> None:
    pieces = [asymmetric("FRONT", is_hollow), mirrored(asymmetric("", is_hollow), "BACK")]
    if not is_on_left:
        pieces = [mirrored(piece, piece.name) for piece in pieces]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    draft = read_drafted(path)
    assert [part.kind for part in draft.parts] == ["front", "back"]
    assert kinds(draft) == SEWN
    assert boundary_loops(path, DraftOptions()) == 3  # hem, arm, and neck with the other arm


@pytest.mark.parametrize("is_hollow", [False, True])
def test_what_does_not_fit_is_neither_mirrored_nor_sewn(is_hollow: bool, tmp_path: Path) -> None:
    """A back with its shoulder on the other side, or with a side of its own length."""
    for back in (asymmetric("BACK", is_hollow), mirrored(asymmetric("", is_hollow, 34.0), "BACK")):
        draft = read_drafted(write(tmp_path / "a.dxf", {"M": [asymmetric("FRONT", is_hollow), back]}))
        assert not draft.joints
        assert not any("mirrored" in note for note in draft.notes)


def slanted(name: str, depth: float, rise: float) -> Drafted:
    """A whole front or back whose hem is higher on one side."""
    upper = half_body(name, 25.0, 62.0, 8.0, depth, 19.0).edges[1:5]
    other = [[(-x, y) for x, y in edge[::-1]] for edge in upper[::-1]]
    right, left = (25.0, -rise), (-25.0, rise)
    upper[0], other[-1] = line(right, upper[0][-1]), line(other[-1][0], left)
    return Drafted(name, [line(left, right), *upper, *other])


@pytest.mark.parametrize("rise", [-10.0, 10.0])
def test_a_whole_piece_with_a_slanting_hem_is_not_mirrored(rise: float, tmp_path: Path) -> None:
    pieces = [slanted("FRONT", 10.0, rise), slanted("BACK", 2.5, -rise)]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert not draft.joints
    assert not any("mirrored" in note for note in draft.notes)


@pytest.mark.parametrize(("wide", "depth"), [(8.0, 2.5), (16.0, 8.0)])
def test_half_a_back_is_mirrored(wide: float, depth: float, tmp_path: Path) -> None:
    front, back = half_body("FRONT", 25.0, 62.0, wide, 10.0, 21.0), half_body("BACK", 25.0, 62.0, wide, depth, 21.0)
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, replace(back, fold=None)]}))
    assert kinds(draft) == {"shoulder": 2, "side": 2}


def test_crossed_fronts_with_a_slanting_neckline_are_sewn(tmp_path: Path) -> None:
    front, back = (half_body(name, 25.0, 62.0, 8.0, depth, 19.0) for name, depth in (("FRONT", 10.0), ("BACK", 2.5)))
    low, foot = (-20.0, 10.0), (-20.0, 0.0)
    edges = [line(foot, (25.0, 0.0)), *front.edges[1:4], line((8.0, 62.0), low), line(low, foot)]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [Drafted("FRONT", edges, "2"), back]}))
    assert kinds(draft) == {"shoulder": 2, "side": 2}
