"""Bibs above a waistband: sewn to its middle in front, their straps to it behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, band, bezier, line, trousers, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.kinds import named_all

BIB = {"bib": 1, "strap": 4, "waistband": 1, "waistband ends": 1}


def bib(name: str = "BIB", wide: float = 14.0) -> Drafted:
    side = bezier((wide, 0.0), (wide - 2.0, 8.0), (11.0, 18.0), (10.0, 24.0))
    edges = [line((0.0, 0.0), (wide, 0.0)), side, line((10.0, 24.0), (0.0, 24.0)), line((0.0, 24.0), (0.0, 0.0))]
    return Drafted(name, edges, "1", ((0.0, 24.0), (0.0, 0.0)))


def skirt(name: str) -> Drafted:
    side = bezier((28.0, 0.0), (28.0, 20.0), (27.0, 42.0), (19.0, 56.0))
    edges = [line((0.0, 0.0), (28.0, 0.0)), side, line((19.0, 56.0), (0.0, 55.0)), line((0.0, 55.0), (0.0, 0.0))]
    return Drafted(name, edges, "1", ((0.0, 55.0), (0.0, 0.0)))


@pytest.mark.parametrize("name", ["BIB", "Latz", "Bavette"])
def test_a_pinafore_is_sewn(name: str, tmp_path: Path) -> None:
    skirts = [skirt("SKIRT FRONT"), skirt("SKIRT BACK")]
    pieces = [*skirts, band("WAISTBAND", 76.0, 4.0), bib(name), band("STRAP", 75.0, 4.0, "2")]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    assert kinds(read_drafted(path)) == {"side": 2, **BIB}
    assert boundary_loops(path, DraftOptions()) == 4  # hem, either arm, and the neck


def test_dungarees_hold_their_bib_in_front(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*trousers(), bib(), band("STRAP", 80.0, 4.0, "2")]}))
    found = kinds(draft)
    assert all(found[kind] == count for kind, count in BIB.items())
    (waistband,) = (part for part in draft.parts if part.kind == "waistband")
    (front,) = waistband.roles["bib"]
    spots = [
        float(waistband.edges[k].at(np.array([0.5]))[0, 0]) for role in "-+" for k in waistband.roles[f"strap{role}"]
    ]
    legs = [part.shape.length(part.roles["waist"]) for part in draft.parts if part.kind in ("leg_front", "leg_back")]
    turn = waistband.shape.length(waistband.roles["long"]) / sum(legs)  # a band begins at a side seam
    assert waistband.edges[front].at(np.array([0.5]))[0, 0] == pytest.approx(turn * legs[0], abs=1e-3)
    behind = turn * (sum(legs) - legs[-1])
    assert spots == pytest.approx([behind - 0.08, behind + 0.08], abs=1e-3)


def test_a_bib_too_wide_for_the_front_is_not_sewn(tmp_path: Path) -> None:
    pieces = [*trousers(), bib(wide=34.0), band("STRAP", 80.0, 4.0, "2")]
    found = kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces})))
    assert not found["bib"]
    assert not found["strap"]


def test_a_bib_of_a_shirt_is_no_front_of_its_own() -> None:
    for names, kind in ((("BIB", "WAISTBAND"), "bib"), (("BIB", "LEG FRONT"), "front"), (("BIB", "FRONT"), "")):
        assert named_all([(name, "", "") for name in names])[0].kind == kind
