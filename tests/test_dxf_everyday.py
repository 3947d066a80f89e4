"""Everyday clothes: of each pattern all seams are found, and none that is false."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from dxf_everyday import EVERYDAY, TRUE_EVERYDAY
from dxf_patterns import Drafted, Style, band, bezier, write
from dxf_shirts import shirt, write_shirt
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.labels import ON_FOLD, PLEATED

STYLES = [Style(), Style("ENGLISH", turned=90.0, entity="LWPOLYLINE", allowance=1.0)]


@pytest.mark.parametrize("garment", EVERYDAY)
def test_all_true_seams_are_found_and_no_others(tmp_path: Path, garment: str) -> None:
    for style in STYLES:
        draft = read_drafted(write(tmp_path / "a.dxf", {"M": EVERYDAY[garment]()}, style))
        assert kinds(draft) == TRUE_EVERYDAY[garment]


@pytest.mark.parametrize(
    ("name", "kind"),
    [("BORD COTE MANCHE", "cuff"), ("Bündchen Hals", "collar"), ("etek ribana", "hem_band"), ("KOL RİBANA", "cuff"),
     ("bord-côte taille", "waistband"), ("下摆罗纹", "hem_band"), ("Rib Front", "front")],
)  # fmt: skip
def test_where_a_band_of_rib_goes_tells_what_it_is(name: str, kind: str) -> None:
    assert named(name).kind == kind


@pytest.mark.parametrize(
    ("name", "kind"),
    [("Volant Jupe", "hem_band"), ("NECK FRILL", "collar"), ("Rüsche Ärmel", "cuff"), ("RUFFLE FACING", "none"),
     ("Ruffle Skirt Front", "skirt_front"), ("ruffled skirt", "skirt")],
)  # fmt: skip
def test_where_a_ruffle_goes(name: str, kind: str) -> None:
    assert named(name).kind == kind


@pytest.mark.parametrize(
    ("name", "kind"),
    [("TURTLENECK", "collar"), ("Roll neck", "collar"), ("TURTLENECK FRONT", "front"), ("Polo-neck sleeve", "sleeve"),
     ("Besatz Vorderteil", "none"), ("CARTERA", "none"), ("裤耳", "none"), ("BACK RISER", "yoke")],
)  # fmt: skip
def test_words_of_rooms(name: str, kind: str) -> None:
    assert named(name).kind == kind


def test_a_wrap_skirt_says_where_it_is_left_open(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": EVERYDAY["wrap skirt"]()}))
    assert sum(note.startswith("the front is left open at") for note in draft.notes) == 1


def test_a_cap_that_is_too_long_is_gathered_into_a_whole_armhole_only(tmp_path: Path) -> None:
    """Where a yoke is missing, the armhole is too short for a plain sleeve, and nothing is gathered."""
    pieces = [piece for piece in shirt() if "YOKE" not in piece.name]
    assert not kinds(read_drafted(write_shirt(pieces, tmp_path / "a.dxf")))["sleeve cap"]


def test_a_straight_armhole_is_none_where_no_sleeve_is_as_long(tmp_path: Path) -> None:
    """The corner is then one of the side, and the side is sewn as a whole."""
    front, back, _ = EVERYDAY["dropped shoulders"]()
    longer = [[(1.3 * x, y) for x, y in edge] for edge in EVERYDAY["dropped shoulders"]()[2].edges]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [front, back, Drafted("SLEEVE", longer, "2")]}))
    sides = [joint for joint in draft.joints if joint.reason.startswith("side")]
    assert [len(joint.one) for joint in sides] == [2, 2]
    assert not kinds(draft)["sleeve cap"]


def test_a_ruffle_goes_round_the_lowest_tier(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": EVERYDAY["tiers"]()})
    assert boundary_loops(path, DraftOptions()) == 2  # waist and hem
    ruffle = next(joint for joint in read_drafted(path).joints if joint.reason.startswith("hem band"))
    assert ruffle.reason.endswith("3400 to 2250 mm")


@pytest.mark.parametrize(("widths", "names"), [((50.0, 75.0), "21"), ((60.0, 60.0), "AB")])
def test_tiers_in_no_sure_order_are_not_sewn(tmp_path: Path, widths: tuple[float, ...], names: str) -> None:
    pieces = [band(f"TIER {name}", wide, 22.0, "2") for name, wide in zip(names, widths, strict=True)]
    assert not read_drafted(write(tmp_path / "a.dxf", {"M": [*pieces, band("WAISTBAND", 72.0, 4.0)]})).joints


def test_numbers_tell_the_order_of_tiers_as_wide_as_each_other(tmp_path: Path) -> None:
    pieces = [band(f"TIER {name}", 60.0, 22.0, "2") for name in (2, 1)]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*pieces, band("WAISTBAND", 72.0, 4.0)]}))
    assert kinds(draft) == {"side": 4, "tier": 2, "waistband": 1, "waistband ends": 1}
    assert [(part.name, part.level) for part in draft.parts if part.level] == [("TIER 2 front", 1), ("TIER 2 back", 1)]


def test_bibs_stay_open_at_their_sides(tmp_path: Path) -> None:
    """Also where a side seam would fit, and one is wider than the waist; legs, and one opening round both bibs."""
    *legs, front, back = EVERYDAY["overalls"]()
    alike = replace(front, name=back.name)
    pieces = [*legs, front, alike]
    path = write(tmp_path / "a.dxf", {"M": EVERYDAY["overalls"]()})
    assert boundary_loops(path, DraftOptions()) == 3
    assert sum("folds down" in note for note in read_drafted(path).notes) == 1
    assert not kinds(read_drafted(write(tmp_path / "b.dxf", {"M": pieces})))["side"]


def half_skirt(name: str, quantity: str) -> Drafted:
    side = bezier((23.0, 0.0), (25.0, 25.0), (26.0, 42.0), (18.0, 60.0))
    edges = [[(0.0, 0.0), (23.0, 0.0)], side, [side[-1], (0.0, 59.0)], [(0.0, 59.0), (0.0, 0.0)]]
    return Drafted(name, edges, quantity)


def test_half_a_skirt_that_is_cut_once_is_no_whole_one(tmp_path: Path) -> None:
    """Its middle was sewn as a side: a half that says so, or whose other half is nowhere, is opened."""
    pieces = [half_skirt("FRONT", "1"), half_skirt("BACK", "2"), band("WAISTBAND", 74.0, 4.0)]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == {"side": 2, "centre back": 1, "waistband": 1, "waistband ends": 1}
    assert any("mirrored at its straight centre" in note for note in draft.notes)


def test_halves_of_a_skirt_that_are_drawn_one_by_one_meet_in_the_middle(tmp_path: Path) -> None:
    left = half_skirt("SKIRT FRONT LEFT", "1")
    right = Drafted("SKIRT FRONT RIGHT", [[(-x, y) for x, y in edge[::-1]] for edge in left.edges[::-1]])
    back = replace(half_skirt("SKIRT BACK", "1"), fold=((0.0, 59.0), (0.0, 0.0)))
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [left, right, back, band("WAISTBAND", 74.0, 4.0)]}))
    assert kinds(draft) == {"side": 2, "centre front": 1, "waistband": 1, "waistband ends": 1}


@pytest.mark.parametrize("text", ["sur le pli", "Sur pli", "pliure", "VT i. Br.", "im Bruch", "CUT ON FOLD"])
def test_labels_that_say_on_the_fold(text: str) -> None:
    assert re.search(ON_FOLD, text.lower())
    assert not re.search(PLEATED, f"{text} 2".lower())
