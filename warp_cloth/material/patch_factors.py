"""Factors of hinge stiffness, fitted so that every patch of a garment bends like the fabric."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks, map_rows
from warp_cloth.base.row_sums import RowSums
from warp_cloth.material.constants import Sheet

Floats = NDArray[np.float64]

# A patch is the distribution of a random walk from its vertex with so many steps, each taken with probability 1/2: two
# or three edges wide. That has hinges of every direction; much larger patches would mix regions of other diagonals.
STEPS = 6
LEAST_FACTOR, MOST_FACTOR = (
    0.1,
    20.0,
)  # limits: a mesh may lack hinges in some direction; the others must not become another material
MOST_LEAN = 3.0  # of the factors' logarithm
LEAST_APART = 0.05  # least difference of the two bends' mean cos 2 angle; below it all hinges have one direction
MOST_CHANGE, MOST_DEFICIT = 1.0, 1e3  # of the lean, and of an energy's deficit, in one step
MOST_STEPS, CLOSE = 3, 0.01  # Newton steps in one improvement; ends at energies within 1 % (rms)
# Of warp, weft and biases; the biases' weight keeps hinges stiff that warp and weft alone would not need.
WEIGHTS = (1.0, 1.0, 0.15)
TINY = np.finfo(float).tiny
LEAST = 1e-150  # of a number that is a divisor twice


class Patches:
    """Sums of hinge quantities over the patch round every vertex; V vertices, H hinges."""

    def __init__(self, sheet: Sheet, count: int) -> None:
        edges, hinges = sheet.topology.edges, sheet.topology.hinges
        self.count = count
        self._corners = np.ascontiguousarray(hinges.T, dtype=np.intp)  # NumPy would convert other integers at each use
        self._hinges = len(hinges)
        self._at_vertices = RowSums(self._corners.ravel(), np.tile(np.arange(len(hinges)), 4), count)
        self._around = RowSums(edges[:, ::-1].T.ravel(), edges.T.ravel(), count)
        self._weight = 0.5 / np.maximum(np.bincount(edges.ravel(), minlength=count), 1)
        corners = sheet.triangles.ravel()
        areas = np.asarray(np.bincount(corners, np.repeat(sheet.areas / 3.0, 3), count), float)
        self.area = self._spread(areas[:, None])[:, 0]

    def _spread(self, values: Floats) -> Floats:
        """Spreads K values of every vertex by the random walk, in place; their sums are conserved. Shape [V, K]."""
        weight = np.repeat(self._weight, values.shape[1]).reshape(values.shape)
        outgoing, next_outgoing = weight * values, np.empty_like(values)
        for _ in range(STEPS):

            def walk(there: slice, sums: Floats, onward: Floats = next_outgoing) -> None:
                own = values[there]
                own *= 0.5
                own += sums
                np.multiply(weight[there], own, out=onward[there])

            self._around.for_each_chunk(outgoing, walk)
            outgoing, next_outgoing = next_outgoing, outgoing
        return values

    def sums(self, *products: Sequence[Floats]) -> Floats:
        """Patch sums of each product of hinge quantities, a quarter of it at each vertex; shape [K, V]."""
        each = np.empty((self._hinges, len(products)))

        def put(part: slice) -> None:
            for place, factors in enumerate(products):
                product = factors[0][part]
                for factor in factors[1:]:
                    product = product * factor[part]
                np.multiply(product, 0.25, out=each[part, place])

        map_chunks(put, self._hinges)
        return np.ascontiguousarray(self._spread(self._at_vertices(each)).T)

    def means(self, own: Floats, part: slice) -> Floats:
        """Mean over the four vertices of each hinge of a chunk."""
        start, end, first, second = own.take(self._corners[:, part])
        return np.asarray(0.25 * (start + end + first + second))

    def scale(self, values: Sequence[Floats], beyond: Floats) -> Floats:
        """Factors that make patch sums densities per area [1/m2], completed beyond the border, shape [V].

        Args:
            values: quantities of each hinge, of which the product is summed.
            beyond: the same quantity at each vertex, if the cloth continued beyond the border.
        """
        (within,), further = self.sums(values), self._spread(beyond[:, None])[:, 0]
        return np.asarray((1.0 + further / np.maximum(within, LEAST)) / np.maximum(self.area, LEAST))


class Fit:
    """Hinge stiffness, fitted to the bending energies that patches should have."""

    def __init__(self, patches: Patches, usual: Floats, lean: Floats) -> None:
        self.stiffness = usual.copy()  # C [N m], shape [H]
        self._patches, self._usual, self._lean = patches, usual, lean
        self._even, self._leaning = np.zeros(patches.count), np.zeros(patches.count)

    def improve(self, energies: Sequence[Floats], scales: Sequence[Floats], wanted: Sequence[float]) -> None:
        """Newton steps, in logarithms, towards patches of the wanted bendings.

        Bent along warp, weft and biases, or in several directions, each hinge has C times its ``energies``, each shape
        [H]; the patch sums times ``scales``, each shape [V], should be ``wanted``.
        """
        count, has_lean = len(energies), bool(self._lean.any())
        for _ in range(MOST_STEPS):
            leaning = [(own, self.stiffness, self._lean) for own in energies] if has_lean else []
            sums, leans = np.split(self._patches.sums(*((own, self.stiffness) for own in energies), *leaning), [count])
            deficits = [
                map_rows(partial(_deficit, own), *both) for *both, own in zip(sums, scales, wanted, strict=True)
            ]
            if not has_lean:
                self._add(np.mean(deficits, axis=0), 0.0)
                return
            if max(float(np.sqrt(np.mean(deficit * deficit))) for deficit in deficits[:2]) < CLOSE:
                return
            each = [map_rows(_per, own, total) for own, total in zip(leans, sums, strict=True)]
            self._add(*self._fitted(deficits, each))

    def _fitted(self, deficits: Sequence[Floats], leans: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Changes of even and lean that minimise the deficits: each changes by even + lean * ``leans``, shape [V]."""
        weights, deficit, lean = np.array(WEIGHTS), np.array(deficits), np.array(leans)
        count, own, first = weights.sum(), weights @ deficit, weights @ lean
        second, both = weights @ lean**2, weights @ (lean * deficit)
        apart = np.maximum(count * second - first * first, LEAST_APART**2)
        change = np.clip((count * both - first * own) / apart, -MOST_CHANGE, MOST_CHANGE)
        change = np.clip(self._leaning + change, -MOST_LEAN, MOST_LEAN) - self._leaning
        return (own - change * first) / count, change

    def _add(self, even: Floats, lean: Floats | float) -> None:
        """Adds these to the logarithms of the patches' factors, shape [V]."""
        self._even = np.clip(self._even + even, np.log(LEAST_FACTOR), np.log(MOST_FACTOR))
        self._leaning += lean
        map_chunks(self._put_stiffness, len(self._usual))

    def _put_stiffness(self, part: slice) -> None:
        means, lean = self._patches.means, self._lean[part]
        factor = np.exp(means(self._even, part) + lean * means(self._leaning, part))
        self.stiffness[part] = self._usual[part] * np.clip(factor, LEAST_FACTOR, MOST_FACTOR)


def _deficit(wanted: float, total: Floats, scale: Floats) -> Floats:
    return np.asarray(-np.log(np.clip(total * scale / wanted, 1.0 / MOST_DEFICIT, MOST_DEFICIT)))


def _per(leaning: Floats, total: Floats) -> Floats:
    return np.asarray(leaning / np.maximum(total, TINY))
