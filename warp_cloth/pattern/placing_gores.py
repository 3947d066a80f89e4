"""Skirts laid as a cone round the trunk: gores one after another, from the right side on by the front, and rings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.figure import UP, Figure
from warp_cloth.pattern.levels import WHOLE_TURN, repeated, spans
from warp_cloth.pattern.round_skirts import ring_of
from warp_cloth.pattern.runs import parts_of_kind
from warp_cloth.pattern.wrap import Cone, Wrap

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


def cone(parts: Sequence[Part], index: int, figure: Figure) -> Cone | None:
    """Part of a ring as part of a cone: a front or back as half of it, half a front as a quarter, gores in turn."""
    part = parts[index]
    if ring_of(part.edges, "centre" in part.roles) is None:
        return None
    waist = np.concatenate([part.edges[k].at(np.linspace(0.0, 1.0, 33)) for k in part.roles["waist"]])
    terms = np.column_stack([2.0 * waist, np.ones(len(waist))])
    centre = np.linalg.lstsq(terms, (waist**2).sum(axis=1), rcond=None)[0][:2]  # of the circle through them
    away = waist - centre
    angles = np.arctan2(away @ np.array([part.up[1], -part.up[0]]), -(away @ part.up))
    around = _around(parts, index)
    ways = figure.half_width * figure.left, 0.5 * (figure.front + figure.back) * figure.forward
    ahead = 0.5 * (figure.front - figure.back) * figure.forward
    radius = float(np.hypot(*away.T).mean())
    turned = float(angles.min()), float(angles.max())
    return Cone(centre, part.up, radius, turned, around, figure.middle + ahead, *ways)


def _around(parts: Sequence[Part], index: int) -> tuple[float, float]:
    """From where to where a part of a cone goes round the trunk [rad], 0 in front, rising to the wearer's left."""
    part = parts[index]
    if part.kind == "gore":
        gores = parts_of_kind(parts, "gore")
        ends = np.cumsum([0.0, *(float(np.ptp(parts[each].shape.box, axis=0)[0]) for each in gores)])
        low, high = (WHOLE_TURN * ends[gores.index(index) + n] / ends[-1] - 0.5 * np.pi for n in (0, 1))
        return float(low), float(high)
    middle = 0.0 if part.kind == "skirt_front" else np.pi
    faced = part.side if part.kind == "skirt_front" else -part.side  # a back's +x is at the wearer's right
    quarter = 0.5 * np.pi
    return middle - quarter * (faced <= 0), middle + quarter * (faced >= 0)
