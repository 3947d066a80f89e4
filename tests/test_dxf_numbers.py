"""Pieces whose names say nothing: what they are is told by their shapes, or not at all, and no seam is sewn falsely."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from dxf_panelled import PANELLED
from dxf_patterns import GARMENTS, GRADES, STYLES, TRUE_SEAMS, Drafted, Style, tshirt, write
from test_dxf import drafted, kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.draft import Stated
from warp_cloth.pattern.drafted import drafted_pattern
from warp_cloth.pattern.proposal import SEWN_FROM

TOLD = ("tshirt", "trousers", "hooded", "leggings")


def numbered(pieces: list[Drafted], **changes: str) -> list[Drafted]:
    return [replace(piece, name=str(number), **changes) for number, piece in enumerate(pieces, 1)]  # type: ignore[arg-type]


def mirrored(piece: Drafted) -> Drafted:
    edges = [[(-x, y) for x, y in edge[::-1]] for edge in piece.edges[::-1]]
    return replace(piece, edges=edges, notches=[(-x, y) for x, y in piece.notches])


@pytest.mark.parametrize("garment", TOLD)
@pytest.mark.parametrize("style", ["plain", "own"])
def test_numbered_pieces_are_sewn_as_named_ones(garment: str, style: str, tmp_path: Path) -> None:
    for size, grade in GRADES.items():
        how = STYLES[garment] if style == "own" else Style()
        draft = read_drafted(write(tmp_path / "numbers.dxf", {size: numbered(GARMENTS[garment](grade))}, how))
        assert kinds(draft) == TRUE_SEAMS[garment]
        assert SEWN_FROM <= min(joint.confidence for joint in draft.joints) <= 0.9  # less sure than by name
        assert any("no names tell" in note for note in draft.notes)


@pytest.mark.parametrize("garment", [*TOLD, "raglan"])
def test_a_piece_beside_named_ones_is_told_by_its_shape(garment: str, tmp_path: Path) -> None:
    pieces = GARMENTS[garment](0.0)
    for index, piece in enumerate(pieces):
        changed = [*pieces[:index], replace(piece, name="XYZZY"), *pieces[index + 1 :]]
        draft = read_drafted(write(tmp_path / "unknown.dxf", {"M": changed}))
        found = kinds(replace(draft, joints=tuple(j for j in draft.joints if j.confidence >= SEWN_FROM)))
        if garment == "raglan" or piece.name == "Hem Band":  # not told by shape: it stays unknown, and nothing is false
            assert not found - Counter(TRUE_SEAMS[garment])
        else:
            assert found == TRUE_SEAMS[garment]


def test_a_numbered_tshirt_has_the_same_seams(tmp_path: Path) -> None:
    named = drafted(tmp_path, "tshirt")
    numbers = read_drafted(write(tmp_path / "numbers.dxf", {"M": numbered(tshirt())}))
    seams = [{(joint.one, joint.other) for joint in draft.joints} for draft in (named, numbers)]
    assert seams[0] == seams[1]


def test_a_numbered_pocket_is_left_out_and_the_others_are_still_told(tmp_path: Path) -> None:
    path = write(tmp_path / "pocket.dxf", {"M": numbered(GARMENTS["hooded"](0.0))})
    draft = read_drafted(path)
    assert kinds(draft) == TRUE_SEAMS["hooded"]
    assert "7" not in {panel.name for panel in drafted_pattern(draft, None).panels}
    assert kinds(read_drafted(path, DraftOptions(pieces={"7": Stated("none")}))) == TRUE_SEAMS["hooded"]


def test_sleeves_drawn_left_and_right_are_a_pair(tmp_path: Path) -> None:
    front, back, sleeve, neck = tshirt()
    pieces = numbered([front, back, sleeve, mirrored(sleeve), neck], quantity="1")
    draft = read_drafted(write(tmp_path / "both.dxf", {"M": pieces}))
    assert [part.kind for part in draft.parts] == ["front", "back", "sleeve", "sleeve", "collar"]
    assert kinds(draft) == TRUE_SEAMS["tshirt"]


@pytest.mark.parametrize("garment", [*PANELLED, "raglan"])
def test_numbered_pieces_of_another_cut_are_not_sewn(garment: str, tmp_path: Path) -> None:
    for size, grade in GRADES.items():
        pieces = numbered((GARMENTS | PANELLED)[garment](grade))
        assert not read_drafted(write(tmp_path / "numbers.dxf", {size: pieces})).joints


SOME = {
    (0, 1): {"shoulder": 2, "side": 2},
    (0, 2, 3): {},
    (0, 0, 2, 3): {"underarm": 2},
    (2, 3): {},
    (0, 1, 2, 2, 3): {},
}


@pytest.mark.parametrize("kept", SOME)
def test_what_is_no_whole_garment_has_no_false_seams(kept: tuple[int, ...], tmp_path: Path) -> None:
    """Without its front or back, or with one piece twice: at most the seams that are surely there."""
    pieces = numbered([tshirt()[index] for index in kept])
    assert kinds(read_drafted(write(tmp_path / "some.dxf", {"M": pieces}))) == SOME[kept]
