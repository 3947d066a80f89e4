"""Names of blocks and layers as some pattern programs write them, made such that a strict reader takes the file.

Valentina names blocks as its pieces are named ("FLAP/FACING"), with question marks for letters that the file's code
page lacks, and several blocks alike ("DETAIL"). The format allows neither: one such name would refuse a whole file, and
blocks of one name would fall together.
"""

from __future__ import annotations

import re
from collections import Counter

BLOCK, INSERT, RECORD, LAYER = b"BLOCK", b"INSERT", b"BLOCK_RECORD", b"LAYER"
NAMING = {BLOCK: (b"2", b"3"), INSERT: (b"2",), RECORD: (b"2",), LAYER: (b"2",)}  # group codes that hold the name
LAYER_CODE = b"8"
# some may be the second byte of a Japanese or Chinese letter, after one beyond ASCII
FORBIDDEN = re.compile(rb'[<>/":;?=,\x00-\x1f]|(?<=.)\*|(?<![\x80-\xff])[|`]|(?<![\x80-\xff])\\(?![UM]\+)')
STAND_IN = b"_"
AGAIN = "~~"  # before the number of a block whose name another one has, too
_NUMBERED = re.compile(rf"{AGAIN}\d+$")


def written_name(block: str) -> str:
    """The name of a block as its file has it, but for letters that names may not have."""
    return _NUMBERED.sub("", block)


def with_usable_names(data: bytes) -> bytes:
    """The bytes of an ASCII DXF file with names that are allowed, and of blocks unlike, and with clean lines."""
    lines = _lines(data)
    blocks = [name for entity, code, _, name in _names(lines) if entity == BLOCK and code == b"2"]
    counts = Counter(FORBIDDEN.sub(STAND_IN, name).upper() for name in blocks)
    seen: Counter[tuple[bytes, bytes, bytes]] = Counter()
    changes: dict[int, bytes] = {}
    for entity, code, place, name in _names(lines):
        usable = FORBIDDEN.sub(STAND_IN, name)
        alike = counts[usable.upper()] if entity in (BLOCK, INSERT, RECORD) and code != LAYER_CODE else 1
        if alike > 1:
            key = (entity, code, usable.upper())
            number = seen[key] % alike
            seen[key] += 1
            usable += b"%s%d" % (AGAIN.encode(), number + 1) if number else b""
        if usable != name:
            changes[place] = usable
    for place, line in changes.items():
        lines[place] = line
    return b"\n".join(lines)


def _lines(data: bytes) -> list[bytes]:
    """The lines of a file in pairs of group code and value, without blanks behind or above them.

    Line ends may be those of old Macs, or doubled; polylines that run into the next entity get their end.
    """
    data = re.sub(rb"\r+\n", b"\n", data) if b"\n" in data else data.replace(b"\r", b"\n")
    lines = [line.rstrip(b" \t") for line in data.removeprefix(b"\xef\xbb\xbf").split(b"\n")]
    first = next((place for place, line in enumerate(lines) if line), 0)
    lines = lines[first:]
    ends = []
    inside = False
    for place in range(1, len(lines), 2):
        if lines[place - 1].strip() == b"0":
            entity = lines[place].strip()
            if inside and entity not in (b"VERTEX", b"SEQEND"):
                ends.append(place - 1)
            inside = entity == b"POLYLINE" or (inside and entity == b"VERTEX")
    for place in reversed(ends):
        lines[place:place] = [b"  0", b"SEQEND"]
    return lines


def _names(lines: list[bytes]) -> list[tuple[bytes, bytes, int, bytes]]:
    """The names in a file: the kind of entity, the group code, the line, and the name."""
    found = []
    entity = b""
    naming: tuple[bytes, ...] = ()
    for place in range(1, len(lines), 2):
        code = lines[place - 1].strip()
        if code == b"0":
            entity = lines[place].strip()
            naming = NAMING.get(entity, ())
        elif code == LAYER_CODE or code in naming:
            found.append((entity, code, place, lines[place].strip()))
    return found
