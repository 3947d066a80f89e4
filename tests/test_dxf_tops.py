"""Tops as rooms cut them: waistcoats whose fronts have a straight neck and a point, peplums, ribs of sleeves."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, Point, band, half_body, length, line, trousers, tshirt, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, load_pattern, read_drafted
from warp_cloth.pattern.kinds import named


def waistcoat(point: float) -> list[Drafted]:
    """A back on the fold, and a front with a straight neckline and a hem that has a point this far down [cm]."""
    back, front = half_body("BACK", 25.0, 58.0, 8.0, 2.5, 17.0), half_body("FRONT", 25.0, 58.0, 8.0, 9.0, 17.0)
    _, side, armhole, shoulder, *_ = front.edges
    foot, tip, neck = (-2.0, 0.0), (6.0, -point), (-2.0, 32.0)
    hem = [line(foot, tip), line(tip, side[0])] if point else [line(foot, side[0])]
    edges = [*hem, side, armhole, shoulder, line(shoulder[-1], neck), line(neck, foot)]
    return [Drafted("FRONT", edges, "2"), back]


@pytest.mark.parametrize("point", [0.0, 3.0, 7.0])
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_a_front_with_a_straight_neck_is_no_leg(point: float, is_mirrored: bool, tmp_path: Path) -> None:
    """One edge of it is hollow, like a leg's; but the other piece is of a bodice."""
    front, back = waistcoat(point)
    if is_mirrored:
        front = replace(front, edges=[[(-x, y) for x, y in edge[::-1]] for edge in front.edges[::-1]])
    path = write(tmp_path / "a.dxf", {"M": [front, back]})
    draft = read_drafted(path)
    assert kinds(draft) == {"shoulder": 2, "side": 2}
    assert min(joint.confidence for joint in draft.joints) >= 0.95
    assert boundary_loops(path, DraftOptions()) == 3


def peplum(name: str, waist: float) -> Drafted:
    """A sixth of a ring on the fold, as long at its waist as half a bodice's hem."""
    radius = waist / (math.pi / 3)

    def arc(r: float) -> list[Point]:
        return [(r * math.sin(a), -r * math.cos(a)) for a in np.linspace(0.0, math.pi / 3, 20)]

    upper, lower = arc(radius), arc(radius + 16.0)
    edges = [lower, line(lower[-1], upper[-1]), upper[::-1], line(upper[0], lower[0])]
    return Drafted(name, edges, "1", (upper[0], lower[0]))


def test_a_peplum_is_sewn_to_the_waist(tmp_path: Path) -> None:
    bodice = [
        half_body(f"{face} Bodice", 24.0, 42.0, 8.5, depth, 19.0) for face, depth in (("Front", 9.5), ("Back", 2.5))
    ]
    pieces = [
        *bodice,
        *(
            peplum(f"{face} Peplum", length(each.edges[0]))
            for face, each in zip(("Front", "Back"), bodice, strict=True)
        ),
    ]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    assert kinds(read_drafted(path)) == {"shoulder": 2, "side": 4, "waist": 2}
    assert boundary_loops(path, DraftOptions()) == 4


def test_garments_that_no_seam_joins_are_told(tmp_path: Path) -> None:
    notes = load_pattern(write(tmp_path / "a.dxf", {"M": [*tshirt(), *trousers()]}), edge=0.04).notes
    assert any('2 garments, those of "FRONT", "FRONT LEG"' in note for note in notes)
    assert not any(
        "garments" in note for note in load_pattern(write(tmp_path / "b.dxf", {"M": tshirt()}), edge=0.04).notes
    )


def test_a_rib_of_a_sleeve_is_its_cuff(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*tshirt(), band("SLEEVE RIB", 28.0, 3.0, "2")]}))
    assert kinds(draft)["cuff"] == kinds(draft)["cuff ends"] == 2
    assert kinds(draft)["underarm"] == 2


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Sleeve Band", "cuff"),
        ("SLEEVE HEM BAND", "cuff"),
        ("Rib Sleeve", "sleeve"),
        ("HEM RIB", "hem_band"),
        ("胸袋", "none"),
        ("Knee Patch", "none"),
        ("Patchwork Front", "front"),
        ("Drawstring", "none"),
        ("Schößchen vorn", "skirt_front"),
        ("Back Peplum", "skirt_back"),
    ],
)
def test_names_of_what_is_sewn_to_tops(name: str, kind: str) -> None:
    assert named(name).kind == kind


@pytest.mark.parametrize("count", [1, 2])
def test_a_band_below_an_open_front_is_open_as_well(count: int, tmp_path: Path) -> None:
    """As of a bomber jacket: from the middle of one front to that of the other, or not sewn, as one for each face."""
    front, back, arm, _ = tshirt()
    half = replace(front, fold=None, quantity="1,1")
    hem = 2.0 * (length(front.edges[0]) + length(back.edges[0]))
    bands = [band(name, 0.95 * hem / count, 6.0) for name in ("HEM BAND FRONT", "HEM BAND BACK")[:count]]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [half, back, arm, *bands]}))
    assert (kinds(draft)["hem band"], kinds(draft)["hem_band ends"]) == (2 - count, 0)
    if count == 1:
        joint = next(joint for joint in draft.joints if joint.reason.startswith("hem band"))
        assert [draft.parts[joint.other[end].panel].name for end in (0, -1)] == ["FRONT mirrored", "FRONT"]
        assert boundary_loops(tmp_path / "a.dxf", DraftOptions()) == 3  # wrists, and all round the front


def test_a_back_cut_straight_across_is_of_the_front_s_bodice(tmp_path: Path) -> None:
    """As of a camisole; its straps are asked for. Beside a back bodice it is a skirt's."""
    front, back = half_body("FRONT", 23.0, 62.0, 8.0, 9.0, 15.0), half_body("BACK", 23.0, 62.0, 8.0, 2.5, 15.0)
    _, side, *_ = front.edges
    low = (0.0, side[1][1])
    edges = [line((0.0, 0.0), (23.0, 0.0)), side, line(side[1], low), line(low, (0.0, 0.0))]
    straight = Drafted("BACK", edges, "1", (low, (0.0, 0.0)))
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, straight, band("STRAP", 40.0, 1.5, "2")]}))
    assert kinds(draft) == {"side": 2}
    assert [part.kind for part in draft.parts] == ["front", "back", "strap", "strap"]
    pieces = [front, back, *(replace(straight, name=f"{face} BOTTOM") for face in ("FRONT", "BACK"))]
    draft = read_drafted(write(tmp_path / "b.dxf", {"M": pieces}))
    assert [part.kind for part in draft.parts] == ["front", "back", "skirt_front", "skirt_back"]


@pytest.mark.parametrize("name", ["ARMBAND", "ARMHOLE RIB", "Armlochbündchen", "BORD COTE EMMANCHURE"])
def test_bands_go_round_armholes_without_sleeves(name: str, tmp_path: Path) -> None:
    front, back = half_body("FRONT", 24.0, 60.0, 8.0, 14.0, 14.0), half_body("BACK", 24.0, 60.0, 8.0, 6.0, 14.0)
    round_arm = length(front.edges[2]) + length(back.edges[2])
    path = write(tmp_path / "a.dxf", {"M": [front, back, band(name, 0.9 * round_arm, 2.0, "2")]})
    assert kinds(read_drafted(path)) == {"shoulder": 2, "side": 2, "cuff": 2, "cuff ends": 2}
    assert boundary_loops(path, DraftOptions()) == 4
    short = write(tmp_path / "b.dxf", {"M": [front, back, band("CUFF", 0.5 * round_arm, 6.0, "2")]})
    assert kinds(read_drafted(short)) == {"shoulder": 2, "side": 2}  # of a sleeve that the file lacks


@pytest.mark.parametrize(
    ("name", "kind"),
    [("W/B", "waistband"), ("WSTBND", "waistband"), ("FRNT", "front"), ("SKRT FRT", "skirt_front"),
     ("NECK TRIM", "collar"), ("BK NK FCG", "none"), ("BUTTON STAND", "none"), ("TIGHTS", "leg")],
)  # fmt: skip
def test_short_names_of_rooms(name: str, kind: str) -> None:
    assert named(name).kind == kind


@pytest.mark.parametrize("depth", [16.0, 24.0])
def test_a_deep_pointed_neckline_is_no_dart(depth: float, tmp_path: Path) -> None:
    pieces = []
    for name, deep in (("FRONT", depth), ("BACK", 2.5)):
        piece = half_body(name, 25.0, 60.0, 7.0, deep, 19.0)
        if name == "FRONT":
            piece.edges[4] = line(piece.edges[4][0], piece.edges[4][-1])
        pieces.append(piece)
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == {"shoulder": 2, "side": 2}


def test_a_symmetric_piece_that_is_read_unevenly_is_not_sewn(tmp_path: Path) -> None:
    """A poncho's slanting tops were a waist on one side, and a side on the other: one side of it was closed."""
    pieces = []
    for name, depth in (("FRONT", 8.0), ("BACK", 2.0)):
        path = [(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (8.0, 55.0), (0.0, 55.0 - depth)]
        edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
        pieces.append(Drafted(name, edges, "1", (path[-1], path[0])))
    assert not kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces})))
