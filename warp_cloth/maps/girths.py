"""Girths of a worn garment beside the body's: what a pattern maker compares."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.maps.levels import Level, trunk_level
from warp_cloth.maps.section import Section, cut
from warp_cloth.material.constants import Sheet
from warp_cloth.mesh import Mesh, Points

SECTORS = 72  # of 5 degrees round the trunk
ALONG = 9  # spots looked at along each piece of a section
PRESENT = 0.3  # less than this is a strap or a corner of the hem
MILLIMETRES = 1e3
# A garment's chest is measured a little below its armholes, and those of a wide garment hang low [m].
LOWER = {"chest": 0.12}
STEP = 0.01


def garment_girths(
    name: str, points: Points, sheet: Sheet | None, avatar: Mesh, levels: Sequence[Level]
) -> list[dict[str, Any]]:
    """Girths at each level that the garment reaches [mm].

    ``garment`` is the cloth's length round the trunk as worn, folds and all, ``natural`` that same line in the rest
    shape, ``ease`` natural less the body's: negative where the cloth must stretch to go round. Where sleeves join the
    trunk at the chest, the garment is measured a little lower.
    """
    rows: list[dict[str, Any]] = []
    if sheet is None:
        return rows
    for level in levels:
        row = None
        for drop in np.arange(0.0, LOWER.get(level.name, 0.0) + 0.5 * STEP, STEP):
            lower = _girth_row(name, points, sheet, avatar, level, drop)
            row = lower if row is None or (lower is not None and lower["closed"]) else row
            if row is None or row["closed"]:
                break
        rows += [row] if row is not None else []
    return rows


def _girth_row(
    name: str, points: Points, sheet: Sheet, avatar: Mesh, level: Level, drop: float
) -> dict[str, Any] | None:
    """The garment's girth ``drop`` [m] below a level; None where it does not reach."""
    low, high = avatar.bounds()
    section = cut(points, sheet.triangles, level.height - drop)
    here = trunk_level(avatar, level.height - drop, 0.5 * float(low[0] + high[0])) if drop > 0.0 else level
    if not len(section.faces) or here is None:
        return None
    ring = _ring(section, here)
    chosen = _near_the_trunk(section.ends, here) if ring is None else section.part == ring
    ends = section.ends[chosen]
    if ring is None and _covered(ends, here) < PRESENT:
        return None
    worn = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    flat = np.einsum("sek,skd->sed", section.weights[chosen], sheet.flat[section.faces[chosen]])
    natural = float(np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1).sum())
    return {
        "garment": name,
        "level": level.name,
        "height": MILLIMETRES * (level.height - float(low[1])),
        "body_girth": MILLIMETRES * level.girth,
        "garment_girth": MILLIMETRES * worn,
        "natural_girth": MILLIMETRES * natural,
        "ease": MILLIMETRES * (natural - level.girth) if ring is not None else None,
        "closed": ring is not None,
    }


def _ring(section: Section, level: Level) -> int | None:
    """The part of a garment's section that goes round the trunk and round no arm; the longest, where there are more."""
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
    """Parts of the body's section beside the trunk; what lies within it, as a second skin, is none."""
    trunk = level.section.ends[level.section.part == level.trunk]
    others = (part for part in range(level.section.part_count) if part != level.trunk)
    return [part for part in others if not _encloses(trunk, _middle(level, part))]


def _encloses(ends: NDArray[np.float64], spot: NDArray[np.float64]) -> bool:
    """Whether closed lines go round a point: a ray from it crosses them an odd number of times."""
    x, z = ends[..., 0] - spot[0], ends[..., 1] - spot[1]
    across = (z[:, 0] < 0.0) != (z[:, 1] < 0.0)
    rise = np.where(across, z[:, 1] - z[:, 0], 1.0)
    crossing = x[:, 0] - z[:, 0] * (x[:, 1] - x[:, 0]) / rise
    return bool((across & (crossing > 0.0)).sum() % 2)


def _near_the_trunk(ends: NDArray[np.float64], level: Level) -> NDArray[np.bool_]:
    """Whether segments are nearer to the trunk than to any limb, shape [S]."""
    middle = ends.mean(axis=1)
    spots, part = level.section.ends.mean(axis=1), level.section.part
    away = ((middle[:, None, :] - spots[None, :, :]) ** 2).sum(axis=2)
    return ~np.isin(part[np.argmin(away, axis=1)], _limbs(level))


def _covered(ends: NDArray[np.float64], level: Level) -> float:
    """Share of the directions from the trunk's middle in which there is cloth."""
    trunk = level.section.ends[level.section.part == level.trunk]
    # long edges reach over several sectors
    share = np.linspace(0.0, 1.0, ALONG)[:, None, None]
    spots = (1.0 - share) * ends[:, 0] + share * ends[:, 1]
    way = spots.reshape(-1, 2) - trunk.reshape(-1, 2).mean(axis=0)
    sector = np.floor((np.arctan2(way[:, 1], way[:, 0]) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    return len(np.unique(sector)) / SECTORS
