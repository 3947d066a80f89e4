"""Fonts of pictures: Pillow's own, or one of the system's where a name has letters that Pillow's lacks."""

from __future__ import annotations

import functools
import unicodedata

from PIL import ImageFont

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

# Files that Pillow finds where systems keep their fonts.
OTHERS = (
    "DejaVuSans.ttf",
    "NotoSans-Regular.ttf",
    "LiberationSans-Regular.ttf",
    "arial.ttf",
    "Arial.ttf",
    "NotoSansCJK-Regular.ttc",
    "YuGothM.ttc",
    "msyh.ttc",
    "malgun.ttf",
    "Arial Unicode.ttf",
    "NotoSansArabic-Regular.ttf",
    "NotoSansHebrew-Regular.ttf",
)
NO_LETTER = "\uffff"  # which no font has: its box is that of every letter a font lacks
# Letters without an accent that could be left out, and dashes.
ASCII = str.maketrans(
    {"ß": "ss", "Æ": "AE", "æ": "ae", "Œ": "OE", "œ": "oe", "Ø": "O", "ø": "o", "Ł": "L", "ł": "l", "Đ": "D", "đ": "d"}
    | dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212", "-")
)


def font_for(height: float, *texts: str) -> Font:
    """A font for these texts of a height [px]: Pillow's own, unless one of the system's has more of their letters."""
    own, letters = ImageFont.load_default(height), frozenset("".join(texts))
    if all(_has(own, letter) for letter in letters):
        return own
    others = (font for name in OTHERS if (font := _of_system(name, height)) is not None)
    return max((own, *others), key=lambda font: sum(_has(font, letter) for letter in letters))


def spelt(text: str, font: Font) -> str:
    """The text in the letters that a font has: others without their accents, or as question marks."""
    return "".join(letter if _has(font, letter) else _bare(letter) for letter in text)


def _bare(letter: str) -> str:
    parts = unicodedata.normalize("NFKD", letter.translate(ASCII))
    return "".join(each for each in parts if not unicodedata.combining(each)).encode("ascii", "replace").decode()


def _has(font: Font, letter: str) -> bool:
    """Whether a font has a letter; white space needs none."""
    return letter.isspace() or letter.isascii() or bytes(font.getmask(letter)) != bytes(font.getmask(NO_LETTER))


@functools.lru_cache(maxsize=64)
def _of_system(name: str, height: float) -> Font | None:
    try:
        return ImageFont.truetype(name, height)
    except OSError:
        return None
