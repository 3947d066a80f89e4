"""The space that a garment leaves free, as a grid, and the shortest ways through it that keep clear of the cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import Floats, empty_heap
from warp_cloth.base.compiled_scipy import compiled_scipy
from warp_cloth.base.mesh import Indices, Points

if TYPE_CHECKING:
    import warp as wp

CELL = 0.02  # [m]
MARGIN = 0.25  # [m] around the garment
NEAR = 0.06  # [m] from cloth, where a way is twice as long as it is
MOST_CELLS = 3_000_000  # a larger garment has larger cells
SAMPLED = 0.7  # of a cell, between samples of a triangle
BLOCK = 1_000_000  # samples at a time


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Cells around a garment, and how far each is from its cloth."""

    low: Points  # lowest corner [m], shape [3]
    cell: float  # [m]
    clearance: Floats  # distance from the cloth [m], shape [X, Y, Z]

    @classmethod
    def around(cls, points: Points, triangles: Indices) -> FreeSpace:
        """The space around a garment at ``points`` [m], shape [V, 3]."""
        low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
        cell = max(CELL, float(np.cbrt(np.prod(high - low) / MOST_CELLS)))
        shape = np.ceil((high - low) / cell).astype(np.int64) + 1
        filled = np.zeros(shape, dtype=bool)
        corners = points[triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        divisions = np.maximum(np.ceil(longest / (SAMPLED * cell)).astype(np.int64), 1)
        for count in np.unique(divisions).tolist():
            weights = _weights(count)
            own = corners[divisions == count]
            for part in np.array_split(own, max(1, len(own) * len(weights) // BLOCK)):
                samples = np.einsum("sk,fkx->fsx", weights, part).reshape(-1, 3)
                filled[tuple(np.floor((samples - low) / cell).astype(np.int64).T)] = True
        return cls(low, cell, cells_off(filled) * cell)

    def clearances(self, points: Points) -> Floats:
        """Distance from the cloth [m] at ``points`` [m], shape [N, 3]; infinite beyond the grid."""
        cells = np.floor((points - self.low) / self.cell).astype(np.int64)
        inside = ((cells >= 0) & (cells < self.clearance.shape)).all(axis=1)
        found = np.full(len(points), np.inf)
        found[inside] = self.clearance[tuple(cells[inside].T)]
        return found

    def between_layers(self, points: Points, direction: Points) -> NDArray[np.bool_]:
        """Whether there is cloth both ahead of each point [m], shape [N, 3], and behind it, along a unit vector."""
        depth = float(np.linalg.norm(self.cell * np.array(self.clearance.shape)))
        steps = np.arange(0.0, depth, self.cell)[:, None] * direction
        rays = [(points[:, None] + sign * steps).reshape(-1, 3) for sign in (1.0, -1.0)]
        ahead, behind = ((self.clearances(ray) <= 0.0).reshape(len(points), -1).any(axis=1) for ray in rays)
        return np.asarray(ahead & behind)

    def clearest(self, point: Points, reach: float) -> Points:
        """The middle of the clearest cell within ``reach`` of a point along each axis [m], shape [3]."""
        shape = np.array(self.clearance.shape)
        centre = np.clip(np.floor((point - self.low) / self.cell).astype(np.int64), 0, shape - 1)
        steps = int(np.ceil(reach / self.cell))
        first, last = np.maximum(centre - steps, 0), np.minimum(centre + steps + 1, shape)
        block = self.clearance[tuple(slice(*span) for span in zip(first, last, strict=True))]
        found: Points = self.low + (np.array(np.unravel_index(np.argmax(block), block.shape)) + first + 0.5) * self.cell
        return found

    def paths(self, start: Points, ends: Sequence[Points]) -> list[Points | None]:
        """The best way from ``start`` to each of ``ends`` [m], each shape [N, 3]; None: cloth lies between."""
        source, targets = self._number(start), [self._number(end) for end in ends]
        distance, before = self._ways(source, targets)
        found: list[Points | None] = []
        for target in targets:
            way = [target]
            if not np.isfinite(distance[target]):
                found.append(None)
                continue
            while before[way[-1]] >= 0:
                way.append(int(before[way[-1]]))
            cells = np.column_stack(np.unravel_index(way[::-1], self.clearance.shape))
            found.append(self.low + (cells + 0.5) * self.cell)
        return found

    def _number(self, point: Points) -> int:
        cell = np.floor((point - self.low) / self.cell).astype(np.int64)
        return int(np.ravel_multi_index(np.clip(cell, 0, np.array(self.clearance.shape) - 1), self.clearance.shape))

    def _ways(self, start: int, ends: Sequence[int]) -> tuple[Floats, Indices]:
        """Length of the best way to each cell, at least as far as ``ends``, and the cell before on it, shape [N]."""
        import warp as wp

        from warp_cloth.kernels.anatomy.heap import NOWHERE
        from warp_cloth.kernels.anatomy.ways import find_ways

        steps = np.linalg.norm(np.indices((3, 3, 3)) - 1, axis=0)
        lengths = wp.array(0.5 * steps * self.cell, dtype=wp.float64, device="cpu")
        heap, before = empty_heap(self._cost.size), wp.full(self._cost.size, NOWHERE, dtype=int, device="cpu")
        inputs = [self._cost, lengths, start, wp.array(ends, dtype=int, device="cpu")]
        wp.launch(find_ways, 1, inputs=inputs, outputs=[heap, before], device="cpu")
        return heap.distance.numpy(), before.numpy()

    @cached_property
    def _cost(self) -> wp.array:
        """1 + (NEAR / d)^2, per length of a way through a cell at distance d from cloth; infinite within it."""
        import warp as wp

        cost = 1.0 + (NEAR / np.maximum(self.clearance, self.cell)) ** 2
        cost[self.clearance <= 0.0] = np.inf
        return wp.array(cost, dtype=wp.float64, device="cpu")


def cells_off(filled: NDArray[np.bool_]) -> Floats:
    """How many cells each is from the nearest filled one, 0 within it, shape [X, Y, Z]."""
    tools = compiled_scipy("ndimage", "_nd_image", "euclidean_feature_transform")
    if tools is None:
        from scipy.ndimage import distance_transform_edt

        return np.asarray(distance_transform_edt(~filled), dtype=np.float64)
    nearest = np.zeros((filled.ndim, *filled.shape), dtype=np.int32)
    tools.euclidean_feature_transform((~filled).astype(np.int8), None, nearest)
    off = nearest - np.indices(filled.shape, dtype=np.int32)
    return np.asarray(np.sqrt((off.astype(np.float64) ** 2).sum(axis=0)))


def _weights(count: int) -> NDArray[np.float64]:
    """Barycentric weights of samples that divide each side of a triangle into ``count``, shape [S, 3]."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    within = i + j <= count
    u, v = i[within] / count, j[within] / count
    return np.stack([1.0 - u - v, u, v], axis=1)
