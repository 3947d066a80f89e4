"""Notes on pieces, those that say the same of several as one."""

from __future__ import annotations

import re
from collections.abc import Sequence

from warp_cloth.pattern.specification import short

MOST_NAMED = 4  # pieces that a note names
_OF_PIECE = re.compile(r'^piece "(.*?)"(:? .*)$')


def gathered(notes: Sequence[str]) -> list[str]:
    """The notes, what several say of a piece each said once, where the first one stood."""
    said: dict[str, list[str]] = {}
    for note in notes:
        found = _OF_PIECE.match(note)
        said.setdefault(note if found is None else found[2], []).append("" if found is None else found[1])
    out = []
    for note in notes:
        found = _OF_PIECE.match(note)
        text = note if found is None else found[2]
        names = list(dict.fromkeys(said.pop(text, [])))
        if len(names) > 1 and "" not in names:
            listed = ", ".join(f'"{short(name)}"' for name in names[:MOST_NAMED])
            out.append(f"each of {len(names)} pieces ({listed}{', ...' * (len(names) > MOST_NAMED)}){text}")
        elif names:
            out.append(note)
    return out
