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
_FIRST = re.compile(r"^([A-Za-z0-9]{1,4})[\W_]+(.*\S)$")  # a size, then a name
_LAST = re.compile(r"^(.*[^\W_])[\W_]+([A-Za-z0-9]{1,4})\W?$")  # a name, then a size
_SMALLEST = 3  # numbers up to it count pieces and are no sizes


def sized(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces with sizes that only their names state ("FRONT-M"), where names so end in sizes."""
    ends = [_LAST.match(piece.name) for piece in pieces]
    firsts = [found for piece in pieces if (found := _FIRST.match(piece.name))]
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
            named = (size.upper() in SIZES and "R" not in of_stem) or (_is_number(size) and others > 1)
        if not named and not piece.size:
            piece = _size_first(piece, firsts)
        out.append(replace(piece, name=stem, size=size) if named else piece)
    return out


def _is_number(size: str) -> bool:
    return size.isdigit() and int(size) > _SMALLEST


def _size_first(piece: Piece, firsts: Sequence[re.Match[str]]) -> Piece:
    """A piece whose name begins with its size ("M_FRONT", "38-FRONT"), where others begin with others."""
    found = _FIRST.match(piece.name)
    if found is None:
        return piece
    size = found[1].upper()
    letters = {each[1].upper() for each in firsts}.intersection(SIZES)
    numbers = {each[1] for each in firsts if each[2] == found[2] and _is_number(each[1])}
    by_letter = size in letters and len(letters) > 1 and not letters <= {"L", "R"}
    return replace(piece, name=found[2], size=size) if by_letter or (size in numbers and len(numbers) > 1) else piece


def sized_by_blocks(pieces: Sequence[Piece], blocks: Sequence[str]) -> list[Piece]:
    """The pieces with the sizes that only the names of their blocks state ("FRONT-38" of the piece "FRONT").

    ``blocks`` has a name for each piece. They state sizes where all pieces that come several times come in the same
    ones; running numbers of blocks do not.
    """
    told = sized([replace(piece, name=block) for piece, block in zip(pieces, blocks, strict=True)])
    sizes: dict[str, list[str]] = {}
    for piece, other in zip(pieces, told, strict=True):
        sizes.setdefault(piece.name, []).append(other.size)
    several = {tuple(sorted(own)) for own in sizes.values() if len(own) > 1}
    of_each = next(iter(several), ())
    if any(piece.size for piece in pieces) or len(several) != 1 or len(set(of_each)) < len(of_each):
        return list(pieces)
    return [replace(piece, size=other.size) for piece, other in zip(pieces, told, strict=True)]


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
