"""What a piece is by its name: sleeve, hood, front of a leg, on which side; and the places that a scene may state."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

from warp_cloth.pattern.vocabulary import (
    BESIDE,
    BIB_WORDS,
    INNER_CLOTH,
    LEFT_WORDS,
    RIB,
    RIBBED,
    RIGHT_WORDS,
    RUFFLE,
    SIDE_PANEL_WORDS,
    STAND,
    TIER,
    UNDER,
    WORDS,
)

LEFT, BOTH, RIGHT = 1, 0, -1  # the wearer's

# What pieces are called after the name of their style
CODES = (
    ("front", ("F", "FR", "FT", "FRT", "FP", "DV", "DEV", "VT")),
    ("back", ("B", "BK", "BCK", "BP", "DS", "RT")),
    ("sleeve", ("S", "SL", "SLV", "MA", "AE")),
    ("collar", ("C", "CO", "CL", "COL", "NB", "NK", "KR")),
    ("cuff", ("CF", "CU", "CUF")),
    ("waistband", ("WB", "W")),
    ("hood", ("H", "HD")),
    ("yoke", ("Y", "YK")),
    ("none", ("PK", "PKT", "POC", "FAC", "FL", "LB", "LIN", "INT")),
)
# Codes that say what a piece is where at least so many of one set are there: centre and side, front and back; left and
# right halves
CODE_SETS: tuple[tuple[int, dict[str, tuple[str, int, str]]], ...] = (
    (2, {"CF": ("front", 0, ""), "CB": ("back", 0, ""), "SF": ("front", 0, "side"), "SB": ("back", 0, "side")}),
    (2, {"FC": ("front", 0, ""), "BC": ("back", 0, ""), "FS": ("front", 0, "side"), "BS": ("back", 0, "side")}),
    (3, {"LF": ("front", 1, ""), "RF": ("front", -1, ""), "LB": ("back", 1, ""), "RB": ("back", -1, "")}),
    (3, {"FL": ("front", 1, ""), "FR": ("front", -1, ""), "BL": ("back", 1, ""), "BR": ("back", -1, "")}),
)
SIDES = ((LEFT, LEFT_WORDS), (RIGHT, RIGHT_WORDS))
# Places that a scene may state, and the kind and side that each means
PLACES: dict[str, tuple[str, int]] = {
    "front": ("front", BOTH),
    "back": ("back", BOTH),
    "left_front": ("front", LEFT),
    "right_front": ("front", RIGHT),
    "left_back": ("back", LEFT),
    "right_back": ("back", RIGHT),
    "side_front": ("side_front", BOTH),
    "left_side_front": ("side_front", LEFT),
    "right_side_front": ("side_front", RIGHT),
    "side_back": ("side_back", BOTH),
    "left_side_back": ("side_back", LEFT),
    "right_side_back": ("side_back", RIGHT),
    "sleeve": ("sleeve", BOTH),
    "left_sleeve": ("sleeve", LEFT),
    "right_sleeve": ("sleeve", RIGHT),
    "under_sleeve": ("under_sleeve", BOTH),
    "left_under_sleeve": ("under_sleeve", LEFT),
    "right_under_sleeve": ("under_sleeve", RIGHT),
    "front_sleeve": ("front_sleeve", BOTH),
    "left_front_sleeve": ("front_sleeve", LEFT),
    "right_front_sleeve": ("front_sleeve", RIGHT),
    "back_sleeve": ("back_sleeve", BOTH),
    "left_back_sleeve": ("back_sleeve", LEFT),
    "right_back_sleeve": ("back_sleeve", RIGHT),
    "leg_front": ("leg_front", BOTH),
    "left_leg_front": ("leg_front", LEFT),
    "right_leg_front": ("leg_front", RIGHT),
    "leg_back": ("leg_back", BOTH),
    "left_leg_back": ("leg_back", LEFT),
    "right_leg_back": ("leg_back", RIGHT),
    "leg": ("leg", BOTH),
    "left_leg": ("leg", LEFT),
    "right_leg": ("leg", RIGHT),
    "skirt_front": ("skirt_front", BOTH),
    "skirt_back": ("skirt_back", BOTH),
    "gore": ("gore", BOTH),
    "side_skirt_front": ("side_skirt_front", BOTH),
    "side_skirt_back": ("side_skirt_back", BOTH),
    "yoke": ("yoke", BOTH),
    "front_yoke": ("front_yoke", BOTH),
    "hood": ("hood", BOTH),
    "left_hood": ("hood", LEFT),
    "right_hood": ("hood", RIGHT),
    "collar": ("collar", BOTH),
    "stand": ("stand", BOTH),
    "fall": ("fall", BOTH),
    "waistband": ("waistband", BOTH),
    "hem_band": ("hem_band", BOTH),
    "cuff": ("cuff", BOTH),
    "left_cuff": ("cuff", LEFT),
    "right_cuff": ("cuff", RIGHT),
    "none": ("none", BOTH),
}
SKIRTS = ("skirt_front", "skirt_back")
COLLARS = ("collar", "stand", "fall")
STRIPS = (*COLLARS, "cuff", "waistband", "hem_band")
YOKE_OF = {"front": "front_yoke", "back": "yoke"}  # the yoke at the top of each
YOKES = tuple(YOKE_OF.values())
HALF_SLEEVES = ("front_sleeve", "back_sleeve")  # of one parted along the arm, at its top and beneath
PAIRED = (
    "sleeve",
    "under_sleeve",
    "lower_sleeve",
    *HALF_SLEEVES,
    "leg",
    "leg_front",
    "leg_back",
    "hood",
    "cuff",
    "strap",
    "side_front",
    "side_back",
    "side_skirt_front",
    "side_skirt_back",
)  # cut twice where no number is stated


SIDE_PANEL, UNDER_SLEEVE = "side", "under"
# Letters with no accent to take off
LETTERS = str.maketrans({"ł": "l", "ø": "o", "đ": "d", "ı": "i", "ß": "ss", "æ": "ae", "œ": "oe"})
ENCODINGS = ("utf-8", "gbk", "cp932", "cp949", "cp1251")  # of names that a file does not declare, and cp1252 spoils


@dataclass(frozen=True)
class Named:
    """What a name says; ``kind`` is empty where it says nothing."""

    kind: str = ""
    side: int = BOTH
    panel: str = ""  # SIDE_PANEL of a front or back, UNDER_SLEEVE of a sleeve
    face: str = ""  # "front" or "back", of a piece of another kind: a yoke's
    sure: float = 0.97  # of the kind
    is_facing: bool = False  # by its shape it faces another piece, and is left out
    is_layer: bool = False  # it lies over or under another piece, and is left out
    is_ruffle: bool = False
    is_tier: bool = False  # of a skirt
    level: int | None = None  # from above, of a skirt's pieces that lie one below another, drawn upright


def plain(text: str) -> str:
    """A text in lower case without accents of Latin and Greek letters; other scripts as they are."""
    apart = unicodedata.normalize("NFKD", text.lower()).translate(LETTERS)
    return unicodedata.normalize("NFC", re.sub(r"(?<=[a-z\u0370-\u03ff])[\u0300-\u036f]+", "", apart))


def named(name: str) -> Named:
    """What a piece's name says of it, in whatever encoding it was written."""
    what = _named(name)
    if not what.kind and any(letter >= "\x80" for letter in name):
        for read in ("cp1252", "utf-8"):  # as it may have been read
            for encoding in ENCODINGS:
                try:
                    other = _named(name.encode(read).decode(encoding))
                except UnicodeError:
                    continue
                if other.kind:
                    return other
    return what


def spaced(name: str) -> str:
    """A name as plain words, without numbers and signs; of a style "B2204" the B is no back."""
    text = re.sub(r"\d{3,}", "0", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name))
    return plain(re.sub(r"[_\-.,/()1-9#]+|(?<!\w)0", " ", text))


def _named(name: str) -> Named:
    text = re.sub(BESIDE, " ", spaced(name))
    found = [kind for kind, words in WORDS if re.search(words, text)]
    side = next((side for side, words in SIDES if re.search(words, text)), BOTH)
    kind = found[0] if found else ""
    is_ruffle = bool(re.search(RUFFLE, text)) and {"none", "front", "back"}.isdisjoint(found)
    if is_ruffle or (kind != "none" and re.search(RIB, text)):
        kind = next((band for band, words in RIBBED if re.search(words, text)), "hem_band" if is_ruffle else kind)
    if is_ruffle:
        return Named(kind, side, is_ruffle=True)
    face = next((each for each in found[1:] if each in ("front", "back")), "")
    if kind in ("", "skirt", "front", "back") and re.search(TIER, text):
        face = next((each for each in found if each in ("front", "back")), "")
        return Named(f"skirt_{face}" if face else "skirt", side, is_tier=True)
    if kind in ("leg", "skirt"):
        is_panel = kind == "skirt" and face and re.search(SIDE_PANEL_WORDS, text)
        return Named(f"{kind}_{face}" if face else kind, side, SIDE_PANEL if is_panel else "")
    if kind in ("", "front", "back") and re.search(SIDE_PANEL_WORDS, text):
        return Named(kind, side, SIDE_PANEL)
    if kind == "sleeve" and re.search(UNDER, text):
        return Named(kind, side, UNDER_SLEEVE)
    return Named(kind, side, face=face if kind not in ("front", "back") else "")


def is_named_stand(name: str) -> bool:
    """Whether a collar's name says that it is the stand below another one."""
    return bool(re.search(STAND, plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name))))


def named_all(texts: Sequence[Sequence[str]]) -> list[Named]:
    """What pieces are by their names, categories and materials; else by the codes after what all names begin with."""
    names = sorted({name for name, _, _ in texts})
    # of sorted names the first and the last differ soonest
    alike = [one == other for one, other in zip(names[0], names[-1], strict=False)]
    style = 0 if len(names) < 2 else alike.index(False) if False in alike else len(alike)
    found = []
    for name, category, material in texts:
        what = named(name)
        if not what.kind:
            other = named(category)
            what = replace(other, side=what.side or other.side) if other.kind else what
        words = [word.upper() for word in re.findall(r"[A-Za-z]+", name[style:])]
        if not what.kind:
            what = replace(what, kind=_coded(words))
        elif what.kind in ("front", "back") and len(words) > 1 and len(words[0]) > 1:  # "SL FR" is of a sleeve
            what = replace(what, kind=_coded(words[:1]) or what.kind)
        if re.search(INNER_CLOTH, plain(material)):
            what = replace(what, kind="none")
        found.append(what)
    found = [
        _as_bib(found) if not what.kind and re.search(BIB_WORDS, plain(name)) else what
        for what, (name, _, _) in zip(found, texts, strict=True)
    ]
    found = _by_code_sets(texts, found)
    # "right side front" may mean the side of the wearer: a side panel has a middle one next to it, if by another name
    whole = {what.kind for what in found if not what.panel}
    return [what if {what.kind, ""} & whole or not what.kind else replace(what, panel="") for what in found]


def _as_bib(found: Sequence[Named]) -> Named:
    """A piece named a bib: on a waistband; without one it is sewn to the waist as a front, if nothing else is one."""
    kinds = {what.kind for what in found}
    return Named("bib" if "waistband" in kinds else "" if "front" in kinds else "front")


def _by_code_sets(texts: Sequence[Sequence[str]], found: Sequence[Named]) -> list[Named]:
    """What was found, and of names that begin with the codes of a set what these say."""
    firsts = [next(iter(re.findall(r"[A-Za-z]+", name)), "").upper() for name, _, _ in texts]
    out = list(found)
    for least, codes in CODE_SETS:
        whole = any(
            what.kind in ("front", "back") for what, first in zip(found, firsts, strict=True) if first not in codes
        )
        has_sides = any(side for _, side, _ in codes.values())
        if len({*firsts} & {*codes}) < least or (has_sides and whole):  # "lf" beside "front" is half of a sleeve
            continue
        for index, first in enumerate(firsts):
            if first in codes and named(texts[index][0]).kind in ("", "front", "back"):
                kind, side, panel = codes[first]
                out[index] = replace(out[index], kind=kind, side=side, panel=panel)
    return out


def _coded(words: Sequence[str]) -> str:
    """The kind that the words of a code stand for: after "TEE", "FR" and "BK" are a front and a back."""
    telling = [word for place, word in enumerate(words) if place == 0 or len(word) > 1]
    return next((kind for word in telling for kind, codes in CODES if word in codes), "")


def without_side(name: str) -> str:
    """A name without the words for left and right, for finding the two of a pair."""
    text = plain(re.sub(r"[_\-.,/() ]+", " ", name))
    for _, words in SIDES:
        text = re.sub(rf"({words})\w*", " ", text)
    return " ".join(text.split())
