"""Sums over the vertices of each item, on the device, and what they came to, read without holding the device up."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.certificate.summary import CHUNK, COLUMNS, GROUP, chunk_kernel, looks_type, summarise_groups
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.active_set import AtWork


@dataclass(frozen=True, eq=False)
class Answer:
    """Figures of all items that are on their way to the host; the next question to the same summary replaces them."""

    figures: wp.array  # in the host's memory, shape [items, COLUMNS]
    arrival: wp.Event | None  # None: they are there

    def read(self) -> Floats:
        """The figures, once they are there; what was launched after the question is not waited for."""
        if self.arrival is not None:
            wp.synchronize_event(self.arrival)
        return np.array(self.figures.numpy())


class Summary:
    """Sums the items of a model, in an order that knows nothing of an item's company."""

    def __init__(self, model: ClothModel, at_work: AtWork) -> None:
        self._model = model
        self._chunks = chunk_kernel(model.precision)
        self.looks_type = looks_type(model.precision)
        starts = [np.arange(first, end, CHUNK) for first, end in itertools.pairwise(model.item_start)]
        counts = np.array([len(each) for each in starts])
        first = np.concatenate([*starts, [model.vertex_count]])
        self._first_vertex = wp.array(first, dtype=wp.int32, device=model.device)
        self._some = at_work.more(np.cumsum([0, *counts]).tolist())
        self._sums = self._rows(len(first) - 1)
        self._levels: list[tuple[wp.array, wp.array]] = []  # first rows of each group, and the groups' sums
        while not self._levels or counts.max() > 1:
            first, counts = _groups(counts)
            self._levels.append((wp.array(first, dtype=wp.int32, device=model.device), self._rows(len(first) - 1)))
        self._arrival: wp.Event | None = None
        self._there = self._levels[-1][1]
        if wp.get_device(model.device).is_cuda:
            self._arrival = wp.Event(model.device)
            self._there = wp.empty_like(self._there, device="cpu", pinned=True)

    def _rows(self, count: int) -> wp.array:
        return wp.zeros((count, COLUMNS), dtype=wp.float64, device=self._model.device)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a question launches."""
        return [self._chunks, summarise_groups]

    def ask(self, left: wp.array, looks: Any) -> Answer:
        """Figures of all items as they stand; of those that do not iterate what they last were.

        ``left`` is of kernels.certificate.residual, ``looks`` of ``looks_type``: shapes to compare with.
        """
        model, device = self._model, self._model.device
        inputs = [model.vertices, model.state, self._some.groups, self._first_vertex, left, looks, self._sums]
        wp.launch(self._chunks, dim=self._some.size, inputs=inputs, device=device)
        sums = self._sums
        for first, groups in self._levels:
            wp.launch(summarise_groups, dim=groups.shape, inputs=[first, sums, groups], device=device)
            sums = groups
        if self._arrival is not None:
            wp.copy(self._there, sums)
            wp.record_event(self._arrival)
        return Answer(self._there, self._arrival)


def _groups(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First rows of the groups of items that have ``counts`` rows each, the row count, and how many groups each has."""
    begins = np.cumsum(counts) - counts
    first = [np.arange(begin, begin + count, GROUP) for begin, count in zip(begins, counts, strict=True)]
    return np.concatenate([*first, [counts.sum()]]), np.array([len(each) for each in first])
