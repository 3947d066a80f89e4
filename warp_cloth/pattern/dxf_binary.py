"""Binary DXF as text, so that both are mended alike."""

from __future__ import annotations

import re

SENTINEL = b"AutoCAD Binary DXF\r\n\x1a\x00"
BINARY = SENTINEL[:18]
LARGEST_CODE = 1071  # of a group: a larger one is a part of some number
_SECTION = re.compile(rb"\x00\x00SECTION\x00\x02\x00")  # with group codes of two bytes
_VERSION = re.compile(rb"\$ACADVER\x00\x01\x00(AC\d{4})\x00")
_PAGE = re.compile(rb"\$DWGCODEPAGE\x00\x03\x00([^\x00]*)\x00")
_UNIT = re.compile(rb"\$INSUNITS\x00\x46\x00(.)\x00", re.DOTALL)


def as_text(data: bytes) -> bytes:
    """A binary DXF file as an ASCII one; Valentina's have a header that misstates its numbers, and go without it.

    Raises:
        Exception: what is damaged raises whatever ezdxf or the decoding happens to meet in it.
    """
    try:
        return _text(data)
    except Exception:  # of numbers read at wrong places
        version, sections = _VERSION.search(data), [found.start() for found in _SECTION.finditer(data)]
        if version is None or len(sections) < 2:
            raise
        unit, page = _UNIT.search(data), _PAGE.search(data)
        header = b"\x00\x00SECTION\x00\x02\x00HEADER\x00\x09\x00$ACADVER\x00\x01\x00" + version[1] + b"\x00"
        header += b"" if page is None else b"\x09\x00$DWGCODEPAGE\x00\x03\x00" + page[1] + b"\x00"
        header += b"" if unit is None else b"\x09\x00$INSUNITS\x00\x46\x00" + unit[1] + b"\x00"
        return _text(SENTINEL + header + b"\x00\x00ENDSEC\x00" + data[sections[1] :])


def _text(data: bytes) -> bytes:
    from ezdxf.lldxf.tagger import binary_tags_loader

    lines = []
    for tag in binary_tags_loader(data):
        if tag.code > LARGEST_CODE:
            raise ValueError(f"group code {tag.code}")
        value = tag.value.hex() if isinstance(tag.value, bytes) else str(tag.value)
        lines += [str(tag.code), " ".join(value.splitlines())]
    return "\n".join([*lines, ""]).encode(_encoding(lines), "surrogateescape")


def _encoding(lines: list[str]) -> str:
    """That in which a text file with these lines is read: its own code page, or UTF-8 since R2007."""
    from ezdxf.tools.codepage import toencoding

    def stated(name: str) -> str:
        return lines[lines.index(name) + 2] if name in lines[:2000] else ""

    return "utf-8" if stated("$ACADVER") >= "AC1021" else toencoding(stated("$DWGCODEPAGE"))
