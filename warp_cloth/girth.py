"""Girths at a height: of a body by tape, and of a garment worn on it, as worn and as cut."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.connected import lowest_connected
from warp_cloth.errors import InputError
from warp_cloth.mesh import Indices, Mesh, Points
from warp_cloth.rest import Floats, RestShape
from warp_cloth.shapes import trunk_girth
from warp_cloth.shapes.measures import CHEST_LEVEL, HIP_LEVEL, WAIST_LEVEL

LEVELS = {"chest": CHEST_LEVEL, "waist": WAIST_LEVEL, "hip": HIP_LEVEL}  # share of the body's height


@dataclass(frozen=True)
class LevelFit:
    """Body and garment at one level."""

    height: float  # above the floor [m]
    body: float  # girth of the trunk by tape [m]
    garment: float  # girth of the garment as cut [m]
    stretch: float  # of the garment as worn against as cut

    @property
    def ease(self) -> float:
        """How much larger the garment is cut than the body [m]; negative where it must stretch."""
        return self.garment - self.body


def level_fits(body: Mesh, points: Points, triangles: Indices, rest: RestShape) -> dict[str, LevelFit]:
    """The levels at which a closed ring of the garment runs round the trunk.

    Args:
        body: standing on the lowest point, y up.
        points: the garment as worn [m], shape [V, 3].
        triangles: of the garment, shape [F, 3].
        rest: its rest shape.
    """
    lower, upper = body.bounds()
    middle = 0.5 * (lower[0] + upper[0])
    centred = replace(body, points=body.points - np.array([middle, 0.0, 0.0]))
    found = {}
    for name, share in LEVELS.items():
        height = float(lower[1] + share * (upper[1] - lower[1]))
        ring = garment_girths(points - np.array([middle, 0.0, 0.0]), triangles, rest, height)
        if ring is None:
            continue
        try:
            girth = trunk_girth(centred, height)
        except InputError:
            continue
        if girth > 0.0:
            worn, cut = ring
            found[name] = LevelFit(height - float(lower[1]), girth, cut, worn / cut - 1.0)
    return found


def garment_girths(points: Points, triangles: Indices, rest: RestShape, height: float) -> tuple[float, float] | None:
    """Length of a garment's section at a height [m], as worn and as cut; None without a closed ring round x = 0.

    The section's pieces in single triangles are carried over to the triangles at rest. Rings that x = 0 does not pass
    through (sleeves) are left out.
    """
    level = points[:, 1] - height
    above = level >= 0.0
    cut = triangles[above[triangles].any(axis=1) & ~above[triangles].all(axis=1)]
    if not len(cut):
        return None
    # the corner that is alone on its side comes first: both pieces of the section's way start from it
    alone = np.where(above[cut].sum(axis=1)[:, None] == 1, above[cut], ~above[cut]).argmax(axis=1)
    row = np.arange(len(cut))
    first, second, third = (cut[row, (alone + turn) % 3] for turn in range(3))
    share = np.stack([level[first] / (level[first] - level[other]) for other in (second, third)], axis=1)
    sides = _rest_sides(rest, np.stack([first, second, third], axis=1))
    flat = _third_corner(sides)
    at_rest = np.linalg.norm(share[:, :1] * np.stack([sides[:, 0], 0.0 * row], axis=1) - share[:, 1:] * flat, axis=1)
    ends = [points[first] + share[:, [k]] * (points[other] - points[first]) for k, other in enumerate((second, third))]
    worn = np.linalg.norm(ends[0] - ends[1], axis=1)

    keys = [np.minimum(first, other) * len(points) + np.maximum(first, other) for other in (second, third)]
    spots, spot = np.unique(np.concatenate(keys), return_inverse=True)
    one, other = spot[: len(cut)], spot[len(cut) :]
    part = lowest_connected(len(spots), one, other)
    open_ends = np.bincount(spot, minlength=len(spots)) != 2
    x = np.zeros(len(spots))
    x[one], x[other] = ends[0][:, 0], ends[1][:, 0]
    rings = np.intersect1d(part[x < 0.0], part[x >= 0.0])
    rings = np.setdiff1d(rings, part[open_ends])
    chosen = np.isin(part[one], rings)
    if not chosen.any():
        return None
    return float(worn[chosen].sum()), float(at_rest[chosen].sum())


def _rest_sides(rest: RestShape, corners: Indices) -> Floats:
    """Rest lengths of the sides (0,1), (0,2), (1,2) of triangles [m], shape [N, 3]."""
    edges = np.sort(rest.topology.edges.astype(np.int64), axis=1)
    count = int(edges.max()) + 1
    keys = edges[:, 0] * count + edges[:, 1]
    order = np.argsort(keys)
    sides = np.sort(corners[:, [[0, 1], [0, 2], [1, 2]]].astype(np.int64), axis=2)
    place = np.searchsorted(keys[order], sides[..., 0] * count + sides[..., 1])
    return rest.edge_length[order[place]]


def _third_corner(sides: Floats) -> Floats:
    """Where the third corner lies in the plane [m], the first at the origin, the second on x; shape [N, 2]."""
    a, b, c = sides.T
    x = (a**2 + b**2 - c**2) / (2.0 * a)
    return np.stack([x, np.sqrt(np.maximum(b**2 - x**2, 0.0))], axis=1)
