"""Gores of a skirt laid as a cone round the trunk, one after another, from the right side on by the front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.levels import WHOLE_TURN, repeated, spans
from warp_cloth.pattern.runs import parts_of_kind
from warp_cloth.pattern.wrap import Wrap

LEAST = 0.01  # [m] of a gore's width


def gore(parts: Sequence[Part], index: int, figure: Figure) -> Wrap:
    """A gore as an arc of the ring that all gores make at each height; their waist at the trunk's middle."""
    part = parts[index]
    gores = parts_of_kind(parts, "gore")
    levels, least, most = spans(part)
    height = float(figure.middle[1]) + levels - levels[-1]
    widths = [np.interp(height, *_widths(parts[each], figure)) for each in gores]
    around = np.maximum(np.sum(widths, axis=0), LEAST * len(gores))
    bend = WHOLE_TURN / around
    share = (sum(widths[: gores.index(index)]) + 0.5 * widths[gores.index(index)]) / around
    angle = WHOLE_TURN * float(np.median(share))
    outward = np.sin(angle) * figure.forward - np.cos(angle) * figure.left
    across = np.cross(UP, outward)
    # round the hips, if need be stretched: a waist that started within them would stay there
    deep, ahead = 0.5 * (figure.front + figure.back), 0.5 * (figure.front - figure.back)
    clear = 1.0 / np.hypot(np.sin(angle) / deep, np.cos(angle) / figure.half_width)
    stretch = np.maximum(1.0, clear * bend)[:, None]
    origin = np.stack([figure.at_height(y) for y in height]) + ahead * figure.forward
    across, outward = (stretch * each for each in repeated(across, outward))
    return Wrap(part.up, levels, 0.5 * (least + most), bend, origin + outward / bend[:, None], across, outward)


def _widths(part: Part, figure: Figure) -> tuple[np.ndarray, np.ndarray]:
    """Widths of a gore by height [m]."""
    levels, least, most = spans(part)
    return float(figure.middle[1]) + levels - levels[-1], np.maximum(most - least, LEAST)
