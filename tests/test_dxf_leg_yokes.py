"""Jeans: a yoke between each leg's back and the waistband."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_panelled import cut_at
from dxf_patterns import Drafted, length, line, trousers, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.proposal import SEWN_FROM

SEAMS = {"yoke": 2, "outseam": 2, "inseam": 2, "front crotch": 1, "back crotch": 1, "waistband": 1, "waistband ends": 1}


def jeans(centre: float = 0.25) -> list[Drafted]:
    """The trousers, their back cut across below the waist: at the side 0.06 down, and this much of the crotch seam."""
    front, back, band = trousers()
    hem, side, waist, crotch, inseam = back.edges
    low, high = cut_at(side, 0.94)
    upper, lower = cut_at(crotch, centre)
    across = line(low[-1], upper[-1])
    yoke = Drafted("BACK YOKE", [across[::-1], high, waist, upper], "1,1")
    under = replace(back, name="BACK", edges=[hem, low, across, lower, inseam], notches=[])
    return [replace(front, name="FRONT", notches=[]), under, yoke, band]


def flipped(piece: Drafted, across: bool, along: bool) -> Drafted:
    """The piece as it is drawn mirrored, or upside down."""
    x, y = (-1.0 if across else 1.0), (-1.0 if along else 1.0)
    edges = [[(x * a, y * b) for a, b in edge] for edge in piece.edges]
    return replace(piece, edges=[edge[::-1] for edge in edges[::-1]] if x * y < 0.0 else edges)


def check_all_sewn(path: Path) -> None:
    """That all seams of the jeans are found and sewn."""
    draft = read_drafted(path)
    assert kinds(draft) == SEAMS
    assert min(joint.confidence for joint in draft.joints) >= 0.9
    assert not draft.unsewn
    assert boundary_loops(path, DraftOptions()) == 3


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("along", [False, True])
def test_a_yoke_is_sewn_between_back_and_waistband(across: bool, along: bool, tmp_path: Path) -> None:
    """However it is drawn: which end is at the side, and which edge is the waist, lengths tell."""
    pieces = [flipped(each, across, along) if each.name == "BACK YOKE" else each for each in jeans()]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    check_all_sewn(path)


def whole_yoke() -> list[Drafted]:
    """The jeans with one yoke on the fold behind, its half as long at hem, waist, side and middle as one of a pair."""
    front, back, yoke, waistband = jeans()
    hem, side, waist, centre = (length(edge) for edge in yoke.edges)
    low, tip = (0.0, 0.0), (math.sqrt(hem**2 - 9.0), 3.0)  # a hem that rises by 3 cm to the side
    angles = np.linspace(0.3, 2.6, 4001)
    ends = np.array(tip) + side * np.column_stack([np.cos(angles), np.sin(angles)])
    x, y = ends[np.abs(np.hypot(ends[:, 0], ends[:, 1] - centre) - waist).argmin()]
    corners = [low, tip, (float(x), float(y)), (0.0, centre)]
    edges = [line(a, b) for a, b in zip(corners, [*corners[1:], low], strict=True)]
    return [front, back, Drafted("YOKE", edges, "1", ((0.0, centre), low)), waistband]


@pytest.mark.parametrize("along", [False, True])
def test_one_yoke_on_the_fold_goes_over_both_legs(along: bool, tmp_path: Path) -> None:
    pieces = whole_yoke()
    yoke = flipped(pieces[2], False, along)
    a, b = pieces[2].fold or ((0.0, 0.0), (0.0, 0.0))
    pieces[2] = replace(yoke, fold=((a[0], -a[1]), (b[0], -b[1])) if along else (a, b))
    path = write(tmp_path / "a.dxf", {"M": pieces})
    check_all_sewn(path)


def test_what_a_yoke_may_belong_between_is_not_sewn_past_it(tmp_path: Path) -> None:
    """Half a yoke that is cut once is not told: the back's top is not the waist, nor its side all of the side."""
    pieces = [replace(each, quantity="1") if each.name == "BACK YOKE" else each for each in jeans()]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert not {"waistband", "outseam"} & {*kinds(draft)}
    assert all(joint.confidence < SEWN_FROM for joint in draft.unsewn)
