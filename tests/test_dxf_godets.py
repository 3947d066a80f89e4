"""Skirts with godets, in side seams and in slits up from the hem."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, Style, bezier, line, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.proposal import SEWN_FROM

TALL = 25.0  # [cm] of a godet


def skirt(godets: int, has_slits: bool = False, marked: bool = True, notched: bool = False) -> list[Drafted]:
    """A skirt whose side seams end in edges as long as a godet, if ``marked``, or have a notch there, if ``notched``.

    ``has_slits``: a godet in each half, too.
    """
    pieces = []
    for face, waist in (("FRONT", 18.0), ("BACK", 17.5)):
        mark, top = (24.0, TALL), (waist, 61.0)
        hip = bezier(mark, (24.0, 42.0), (21.0, 52.0), top)
        hem, tip = [line((0.0, 0.0), (24.0, 0.0))], (12.0, math.sqrt(TALL**2 - 0.25))
        if has_slits:
            path = [(0.0, 0.0), (11.5, 0.0), tip, (12.5, 0.0), (24.0, 0.0)]
            hem = [line(a, b) for a, b in pairwise(path)]
        side = [line((24.0, 0.0), mark), hip] if marked else [[(24.0, 0.0), *hip]]
        edges = [*hem, *side, line(top, (0.0, 60.0)), line((0.0, 60.0), (0.0, 0.0))]
        pieces.append(Drafted(f"SKIRT {face}", edges, "1", ((0.0, 60.0), (0.0, 0.0)), [mark] if notched else []))
    angles = np.linspace(-0.4, 0.4, 20)
    arc = [(TALL * math.sin(a), TALL - TALL * math.cos(a)) for a in angles]
    wedge = [arc, line(arc[-1], (0.0, TALL)), line((0.0, TALL), arc[0])]
    return [*pieces, Drafted("GODET", wedge, str(godets))]


@pytest.mark.parametrize("has_slits", [False, True])
def test_a_godet_goes_into_each_seam_that_ends_at_the_hem_as_long(has_slits: bool, tmp_path: Path) -> None:
    count = 6 if has_slits else 2
    path = write(tmp_path / "a.dxf", {"M": skirt(count, has_slits)})
    draft = read_drafted(path)
    assert kinds(draft) == Counter({"side": 2, "godet": 2 * count})
    assert not draft.unsewn
    assert boundary_loops(path, DraftOptions()) == 2  # waist and hem


def test_a_notch_tells_where_a_godet_ends(tmp_path: Path) -> None:
    """Where another number of godets is cut, seams are left to the user as without one."""
    path = write(tmp_path / "a.dxf", {"M": skirt(2, marked=False, notched=True)}, Style(marks=False))
    assert kinds(read_drafted(path)) == {"side": 2, "godet": 4}
    assert boundary_loops(path, DraftOptions()) == 2
    assert not kinds(read_drafted(write(tmp_path / "b.dxf", {"M": skirt(3, marked=False, notched=True)})))


@pytest.mark.parametrize(("godets", "marked"), [(3, True), (2, False)])
def test_seams_that_a_godet_may_go_into_are_not_sewn_past_it(godets: int, marked: bool, tmp_path: Path) -> None:
    """Of three godets it is not told which seams they go into; nor where seams have no mark for them."""
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": skirt(godets, marked=marked)}))
    assert not {"side", "godet"} & {*kinds(draft)}
    assert {joint.reason.split(",")[0] for joint in draft.unsewn} == {"side"}
    assert all(joint.confidence < SEWN_FROM for joint in draft.unsewn)


def test_a_godet_is_no_gusset() -> None:
    assert [named(name).kind for name in ("GODET", "Zwickel", "Crotch Gusset")] == ["godet", "gusset", "gusset"]
