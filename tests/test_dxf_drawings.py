"""One T-shirt in the many ways in which drawings hold it: lines, layers, blocks and texts of other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from dxf_patterns import GRADES, TRUE_SEAMS, Drafted, Point, tshirt
from test_dxf import EXACT, kinds

from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.loops import inset

BESIDE = 900.0  # [mm] between pieces of one sheet
GERMAN = {"FRONT": "VORDERTEIL", "BACK": "RÜCKENTEIL", "SLEEVE": "ÄRMEL", "NECKBAND": "KRAGEN"}


def placed(points: list[Point], right: float = 0.0) -> list[Point]:
    return [(10.0 * x + right, 10.0 * y) for x, y in points]


def around(piece: Drafted, right: float = 0.0, allowance: float = 0.0) -> list[Point]:
    points = np.array([point for edge in piece.edges for point in edge[:-1]])
    return placed([(float(x), float(y)) for x, y in (inset(points, -allowance) if allowance else points)], right)


def closed(at: Any, piece: Drafted, right: float, layer: str = "1", allowance: float = 0.0) -> None:
    at.add_lwpolyline(around(piece, right, allowance), close=True, dxfattribs={"layer": layer})


def fold(at: Any, piece: Drafted, right: float, layer: str = "6") -> None:
    if piece.fold is not None:
        at.add_line(*placed(list(piece.fold), right), dxfattribs={"layer": layer})


def splines(at: Any, piece: Drafted, right: float) -> None:
    for edge in piece.edges:
        points = placed(edge, right)
        fit = [(x, y, 0.0) for x, y in (*points[:-1:6], points[-1])]
        if len(points) > 2:
            at.add_spline(fit, dxfattribs={"layer": "1"})
        else:
            at.add_line(*points, dxfattribs={"layer": "1"})
    fold(at, piece, right)


def reversed_with_gaps(at: Any, piece: Drafted, right: float) -> None:
    for number, edge in enumerate(piece.edges):
        points = [(x + 0.3 * (number % 2), y) for x, y in placed(edge, right)]
        at.add_lwpolyline(points[:: -1 if number % 2 else 1], dxfattribs={"layer": "1"})
    fold(at, piece, right)


def doubled(at: Any, piece: Drafted, right: float) -> None:
    for edge in (*piece.edges, *piece.edges):
        at.add_lwpolyline(placed(edge, right), dxfattribs={"layer": "1"})
    fold(at, piece, right)


def seam_layers(at: Any, piece: Drafted, right: float) -> None:
    closed(at, piece, right, "Seam allowance", 0.4)
    closed(at, piece, right, "Seam line")
    fold(at, piece, right, "Fold")


def told_fold(at: Any, piece: Drafted, right: float) -> None:
    closed(at, piece, right)
    if piece.fold is not None:
        at.add_text("CUT 1 ON FOLD").set_placement((right + 5.0, 300.0))


def no_fold(at: Any, piece: Drafted, right: float) -> None:
    closed(at, piece, right)


def one_layer(at: Any, piece: Drafted, right: float) -> None:
    closed(at, piece, right, "0", 0.4)
    closed(at, piece, right, "0")


def plain(at: Any, piece: Drafted, right: float) -> None:
    closed(at, piece, right)
    fold(at, piece, right)


Draw = Callable[[Any, Drafted, float], None]
WAYS = (splines, reversed_with_gaps, doubled, seam_layers, told_fold, no_fold, one_layer)
DRAWN = {each.__name__: each for each in WAYS}


def drawing(draw: Draw, sheet: str = "", texts: tuple[str, ...] = ("Piece Name: {}", "Quantity: {}")) -> Any:
    """Pieces in blocks of their own ("BLOCK" or "*U"), in one block ("SHEET") or in the model space ("SPACE")."""
    document = ezdxf.new("R2010")
    space = document.modelspace()
    shared = document.blocks.new("SHEET") if sheet == "SHEET" else space
    for number, piece in enumerate(tshirt()):
        alone = sheet in ("", "*U")
        own = document.blocks.new_anonymous_block if sheet else lambda: document.blocks.new(f"P{number}")  # noqa: B023
        at = own() if alone else shared
        right = 0.0 if alone else number * BESIDE
        draw(at, piece, right)
        for text, value in zip(texts, (piece.name, piece.quantity), strict=True):
            said = GERMAN.get(value, value) if text.startswith("Teil") else value
            at.add_text(text.format(said)).set_placement((right + 50.0, 10.0))
        if alone:
            space.add_blockref(at.name, (0.0, 0.0))
    if sheet == "SHEET":
        space.add_blockref("SHEET", (0.0, 0.0))
    return document


@pytest.mark.parametrize("way", DRAWN)
def test_all_seams_are_found_however_outlines_are_drawn(way: str, tmp_path: Path) -> None:
    drawing(DRAWN[way], "SPACE" if way == "one_layer" else "").saveas(tmp_path / "drawn.dxf")
    draft = read_drafted(tmp_path / "drawn.dxf")
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert not any("was open" in note for note in draft.notes)
    low, high = draft.parts[0].shape.box
    assert high[1] - low[1] == pytest.approx(0.7, rel=EXACT)


@pytest.mark.parametrize("sheet", ["SPACE", "SHEET", "*U"])
def test_pieces_are_found_wherever_they_lie(sheet: str, tmp_path: Path) -> None:
    drawing(plain, sheet).saveas(tmp_path / "drawn.dxf")
    assert kinds(read_drafted(tmp_path / "drawn.dxf")) == TRUE_SEAMS["tshirt"]


def test_a_binary_file_is_read(tmp_path: Path) -> None:
    drawing(plain).saveas(tmp_path / "drawn.dxf", fmt="bin")
    assert kinds(read_drafted(tmp_path / "drawn.dxf")) == TRUE_SEAMS["tshirt"]


def test_a_binary_file_is_read_whose_header_is_spoiled(tmp_path: Path) -> None:
    """Valentina's library writes the times of its header as integers of four bytes."""
    path = tmp_path / "drawn.dxf"
    drawing(plain).saveas(path, fmt="bin")
    version = b"$ACADVER\x00\x01\x00AC1024\x00"
    data = path.read_bytes()
    assert data.count(version) == 1
    path.write_bytes(data.replace(version, version + b"\x09\x00$TDCREATE\x00\x28\x00\x05\x00\x00\x00"))
    assert kinds(read_drafted(path)) == TRUE_SEAMS["tshirt"]


def test_texts_in_other_languages_state_names_and_numbers(tmp_path: Path) -> None:
    drawing(plain, "", ("Teilename: {}", "Stückzahl: {}")).saveas(tmp_path / "drawn.dxf")
    draft = read_drafted(tmp_path / "drawn.dxf")
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert [part.name for part in draft.parts][:2] == ["VORDERTEIL", "RÜCKENTEIL"]


def test_quantities_may_be_pairs(tmp_path: Path) -> None:
    document = drawing(plain)
    for block in document.blocks:
        for text in block.query("TEXT"):
            text.dxf.text = text.dxf.text.replace("Quantity: 2", "Quantity: 1 PAIR")
    document.saveas(tmp_path / "drawn.dxf")
    assert kinds(read_drafted(tmp_path / "drawn.dxf")) == TRUE_SEAMS["tshirt"]


def test_names_may_begin_with_the_size(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    for size, grade in GRADES.items():
        for piece in tshirt(grade):
            plain(document.blocks.new(f"{size}_{piece.name}"), piece, 0.0)
    document.saveas(tmp_path / "sizes.dxf")
    draft = read_drafted(tmp_path / "sizes.dxf")
    assert draft.sizes == ("S", "M", "L")
    assert kinds(draft) == TRUE_SEAMS["tshirt"]


def test_a_half_whose_other_half_is_drawn_stays_a_half(tmp_path: Path) -> None:
    document = drawing(no_fold)
    front = tshirt()[0]
    block = document.blocks.new("P9")
    block.add_lwpolyline([(-x, y) for x, y in around(front)], close=True, dxfattribs={"layer": "1"})
    block.add_text("Piece Name: FRONT LEFT")
    document.blocks.get("P0").query("TEXT")[0].dxf.text = "Piece Name: FRONT RIGHT"
    document.saveas(tmp_path / "halves.dxf")
    draft = read_drafted(tmp_path / "halves.dxf")
    assert len([part for part in draft.parts if part.kind == "front"]) == 2
    assert not any("is half a front" in note for note in draft.notes)
