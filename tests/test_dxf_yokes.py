"""Tops with yokes in front and behind: dresses gathered below them, western shirts that open."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import Drafted, band, half_body, length, line, sleeve, write
from dxf_shirts import yoke_and_back
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.draft import Stated

YOKED = Counter({"shoulder": 2, "side": 2, "yoke": 2, "sleeve cap": 2, "underarm": 2})


def dress(wider: float, has_sleeves: bool = True, neck: float = 9.0, high: float = 13.0) -> list[Drafted]:
    """A dress, each half of it this much wider below its yokes; its neck is so deep, the yokes are so high [cm]."""
    pieces, armholes = [], []
    for name, depth in (("FRONT", neck), ("BACK", 2.5)):
        half = half_body(name, 25.0, 95.0, 8.0, depth, 19.5)
        armholes.append(length(half.edges[2]))
        yoke, under = yoke_and_back(half, high)
        hem, side, armhole, top, fold = under.edges
        corner = (hem[1][0] + wider, 0.0)
        moved = [[(x + wider, y) for x, y in edge] for edge in (side, armhole)]
        edges = [line(hem[0], corner), [corner, *moved[0][1:]], moved[1], line(moved[1][-1], top[-1]), fold]
        pieces += [replace(yoke, name=f"{name} YOKE"), replace(under, name=name, edges=edges)]
    return [*pieces, sleeve("SLEEVE", 17.0, 22.0, 15.0, *armholes)] if has_sleeves else pieces


@pytest.mark.parametrize("wider", [0.0, 5.0, 12.0])
def test_fronts_and_backs_are_sewn_to_their_yokes(wider: float, tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": dress(wider)})
    draft = read_drafted(path)
    assert kinds(draft) == YOKED
    assert not draft.unsewn
    assert boundary_loops(path, DraftOptions()) == 4


def test_a_neck_that_reaches_far_down_a_yoke_does_not_turn_it_upside_down(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": dress(0.0, neck=11.0, high=8.0)}))
    assert kinds(draft) == YOKED
    assert not draft.unsewn


def test_yokes_of_a_sleeveless_dress_tell_that_it_is_a_top(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": dress(5.0, has_sleeves=False)})
    assert kinds(read_drafted(path)) == Counter({"shoulder": 2, "side": 2, "yoke": 2})
    assert boundary_loops(path, DraftOptions()) == 4


def test_a_front_that_opens_has_a_yoke_on_either_side(tmp_path: Path) -> None:
    """As of a western shirt: the collar goes round the necks of three yokes."""
    front_yoke, front, back_yoke, back, arm = dress(0.0)
    halves = [replace(each, fold=None, quantity="1,1") for each in (front_yoke, front)]
    neck = 2.0 * (length(front_yoke.edges[3]) + length(back_yoke.edges[3]))
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*halves, back_yoke, back, arm, band("COLLAR", neck, 7.0)]}))
    assert kinds(draft) == YOKED + Counter({"yoke": 1, "collar": 1})


def test_a_yoke_in_front_of_a_skirt_is_not_of_a_top(tmp_path: Path) -> None:
    edges = band("", 20.0, 12.0).edges
    pieces = [Drafted(f"{face} {kind}", edges, "1") for face in ("FRONT", "BACK") for kind in ("SKIRT", "YOKE")]
    assert "front_yoke" not in {part.kind for part in read_drafted(write(tmp_path / "a.dxf", {"M": pieces})).parts}


def test_a_yoke_in_front_may_be_stated(tmp_path: Path) -> None:
    renamed = [replace(each, name=each.name.replace("FRONT YOKE", "PIECE A")) for each in dress(5.0)]
    path = write(tmp_path / "a.dxf", {"M": renamed})
    assert kinds(read_drafted(path, DraftOptions(pieces={"PIECE A": Stated("front_yoke")}))) == YOKED
