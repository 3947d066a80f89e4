"""The sizes of pieces: as stated, as their names end or begin, or by how often each piece comes in a file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from warp_cloth.pattern.loops import area_of
from warp_cloth.pattern.piece import Piece

SIZES = ("XXXS", "XXS", "XS", "S", "M", "L", "XL", "XXL", "XXXL", "2XL", "3XL", "4XL", "5XL", "6XL")
GROWN = 0.003  # relative, by which areas of all pieces in two sizes differ at least
_FIRST = re.compile(r"^([A-Za-z0-9]{1,4})\s*[-_ .]\s*(.*\S)$")  # a size, then a name


def sized(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces with sizes that only their names state ("FRONT-M"), where names so end in sizes."""
    ends = [re.match(r"^(.*\S)\s*[-_ .(]\s*([A-Za-z0-9]{1,4})\)?$", piece.name) for piece in pieces]
    firsts = {found[1].upper() for piece in pieces if (found := _FIRST.match(piece.name))}
    out = []
    for piece, found in zip(pieces, ends, strict=True):
        if found is None:
            out.append(piece if piece.size else _size_first(piece, firsts))
            continue
        stem, size = found[1], found[2]
        if piece.size:
            named = size.lower() == piece.size.lower()
        else:
            of_stem = [each[2].upper() for each in ends if each is not None and each[1] == stem]
            others = len(of_stem)
            named = (size.upper() in SIZES and "R" not in of_stem) or (size.isdigit() and int(size) > 3 and others > 1)
        if not named and not piece.size:
            piece = _size_first(piece, firsts)
        out.append(replace(piece, name=stem, size=size) if named else piece)
    return out


def _size_first(piece: Piece, firsts: set[str]) -> Piece:
    """A piece whose name begins with its size ("M_FRONT"), where others begin with others."""
    found = _FIRST.match(piece.name)
    sizes = firsts.intersection(SIZES)
    if found is None or found[1].upper() not in sizes or len(sizes) < 2 or sizes <= {"L", "R"}:
        return piece
    return replace(piece, name=found[2], size=found[1].upper())


def rank(size: str) -> tuple[float, str]:
    """Sizes in order: letters, then numbers."""
    upper = size.upper()
    if upper in SIZES:
        return float(SIZES.index(upper)) - 1000.0, upper
    digits = "".join(c for c in upper if c.isdigit())
    return (float(digits[:9]) if digits else 1e12), upper


def numbered(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces of a file that states no sizes, but has each piece as often as it has sizes; and a note on it.

    Sizes are then numbered from small to large. At least three pieces are to come so often, in order.
    """
    if any(piece.size for piece in pieces):
        return list(pieces), []
    places: dict[str, list[int]] = {}
    for index, piece in enumerate(pieces):
        places.setdefault(piece.name, []).append(index)
    often = [own for own in places.values() if len(own) > 1]
    if len(often) < 3 or len({len(own) for own in often}) > 1:
        return list(pieces), []
    count = len(often[0])
    areas = [sum(area_of(pieces[own[number]].outline) for own in often) for number in range(count)]
    grown = [b / a - 1.0 for a, b in pairwise(areas)]
    if min(map(abs, grown)) < GROWN or not (min(grown) > 0.0 or max(grown) < 0.0):
        return list(pieces), []
    out = list(pieces)
    for own in often:
        for number, index in enumerate(own if grown[0] > 0.0 else own[::-1]):
            out[index] = replace(pieces[index], size=str(number + 1))
    return out, [f"no sizes are stated, and pieces come {count} times: numbered 1 to {count}, from small to large"]
