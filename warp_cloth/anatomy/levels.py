"""Chest, waist and hip levels of any standing body, found from its horizontal sections."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.section import Section, convex_girth, cut

STEP = 0.01  # of the stature, between sections
# Heights between which each level is searched for, as fractions of the stature (after ISO 8559-1: the hip at the widest
# part of the seat, the waist at the narrowest between ribs and hip bone, the chest at the widest below the armpits).
HIP_RANGE = (0.49, 0.55)
WAIST_RANGE = (0.57, 0.67)
CHEST_RANGE = (0.68, 0.73)
# The same of chest and waist as fractions of the trunk, from the crotch up to the roots of hanging arms, and the steps:
# neither hats, heels, a bent head nor a crown that a scan lacks move them. Arms join the section at 0.93 to 0.98.
WAIST_OF_TRUNK, CHEST_OF_TRUNK = (0.42, 0.72, 0.03), (0.77, 0.89, 0.015)
# Of the trunk likewise: the hip is searched from here at least, to there. HIP_RANGE begins at 0.00 to 0.14 and ends at
# 0.21 to 0.34 of grown-ups and of children over six; of who has a large head, short legs or no feet it lies higher.
HIP_OF_TRUNK = (0.145, 0.2)
# A trunk that is so many times as wide as one step below includes the arms (measured: 1.6 to 2.3; at a bust, which
# only adds to the girth in front, 1.04).
ARMS_JOIN = 1.25
# At this fraction of the stature a neck or chin has at most this fraction of the chest's girth (measured: half of it,
# more for a child). If the head is cut off these are the shoulders, and all fractions are wrong.
NECK, NECK_WIDEST = 0.88, 0.9
# A foot's length as a fraction of the stature, and the heights at which it is measured (measured: 0.13 to 0.15; legs
# cut off at the ankle 0.06, at the knee 0.09). Without feet all fractions are wrong, and the hip is 2 cm too small.
FOOT, FOOT_HEIGHTS = 0.1, (0.005, 0.01, 0.02)
STATURES = (0.8, 2.6)  # [m] of a body
GIRTHS = (0.3, 2.2)  # [m]
BUST_STEPS = 20  # between waist and chest


@dataclass(frozen=True, eq=False)
class Level:
    """A level: its height, the girth there, the body's section, and which part of the section is the trunk."""

    name: str
    height: float  # [m]
    girth: float  # [m]
    section: Section
    trunk: int


LevelAt = Callable[[float], Level | None]


@dataclass(frozen=True, eq=False)
class Heights:
    """Where each level is searched for [m], from the lowest up, each of shape [N]."""

    chest: NDArray[np.float64]
    waist: NDArray[np.float64]
    hip: NDArray[np.float64]

    @classmethod
    def of_stature(cls, floor: float, stature: float) -> Heights:
        """Of a body of this stature [m] whose feet would stand on a floor of this height [m]."""
        fractions = np.arange(HIP_RANGE[0], CHEST_RANGE[1] + 0.5 * STEP, STEP)

        def inside(bounds: tuple[float, float]) -> NDArray[np.float64]:
            low, high = bounds
            return floor + fractions[(fractions >= low - 1e-9) & (fractions <= high + 1e-9)] * stature

        return cls(inside(CHEST_RANGE), inside(WAIST_RANGE), inside(HIP_RANGE))

    def on_trunk(self, crotch: float, roots: float) -> Heights:
        """The same by the heights of a trunk's crotch and arms' roots [m]; the hip farther up or down if need be."""

        def inside(low: float, high: float, step: float) -> NDArray[np.float64]:
            return np.asarray(crotch + np.arange(low, high + 0.5 * step, step) * (roots - crotch), dtype=np.float64)

        low, high = (crotch + bound * (roots - crotch) for bound in HIP_OF_TRUNK)
        step = float(self.hip[1] - self.hip[0])
        below, above = np.arange(low, self.hip[0], step), np.arange(high, self.hip[-1], -step)[::-1]
        hip = np.concatenate([below, self.hip, above])
        return replace(self, chest=inside(*CHEST_OF_TRUNK), waist=inside(*WAIST_OF_TRUNK), hip=hip)


def body_levels(body: Mesh, trunk: tuple[float, float] | None = None) -> tuple[Level, ...] | None:
    """Chest, waist and hip of a body that stands along y, facing +z, with head and feet, arms apart from the trunk.

    None for anything else. ``trunk``: heights of its crotch and of its arms' roots [m], where they are known.
    """
    low, high = body.bounds()
    stature = float(high[1] - low[1])
    if not STATURES[0] <= stature <= STATURES[1]:
        return None
    middle = 0.5 * float(low[0] + high[0])
    heights = Heights.of_stature(float(low[1]), stature)
    if trunk is not None:
        heights = heights.on_trunk(*trunk)
    found = trunk_levels(lambda height: trunk_level(body, height, middle), heights)
    good = tuple(level for level in found if GIRTHS[0] <= level.girth <= GIRTHS[1])
    legs = cut(body.points, body.triangles, float(low[1]) + 0.25 * stature).part_count >= 2
    neck = trunk_level(body, low[1] + NECK * stature, middle)
    headed = neck is not None and len(good) > 0 and neck.girth <= NECK_WIDEST * good[0].girth
    soles = (cut(body.points, body.triangles, float(low[1]) + fraction * stature) for fraction in FOOT_HEIGHTS)
    footed = any(_longest(sole) >= FOOT * stature for sole in soles)
    return good if legs and headed and footed and len(good) == 3 else None


def trunk_levels(at: LevelAt, heights: Heights, top: float = np.inf) -> list[Level]:
    """Chest, waist and hip of a trunk along y, facing +z, as far as they are found.

    Not a chest or waist of which a part is cut off: where it is widest, or narrowest, may be there.

    Args:
        at: the trunk's level at a height, without arms that are apart from it.
        heights: where each level is searched for.
        top: height above which the trunk is not measured [m], where that is known.
    """
    seen = {float(height): at(float(height)) for each in (heights.hip, heights.waist, heights.chest) for height in each}
    # from the waist up, no higher than where the arms join
    upwards = sorted(height for height in seen if height >= heights.waist[0])
    while upwards and seen[upwards[0]] is None:  # of a bust, which begins above
        upwards.pop(0)
    for below, here in pairwise(upwards):
        under, level = seen[below], seen[here]
        if under is None or level is None or width(level) > ARMS_JOIN * width(under):
            top = min(top, here)
            break

    def among(name: str, searched: NDArray[np.float64], sign: float) -> Level | None:
        found = [level for level in (seen[float(height)] for height in searched if height < top) if level is not None]
        if name != "hip" and any(seen[float(height)] is None for height in searched):
            return None
        best = max(found, key=lambda level: sign * level.girth, default=None)
        return None if best is None else replace(best, name=name)

    chosen = (among("chest", heights.chest, 1.0), among("waist", heights.waist, -1.0), among("hip", heights.hip, 1.0))
    return [level for level in chosen if level is not None]


def under_bust_level(at: LevelAt, chest: Level, waist: Level) -> Level | None:
    """The level just below the breasts: where the girth falls farthest below an even change from chest to waist."""
    share = np.linspace(0.0, 1.0, BUST_STEPS + 1)[1:-1]
    heights = waist.height + share * (chest.height - waist.height)
    levels = [at(float(height)) for height in heights]
    even = waist.girth + share * (chest.girth - waist.girth)
    below = [even[n] - level.girth if level is not None else -np.inf for n, level in enumerate(levels)]
    found = levels[int(np.argmax(below))]
    return None if found is None else replace(found, name="under_bust")


def width(level: Level) -> float:
    """Larger of the trunk's width and depth at a level [m]."""
    trunk = level.section.ends[level.section.part == level.trunk]
    return float(np.ptp(trunk.reshape(-1, 2), axis=0).max())


def _longest(sole: Section) -> float:
    """Extent of a section from back to front, or of one part in any direction (toes may turn out) [m]."""
    if not len(sole.ends):
        return 0.0
    directions = np.array([(0.0, 1.0), (1.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5)), (np.sqrt(0.5), -np.sqrt(0.5))])
    along = sole.ends.reshape(-1, 2) @ directions.T
    part = np.repeat(sole.part, 2)
    lengths = [np.ptp(along[part == number], axis=0).max() for number in range(sole.part_count)]
    return float(max(np.ptp(along[:, 0]), *lengths))


def trunk_level(body: Mesh, height: float, middle: float) -> Level | None:
    """The level at a height, whose trunk is the part that crosses the body's middle plane; None below the crotch."""
    section = cut(body.points, body.triangles, height)
    best: Level | None = None
    for part, ends in enumerate(section.parts()):
        if ends[..., 0].min() < middle < ends[..., 0].max():
            girth = convex_girth(ends.reshape(-1, 2))
            if best is None or girth > best.girth:
                best = Level("", height, girth, section, part)
    return best
