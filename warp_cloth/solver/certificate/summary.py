"""Figures of each item: sums over its vertices on the device, read asynchronously."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.certificate.summary import (
    COLUMNS,
    GROUP,
    SLICE,
    shapes_type,
    summarise_groups,
    summarise_slices_kernel,
)
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.active_set import ActiveSet


@dataclass(frozen=True, eq=False)
class PendingFigures:
    """Figures of all items, copied asynchronously; the next request to the same summary overwrites them."""

    figures: wp.array  # in the host's memory, shape [items, COLUMNS]
    arrival: wp.Event | None  # None: they have arrived

    def read(self) -> Floats:
        """The figures, as soon as they have arrived; does not wait for what was launched after the request."""
        if self.arrival is not None:
            wp.synchronize_event(self.arrival)
        return np.array(self.figures.numpy())


class Summary:
    """Sums the items of a model, each in an order that does not depend on the others."""

    def __init__(self, model: ClothModel, active_set: ActiveSet) -> None:
        self._model = model
        self._summarise_slices = summarise_slices_kernel(model.precision)
        self.shapes_type = shapes_type(model.precision)
        starts = [np.arange(first, end, SLICE) for first, end in itertools.pairwise(model.item_start)]
        counts = np.array([len(each) for each in starts])
        first = np.concatenate([*starts, [model.vertex_count]])
        self._first_vertex = wp.array(first, dtype=wp.int32, device=model.device)
        self._active_slices = active_set.add(np.cumsum([0, *counts]).tolist())
        self._sums = self._rows(len(first) - 1)
        self._levels: list[tuple[wp.array, wp.array]] = []  # first rows of each group, and the groups' sums
        while not self._levels or counts.max() > 1:
            first, counts = _groups(counts)
            self._levels.append((wp.array(first, dtype=wp.int32, device=model.device), self._rows(len(first) - 1)))
        self._arrival: wp.Event | None = None
        self._figures = self._levels[-1][1]
        if wp.get_device(model.device).is_cuda:
            self._arrival = wp.Event(model.device)
            self._figures = wp.empty_like(self._figures, device="cpu", pinned=True)

    def _rows(self, count: int) -> wp.array:
        return wp.zeros((count, COLUMNS), dtype=wp.float64, device=self._model.device)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a request launches."""
        return [self._summarise_slices, summarise_groups]

    def request(self, residual: wp.array, shapes: Any) -> PendingFigures:
        """Figures of all selected items as they are now; of those that do not iterate, the last ones.

        Args:
            residual: of kernels.certificate.residual, shape [V, 2].
            shapes: of ``shapes_type``, to compare with.
        """
        model, device = self._model, self._model.device
        inputs = [self._active_slices.groups, self._first_vertex, residual, shapes, self._sums]
        inputs = [model.vertices, model.state, *inputs]
        wp.launch(self._summarise_slices, dim=self._active_slices.size, inputs=inputs, device=device)
        sums = self._sums
        for first, groups in self._levels:
            wp.launch(summarise_groups, dim=groups.shape, inputs=[first, sums, groups], device=device)
            sums = groups
        if self._arrival is not None:
            wp.copy(self._figures, sums)
            wp.get_stream(device).record_event(self._arrival)
        return PendingFigures(self._figures, self._arrival)


def _groups(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First rows of the groups of items that have ``counts`` rows each, the row count, and how many groups each has."""
    begins = np.cumsum(counts) - counts
    first = [np.arange(begin, begin + count, GROUP) for begin, count in zip(begins, counts, strict=True)]
    return np.concatenate([*first, [counts.sum()]]), np.array([len(each) for each in first])
