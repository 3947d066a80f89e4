"""Text files as other programs write them: a byte order mark says which Unicode it is."""

from __future__ import annotations

import codecs

_UTF32 = (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def in_utf8(data: bytes) -> bytes:
    """The bytes of a text in UTF-8 without a mark, where a mark tells what they are; else as they are."""
    kind = "utf-32" if data.startswith(_UTF32) else "utf-16" if data.startswith(_UTF16) else ""
    try:
        return data.decode(kind).encode("utf-8") if kind else data.removeprefix(codecs.BOM_UTF8)
    except UnicodeError:
        return data
