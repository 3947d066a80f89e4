"""Pieces set in between others, sleeves cut in one with a bodice, bands in two; codes and labels of strangers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, band, bezier, leggings, line, trousers, write
from dxf_sewn_in import SEWN_IN, TRUE_SEWN_IN, banded_skirt, hood_of_three, kimono, romper
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.drafted import drafted_pattern
from warp_cloth.pattern.dxf_drawn import Drawn
from warp_cloth.pattern.kinds import LEFT, RIGHT, SIDE_PANEL, named, named_all
from warp_cloth.pattern.labels import copies_of, name_of
from warp_cloth.pattern.levels import spans
from warp_cloth.pattern.panel_roles import legged_roles, yoked_roles
from warp_cloth.pattern.roles import Shape

OPENINGS = {"kimono": 4, "gusset": 4, "hood of three": 4, "tapered strip": 4, "waistband in two": 2, "romper": 5}


@pytest.mark.parametrize("garment", SEWN_IN)
def test_what_is_set_in_is_sewn_in_and_nothing_else_is(garment: str, tmp_path: Path) -> None:
    """All that is open then are neck, sleeves, waist and hem."""
    path = write(tmp_path / "set_in.dxf", {"M": SEWN_IN[garment]()})
    draft = read_drafted(path)
    assert kinds(draft) == TRUE_SEWN_IN[garment]
    assert min(joint.confidence for joint in draft.joints) >= 0.85
    assert boundary_loops(path, DraftOptions()) == OPENINGS[garment]


@pytest.mark.parametrize("with_gusset", [False, True])
def test_cuffs_go_round_the_ends_of_sleeves_cut_in_one(with_gusset: bool, tmp_path: Path) -> None:
    """They start there, where the sleeves lie straight out, and not at the end of a hanging arm."""
    path = write(tmp_path / "a.dxf", {"M": [*kimono(with_gusset), band("Polsino", 28.0, 6.0, "2")]})
    draft = read_drafted(path)
    garment = "gusset" if with_gusset else "kimono"
    assert kinds(draft) == {**TRUE_SEWN_IN[garment], "cuff": 2, "cuff ends": 2}
    assert boundary_loops(path, DraftOptions()) == OPENINGS[garment]
    panels = drafted_pattern(draft, None).panels
    for joint in (each for each in draft.joints if each.reason.startswith("cuff,")):
        middles = []
        for run in (joint.one, joint.other):
            wraps = [(panels[side.panel].wrap, draft.parts[side.panel].edges[side.edge].points) for side in run]
            middles.append(np.mean([wrap.placed(points).mean(axis=0) for wrap, points in wraps if wrap], axis=0))
        assert float(np.linalg.norm(middles[0] - middles[1])) < 0.01


def test_a_slit_is_no_dart_where_a_gusset_may_belong_into_it(tmp_path: Path) -> None:
    front, back, gusset = kimono(True)
    other = replace(gusset, edges=[[(1.5 * x, 1.5 * y) for x, y in edge] for edge in gusset.edges])
    assert not {"dart", "gusset"} & {*kinds(read_drafted(write(tmp_path / "a.dxf", {"M": [front, back, other]})))}
    assert kinds(read_drafted(write(tmp_path / "b.dxf", {"M": [front, back]})))["dart"] == 4


@pytest.mark.parametrize("made", [leggings, trousers])
def test_legs_are_not_closed_where_a_gusset_belongs(made: Callable[[], list[Drafted]], tmp_path: Path) -> None:
    gusset = Drafted(
        "GUSSET", [line((0, 7), (-4, 0)), line((-4, 0), (0, -7)), line((0, -7), (4, 0)), line((4, 0), (0, 7))]
    )
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*made(), gusset]}))
    assert not {"inseam", "front crotch", "back crotch"} & {*kinds(draft)}
    assert {"inseam", "front crotch", "back crotch"} <= {joint.reason.split(",")[0] for joint in draft.unsewn}


def test_halves_of_a_hood_are_not_sewn_to_each_other_where_a_strip_is(tmp_path: Path) -> None:
    pieces = hood_of_three()
    short = [[(x, 0.7 * y) for x, y in edge] for edge in pieces[-1].edges]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*pieces[:-1], replace(pieces[-1], edges=short)]}))
    assert not {"hood centre", "hood strip"} & {*kinds(draft)}


def test_of_two_waistbands_all_round_none_is_half_of_one(tmp_path: Path) -> None:
    *skirt, front, back = banded_skirt()
    long = [replace(each, edges=[[(2.0 * x, y) for x, y in edge] for edge in each.edges]) for each in (front, back)]
    assert "waistband" not in kinds(read_drafted(write(tmp_path / "a.dxf", {"M": [*skirt, *long]})))


def test_codes_of_panels_tell_together_what_they_are() -> None:
    def told(*names: str) -> list[tuple[str, int, str]]:
        return [(what.kind, what.side, what.panel) for what in named_all([(name, "", "") for name in names])]

    assert told("CF", "CB", "SF", "SB-2", "SLV") == [
        ("front", 0, ""), ("back", 0, ""), ("front", 0, SIDE_PANEL), ("back", 0, SIDE_PANEL), ("sleeve", 0, "")
    ]  # fmt: skip
    assert told("lf", "rf", "lb", "rb")[1:3] == [("front", RIGHT, ""), ("back", LEFT, "")]
    assert told("Front", "Back", "CF")[2][0] == "cuff"


@pytest.mark.parametrize(
    ("name", "kind", "side"),
    [
        ("lsl_f", "sleeve", LEFT),
        ("rsl_b", "sleeve", RIGHT),
        ("slv_bk", "sleeve", 0),
        ("r_leg_frt", "leg_front", RIGHT),
        ("bck", "back", 0),
        ("schouderpas", "yoke", 0),
        ("island_f", "front", 0),
    ],
)
def test_short_names(name: str, kind: str, side: int) -> None:
    """A sleeve's front and back are of the sleeve, whatever letter follows."""
    assert (named(name).kind, named(name).side) == (kind, side)


@pytest.mark.parametrize(
    ("label", "name", "copies"),
    [
        ("Knopfleiste 2x zuschneiden", "Knopfleiste", (1, 1)),
        ("Rückenteil 1x zuschneiden im Bruch", "Rückenteil", (1, 0)),
        ("Devant - couper 1 fois au pli", "Devant", (1, 0)),
        ("Cut 2 lining, 2 fabric", "piece", (1, 1)),
    ],
)
def test_a_label_of_one_line(label: str, name: str, copies: tuple[int, int]) -> None:
    drawn = Drawn("")
    drawn.state(label)
    assert (name_of(drawn), copies_of(drawn, drawn.texts)) == (name, copies)


def test_an_underarm_beside_a_straight_centre_is_no_fork() -> None:
    """Of a short bodice with deep armholes its corner is as low."""
    low = (0.0, 0.23)
    path = [low, (0.0, 0.0), (0.23, 0.0), (0.24, 0.13), (0.17, 0.35), (0.11, 0.38)]
    armhole = bezier(path[3], (0.18, 0.14), (0.15, 0.28), path[4])
    neck = bezier(path[5], (0.1, 0.27), (0.05, 0.23), low)
    edges = [line(*path[0:2]), line(*path[1:3]), line(*path[2:4]), armhole, line(*path[4:6]), neck]
    assert legged_roles(Shape(tuple(Chain(np.array(edge)) for edge in edges), np.array([0.0, 1.0]))) == {}
    front = [[(x / 100, y / 100) for x, y in edge] for edge in romper()[0].edges]
    assert "inseam" in legged_roles(Shape(tuple(Chain(np.array(edge)) for edge in front), np.array([0.0, 1.0])))


def test_levels_rise_where_the_one_that_is_asked_for_is_an_end() -> None:
    """As that of an underarm at the very top of a sleeve: what lies between two at one height would be nowhere."""
    corners = np.array([(0.0, 0.0), (0.2, 0.0), (0.2, 0.4), (0.0, 0.4), (0.0, 0.0)])
    edges = tuple(Chain(corners[k : k + 2]) for k in range(4))
    part = Part("A", edges, (0, 1, 2, 3), None, np.zeros((0, 2)), (), "", 0, np.array([0.0, 1.0]), {}, 1.0)
    for at in (0.0, 0.4, 0.25, None):
        levels = spans(part, at)[0]
        assert (np.diff(levels) > 0.0).all()
        assert at is None or np.abs(levels - at).min() == 0.0


def test_a_back_that_has_no_sides_below_its_yoke_has_no_roles_there() -> None:
    corners = np.array([(0.0, 0.0), (0.3, 0.0), (0.2, 0.05), (0.0, 0.4), (0.0, 0.0)])
    shape = Shape(tuple(Chain(corners[k : k + 2]) for k in range(4)), np.array([0.0, 1.0]))
    assert yoked_roles(shape, True) == {}
