"""What files of programs' own examples showed: names that are none, facings, legs with darts, notes of many pieces."""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from dxf_patterns import TRUE_SEAMS, Drafted, bezier, line, tshirt
from dxf_programs import outline
from dxf_rooms import MM, Blocks
from dxf_rooms import named as named_texts
from test_dxf import kinds

from warp_cloth.base.errors import InputError
from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.dxf_binary import as_text
from warp_cloth.pattern.dxf_names import with_usable_names
from warp_cloth.pattern.facings import is_facing
from warp_cloth.pattern.kinds import named
from warp_cloth.pattern.piece_notes import gathered


def blocks(*pieces: tuple[str, Drafted]) -> Blocks:
    out = Blocks(MM)
    for name, piece in pieces:
        out.begin(name, ())
        out.polyline(outline(piece), 1, closed=True)
        out.end_block(piece)
    return out


def test_names_that_are_allowed_stay_as_they_are() -> None:
    data = b"  0\nBLOCK\n  8\n1\n  2\nFRONT\n  0\nTEXT\n  1\na/b?\n"
    assert with_usable_names(data) == data


def test_blocks_of_one_name_stay_apart(tmp_path: Path) -> None:
    """As different pieces, whose inserts follow each other."""
    front, back, *_ = tshirt()
    path = blocks(("DETAIL", front), ("DETAIL", back)).finish(tmp_path / "twice.dxf")
    parts = read_drafted(path).parts
    assert [part.name for part in parts] == ["DETAIL", "DETAIL #2"]


def test_a_facing_lies_along_neck_and_shoulder_of_a_nameless_front(tmp_path: Path) -> None:
    """It is left out, and the T-shirt is sewn as without it."""
    pieces = tshirt()
    shoulder, neck = pieces[0].edges[3:5]
    low, corner = (neck[-1][0], neck[-1][1] - 6.0), (shoulder[0][0], neck[-1][1] - 6.0)
    facing = Drafted("5", [shoulder, neck, line(neck[-1], low), line(low, corner), line(corner, shoulder[0])])
    numbered = [(str(k), piece) for k, piece in enumerate([*pieces, facing])]
    draft = read_drafted(blocks(*numbered).finish(tmp_path / "faced.dxf"))
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert any("4: facing" in note for note in draft.notes)


def test_a_strip_along_a_straight_edge_is_no_facing() -> None:
    def rectangle(wide: float, high: float) -> list[Chain]:
        corners = np.array([(0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high), (0.0, 0.0)])
        return [Chain(corners[k : k + 2]) for k in range(4)]

    assert not is_facing(rectangle(0.4, 0.05), rectangle(0.4, 0.6))
    assert is_facing(rectangle(0.4, 0.6), rectangle(0.4, 0.6))


def yoked() -> list[tuple[str, Drafted]]:
    """A T-shirt whose back is cut across below the shoulders, and laid in a pleat of 5 cm there."""
    front, back, sleeve, band = tshirt()
    hem, side, armhole, shoulder, neck, fold = (list(edge) for edge in back.edges)
    height = armhole[-1][1] - 8.0
    cut = next(k for k, point in enumerate(armhole) if point[1] > height)
    corner, middle = armhole[cut], (0.0, armhole[cut][1])
    yoke = [line(middle, corner), armhole[cut:], shoulder, neck, line(fold[0], middle)]
    pleat = [(x - 5.0 if x == 0.0 else x, y) for x, y in (hem[0], middle)]
    below = [line(pleat[0], hem[1]), side, armhole[: cut + 1], line(corner, pleat[1]), line(pleat[1], pleat[0])]
    pieces = [("YOKE", Drafted("YOKE", yoke)), ("BACK", Drafted("BACK", below))]
    return [("FRONT", front), *pieces, ("SLEEVE", sleeve), ("COLLAR", band)]


def test_a_back_with_a_yoke_is_sewn(tmp_path: Path) -> None:
    """The cap goes over the yoke's armhole, too, and no armhole is a crotch."""
    draft = read_drafted(blocks(*yoked()).finish(tmp_path / "yoked.dxf"))
    assert kinds(draft) == TRUE_SEAMS["tshirt"] | {"yoke": 1}


def test_of_a_stand_and_a_collar_neither_is_sewn_unasked(tmp_path: Path) -> None:
    stand = tshirt()[-1]
    path = blocks(*yoked(), ("COLLAR STAND", stand)).finish(tmp_path / "yoked.dxf")
    assert not {"collar", "collar ends"} & set(kinds(read_drafted(path)))


def half_skirt(name: str, vent: float) -> Drafted:
    """Half a pencil skirt, its middle at x = 0, with a vent there."""
    middle = [(0.0, 60.0), *([(0.0, 20.0), (-vent, 18.0), (-vent, 0.0)] if vent else [(0.0, 0.0)])]
    side = bezier((22.0, 0.0), (26.0, 30.0), (26.0, 45.0), (18.0, 61.0))
    edges = [line(middle[-1], side[0]), side, line(side[-1], middle[0])]
    return Drafted(name, [*edges, *(line(a, b) for a, b in pairwise(middle))])


def test_half_skirts_without_a_number_are_opened_or_cut_as_pairs(tmp_path: Path) -> None:
    """A front whose middle is straight is mirrored there; a back with a vent is sewn along its middle."""
    pieces = half_skirt("FRONT", 0.0), half_skirt("BACK", 4.0)
    draft = read_drafted(blocks(*((piece.name, piece) for piece in pieces)).finish(tmp_path / "skirt.dxf"))
    assert [part.name for part in draft.parts] == ["FRONT", "BACK", "BACK mirrored"]
    assert kinds(draft) == {"side": 2, "centre back": 1}


def test_a_binding_is_no_sleeve() -> None:
    assert named("armBinding").kind == named("BACK_LINI").kind == "none"
    assert named("neckBinding").kind == "collar"


def test_a_front_without_pocket_is_no_pocket() -> None:
    assert named("FRONT_NO_POCKET").kind == named("Front with pockets").kind == "front"
    assert named("FRONT POCKET").kind == "none"


def test_what_many_pieces_say_is_said_once() -> None:
    notes = ['piece "A": has no grain line', "a unit", 'piece "B": has no grain line', 'piece "B" is odd']
    assert gathered(notes) == ['each of 2 pieces ("A", "B"): has no grain line', "a unit", 'piece "B" is odd']


WRITTEN: dict[str, Callable[[str], str]] = {
    "old Macs' lines": lambda text: text.replace("\n", "\r"),
    "blank lines above": lambda text: f"\n\n{text}",
    "blanks behind": lambda text: text.replace("\n", "  \n"),
    "no sequence ends": lambda text: text.replace("  0\nSEQEND\n  8\n1\n", ""),
    "no header": lambda text: text[text.index("  0\nSECTION\n  2\nBLOCKS") :],
    "no end": lambda text: text.replace("  0\nEOF\n", ""),
    "comments": lambda text: "999\nby hand\n" + text.replace("  0\nPOLYLINE", "999\nnote\n  0\nPOLYLINE"),
    "decimal commas": lambda text: re.sub(r"(\d)\.(\d)", r"\1,\2", text),
    "layers named": lambda text: text.replace("\n  8\n1\n", "\n  8\nBoundary_Line\n"),
    "lines left open": lambda text: text.replace("\n 66\n1\n 70\n1\n", "\n 66\n1\n 70\n0\n"),
}


@pytest.mark.parametrize("way", WRITTEN)
def test_a_tshirt_is_read_however_its_file_is_written(way: str, tmp_path: Path) -> None:
    out = Blocks(MM)
    for piece in tshirt():
        out.begin(piece.name, named_texts(piece))
        out.polyline(outline(piece), 1, closed=True)
        out.end_block(piece)
    path = out.finish(tmp_path / "tee.dxf", "Units: METRIC")
    text = path.read_text()
    path.write_bytes(WRITTEN[way](text).encode())
    assert path.read_bytes() != text.encode()
    assert kinds(read_drafted(path)) == TRUE_SEAMS["tshirt"]


def test_a_named_facing_is_no_second_front(tmp_path: Path) -> None:
    """What is called a front, and repeats the neck and the shoulder of a larger one, faces it."""
    pieces = tshirt()
    shoulder, neck = pieces[0].edges[3:5]
    low, corner = (neck[-1][0], neck[-1][1] - 6.0), (shoulder[0][0], neck[-1][1] - 6.0)
    facing = Drafted("X", [shoulder, neck, line(neck[-1], low), line(low, corner), line(corner, shoulder[0])])
    both = [(piece.name, piece) for piece in pieces]
    draft = read_drafted(blocks(*both, ("FRONT NECK INSIDE", facing)).finish(tmp_path / "faced.dxf"))
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert any('"FRONT NECK INSIDE" is left out: it faces another piece' in note for note in draft.notes)


@pytest.mark.parametrize(("page", "name"), [("cp932", "ポケット"), ("cp932", "表前"), ("cp950", "功許蓋")])
def test_letters_of_two_bytes_are_no_forbidden_ones(page: str, name: str) -> None:
    lines = b"  0\nBLOCK\n  2\n" + name.encode(page) + b"\n  0\nENDBLK\n"
    assert with_usable_names(lines) == lines


def test_blocks_that_differ_in_a_forbidden_letter_stay_two() -> None:
    lines = b"\n".join(b"0\nBLOCK\n2\n" + name for name in (b"A/1", b"A_1", b"A:1"))
    assert with_usable_names(lines).split(b"\n")[3::4] == [b"A_1", b"A_1~~2", b"A_1~~3"]


def test_doubled_line_ends_and_single_ones_within_a_text_are_read() -> None:
    assert with_usable_names(b"0\r\r\nTEXT\r\r\n1\r\r\nA\rB\r\r\n") == b"0\nTEXT\n1\nA\rB\n"


@pytest.mark.parametrize(("version", "page"), [("R2000", "cp1251"), ("R2010", "utf-8")])
def test_binary_files_keep_their_letters(version: str, page: str) -> None:
    document = ezdxf.new(version)
    document.encoding = page
    document.header["$DWGCODEPAGE"] = "ANSI_1251"
    document.modelspace().add_text("ПЕРЕД")
    stream = io.BytesIO()
    document.write(stream, fmt="bin")
    assert "ПЕРЕД".encode(page) in as_text(stream.getvalue())


def test_a_circle_about_no_place_is_refused_at_once(tmp_path: Path) -> None:
    """Flattening a curve of coordinates that are no numbers would never end."""
    path = blocks(*yoked()).finish(tmp_path / "circle.dxf")
    circle = "  0\nCIRCLE\n  8\n1\n 10\nnan\n 20\n0\n 40\n5\n"
    path.write_text(path.read_text().replace("  0\nENDBLK\n", circle + "  0\nENDBLK\n", 1))
    with pytest.raises(InputError, match="not a usable number"):
        read_drafted(path)


def test_an_outline_of_no_numbers_on_a_sheet_is_refused_in_one_line(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    for wrong in (math.nan, math.inf):
        document.modelspace().add_lwpolyline([(0, 0), (500, 0), (500, wrong), (0, 500)], close=True)
    document.saveas(tmp_path / "a.dxf")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=r"a\.dxf: a coordinate is not a usable number"):
            read_drafted(tmp_path / "a.dxf")
