"""Blocks that hold a piece in several sizes, and blocks that repeat others: as one drawn piece a size."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_drawn import CUT, Drawn
from warp_cloth.pattern.labels import SIZE_KEYS, name_of, size_of
from warp_cloth.pattern.loops import area_of, chained

SMALLEST_SIZE = 0.5  # of the area of the largest one
APART = 0.002  # relative, by which areas of two sizes differ at least


def without_shadows(pieces: Sequence[Drawn]) -> list[Drawn]:
    """The pieces without those that repeat another one under a size of its own, "M-1" beside "M", as Optitex does."""
    known = {(name_of(piece), size_of(piece)) for piece in pieces}
    kept = []
    for piece in pieces:
        found = re.match(r"^(.+)-\d$", size_of(piece))
        if found is None or (name_of(piece), found[1]) not in known:
            kept.append(piece)
    return kept


def unnested(pieces: Sequence[Drawn]) -> tuple[list[Drawn], list[str]]:
    """A drawn piece for each size where blocks have a cut line for each, and a note on it; sizes are numbered."""
    nests = [_nest(piece) for piece in pieces]
    count = Counter(len(nest) for nest in nests if len(nest) > 1).most_common(1)
    if not count:
        return list(pieces), []
    often = count[0][0]
    out = []
    for piece, nest in zip(pieces, nests, strict=True):
        if len(nest) != often:
            out.append(piece)
            continue
        rest = [line for line in piece.lines[CUT] if not any(_draws(line, loop) for loop in nest)]
        for number, loop in enumerate(nest):
            lines = piece.lines | {CUT: [np.concatenate([loop, loop[:1]]), *rest]}
            out.append(replace(piece, lines=lines, texts=piece.texts | {SIZE_KEYS[0]: str(number + 1)}))
    return out, [f"blocks hold {often} outlines each: taken as sizes 1 to {often}, from small to large"]


def _nest(piece: Drawn) -> list[Floats]:
    """Closed cut lines of about one size, from small to large."""
    loops = sorted(chained(piece.lines.get(CUT, [])), key=lambda loop: abs(area_of(loop)))
    areas = [abs(area_of(loop)) for loop in loops]
    large = [k for k, area in enumerate(areas) if area > SMALLEST_SIZE * areas[-1]]
    apart = [k for k in large if k == large[-1] or areas[k] < (1.0 - APART) * areas[k + 1]]
    return [loops[k] for k in apart]


def _draws(line: Floats, loop: Floats) -> bool:
    """Whether a line draws a loop, or a part of it."""
    reach = 1e-6 * float(np.ptp(loop, axis=0).max())
    return all(float(np.hypot(*(loop - point).T).min()) <= reach for point in line[[0, len(line) // 2, -1]])
