"""Which garments lie within which, where a scene lists them otherwise than they are modelled."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.choice import Choice
from warp_cloth.base.errors import InputError
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.skin import Skin
from warp_cloth.scene import Scene

# A garment lies within another where it is nearer to the skin on so much of the skin that both cover, and on average by
# so much [m]. A jacket over a shirt: 0.82 and 7 mm; a shirt and trousers that meet at the waist: 0.61 and 0.7 mm.
NEARER_PART, NEARER_BY = 0.75, 2e-3
LEAST_SHARED = 0.05  # of the skin that the smaller covers; less tells nothing


def refuse_twins(scene: Scene, garments: Sequence[Garment]) -> None:
    """Refuses a garment modelled in 3-D that is listed twice, in one place: neither could be the outer one.

    Raises:
        InputError: two garments that collide are the same.
    """
    if scene.collision.cloth is False:
        return
    for (one, first), (other, second) in combinations(zip(scene.garment_keys, garments, strict=True), 2):
        if not (first.is_modelled and second.is_modelled):
            continue
        if np.array_equal(first.points, second.points) and np.array_equal(first.triangles, second.triangles):
            raise InputError(other, f"is the same mesh in the same place as {one}", "remove one of them, or move it")


def layers_of(scene: Scene, garments: Sequence[Garment], skin: Skin | None) -> tuple[tuple[int, ...], list[Choice]]:
    """The layer of each garment, from the inside out, and why, where the scene lists them otherwise; else () and none.

    Only garments modelled in 3-D tell which is the inner one. ``skin``: that they are modelled on; None: it moves, or
    they do not meet it.
    """
    modelled = [index for index, garment in enumerate(garments) if garment.is_modelled]
    if skin is None or len(modelled) < 2 or scene.collision.cloth is False:
        return (), []
    heights = {index: _mean_heights(garments[index], skin) for index in modelled}
    inner_of = {  # of each garment, those listed after it that lie within it
        index: [later for later in modelled if later > index and _is_within(heights[later], heights[index])]
        for index in modelled
    }
    if not any(inner_of.values()):
        return (), []
    order: list[int] = []
    while len(order) < len(garments):
        left = [index for index in range(len(garments)) if index not in order]
        free = [index for index in left if not set(inner_of.get(index, ())) & set(left)]
        order.append(free[0])  # of those left the last has none after it, so one is always free
    keys = scene.garment_keys
    reason = ", ".join(f"{keys[one]} lies within {keys[index]}" for index in modelled for one in inner_of[index])
    value = ", ".join(keys[index] for index in order)
    return tuple(np.argsort(order).tolist()), [Choice("garment", value, f"inner to outer, as {reason}")]


def _mean_heights(garment: Garment, skin: Skin) -> NDArray[np.float64]:
    """The mean height of cloth above each vertex of the skin that is nearest to some of it [m]; nan: to none."""
    heights, nearest = skin.heights(garment.points)
    size = skin.body.vertex_count
    count = np.bincount(nearest, minlength=size)
    return np.where(count > 0, np.bincount(nearest, heights, size) / np.maximum(count, 1), np.nan)


def _is_within(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether the garment of these heights above the skin lies within the other."""
    further = other - one
    further = further[~np.isnan(further)]
    covered = min(np.count_nonzero(~np.isnan(one)), np.count_nonzero(~np.isnan(other)))
    if not len(further) or len(further) < LEAST_SHARED * covered:
        return False
    return bool((further > 0.0).mean() >= NEARER_PART and further.mean() >= NEARER_BY)
