"""Text encodings by byte order mark."""

from __future__ import annotations

import codecs

_UTF32 = (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def to_utf8(data: bytes) -> bytes:
    """Text with a byte order mark (UTF-8, UTF-16, UTF-32) as UTF-8 without it; other bytes unchanged."""
    kind = "utf-32" if data.startswith(_UTF32) else "utf-16" if data.startswith(_UTF16) else ""
    try:
        return data.decode(kind).encode("utf-8") if kind else data.removeprefix(codecs.BOM_UTF8)
    except UnicodeError:
        return data
