"""DXF files as people draw them: labels of one line, blocks within blocks, a layer for each size, title blocks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from dxf_patterns import GARMENTS, GRADES, TRUE_SEAMS, Drafted, Style, tshirt, write
from test_dxf import kinds

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.dxf_drawn import Drawn
from warp_cloth.pattern.dxf_sheet import _told_apart
from warp_cloth.pattern.kinds import is_named_stand, named
from warp_cloth.pattern.labels import name_of

MM = 10.0


def outline(piece: Drafted, opened: bool = True) -> np.ndarray:
    """The outline in centimetres, halves on the fold opened."""
    half = np.array([point for edge in piece.edges for point in edge[:-1]])
    if piece.fold is None or not opened:
        return half
    return np.concatenate([half, (half * (-1, 1))[::-1][np.abs(half[::-1, 0]) > 1e-9]])


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("FRENTE - cortar 1x na dobra", "FRENTE"),
        ("Cut 2 SLEEVE", "SLEEVE"),
        ("voorpand 1x stofvouw", "voorpand"),
        ("Рукав 2 дет.", "Рукав"),
        ("ÖN BEDEN 1 adet katta", "ÖN BEDEN"),
    ],
)
def test_a_label_of_one_line_names_its_piece(label: str, name: str) -> None:
    drawn = Drawn("")
    drawn.state(label)
    assert name_of(drawn).rstrip(".") == name
    drawn.state("KRAGEN")  # a line that says nothing of cutting comes first
    assert name_of(drawn) == "KRAGEN"


def test_letters_that_unicode_could_take_apart_are_no_accents() -> None:
    """The Russian short i, unlike an umlaut."""
    assert named("Стойка").kind == named("Бейка").kind == "collar"
    assert is_named_stand("Воротник-стойка")
    assert named("Rückenteil").kind == "back"


def nested(path: Path) -> Path:
    """Outlines within blocks of pieces, within a block that is the sheet; the other sleeve is mirrored there."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 4
    sheet = document.blocks.new("SHEET")
    for number, piece in enumerate(tshirt()):
        shape, block = document.blocks.new(f"OUTLINE {number}"), document.blocks.new(f"B{number}")
        shape.add_lwpolyline((MM * outline(piece)).tolist(), close=True, dxfattribs={"layer": "CUT"})
        block.add_blockref(shape.name, (0, 0))
        block.add_mtext(f"{{\\fArial|b0|i0;{piece.name}\\PSize M\\PCut 1}}", dxfattribs={"insert": (0.0, 100.0)})
        sheet.add_blockref(block.name, (900 * number, 0))
        if piece.quantity == "2":
            sheet.add_blockref(block.name, (900 * number, 900), dxfattribs={"xscale": -1})
    document.modelspace().add_blockref("SHEET", (0, 0))
    document.saveas(path)
    return path


def test_blocks_within_blocks_are_one_piece_each(tmp_path: Path) -> None:
    draft = read_drafted(nested(tmp_path / "nested.dxf"))
    assert [part.name for part in draft.parts] == ["FRONT", "BACK", "SLEEVE", "SLEEVE mirrored", "NECKBAND"]
    assert kinds(draft) == TRUE_SEAMS["tshirt"]


def sheet(path: Path, labels: tuple[str, ...], draw: Any) -> Path:
    """All pieces in the model space, in centimetres, with a label in each."""
    document = ezdxf.new("R2013")
    document.header["$INSUNITS"] = 5
    space = document.modelspace()
    for number, label in enumerate(labels):
        space.add_text(label, dxfattribs={"layer": "TEXT"}).set_placement((100.0 * number, 1.0))
    draw(space)
    document.saveas(path)
    return path


def test_a_layer_for_each_size_makes_sizes(tmp_path: Path) -> None:
    """Layers of their own that no standard knows, outlines of sizes one in another."""

    def draw(space: Any) -> None:
        for size, grade in zip(("36", "38", "40"), GRADES.values(), strict=True):
            for number, piece in enumerate(tshirt(grade)):
                at = np.array([100.0 * number - (25.0 if number == 3 else 0.0), 0.0])
                space.add_lwpolyline((outline(piece) + at).tolist(), close=True, dxfattribs={"layer": f"SIZE_{size}"})

    path = sheet(tmp_path / "layers.dxf", ("front", "back", "sleeve 2x", "neckband"), draw)
    for size, sleeve in (("36", 34.8), ("40", 37.2)):
        draft = read_drafted(path, DraftOptions(size=size))
        assert draft.sizes == ("36", "38", "40")
        assert kinds(draft) == TRUE_SEAMS["tshirt"]
        around = np.concatenate([edge.points for edge in draft.parts[2].edges])
        assert np.ptp(around[:, 0]) == pytest.approx(0.01 * sleeve, abs=1e-6)


def test_layers_are_told_by_what_differs() -> None:
    assert _told_apart(["SIZE_36", "SIZE_38"]) == ["36", "38"]
    assert _told_apart(["T-shirt M", "T-shirt XL"]) == ["M", "XL"]
    assert _told_apart(["M", "L"]) == ["M", "L"]


def test_frames_title_blocks_and_buttons_are_no_pieces(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        for low, high in (((-60, -20), (500, 110)), ((400, -20), (500, 20))):
            corners = [low, (high[0], low[1]), high, (low[0], high[1])]
            space.add_lwpolyline(corners, close=True, dxfattribs={"layer": "FRAME"})
        for number, piece in enumerate(tshirt()):
            points = outline(piece, opened=False) + np.array([100.0 * number - (30.0 if number == 3 else 0.0), 0.0])
            space.add_lwpolyline(points.tolist(), close=True, dxfattribs={"layer": "pattern"})
            space.add_circle((100 * number + 5, 80), 0.6, dxfattribs={"layer": "buttons"})

    labels = ("voorpand 1x stofvouw", "achterpand 1x stofvouw", "mouw 2x", "halsboord 1x")
    draft = read_drafted(sheet(tmp_path / "sheet.dxf", labels, draw))
    assert [part.name for part in draft.parts] == ["voorpand", "achterpand", "mouw", "mouw mirrored", "halsboord"]
    assert kinds(draft) == TRUE_SEAMS["tshirt"]


def test_folds_and_grains_on_the_outlines_layer_are_no_outlines(tmp_path: Path) -> None:
    """Joined end to end, the fold and the grain of one piece and another were one more piece."""
    document = ezdxf.new("R2000")
    space = document.modelspace()
    for number, piece in enumerate(tshirt()):
        points = outline(piece, opened=False) * MM + (1500.0 * number, 0.0)
        low, high = points.min(axis=0), points.max(axis=0)
        middle = 0.5 * (low + high)
        space.add_lwpolyline(points.tolist(), close=True)
        if piece.fold is not None:
            space.add_line(*(np.array(piece.fold) * MM + (1500.0 * number, 0.0)).tolist())
        space.add_line((middle[0], 0.8 * low[1] + 0.2 * high[1]), (middle[0], 0.2 * low[1] + 0.8 * high[1]))
        count = "1+1" if piece.name == "SLEEVE" else "1"
        for row, text in enumerate((piece.name, f"Cut {count}")):
            space.add_text(text).set_placement((middle[0] - 1.0, middle[1] - 10.0 * row))
    path = tmp_path / "sheet.dxf"
    document.saveas(path)
    draft = read_drafted(path)
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert len(draft.parts) == 5


@pytest.mark.parametrize("garment", ["tshirt", "trousers"])
def test_pieces_without_grain_may_lie_sideways(garment: str, tmp_path: Path) -> None:
    """As they are laid for cutting: the seams that they would have tell."""
    for turned in (0.0, 90.0, -90.0):
        path = write(tmp_path / "a.dxf", {"M": GARMENTS[garment](0.0)}, Style(turned=turned, marks=False))
        document = ezdxf.readfile(path)
        for block in document.blocks:
            for line in block.query('LINE[layer=="7"]'):
                block.delete_entity(line)
        document.saveas(path)
        draft = read_drafted(path)
        assert kinds(draft) == TRUE_SEAMS[garment]
        assert any(f"along {'x' if turned else 'y'} of the drawing" in note for note in draft.notes)
