"""Fronts and backs that end between the legs, like those of bodysuits and swimsuits."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, bezier, half_body, line, write
from test_dxf import boundary_loops, kinds
from test_dxf_leg_yokes import flipped

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.bodices import arm_side, bodice_roles
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.leg_openings import CROTCH_UP_TO, with_leg_openings
from warp_cloth.pattern.roles import Shape

SEAMS = Counter({"shoulder": 2, "side": 2, "crotch": 1})


def bodysuit(is_flat: bool = False) -> list[Drafted]:
    """``is_flat``: its openings run out more than up, as far as the hip is wide."""
    pieces = []
    for name, depth, inner in (("FRONT", 11.0, (5.0, -22.0)), ("BACK", 5.0, (9.0, -27.0))):
        _, side, armhole, shoulder, neck, _ = half_body(name, 26.0, 44.0, 8.0, depth, 17.0).edges
        crotch, hip, centre = (3.5, -31.0), (26.0, -14.0 if is_flat else -4.0), (0.0, -31.0)
        leg = bezier(crotch, inner, (inner[0] + 9.0, inner[1] + 9.0), hip)
        up = bezier(hip, (25.0, 2.0), (22.0, 8.0), side[1])
        edges = [line(centre, crotch), leg, up, armhole, shoulder, neck, line(neck[-1], centre)]
        pieces.append(Drafted(name, edges, "1", (neck[-1], centre)))
    return pieces


@pytest.mark.parametrize("is_halved", [False, True])
@pytest.mark.parametrize("across", [False, True])
def test_openings_for_legs_stay_open(is_halved: bool, across: bool, tmp_path: Path) -> None:
    """Sides end at the hip; before, they were sewn down to the crotch, and legs had no way out."""
    front, back = (flipped(each, across, False) if is_halved else each for each in bodysuit())
    back = replace(back, fold=None, quantity="1,1") if is_halved else back
    path = write(tmp_path / "a.dxf", {"M": [replace(front, fold=None, quantity="1,1") if is_halved else front, back]})
    found = kinds(read_drafted(path))
    assert found == (Counter({"shoulder": 2, "side": 2, "crotch": 2, "centre back": 1}) if is_halved else SEAMS)
    assert boundary_loops(path, DraftOptions()) == 5  # neck, arms and legs; an open front is one with the neck


def test_the_crotch_ends_at_corners_where_openings_run_flat(tmp_path: Path) -> None:
    """They were taken for the hem with it, which is too wide for a crotch, and nothing was sewn there."""
    path = write(tmp_path / "a.dxf", {"M": bodysuit(is_flat=True)})
    assert kinds(read_drafted(path)) == SEAMS
    assert boundary_loops(path, DraftOptions()) == 5


def test_a_side_that_runs_out_to_the_bust_is_not_of_the_opening(tmp_path: Path) -> None:
    """Such as a swimsuit, wider at the bust than at the hip; the openings were sewn shut down to the crotch."""
    pieces = []
    for name, depth, inner in (("FRONT", 14.0, 8.0), ("BACK", 20.0, 15.0)):
        crotch, hip, under, tip, high = (4.0, 0.0), (20.0, 20.0), (21.0, 42.0), (9.5, 62.0), (7.0, 62.0)
        leg, low = bezier(crotch, (5.0, 8.0), (inner, 14.0), hip), (0.0, 62.0 - depth)
        sides = [bezier(hip, (17.0, 28.0), (18.0, 36.0), under), bezier(under, (14.0, 43.0), (11.0, 48.0), tip)]
        neck = bezier(high, (6.0, low[1] + 3.0), (4.0, low[1]), low)
        edges = [line((0.0, 0.0), crotch), leg, *sides, line(tip, high), neck, line(low, (0.0, 0.0))]
        pieces.append(Drafted(name, edges, "1", (low, (0.0, 0.0))))
    path = write(tmp_path / "a.dxf", {"M": pieces})
    assert kinds(read_drafted(path)) == SEAMS
    assert boundary_loops(path, DraftOptions()) == 5


def test_a_pointed_hem_is_no_crotch() -> None:
    half = half_body("FRONT", 26.0, 60.0, 8.5, 9.5, 22.0)
    _, side, *others, centre = half.edges
    point = (8.0, -8.0)
    edges = [line((0.0, 0.0), point), line(point, side[0]), side, *others, centre]
    shape = Shape(tuple(Chain(0.01 * np.array(edge)) for edge in edges), np.array([0.0, 1.0]))
    assert "crotch" not in with_leg_openings(shape, bodice_roles(shape, False, arm_side), False)


def test_a_small_top_that_is_narrow_at_its_hem_has_none() -> None:
    """As a doll's: its sides run up straight."""
    half = half_body("FRONT", 26.0, 70.0, 8.5, 9.5, 22.0)
    shape = Shape(tuple(Chain(0.0035 * np.array(edge)) for edge in half.edges), np.array([0.0, 1.0]))
    roles = bodice_roles(shape, False, arm_side)
    assert shape.length(roles["hem"]) < 0.5 * CROTCH_UP_TO
    assert with_leg_openings(shape, roles, False) == roles
