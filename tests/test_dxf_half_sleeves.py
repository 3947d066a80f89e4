"""Sleeves of a front and a back half, parted along the top of the arm: raglan and set in."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from dxf_panelled import cut_at
from dxf_patterns import TRUE_SEAMS, Drafted, band, bezier, hooded, line, raglan, write
from test_dxf import boundary_loops, kinds
from test_dxf_leg_yokes import flipped

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.draft import Stated

RAGLAN = Counter({"side": 2, "raglan": 4, "overarm": 2, "underarm": 2, "collar": 1, "collar ends": 1})


def parted(shaped: bool, names: tuple[str, str] = ("FRONT SLEEVE", "BACK SLEEVE")) -> list[Drafted]:
    """The raglan, its sleeves cut along the arm; ``shaped``: with a corner at the shoulder."""
    front, back, sleeve, band = raglan()
    _, under, behind, opening, ahead, under_front = sleeve.edges
    ahead_of, behind_of = cut_at(opening, 0.5)[::-1]
    neck, wrist = ahead_of[0], (0.0, 0.0)

    def over(sign: float) -> list[list[tuple[float, float]]]:
        tip = (sign * 1.5, 50.0)
        if shaped:
            return [line(neck, (sign * 4.5, 56.0)), line((sign * 4.5, 56.0), wrist)]
        return [[*bezier(neck, (neck[0] + 0.5 * sign, 60.0), tip, (0.0, 30.0)), wrist]]

    ahead_half = [line((-11.0, 0.0), wrist), *(edge[::-1] for edge in over(-1.0)[::-1]), ahead_of, ahead, under_front]
    behind_half = [line(wrist, (11.0, 0.0)), under, behind, behind_of, *over(1.0)]
    return [front, back, Drafted(names[0], ahead_half, "2"), Drafted(names[1], behind_half, "2"), band]


@pytest.mark.parametrize("shaped", [False, True])
@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("along", [False, True])
def test_halves_of_a_raglan_are_sewn(shaped: bool, across: bool, along: bool, tmp_path: Path) -> None:
    """However they are drawn; on which side each is worn, the seam beneath the arm tells."""
    pieces = [flipped(each, across, along) if "SLEEVE" in each.name else each for each in parted(shaped)]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    draft = read_drafted(path)
    assert kinds(draft) == RAGLAN
    assert min(joint.confidence for joint in draft.joints) >= 0.95
    assert not draft.unsewn
    assert boundary_loops(path, DraftOptions()) == 4


def test_halves_of_sleeves_that_are_set_in_have_cuffs(tmp_path: Path) -> None:
    front, back, sleeve, hood, cuff, hem, _ = hooded()
    wrist, under, cap, under_front = sleeve.edges
    top = max(cap, key=lambda point: point[1])
    behind, ahead = cap[: cap.index(top) + 1], cap[cap.index(top) :]
    halves = [
        Drafted("Vorderärmel", [line(wrist[0], (0.0, 0.0)), line((0.0, 0.0), top), ahead, under_front], "2"),
        Drafted("Hinterärmel", [line((0.0, 0.0), wrist[1]), under, behind, line(top, (0.0, 0.0))], "2"),
    ]
    path = write(tmp_path / "a.dxf", {"M": [front, back, *halves, hood, cuff, hem]})
    found = kinds(read_drafted(path))
    assert found == Counter(TRUE_SEAMS["hooded"]) + Counter({"overarm": 2, "sleeve cap": 2})
    assert boundary_loops(path, DraftOptions()) == 4


def test_halves_may_be_stated_and_one_alone_is_no_half(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": parted(False, ("A", "B"))})
    stated = {"A": Stated("front_sleeve"), "B": Stated("back_sleeve")}
    assert kinds(read_drafted(path, DraftOptions(pieces=stated))) == RAGLAN
    front, back, sleeve, neck = raglan()
    draft = read_drafted(write(tmp_path / "b.dxf", {"M": [front, back, replace(sleeve, name="SLEEVE FRT"), neck]}))
    assert kinds(draft) == TRUE_SEAMS["raglan"]


def test_a_cuff_goes_round_both_halves(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*parted(True), band("CUFF", 20.0, 6.0, "2")]}))
    assert kinds(draft) == RAGLAN + Counter({"cuff": 2, "cuff ends": 2})
