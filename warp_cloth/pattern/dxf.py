"""Reading a DXF file of pattern pieces, by the layers of AAMA-292 and ASTM D6673, into pieces as they are drawn.

A piece is a block, inserted or not (dxf_drawn.py); where there are no blocks, a closed outline of the model space
(dxf_sheet.py). Lengths stay in the file's unit here.
"""

from __future__ import annotations

import contextlib
import io
import logging
import re
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8
from warp_cloth.pattern.dxf_binary import BINARY, as_text
from warp_cloth.pattern.dxf_drawn import (
    CUT,
    LINEAR,
    NAMELESS,
    SEW,
    Drawn,
    drawn_piece,
    flat_entities,
    layer_number,
    texts_of,
)
from warp_cloth.pattern.dxf_names import with_usable_names, written_name
from warp_cloth.pattern.dxf_sheet import sheet_pieces
from warp_cloth.pattern.labels import COUNT_KEYS, copies_of
from warp_cloth.pattern.loops import area_of, chained
from warp_cloth.pattern.specification import MOST_PANELS, short

EXPORT_AGAIN = "export the DXF again, as AAMA or ASTM"
LARGEST_FILE = 200_000_000  # bytes
MOST_POINTS = 200_000  # of a piece
HEADER = 100_000  # bytes, within which a file's code page is stated
DOS_PAGE = re.compile(rb"\$DWGCODEPAGE\s+3\s+dos(\d{3})\b", re.IGNORECASE)
BLANK = b" \t\r\n\x00\x1a"  # behind the end of a file


@dataclass(frozen=True, eq=False)
class Drawing:
    """The pieces of a file, what it states of all, and its unit's code ($INSUNITS; 0: none)."""

    pieces: tuple[Drawn, ...]
    stated: dict[str, str]
    unit_code: int


def read_drawing(file: str, data: bytes) -> Drawing:
    """The pieces of a DXF file.

    Raises:
        InputError: ezdxf is not installed, or the file cannot be read or has no pieces.
    """
    document = _document(file, data)
    try:
        pieces, loose = _pieces(document)
        unit = int(document.header.get("$INSUNITS", 0) or 0)
    except InputError:
        raise
    except Exception as error:  # entities that are damaged raise whatever ezdxf happens to meet in them
        _refuse(file, f"an entity cannot be read ({short(type(error).__name__)})")
    sheet = Drawn("")
    for text in loose:
        sheet.state(text)
    pieces = [piece for piece in pieces if piece.has_outline]
    if not pieces:
        _refuse(file, "has no pieces: nothing is drawn on layer 1 (the cut line) or 14 (the sew line)")
    if len(pieces) > MOST_PANELS:
        _refuse(file, f"{len(pieces):,} pieces are more than the {MOST_PANELS:,} that are read", "split the file")
    for piece in pieces:
        _check(file, piece)
    return Drawing(tuple(pieces), sheet.texts, unit)


def _refuse(file: str, problem: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
    raise InputError(file, problem, remedy)


def _document(file: str, data: bytes) -> Any:
    try:
        from ezdxf import recover
    except ImportError:
        raise InputError(file, "needs the package ezdxf", "pip install 'warp-cloth[dxf]'") from None
    if len(data) > LARGEST_FILE:
        _refuse(file, f"is larger than {LARGEST_FILE // 1_000_000} MB, too large for a pattern")
    if not data.strip():
        _refuse(file, "is empty")
    data = _in_utf8(data)
    if data.startswith(b"AC10"):
        _refuse(file, "is a DWG file, not DXF", "save it as DXF")
    if _is_cut_short(data):
        _refuse(file, "is cut short: its last section has no end", "copy or export it again, whole")
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # what it mends is not printed
    try:
        data = as_text(data) if data.startswith(BINARY) else data
        document, _ = recover.read(io.BytesIO(with_usable_names(data)))
    except Exception as error:  # a damaged file raises whatever the recovery happens to meet
        said = short(" ".join(str(error).split())) or type(error).__name__
        _refuse(file, f"cannot be read as DXF: {said}")
    return document


def _in_utf8(data: bytes) -> bytes:
    """Text in UTF-16, or in a code page of DOS that its header states, as UTF-8; other files as they are.

    Text in UTF-8 is recognised where the header states otherwise; of code pages ezdxf knows those of Windows.
    """
    stated = DOS_PAGE.search(data[:HEADER])
    if stated is None or data.startswith(BINARY):
        return to_utf8(data)
    for page in ("utf-8", f"cp{stated[1].decode()}"):
        with contextlib.suppress(LookupError, UnicodeError):
            return data.decode(page).encode()
    return data


def _is_cut_short(data: bytes) -> bool:
    """Whether a file ends within a section, so that pieces may be missing: without its end, and that of the file."""
    return data.rfind(b"SECTION") > data.rfind(b"ENDSEC") and not data.rstrip(BLANK).endswith(b"EOF")


def _pieces(document: Any) -> tuple[list[Drawn], list[str]]:
    """The pieces of all blocks, or else of the model space, and the texts that belong to none."""
    space = list(document.modelspace())
    every = [block for block in document.blocks if not block.is_any_layout]
    blocks = [block for block in every if not block.name.startswith("*")]
    if not any(entity.dxftype() in LINEAR for block in blocks for entity in block):
        blocks = [block for block in every if block.name.upper().startswith("*U")]  # groups that were never named
    drawn = {block.name for block in blocks if _has_lines(block, SEW) or _has_lines(block, CUT)}
    sheets = _sheets(blocks, drawn)
    inner = {name for block in blocks if block.name not in sheets for name in _inserted(block)}
    inserts = [*space, *(each for block in blocks if block.name in sheets for each in block)]
    pieces = []
    for block in blocks:
        if block.name in inner or block.name in sheets:
            continue
        insert = next((each for each in space if each.dxftype() == "INSERT" and each.dxf.name == block.name), None)
        piece = drawn_piece(written_name(block.name), list(block), _scale(insert))
        if insert is not None:
            for attribute in insert.attribs:
                piece.state(attribute.dxf.text)
        _count_inserts(piece, block.name, inserts)
        pieces.append(piece)
    loose = [entity for entity in space if entity.dxftype() != "INSERT"]
    texts = [text for entity in loose for text in texts_of(entity)]
    if not any(piece.has_outline for piece in pieces):
        for piece in pieces:
            _take_outline(piece)
    if not any(piece.has_outline for piece in pieces):
        return sheet_pieces(loose)
    outlined = [piece.block for piece in pieces if piece.has_outline]
    if len(outlined) == 1:  # all in one block
        inner_pieces, rest = sheet_pieces(
            [e for block in blocks if block.name == outlined[0] for e in flat_entities(block, 0)]
        )
        if len(inner_pieces) > 1:
            return inner_pieces, [*texts, *rest]
    return pieces, texts


def _sheets(blocks: list[Any], drawn: set[str]) -> set[str]:
    """Blocks of nothing but pieces, or but sheets of pieces; other blocks within a block are parts of its piece.

    ``drawn``: blocks that are pieces by what is drawn in them. A block that adds its texts and lines to a single one of
    these is a piece, too, and is put among them.
    """
    inserted = {block.name: _inserted(block) for block in blocks}
    sheets: set[str] = set()
    grown = True
    while grown:
        grown = False
        for block in blocks:
            held = inserted[block.name] & (drawn | sheets)
            if block.name in drawn or block.name in sheets or not held:
                continue
            adds = any(entity.dxftype() != "INSERT" for entity in block)
            (drawn if adds and len(held) == 1 and held <= drawn else sheets).add(block.name)
            grown = True
    return sheets


def _count_inserts(piece: Drawn, name: str, entities: list[Any]) -> None:
    """States a pair where a block is inserted as it is and mirrored, and no larger number is stated."""
    ways = [
        float(each.dxf.get("xscale", 1.0)) * float(each.dxf.get("yscale", 1.0)) < 0.0
        for each in entities
        if each.dxftype() == "INSERT" and each.dxf.name == name
    ]
    if any(ways) and not all(ways) and sum(copies_of(piece, piece.texts) or (0, 0)) < 2:
        piece.texts[COUNT_KEYS[0]] = f"{len(ways) - sum(ways)},{sum(ways)}"


def _inserted(block: Any) -> set[str]:
    return {entity.dxf.name for entity in block.query("INSERT")}


def _has_lines(block: Any, layer: int) -> bool:
    linear = [entity for entity in block if entity.dxftype() in LINEAR]
    return any(layer_number(str(entity.dxf.get("layer", "0"))) == layer for entity in linear)


def _take_outline(piece: Drawn) -> None:
    """Takes the largest loop of layers without meaning as the cut line, where a file does not use layers."""
    loops = chained(piece.lines.get(NAMELESS, []))
    if loops:
        largest = max(loops, key=lambda loop: abs(area_of(loop)))
        piece.lines[CUT] = [np.concatenate([largest, largest[:1]])]


def _scale(insert: Any) -> float:
    """The size at which a block is inserted; its place and turn say nothing of the cloth."""
    scale = 1.0 if insert is None else abs(float(insert.dxf.get("xscale", 1.0)))
    return scale if 1e-6 < scale < 1e6 else 1.0


def _check(file: str, piece: Drawn) -> None:
    """Refuses numbers that are none."""
    for lines in (*piece.lines.values(), *piece.points.values()):
        where = f'{file}: block "{short(piece.block)}"' if piece.block else file
        for line in lines:
            if len(line) > MOST_POINTS:
                _refuse(where, f"a line has over {MOST_POINTS:,} points")
            if not np.isfinite(line).all() or float(np.abs(line).max(initial=0.0)) > 1e9:
                _refuse(where, "a coordinate is not a usable number")
