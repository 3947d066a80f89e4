"""Straps: sewn from the top of the front to the top of the back where these say at which place, and else to nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_everyday import EVERYDAY
from dxf_patterns import Drafted, Style, band, bezier, half_body, line, trousers, tshirt, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.drafted import Draft, drafted_pattern
from warp_cloth.pattern.joints import StatedSeam, side_text
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.straps import STRAP

LEFT_AND_RIGHT = {"side": 2, "strap": 4}
POINTS = (("FRONT", 95.0, 9.0), ("BACK", 89.0, 5.0))
FOLD = ((0.0, 1.0), (0.0, 0.0))


def hollow(name: str, top: float, depth: float, tip: float = 1.2) -> Drafted:
    """Half a camisole with a short edge at its top, hollow at neck and arm."""
    under, low = (23.0, 32.0), (0.0, top - depth)
    outer, inner = (9.0 + 0.5 * tip, top), (9.0 - 0.5 * tip, top)
    arm = bezier(under, (18.0, 33.0), (11.0, top - 6.0), outer)
    neck = bezier(inner, (7.0, top - 0.7 * depth), (4.0, low[1]), low)
    edges = [
        line((0.0, 0.0), (23.0, 0.0)),
        line((23.0, 0.0), under),
        arm,
        line(outer, inner),
        neck,
        line(low, (0.0, 0.0)),
    ]
    return Drafted(name, edges, "1", (low, (0.0, 0.0)))


def pointed(name: str, top: float, depth: float) -> Drafted:
    """Half a slip of straight lines, whose front ends in a point without an edge."""
    path = [(0.0, 0.0), (32.0, 0.0), (23.0, 83.0), (9.0, top), (0.0, top - depth)]
    edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    return Drafted(name, edges, "1", (path[-1], path[0]))


def straight(name: str) -> Drafted:
    path = [(0.0, 0.0), (23.0, 0.0), (23.0, 32.0), (0.0, 32.0)]
    edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    return Drafted(name, edges, "1", (path[-1], path[0]))


STRAPPY: dict[str, list[Drafted]] = {
    "a camisole": [hollow("FRONT", 44.0, 7.0), hollow("BACK", 38.0, 2.0), band("STRAP", 36.0, 1.2, "2")],
    "two files' names": [
        hollow("TOP VT", 44.0, 7.0), hollow("TOP RT", 38.0, 2.0),
        band("Träger links", 1.2, 36.0), band("Träger rechts", 1.2, 36.0),
    ],
    "a slip": [*(pointed(*point) for point in POINTS), band("STRAP", 36.0, 0.8, "2")],
    "level behind": [hollow("FRONT", 44.0, 7.0), straight("BACK"), band("STRAP", 40.0, 1.0, "2")],
}  # fmt: skip


@pytest.mark.parametrize("name", STRAPPY)
def test_straps_join_the_front_to_the_back(name: str, tmp_path: Path) -> None:
    for style in (Style(), Style("ENGLISH", turned=90.0, allowance=1.0, entity="LWPOLYLINE")):
        path = write(tmp_path / "a.dxf", {"M": STRAPPY[name]}, style)
        assert kinds(read_drafted(path)) == LEFT_AND_RIGHT
        assert boundary_loops(path, DraftOptions()) == 4  # hem, neck and two arms


def test_straps_hold_up_bibs(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": [*EVERYDAY["overalls"](), band("STRAP", 45.0, 4.0, "2")]})
    draft = read_drafted(path)
    assert kinds(draft)["strap"] == 4
    assert not any("folds down" in note for note in draft.notes)


def _seams_apart(draft: Draft) -> float:
    """How far apart the middles of strap seams start, at most [m]."""
    pattern = drafted_pattern(draft, None)
    apart = []
    for stitch in pattern.stitches:
        if any(draft.parts[side.panel].kind == STRAP for side in stitch.sides):
            spots = []
            for side in stitch.sides:
                panel = pattern.panels[side.panel]
                assert panel.wrap is not None
                spots.append(panel.wrap.placed(panel.edges[side.edge].curve.at(np.array([0.5])))[0])
            apart.append(float(np.linalg.norm(spots[0] - spots[1])))
    assert len(apart) >= 4
    return max(apart)


def test_straps_start_over_the_shoulders(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": STRAPPY["a camisole"]})
    draft = read_drafted(path)
    assert _seams_apart(draft) < 0.01


@pytest.mark.parametrize("way", [1, -1])
def test_stated_seams_of_straps_may_name_either_side_first(way: int, tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": STRAPPY["a camisole"]})
    parts, joints = read_drafted(path).parts, read_drafted(path).joints
    sewn = [(side_text(parts, joint.one), side_text(parts, joint.other)) for joint in joints]
    stated = tuple(StatedSeam(sides[::way]) for sides in sewn)
    assert _seams_apart(read_drafted(path, DraftOptions(seams=stated))) < 0.01


def test_a_notch_says_where_a_strap_ends_behind(tmp_path: Path) -> None:
    front, back, strap = STRAPPY["level behind"]
    sure = {}
    for notches in ((), ((7.0, 32.0),)):
        marked = Drafted(back.name, back.edges, back.quantity, back.fold, [*notches])
        draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, marked, strap]}))
        (joint, *_) = [
            j for j in draft.joints if j.reason.startswith("strap") and draft.parts[j.other[0].panel].kind == "back"
        ]
        part = draft.parts[joint.other[0].panel]
        across = np.concatenate([part.edges[side.edge].points[:, 0] for side in joint.other])
        sure[bool(notches)] = joint.confidence, abs(float(across.mean()))
    assert sure[True][0] > sure[False][0] >= 0.75
    assert sure[True][1] == pytest.approx(0.07, abs=2e-3)
    assert sure[False][1] == pytest.approx(0.09, abs=2e-3)


def test_what_has_shoulders_hangs_from_no_straps(tmp_path: Path) -> None:
    front, back, *_ = tshirt()
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, back, band("SHOULDER STRAP", 12.0, 4.0, "2")]}))
    assert kinds(draft) == {"shoulder": 2, "side": 2}


def level(name: str, top: float, depth: float) -> Drafted:
    """Half a camisole with a V neckline that ends at a level edge of 4 cm."""
    under, outer, inner, low = (23.0, 34.0), (11.0, top), (7.0, top), (0.0, top - depth)
    arm = bezier(under, (17.0, 35.0), (13.0, 40.0), outer)
    sides = line((0.0, 0.0), (23.0, 0.0)), line((23.0, 0.0), under)
    edges = [*sides, arm, line(outer, inner), line(inner, low), line(low, (0.0, 0.0))]
    return Drafted(name, edges, "1", (low, (0.0, 0.0)))


@pytest.mark.parametrize("wide", [1.5, 2.0, 4.0])
def test_a_strap_is_sewn_on_the_middle_of_a_wider_end(wide: float, tmp_path: Path) -> None:
    """Too low for shoulders, so that the edges are not sewn to each other."""
    pieces = [level("FRONT", 48.0, 16.0), level("BACK", 46.0, 8.0), band("STRAP", 20.0, wide, "2")]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == LEFT_AND_RIGHT
    for part in draft.parts[:2]:
        (edge,) = part.roles["strap+"]
        assert abs(float(part.edges[edge].points[:, 0].mean())) == pytest.approx(0.09, abs=1e-3)


@pytest.mark.parametrize("wide", [3.0, 6.0])
def test_tabs_on_shoulders_are_no_straps(wide: float, tmp_path: Path) -> None:
    bodies = [half_body(name, 24.0, 60.0, 8.0, depth, 14.0) for name, depth in (("FRONT", 14.0), ("BACK", 6.0))]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*bodies, band("STRAP", 8.0, wide, "2")]}))
    assert kinds(draft) == {"shoulder": 2, "side": 2}


@pytest.mark.parametrize("pieces", [[hollow("FRONT", 44.0, 7.0), hollow("BACK", 38.0, 2.0)],
                                    [level("FRONT", 48.0, 16.0), level("BACK", 46.0, 8.0)]])  # fmt: skip
def test_ends_below_the_shoulder_are_not_sewn_to_each_other(pieces: list[Drafted], tmp_path: Path) -> None:
    """The straps, or ties, are of no piece."""
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == {"side": 2}
    assert [joint.reason.split(",")[0] for joint in draft.unsewn] == ["shoulder", "shoulder"]


def test_an_underband_goes_round_the_hem(tmp_path: Path) -> None:
    pieces = [hollow("FRONT", 44.0, 7.0), hollow("BACK", 38.0, 2.0), band("UNDERBAND", 72.0, 4.0)]
    found = kinds(read_drafted(write(tmp_path / "a.dxf", {"M": [*pieces, band("STRAP", 36.0, 1.2, "2")]})))
    assert found == LEFT_AND_RIGHT | {"hem band": 1, "hem_band ends": 1}


def test_straps_of_a_level_top_before_and_behind_are_asked_for(tmp_path: Path) -> None:
    pieces = [straight("FRONT"), straight("BACK"), band("STRAP", 40.0, 1.0, "2")]
    assert kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))) == {"side": 2}


@pytest.mark.parametrize(
    "name", ["STRP", "Bretelles", "tirantes", "肩带", "ストラップ", "어깨끈", "askı", "schouderbandje"]
)
def test_straps_are_known_in_other_languages(name: str) -> None:
    assert named(name).kind == "strap"


def test_trousers_with_straps_stay_trousers(tmp_path: Path) -> None:
    front, back, _ = trousers()
    pieces = [replace(front, name="FRONT"), replace(back, name="BACK"), band("STRAP", 30.0, 4.0, "2")]
    found = kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces})))
    assert found == {"outseam": 2, "inseam": 2, "front crotch": 1, "back crotch": 1}
