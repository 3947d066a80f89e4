"""Pieces that are no part of the garment: spare ones, and second layers of bands and yokes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import Drafted, band, leggings, trousers, tshirt, write
from dxf_shirts import shirt, write_shirt
from test_dxf import kinds

from warp_cloth.base.errors import InputError
from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.drafted import drafted_pattern
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.seam_table import seam_table


def test_a_small_piece_of_unknown_name_that_is_sewn_to_nothing_is_left_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.dxf", {"M": [*tshirt(), band("TWILL", 20.0, 1.2), band("SNIB", 15.0, 4.0, "2")]})
    draft = read_drafted(path)
    assert sum("left out; state a seam of it to keep it" in note for note in draft.notes) == 1
    assert "SNIB mirrored" in {part.name for part in draft.parts}  # drawn, so that seams of it can be stated
    panels = {panel.name for panel in drafted_pattern(draft, None).panels}
    assert panels == {"FRONT", "BACK", "SLEEVE", "SLEEVE mirrored", "NECKBAND"}
    assert seam_table(draft, path, tmp_path, 0.0).count('place = "none"') == 2


@pytest.mark.parametrize(
    "piece", [band("STRAP", 38.0, 1.2, "2"), band("SIDE PANEL", 50.0, 6.0), band("MAIN", 60.0, 30.0)]
)
def test_what_may_be_of_the_garment_is_asked_for(piece: Drafted, tmp_path: Path) -> None:
    """What its name tells, and what is large, is not left out unasked."""
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*tshirt(), piece]}))
    with pytest.raises(InputError, match=f'"{piece.name}".* sewn to nothing'):
        drafted_pattern(draft, None)


def test_one_of_two_layers_of_a_band_is_sewn(tmp_path: Path) -> None:
    leg, waist = leggings()
    bands = [replace(waist, name=f"WAISTBAND {which}") for which in ("OUTER", "INNER")]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [leg, *bands]}))
    assert kinds(draft)["waistband"] == kinds(draft)["waistband ends"] == 1
    assert [part.name for part in draft.parts if part.kind == "waistband"] == ["WAISTBAND OUTER"]
    front, back, waist = trousers()
    halves = [replace(waist, name=f"WAISTBAND {which}", edges=band("", 44.0, 4.0).edges) for which in "AB"]
    draft = read_drafted(write(tmp_path / "b.dxf", {"M": [front, back, *halves]}))
    assert sum(part.kind == "waistband" for part in draft.parts) == 2  # each goes half round


def test_one_of_two_layers_of_yokes_and_cuffs_is_sewn(tmp_path: Path) -> None:
    pieces = shirt()
    seams = kinds(read_drafted(write_shirt(pieces, tmp_path / "a.dxf")))
    double = [replace(each, name=f"{each.name} INNER") for each in pieces if each.name in ("YOKE", "CUFF")]
    draft = read_drafted(write_shirt([*pieces, *double], tmp_path / "b.dxf"))
    assert kinds(draft) == seams
    assert sum("are layers of one" in note for note in draft.notes) == 2


@pytest.mark.parametrize(
    ("name", "kind"),
    [("CUFF FUSE", "none"), ("PLKT", "none"), ("BTM RIB", "hem_band"), ("Shoulder Strap", "strap"),
     ("Strapless Front", "front"), ("WAISTBAND ELASTIC", "none"), ("Elastic Waistband", "waistband"),
     ("Bundgummi", "none"), ("Elastic Guide 1", "none"), ("ELASTIC CASING", ""), ("ceinture élastique", "waistband"),
     ("élastique taille", "none")],
)  # fmt: skip
def test_names_of_what_is_no_outer_cloth_and_what_is(name: str, kind: str) -> None:
    assert named(name).kind == kind
