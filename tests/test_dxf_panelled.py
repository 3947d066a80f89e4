"""Princess seams, sleeves of two pieces, names in many languages; and no seam sewn where two fit equally well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest
from dxf_panelled import PANELLED, TRUE_PANELLED_SEAMS, gored_skirt, panelled, panelled_skirt, side_panelled
from dxf_patterns import GRADES, TRUE_SEAMS, Style, band, half_body, length, line, sleeve, tshirt, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.draft import Stated
from warp_cloth.pattern.dxf_drawn import repaired
from warp_cloth.pattern.kinds import PLACES, named
from warp_cloth.pattern.proposal import SEWN_FROM
from warp_cloth.scene.wearables import Place

NAMES = {
    "front": "CENTER FRONT|Vorderteil|devant|delantero|davanti|frente|voorpand|Przód|полочка|ön beden|qian pian|前片",
    "back": "BACK ON FOLD|BACK SHOULDER|Rückenteil|dos|espalda|dietro|costas|achterpand|tył|спинка|arka|houpian|后片",
    "sleeve": "Oberärmel|AERMEL|manche|manga|manica|mouw|rękaw|рукав|kol|hiha|xiuzi|袖子",
    "collar": "Kragen|Halsbündchen|pied de col|cuello|colletto|kołnierz|воротник|yaka|lingzi|领",
    "cuff": "Manschette|poignet|puño|polsino|манжета|袖口|SLEEVE CUFF",
    "waistband": "Hosenbund|ceinture|pretina|cinturino|пояс|yaotou|腰头",
    "hood": "Kapuze|capuche|capucha|cappuccio|капюшон|maozi|帽|フード",
    "leg_front": "Vorderhose|pantalon devant|delantero pantalon|davanti pantalone|qian ku|前裤片",
    "leg_back": "Hinterhose|pantalon dos|trasero pantalon|dietro pantalone|hou ku|后裤片",
    "none": "Tasche|Beleg vorn|poche|parementure devant|bolsillo|vista delantero|fodera|карман|口袋|BACK FACING",
    "": "ORIGINAL PATTERN|SHOULDER PAD|PIECE 3|1204|ELASTIC",
}  # fmt: skip
LANGUAGES = {
    "de": ("Vorderteil", "Rückenteil", "Ärmel", "Halsbündchen"),
    "es": ("DELANTERO", "ESPALDA", "MANGA", "CUELLO"),
    "zh": ("前片", "后片", "袖子", "领"),
}


@pytest.mark.parametrize("kind", NAMES)
def test_names_are_told_in_the_languages_of_pattern_rooms(kind: str) -> None:
    names = NAMES[kind].split("|")
    told = {name: named(each).kind for name in names for each in (name, name.upper(), name.lower())}
    assert told == dict.fromkeys(names, kind)


def test_names_in_an_encoding_that_is_not_stated() -> None:
    spoiled = [name.encode("gbk").decode("cp1252") for name in LANGUAGES["zh"][:3]]
    assert [named(name).kind for name in spoiled] == ["front", "back", "sleeve"]
    assert repaired("рукав".encode().decode("cp1252", "surrogateescape")) == "рукав"
    assert repaired("Rückenteil") == "Rückenteil"


@pytest.mark.parametrize(
    ("encoding", "stated"), [("cp850", "dos850"), ("cp437", "DOS437"), ("utf-8", "dos850"), ("utf-16", "ANSI_1252")]
)
def test_names_in_encodings_of_dos_and_in_utf16(encoding: str, stated: str, tmp_path: Path) -> None:
    """Before, umlauts were other letters and half of the seams missing; UTF-16 was refused as no DXF."""
    pieces = [replace(piece, name=name) for piece, name in zip(tshirt(), LANGUAGES["de"], strict=True)]
    path = write(tmp_path / "plain.dxf", {"M": pieces}, Style())
    text = path.read_text(encoding="cp1252").replace("ANSI_1252", stated)
    path.write_bytes(text.encode(encoding))
    assert [part.name for part in read_drafted(path).parts if "mirrored" not in part.name] == list(LANGUAGES["de"])


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_tshirt_in_any_language_is_sewn_alike(language: str, tmp_path: Path) -> None:
    pieces = [replace(piece, name=name) for piece, name in zip(tshirt(), LANGUAGES[language], strict=True)]
    path = write(tmp_path / "plain.dxf", {"M": pieces}, Style(entity="LWPOLYLINE"))
    assert kinds(read_drafted(path)) == TRUE_SEAMS["tshirt"]


@pytest.mark.parametrize("garment", PANELLED)
def test_seams_of_panels_are_found_and_no_others(garment: str, tmp_path: Path) -> None:
    for size, grade in GRADES.items():
        draft = read_drafted(write(tmp_path / "panels.dxf", {size: PANELLED[garment](grade)}))
        assert kinds(draft) == TRUE_PANELLED_SEAMS[garment]
        assert min(joint.confidence for joint in draft.joints) >= 0.85
        assert not draft.unsewn


@pytest.mark.parametrize("waist", [0.4, 1.2, 2.5])
def test_an_armhole_begins_where_the_side_panel_ends_also_without_a_corner(waist: float, tmp_path: Path) -> None:
    """In a dress of 98 cm the princess seams of the middle panels run on into the armholes without a corner."""
    pieces, armholes = [], []
    for face, depth in (("Vorderteil", 9.5), ("Rückenteil", 2.5)):
        half = half_body(face, 24.0, 98.0, 8.5, depth, 19.0)
        pieces += panelled(half, waist, False, (f"{face} Mitte", f"{face} Seite"))
        armholes.append(length(half.edges[2]))
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*pieces, sleeve("Ärmel", 17.0, 30.0, 14.0, *armholes)]}))
    assert kinds(draft) == {"princess": 4, "shoulder": 2, "side": 2, "sleeve cap": 2, "underarm": 2}
    assert min(joint.confidence for joint in draft.joints) >= 0.95


@pytest.mark.parametrize("garment", PANELLED)
def test_panelled_garments_have_their_openings(garment: str, tmp_path: Path) -> None:
    path = write(tmp_path / "panels.dxf", {"M": PANELLED[garment](0.0)})
    assert boundary_loops(path, DraftOptions()) == (2 if "skirt" in garment else 5 if garment == "jumpsuit" else 4)


def test_side_panels_of_a_skirt_that_fit_either_way_round_are_not_sewn(tmp_path: Path) -> None:
    """Their long edges as long as each other, and no notches."""
    pieces = []
    for piece in panelled_skirt():
        if "SIDE" in piece.name:
            inner, out, tip = piece.edges[3], (22.0, 0.0), (17.5, 58.14)
            edges = [line(inner[1], out), line(out, tip), line(tip, inner[0]), inner]
            assert abs(length(edges[1]) - length(inner)) < 0.1
            piece = replace(piece, edges=edges)
        pieces.append(replace(piece, notches=[]))
    draft = read_drafted(write(tmp_path / "doubt.dxf", {"M": pieces}))
    assert not any(joint.reason.startswith(("princess", "side")) for joint in draft.joints)
    assert {"princess", "side"} <= {joint.reason.split(",")[0] for joint in draft.unsewn}


def test_of_two_seams_that_fit_alike_none_is_sewn(tmp_path: Path) -> None:
    front, back, sleeve, neck = tshirt()
    path = write(tmp_path / "twin.dxf", {"M": [front, replace(front, name="FRONT VERSION B"), back, sleeve, neck]})
    draft = read_drafted(path)
    doubted = {joint.reason.split(",")[0] for joint in draft.unsewn if "another seam fits as well" in joint.reason}
    assert {"shoulder", "side", "sleeve cap"} <= doubted
    assert all(joint.confidence < SEWN_FROM for joint in draft.unsewn)
    assert kinds(draft)["shoulder"] == kinds(draft)["side"] == 0
    chosen = read_drafted(path, DraftOptions(pieces={"FRONT VERSION B": Stated("none")}))
    assert kinds(chosen) == TRUE_SEAMS["tshirt"]


def test_a_scene_may_state_every_place_that_a_piece_can_have() -> None:
    assert set(get_args(Place)) == set(PLACES)


def test_a_side_panel_that_fits_front_and_back_alike_is_asked_for(tmp_path: Path) -> None:
    pieces = [piece for piece in side_panelled() if piece.name != "SIDE PANEL"]
    panel = replace(band("SIDE PANEL", 12.0, 41.5), quantity="2")
    draft = read_drafted(write(tmp_path / "doubt.dxf", {"M": [*pieces, panel]}))
    assert not {"princess", "side"} & set(kinds(draft))
    assert any("state its place, side_front or side_back" in note for note in draft.notes)


def test_gores_with_two_sides_are_mirrored_by_turns(tmp_path: Path) -> None:
    gore, waistband = gored_skirt()
    leaning = [[(x + (0.02 * y if x > 0 else 0.0), y) for x, y in edge] for edge in gore.edges]
    path = write(tmp_path / "gores.dxf", {"M": [replace(gore, edges=leaning, quantity="3,3"), waistband]})
    assert kinds(read_drafted(path))["gore"] == 6


def test_pleats_are_told(tmp_path: Path) -> None:
    front, back, *_ = tshirt()
    path = write(tmp_path / "pleats.dxf", {"M": [replace(front, name="FRONT PLEATED"), back]})
    assert any("pleats are not folded" in note for note in read_drafted(path).notes)


@pytest.mark.parametrize("name", ["princess", "jacket"])
def test_a_middle_panel_of_an_unknown_name_is_told_by_its_seams(name: str, tmp_path: Path) -> None:
    pieces = [
        replace(piece, name="XYZ") if "BACK" in piece.name and piece.fold else piece for piece in PANELLED[name]()
    ]
    path = write(tmp_path / "unnamed.dxf", {"M": pieces}, Style())
    assert kinds(read_drafted(path)) == TRUE_PANELLED_SEAMS[name]


def test_side_panels_beside_what_may_be_their_middle_one_are_no_halves(tmp_path: Path) -> None:
    pieces = [piece for piece in PANELLED["princess"]() if piece.name != "CENTER BACK"]
    (beside,) = (piece for piece in pieces if piece.name == "SIDE BACK")
    unknown = replace(beside, name="XYZ", edges=band("XYZ", 40.0, 30.0).edges, notches=[])
    path = write(tmp_path / "unnamed.dxf", {"M": [*pieces, unknown]}, Style())
    draft = read_drafted(path)
    backs = {index for index, part in enumerate(draft.parts) if part.kind == "side_back"}
    assert len(backs) == 2
    assert not [joint for joint in draft.joints if backs & {side.panel for side in (*joint.one, *joint.other)}]


@pytest.mark.parametrize("is_across", [False, True])
def test_a_lower_sleeve_is_an_under_sleeve_unless_it_is_cut_across(is_across: bool, tmp_path: Path) -> None:
    """A forearm has straight ends; an under sleeve's top is hollow."""
    names = {"TOP SLEEVE": "UPPER SLEEVE", "UNDER SLEEVE": "LOWER SLEEVE"}
    pieces = [replace(piece, name=names.get(piece.name, piece.name)) for piece in PANELLED["jacket"]()]
    pieces = [*pieces[:-1], band("LOWER SLEEVE", 34.0, 25.0, "2")] if is_across else pieces
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}, Style()))
    (kind,) = {part.kind for part in draft.parts if part.name == "LOWER SLEEVE"}
    assert kind == ("sleeve" if is_across else "under_sleeve")
    assert is_across or kinds(draft) == TRUE_PANELLED_SEAMS["jacket"]
