"""What a piece is by its name: sleeve, hood, front of a leg, on which side; and the places that a scene may state."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

LEFT, BOTH, RIGHT = 1, 0, -1  # the wearer's

# Words of names, the more telling first: a "sleeve cuff" is a cuff. Whole words only where they are short.
WORDS = (
    ("none", r"facing|interlin|interfac|fusing|fusible|lining|label|pocket|flap|welt|belt|loop|tasche|beleg|futter"),
    ("cuff", r"cuff|b(ue|ü)ndchen|manschette|poignet|pu(ñ|n)o|polsino"),
    ("hood", r"hood|kapuze|capuch|cappuccio"),
    ("hem_band", r"(hem|bottom)[ _-]*(band|rib)|rib[ _-]*(hem|bottom)"),
    ("waistband", r"waist[ _-]*(band|rib)|\bwb\b|hosenbund|rockbund|\bbund\b|ceinture|cintur"),
    ("collar", r"collar|neck[ _-]*(band|rib|bind)|rib[ _-]*neck|kragen|\bcol\b|cuello|colletto"),
    ("yoke", r"yoke|passe\b|canes(u|ú)"),
    ("gusset", r"gusset|godet|zwickel"),
    ("sleeve", r"sleeve|\bslv|(ä|ae)rmel|manche|manga|manica"),
    ("leg", r"\bleg|pants?\b|trouser|jean|\bhosen?\b|shorts?\b|legging|pantal"),
    ("skirt", r"skirt|\brock|jupe|falda|gonna"),
    ("front", r"front|\bfrt?\b|\bf\b|vorder|devant|delanter|davanti|\bvt\b"),
    ("back", r"back|\bbk\b|\bb\b|r(ü|ue)ck|\bdos\b|espalda|trasero|dietro|hinter|\bht\b|rear"),
)
INNER_CLOTH = r"lining|fus(e|ing|ible)|interlin|interfac|futter|doublure|entretela|forro"
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
SIDES = (
    (LEFT, r"\bleft|\blh\b|\bl\b|links|gauche|izquierd|sinistr"),
    (RIGHT, r"\bright|\brh\b|\br\b|rechts|droite?\b|derech|destr"),
)
# Places that a scene may state, and the kind and side that each means
PLACES: dict[str, tuple[str, int]] = {
    "front": ("front", BOTH),
    "back": ("back", BOTH),
    "left_front": ("front", LEFT),
    "right_front": ("front", RIGHT),
    "left_back": ("back", LEFT),
    "right_back": ("back", RIGHT),
    "sleeve": ("sleeve", BOTH),
    "left_sleeve": ("sleeve", LEFT),
    "right_sleeve": ("sleeve", RIGHT),
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
    "hood": ("hood", BOTH),
    "left_hood": ("hood", LEFT),
    "right_hood": ("hood", RIGHT),
    "collar": ("collar", BOTH),
    "waistband": ("waistband", BOTH),
    "hem_band": ("hem_band", BOTH),
    "cuff": ("cuff", BOTH),
    "left_cuff": ("cuff", LEFT),
    "right_cuff": ("cuff", RIGHT),
    "none": ("none", BOTH),
}
PAIRED = ("sleeve", "leg", "leg_front", "leg_back", "hood", "cuff")  # cut twice where no number is stated


@dataclass(frozen=True)
class Named:
    """What a name says; ``kind`` is empty where it says nothing."""

    kind: str = ""
    side: int = BOTH


def named(name: str) -> Named:
    """What a piece's name says of it."""
    text = re.sub(r"\d{3,}", "0", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name))  # of a style "B2204" the B is no back
    text = re.sub(r"[_\-.,/()1-9]+|(?<!\w)0", " ", text).lower()
    found = [kind for kind, words in WORDS if re.search(words, text)]
    side = next((side for side, words in SIDES if re.search(words, text)), BOTH)
    if not found:
        return Named("", side)
    kind = found[0]
    if kind in ("leg", "skirt"):
        face = next((each for each in found if each in ("front", "back")), "")
        return Named(f"{kind}_{face}" if face else kind, side)
    return Named(kind, side)


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
        if re.search(INNER_CLOTH, material.lower()):
            what = replace(what, kind="none")
        found.append(what)
    return found


def _coded(words: Sequence[str]) -> str:
    """The kind that the words of a code stand for: after "TEE", "FR" and "BK" are a front and a back."""
    telling = [word for place, word in enumerate(words) if place == 0 or len(word) > 1]
    return next((kind for word in telling for kind, codes in CODES if word in codes), "")


def without_side(name: str) -> str:
    """A name without the words for left and right, for finding the two of a pair."""
    text = re.sub(r"[_\-.,/() ]+", " ", name).lower()
    for _, words in SIDES:
        text = re.sub(rf"({words})\w*", " ", text)
    return " ".join(text.split())
