"""Girths of a worn garment and of the body under it: the ease that a pattern maker reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.levels import Level, trunk_level
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.section import Section, Sections, encloses
from warp_cloth.material.constants import Sheet

SECTORS = 72  # of 5 degrees around the trunk
ALONG = 9  # samples along each segment of a section
PRESENT = 0.3  # covered fraction of the directions; less is a strap or a corner of the hem
MILLIMETRES = 1e3
# A garment's chest is measured slightly below its armholes, and those of a wide garment hang low [m].
LOWER = {"chest": 0.12}
STEP = 0.01
# So many times as long as the steps below it lead to: a section just below an armhole still cuts the sleeve, by as much
# as a mesh happens to have its edges there (T-shirts of 8 to 25 mm: 1 to 3.5 cm of 108, and none one step below).
CUTS_SLEEVE = 1.003
SLEEVED = 1.12  # times as long as one step below: a sleeve is part of it
# A level lies across a fold where the girth is so many times that above and that below, within so many steps.
FOLDED, NEARBY_STEPS = 1.05, (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class _Girth:
    """Length of the cloth around the trunk at a height."""

    worn: float  # folds included [m]
    natural: float  # of the same line in the rest shape [m]
    closed: bool  # whether it goes all the way around


class TrunkLevels:
    """Levels of a body at which garments are measured; those below the named ones are each found once."""

    def __init__(self, body: Mesh, levels: Sequence[Level]) -> None:
        """``levels``: of chest, waist and hip, one at least."""
        self.named = tuple(_Around(level) for level in levels)
        self._body, self._others = body, dict[float, "_Around | None"]()
        low, _ = body.bounds()
        self.floor, self._middle = float(low[1]), float(self.named[0].middle[0])

    def at(self, height: float) -> _Around | None:
        """The level at a height [m]; None where there is no trunk."""
        if height not in self._others:
            level = trunk_level(self._body, height, self._middle)
            self._others[height] = None if level is None else _Around(level)
        return self._others[height]


class _Around:
    """A level of the body, and what tells its trunk from limbs that are apart from it."""

    def __init__(self, level: Level) -> None:
        self.level = level
        section = level.section
        trunk = section.ends[section.part == level.trunk]
        self.middle = trunk.reshape(-1, 2).mean(axis=0)  # of the trunk, (x, z) [m]
        middles = {
            part: section.ends[section.part == part].reshape(-1, 2).mean(axis=0)
            for part in range(section.part_count)
            if part != level.trunk
        }
        # parts inside the trunk, such as a second skin, are no limbs
        self.limbs = {part: middle for part, middle in middles.items() if not encloses(trunk, middle)}


def garment_girths(name: str, points: Points, sheet: Sheet | None, trunk: TrunkLevels) -> list[dict[str, Any]]:
    """Girths at each level that the garment reaches [mm].

    ``garment_girth`` is the length of the cloth around the trunk as worn, folds included; ``natural_girth`` that of the
    same line in the rest shape; ``ease`` is the natural minus the body's girth, negative where the cloth must stretch
    to go around. Where sleeves join the trunk at the chest, the garment is measured slightly lower, off them; where a
    fold lies across a level, next to it.
    """
    rows: list[dict[str, Any]] = []
    if sheet is None:
        return rows
    cloth = _Cloth(sheet, Sections(points, sheet.triangles))
    for around in trunk.named:
        girth, level = _girth_near(cloth, trunk, around), around.level
        if girth is None:
            continue
        rows.append(
            {
                "garment": name,
                "level": level.name,
                "height": MILLIMETRES * (level.height - trunk.floor),
                "body_girth": MILLIMETRES * level.girth,
                "garment_girth": MILLIMETRES * girth.worn,
                "natural_girth": MILLIMETRES * girth.natural,
                "ease": MILLIMETRES * (girth.natural - level.girth) if girth.closed else None,
                "closed": girth.closed,
            }
        )
    return rows


@dataclass(frozen=True, eq=False)
class _Cloth:
    """A worn garment: its rest shape, and its sections."""

    sheet: Sheet
    sections: Sections


def _girth_near(cloth: _Cloth, trunk: TrunkLevels, around: _Around) -> _Girth | None:
    """The garment's girth for a level; None if the garment does not reach it."""
    level = around.level
    height = level.height
    found = _girth(cloth, around, height)
    for drop in np.arange(0.0, LOWER.get(level.name, 0.0) + 0.5 * STEP, STEP)[1:]:
        if found is None or found.closed:
            break
        if (lower := _ring_at(cloth, trunk, level.height - drop)) is not None:
            (found, around), height = lower, level.height - drop
    if found is None or not found.closed:
        return found
    if level.name in LOWER and around.limbs:
        found, around, height = _off_sleeves(cloth, trunk, around, found, height)
    elif level.name in LOWER and height == level.height:
        found, around, height = _below_sleeves(cloth, trunk, around, found)
    above, below = (
        [_closed_girth(cloth, around, height + sign * STEP * step) for step in NEARBY_STEPS] for sign in (1.0, -1.0)
    )
    return _girth_off_fold(found, above, below)


def _off_sleeves(
    cloth: _Cloth, trunk: TrunkLevels, around: _Around, found: _Girth, height: float
) -> tuple[_Girth, _Around, float]:
    """A chest's girth, its level and height [m], or those one step below where the section cuts sleeves."""
    below, lowest = (_ring_at(cloth, trunk, height - step * STEP) for step in (1, 2))
    if below is None or lowest is None:
        return found, around, height
    lower = below[0].natural
    cuts = found.natural > CUTS_SLEEVE * max(lower, 2.0 * lower - lowest[0].natural)
    return (*below, height - STEP) if cuts else (found, around, height)


def _below_sleeves(cloth: _Cloth, trunk: TrunkLevels, around: _Around, found: _Girth) -> tuple[_Girth, _Around, float]:
    """A chest's girth, its level and height [m], or those below the armholes where no arm tells sleeves from the rest.

    There an empty sleeve is part of the ring, which is shorter at once where it leaves it.
    """
    name, start = around.level.name, around.level.height
    here = found
    for drop in np.arange(0.0, LOWER[name] + 0.5 * STEP, STEP)[1:]:
        ring = _ring_at(cloth, trunk, start - drop)
        if ring is None or ring[1].limbs:
            break
        if here.natural > SLEEVED * ring[0].natural:
            return (*ring, start - drop)
        here = ring[0]
    return found, around, start


def _girth_off_fold(found: _Girth, above: Sequence[_Girth | None], below: Sequence[_Girth | None]) -> _Girth:
    """The girth or, where a fold lies across its level, the nearest one above or below; all go all the way around.

    A plane along such a fold cuts its layers, so the girth is larger than on both sides; a garment that flares grows in
    one direction only.
    """
    closed = [[girth for girth in side if girth is not None] for side in (above, below)]
    if not all(closed):
        return found
    most = FOLDED * max(min(girth.natural for girth in side) for side in closed)
    nearest = (girth for pair in zip(above, below, strict=True) for girth in pair if girth is not None)
    return next(girth for girth in (found, *nearest) if girth.natural <= most)


def _girth(cloth: _Cloth, around: _Around, height: float) -> _Girth | None:
    """The garment's girth at a height [m]; None if it does not reach that height."""
    section = cloth.sections.at(height)
    if not len(section.faces):
        return None
    if (ring := _ring(section, around)) is not None:
        return _measured(cloth, section, section.part == ring, closed=True)
    chosen = _near_the_trunk(section.ends, around)
    return None if _covered(section.ends[chosen], around) < PRESENT else _measured(cloth, section, chosen, closed=False)


def _ring_at(cloth: _Cloth, trunk: TrunkLevels, height: float) -> tuple[_Girth, _Around] | None:
    """The garment's girth at a height [m], and the body's level there; None: it does not go all the way around."""
    around = trunk.at(height)
    girth = None if around is None else _closed_girth(cloth, around, height)
    return None if around is None or girth is None else (girth, around)


def _closed_girth(cloth: _Cloth, around: _Around, height: float) -> _Girth | None:
    """The garment's girth at a height [m]; None if it does not go all the way around there."""
    section = cloth.sections.at(height)
    ring = _ring(section, around)
    return None if ring is None else _measured(cloth, section, section.part == ring, closed=True)


def _measured(cloth: _Cloth, section: Section, chosen: NDArray[np.bool_], *, closed: bool) -> _Girth:
    """Length of these segments of a section."""
    ends = section.ends[chosen]
    worn = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    return _Girth(worn, section.length_on(cloth.sheet.flat, chosen), closed)


def _ring(section: Section, around: _Around) -> int | None:
    """The part of a garment's section that encloses the trunk and no arm; the longest of several."""
    rings = []
    for part in set(range(section.part_count)) - section.open_parts:
        ends = section.ends[section.part == part]
        if encloses(ends, around.middle) and not any(encloses(ends, limb) for limb in around.limbs.values()):
            rings.append((float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()), part))
    return max(rings)[1] if rings else None


def _near_the_trunk(ends: NDArray[np.float64], around: _Around) -> NDArray[np.bool_]:
    """Whether segments are nearer to the trunk than to any limb, shape [S]."""
    section = around.level.section
    middle, body = ends.mean(axis=1), section.ends.mean(axis=1)
    distance = (middle[:, 0, None] - body[:, 0]) ** 2 + (middle[:, 1, None] - body[:, 1]) ** 2
    return ~np.isin(section.part[np.argmin(distance, axis=1)], list(around.limbs))


def _covered(ends: NDArray[np.float64], around: _Around) -> float:
    """Fraction of the directions from the trunk's middle in which there is cloth."""
    # long edges cross several sectors
    t = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    samples = (1.0 - t) * ends[:, 0] + t * ends[:, 1]
    direction = samples.reshape(-1, 2) - around.middle
    sector = (
        np.floor((np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    )
    return len(np.unique(sector)) / SECTORS
