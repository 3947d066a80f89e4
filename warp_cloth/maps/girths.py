"""Girths of a worn garment and of the body under it: the ease that a pattern maker reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.levels import Level, trunk_level
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.section import Section, cut
from warp_cloth.material.constants import Sheet

SECTORS = 72  # of 5 degrees around the trunk
ALONG = 9  # samples along each segment of a section
PRESENT = 0.3  # covered fraction of the directions; less is a strap or a corner of the hem
MILLIMETRES = 1e3
# A garment's chest is measured slightly below its armholes, and those of a wide garment hang low [m].
LOWER = {"chest": 0.12}
STEP = 0.01
# A level lies across a fold where the girth is so many times that above and that below, within so many steps.
FOLDED, NEARBY_STEPS = 1.05, (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class _Girth:
    """Length of the cloth around the trunk at a height."""

    worn: float  # folds included [m]
    natural: float  # of the same line in the rest shape [m]
    closed: bool  # whether it goes all the way around


def garment_girths(
    name: str, points: Points, sheet: Sheet | None, avatar: Mesh, levels: Sequence[Level]
) -> list[dict[str, Any]]:
    """Girths at each level that the garment reaches [mm].

    ``garment_girth`` is the length of the cloth around the trunk as worn, folds included; ``natural_girth`` that of the
    same line in the rest shape; ``ease`` is the natural minus the body's girth, negative where the cloth must stretch
    to go around. Where sleeves join the trunk at the chest, the garment is measured slightly lower; where a fold lies
    across a level, next to it.
    """
    rows: list[dict[str, Any]] = []
    if sheet is None:
        return rows
    floor = float(avatar.bounds()[0][1])
    for level in levels:
        girth = _girth_near(points, sheet, avatar, level)
        if girth is None:
            continue
        rows.append(
            {
                "garment": name,
                "level": level.name,
                "height": MILLIMETRES * (level.height - floor),
                "body_girth": MILLIMETRES * level.girth,
                "garment_girth": MILLIMETRES * girth.worn,
                "natural_girth": MILLIMETRES * girth.natural,
                "ease": MILLIMETRES * (girth.natural - level.girth) if girth.closed else None,
                "closed": girth.closed,
            }
        )
    return rows


def _girth_near(points: Points, sheet: Sheet, avatar: Mesh, level: Level) -> _Girth | None:
    """The garment's girth for a level; None if the garment does not reach it."""
    low, high = avatar.bounds()
    here, height = level, level.height
    found = _girth(points, sheet, here, height)
    for drop in np.arange(0.0, LOWER.get(level.name, 0.0) + 0.5 * STEP, STEP)[1:]:
        if found is None or found.closed:
            break
        body = trunk_level(avatar, level.height - drop, 0.5 * float(low[0] + high[0]))
        lower = None if body is None else _girth(points, sheet, body, level.height - drop)
        if body is not None and lower is not None and lower.closed:
            found, here, height = lower, body, level.height - drop
    if found is None or not found.closed:
        return found
    above, below = (
        [_girth(points, sheet, here, height + sign * STEP * step) for step in NEARBY_STEPS] for sign in (1.0, -1.0)
    )
    return _girth_off_fold(found, above, below)


def _girth_off_fold(found: _Girth, above: Sequence[_Girth | None], below: Sequence[_Girth | None]) -> _Girth:
    """The girth or, where a fold lies across its level, the nearest one above or below.

    A plane along such a fold cuts its layers, so the girth is larger than on both sides; a garment that flares grows in
    one direction only.
    """
    closed = [[girth for girth in side if girth is not None and girth.closed] for side in (above, below)]
    if not all(closed):
        return found
    most = FOLDED * max(min(girth.natural for girth in side) for side in closed)
    nearest = (girth for pair in zip(above, below, strict=True) for girth in pair if girth is not None and girth.closed)
    return next(girth for girth in (found, *nearest) if girth.natural <= most)


def _girth(points: Points, sheet: Sheet, body: Level, height: float) -> _Girth | None:
    """The garment's girth at a height [m], around the body's section there; None if it does not reach that height."""
    section = cut(points, sheet.triangles, height)
    if not len(section.faces):
        return None
    ring = _ring(section, body)
    chosen = _near_the_trunk(section.ends, body) if ring is None else section.part == ring
    ends = section.ends[chosen]
    if ring is None and _covered(ends, body) < PRESENT:
        return None
    flat = np.einsum("sek,skd->sed", section.weights[chosen], sheet.flat[section.faces[chosen]])
    worn, natural = (float(np.linalg.norm(each[:, 1] - each[:, 0], axis=1).sum()) for each in (ends, flat))
    return _Girth(worn, natural, ring is not None)


def _ring(section: Section, level: Level) -> int | None:
    """The part of a garment's section that encloses the trunk and no arm; the longest of several."""
    trunk, others = _middle(level, level.trunk), [_middle(level, part) for part in _limbs(level)]
    rings = []
    for part in set(range(section.part_count)) - section.open_parts:
        ends = section.ends[section.part == part]
        if _encloses(ends, trunk) and not any(_encloses(ends, other) for other in others):
            rings.append((float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()), part))
    return max(rings)[1] if rings else None


def _middle(level: Level, part: int) -> NDArray[np.float64]:
    """Middle of a part of the body's section, (x, z) [m]."""
    middle: NDArray[np.float64] = level.section.ends[level.section.part == part].reshape(-1, 2).mean(axis=0)
    return middle


def _limbs(level: Level) -> list[int]:
    """Parts of the body's section outside the trunk; those inside it, such as a second skin, do not count."""
    trunk = level.section.ends[level.section.part == level.trunk]
    others = (part for part in range(level.section.part_count) if part != level.trunk)
    return [part for part in others if not _encloses(trunk, _middle(level, part))]


def _encloses(ends: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """Whether closed lines enclose a point: a ray from it crosses them an odd number of times."""
    x, z = ends[..., 0] - point[0], ends[..., 1] - point[1]
    across = (z[:, 0] < 0.0) != (z[:, 1] < 0.0)
    rise = np.where(across, z[:, 1] - z[:, 0], 1.0)
    crossing = x[:, 0] - z[:, 0] * (x[:, 1] - x[:, 0]) / rise
    return bool((across & (crossing > 0.0)).sum() % 2)


def _near_the_trunk(ends: NDArray[np.float64], level: Level) -> NDArray[np.bool_]:
    """Whether segments are nearer to the trunk than to any limb, shape [S]."""
    middle = ends.mean(axis=1)
    body, part = level.section.ends.mean(axis=1), level.section.part
    distance = ((middle[:, None, :] - body[None, :, :]) ** 2).sum(axis=2)
    return ~np.isin(part[np.argmin(distance, axis=1)], _limbs(level))


def _covered(ends: NDArray[np.float64], level: Level) -> float:
    """Fraction of the directions from the trunk's middle in which there is cloth."""
    trunk = level.section.ends[level.section.part == level.trunk]
    # long edges cross several sectors
    t = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    samples = (1.0 - t) * ends[:, 0] + t * ends[:, 1]
    direction = samples.reshape(-1, 2) - trunk.reshape(-1, 2).mean(axis=0)
    sector = (
        np.floor((np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    )
    return len(np.unique(sector)) / SECTORS
