"""Factors of hinges, patch by patch, such that each patch of a garment bends as the fabric does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks, map_rows
from warp_cloth.base.row_sums import RowSums
from warp_cloth.material.constants import Sheet

Floats = NDArray[np.float64]

# A patch spreads from its vertex as a walk of so many steps does, each of them with a chance of one half: over two
# edges or three. That holds hinges of every direction; much larger ones would mix cloth of other diagonals in.
STEPS = 6
LEAST_FACTOR, MOST_FACTOR = 0.1, 20.0  # a mesh may lack hinges that fold; others would be another material
MOST_LEAN = 3.0  # of the factors' logarithm
LEAST_APART = 0.05  # of the two bends' mean cos 2 angle; nearer, all hinges run alike
MOST_TURN, MOST_LACK = 1.0, 1e3  # of the lean, and of an energy, in one step
MOST_STEPS, CLOSE = 3, 0.01  # of Newton's in one improvement; patches' energies off by 1 % (rms) are left so
# Of warp, weft and biases, whose share of the fit keeps hinges that warp and weft could do without from going limp.
WEIGHTS = (1.0, 1.0, 0.15)
TINY = np.finfo(float).tiny
LEAST = 1e-150  # of what is divided by twice, one after another


class Patches:
    """What hinges hold, summed over the patch round every vertex; V vertices, H hinges."""

    def __init__(self, sheet: Sheet, count: int) -> None:
        edges, hinges = sheet.topology.edges, sheet.topology.hinges
        self.count = count
        self._corners = np.ascontiguousarray(hinges.T, dtype=np.intp)  # as NumPy counts, or it would convert them
        self._held = RowSums(self._corners.ravel(), np.tile(np.arange(len(hinges)), 4), count)
        self._around = RowSums(edges[:, ::-1].T.ravel(), edges.T.ravel(), count)
        self._part = 0.5 / np.maximum(np.bincount(edges.ravel(), minlength=count), 1)
        # memory that is used again and again: what is new costs as much as the work in it
        self._holding, self._walking = np.empty(len(hinges)), np.empty((2, count))
        corners = sheet.triangles.ravel()
        self.area = self._spread(np.asarray(np.bincount(corners, np.repeat(sheet.areas / 3.0, 3), count), float))

    def _spread(self, held: Floats) -> Floats:
        """Has what every vertex holds walk about, in its place: the sum stays. Shape [V]."""
        part = self._part
        parts, next_parts = np.multiply(part, held, out=self._walking[0]), self._walking[1]
        for _ in range(STEPS):

            def walk(there: slice, sums: Floats, onward: Floats = next_parts) -> None:
                own = held[there]
                own *= 0.5
                own += sums
                np.multiply(part[there], own, out=onward[there])

            self._around.for_each_chunk(parts, walk)
            parts, next_parts = next_parts, parts
        return held

    def sums(self, *factors: Floats) -> Floats:
        """Of what every hinge holds, a product, shape [V]."""
        map_rows(lambda *own: 0.25 * math.prod(own[1:], start=own[0]), *factors, out=self._holding)
        return self._spread(self._held(self._holding))

    def means(self, own: Floats, part: slice) -> Floats:
        """Of the four vertices of each of some hinges."""
        start, end, first, second = own.take(self._corners[:, part])
        return np.asarray(0.25 * (start + end + first + second))

    def share(self, held: Sequence[Floats], beyond: Floats) -> Floats:
        """What sums are multiplied by to be per area [1/m2], and as if the border's halves were there, shape [V].

        Hinges hold the product of ``held`` and the border's vertices ``beyond``, of one kind.
        """
        return (1.0 + self._spread(beyond) / np.maximum(self.sums(*held), LEAST)) / np.maximum(self.area, LEAST)


class Fit:
    """Constants of hinges, fitted to what the patches should cost to bend."""

    def __init__(self, patches: Patches, usual: Floats, lean: Floats) -> None:
        self.stiffness = usual.copy()  # C [N m], shape [H]
        self._patches, self._usual, self._lean = patches, usual, lean
        self._even, self._leaning = np.zeros(patches.count), np.zeros(patches.count)

    def improve(self, energies: Sequence[Floats], shares: Sequence[Floats], wanted: Sequence[float]) -> None:
        """Newton's steps, in logarithms, towards patches of the wanted bendings.

        Bent along the warp, the weft and the biases, or in several ways without directions, each hinge costs C times
        its ``energies``; the patches' sums times ``shares`` are to be ``wanted``.
        """
        for _ in range(MOST_STEPS):
            sums = [self._patches.sums(own, self.stiffness) for own in energies]
            lacks = [map_rows(partial(_lack, own), *both) for *both, own in zip(sums, shares, wanted, strict=True)]
            if not self._lean.any():
                self._take(np.mean(lacks, axis=0), 0.0)
                return
            if max(float(np.sqrt(np.mean(lack * lack))) for lack in lacks[:2]) < CLOSE:
                return
            leans = [
                map_rows(_per, self._patches.sums(own, self.stiffness, self._lean), total)
                for own, total in zip(energies, sums, strict=True)
            ]
            self._take(*self._fitted(lacks, leans))

    def _fitted(self, lacks: Sequence[Floats], leans: Sequence[Floats]) -> tuple[Floats, Floats]:
        """What even and lean change by so that the lacks, which change by even + lean times ``leans``, are least."""
        weights, lack, lean = np.array(WEIGHTS), np.array(lacks), np.array(leans)
        count, own, first = weights.sum(), weights @ lack, weights @ lean
        second, both = weights @ lean**2, weights @ (lean * lack)
        apart = np.maximum(count * second - first * first, LEAST_APART**2)
        turn = np.clip((count * both - first * own) / apart, -MOST_TURN, MOST_TURN)
        turn = np.clip(self._leaning + turn, -MOST_LEAN, MOST_LEAN) - self._leaning
        return (own - turn * first) / count, turn

    def _take(self, even: Floats, lean: Floats | float) -> None:
        """Changes the patches' logarithms by these, shape [V]."""
        self._even = np.clip(self._even + even, np.log(LEAST_FACTOR), np.log(MOST_FACTOR))
        self._leaning += lean
        map_chunks(self._put_stiffness, len(self._usual))

    def _put_stiffness(self, part: slice) -> None:
        means, lean = self._patches.means, self._lean[part]
        factor = np.exp(means(self._even, part) + lean * means(self._leaning, part))
        self.stiffness[part] = self._usual[part] * np.clip(factor, LEAST_FACTOR, MOST_FACTOR)


def _lack(wanted: float, total: Floats, share: Floats) -> Floats:
    return np.asarray(-np.log(np.clip(total * share / wanted, 1.0 / MOST_LACK, MOST_LACK)))


def _per(leaning: Floats, total: Floats) -> Floats:
    return np.asarray(leaning / np.maximum(total, TINY))
