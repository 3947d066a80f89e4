"""The certificate of rest: residual, rest error, strain (model: rest: a certificate, not a guess)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.certify import bending_energy_kernel, energy_kernels, residual_kernel
from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.pressure import push_kernel
from warp_cloth.kernels.summary import (
    CHUNK,
    COLUMNS,
    FREE,
    LOWER,
    MOVED,
    RELATIVE,
    WAYS,
    WEIGHTS,
    summary_kernels,
)
from warp_cloth.mesh import Points
from warp_cloth.model import ClothModel
from warp_cloth.rest import Floats
from warp_cloth.result import Residual, Strain
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.rest_error import Mark, RestError, rest_error

# A vertex at rest on the avatar stands at the contact offset to within the rounding of a float32 distance and one
# iteration's fall; this far above it still counts as held.
CONTACT_SLACK = 2e-5  # [m]


@dataclass(frozen=True)
class Tolerance:
    """When a shape counts as at rest. All three must hold.

    relative_rms: 1 % of the forces that meet at a vertex is what a laboratory's tensile test resolves.
    relative_p99: single vertices at folds may be five times worse.
    rest_error: 1 mm is below what a fitting shows.
    """

    relative_rms: float = 0.01
    relative_p99: float = 0.05
    rest_error: float = 1e-3  # [m]


@dataclass(frozen=True)
class Check:
    """The certificate's figures of an item after some iterations."""

    iteration: int
    residual: Residual
    rest_error: float  # [m]; inf while nothing is known of it
    finite: bool

    def within(self, tolerance: Tolerance) -> bool:
        """Whether this is rest."""
        return (
            self.finite
            and self.residual.relative_rms <= tolerance.relative_rms
            and self.residual.relative_p99 <= tolerance.relative_p99
            and self.rest_error <= tolerance.rest_error
        )


@dataclass(frozen=True, eq=False)
class Look:
    """What sums over their vertices tell of all items after some iterations, shape [items]."""

    iteration: int
    rms: Floats  # of the residual, in weights
    relative_rms: Floats
    rest_error: Floats  # [m]; inf while nothing is known of it
    moved: Floats  # largest change of a coordinate since the last look at all [m]
    boxes: Floats  # lowest and highest corner of an item's garments [m], shape [items, 2, 3]
    finite: NDArray[np.bool_]

    def nearly_within(self, relative_rms: Floats, error: Floats) -> NDArray[np.bool_]:
        """Whether each may be at rest, as far as sums tell."""
        near: NDArray[np.bool_] = self.finite & (self.relative_rms <= relative_rms) & (self.rest_error <= error)
        return near


class Certifier:
    """Measures the items of a relaxation with the forces and the contact that their iterations use.

    What is summed over an item's vertices is summed on the device, in the same order whatever else is there.
    """

    def __init__(self, relaxation: Relaxation) -> None:
        model = relaxation.model
        types = cloth_types(model.precision)
        self._model = model
        self._relaxation = relaxation
        self._load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
        self._forces = ForcePass(model, "size", self._load)
        self._residual = residual_kernel(model.precision, relaxation.contact, relaxation.collider_type)
        self._summary = summary_kernels(model.precision)
        self._left = wp.zeros(model.vertex_count, dtype=wp.vec2f, device=model.device)
        self._last = wp.clone(model.cloth.position)  # at the last check
        self._rest_error = RestError()
        self._spare: list[wp.array] = []  # shapes that are kept no longer
        chunks = [_chunks(model.of_item(item)) for item in range(model.item_count)]
        first = np.concatenate([*chunks, [model.vertex_count]])
        starts = np.cumsum([0, *(len(each) for each in chunks)])
        self._first_vertex = wp.array(first, dtype=wp.int32, device=model.device)
        self._first_chunk = wp.array(starts, dtype=wp.int32, device=model.device)
        self._sums = wp.zeros((len(first) - 1, COLUMNS), dtype=wp.float64, device=model.device)
        self._figures = wp.zeros((model.item_count, COLUMNS), dtype=wp.float64, device=model.device)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a check launches."""
        summary = self._summary
        return [
            *self._forces.kernels(), self._residual, summary.summarise_chunks, summary.summarise_items,
            summary.keep_shape,
        ]  # fmt: skip

    def look(self, iteration: int) -> Look:
        """Measures all items that iterate, as they stand. Waits for the device."""
        relaxation, model = self._relaxation, self._model
        self._sum_forces()
        asked = [relaxation.step, CONTACT_SLACK, relaxation.collider_data, model.cloth, self._load, self._left]
        wp.launch(self._residual, dim=model.vertex_count, inputs=asked, device=model.device)
        marks = self._rest_error.marks(iteration)
        figures = self._summarised(marks)
        finite = np.asarray(np.isfinite(figures[:, :MOVED]).all(axis=1))
        sums = np.where(finite[:, None], figures[:, :MOVED], np.inf)
        with np.errstate(invalid="ignore"):  # inf over inf, of what is lost
            residual = np.sqrt(sums[:, [WEIGHTS, RELATIVE]] / np.maximum(sums[:, [FREE]], 1.0))
            residual[~finite] = np.inf
            ways = np.sqrt(sums[:, WAYS:MOVED] / np.diff(model.item_start)[:, None])
            error = np.where(finite, rest_error(iteration, marks, ways), np.inf)
        boxes = figures[:, LOWER:].reshape(-1, 2, 3)
        return Look(iteration, residual[:, 0], residual[:, 1], error, figures[:, MOVED], boxes, finite)

    def check(self, look: Look, item: int) -> Check:
        """All figures of one item, as it stood at that look, the last one. Waits for the device."""
        if not look.finite[item]:
            return Check(look.iteration, Residual(*([math.inf] * 5)), math.inf, False)
        left = self._left[self._model.of_item(item)].numpy()
        residual = residual_summary(left, float(look.rms[item]), float(look.relative_rms[item]))
        return Check(look.iteration, residual, float(look.rest_error[item]), True)

    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner of every item that iterates [m], shape [items, 2, 3]. Waits for the device.

        NaN where a point is not finite.
        """
        figures = self._summarised([])
        figures[~np.isfinite(figures[:, FREE])] = np.nan  # the sums tell, comparisons pass over it
        return figures[:, LOWER:].reshape(-1, 2, 3)

    def turn_page(self, iteration: int) -> None:
        """Goes on from a check that looked at all items: the shapes of now are what the next one compares with."""
        wp.copy(self._last, self._model.cloth.position)
        if self._rest_error.due(iteration):
            model = self._model
            shape = self._spare.pop() if self._spare else wp.zeros(model.vertex_count, wp.vec3f, device=model.device)
            wp.launch(self._summary.keep_shape, dim=len(shape), inputs=[model.cloth, shape], device=model.device)
            self._rest_error.keep(Mark(iteration, shape))
        self._spare += self._rest_error.dropped(iteration)

    def last_points(self, item: int) -> Points:
        """An item's points at the last check of all items [m], shape [V, 3]."""
        return np.array(self._last[self._model.of_item(item)].numpy(), dtype=np.float64)

    def _summarised(self, marks: Sequence[Mark]) -> NDArray[np.float64]:
        """Figures of all items, shape [items, COLUMNS]; of those that do not iterate what they last were."""
        model, device = self._model, self._model.device
        looks = self._summary.Looks()
        looks.last, looks.marks = self._last, len(marks)
        for number, mark in enumerate(marks, start=1):
            setattr(looks, f"mark_{number}", mark.shape)
        chunk_inputs = [self._first_vertex, model.cloth, self._left, looks, self._sums]
        wp.launch(self._summary.summarise_chunks, dim=len(self._sums), inputs=chunk_inputs, device=device)
        item_inputs = [self._first_chunk, self._sums, self._figures]
        wp.launch(self._summary.summarise_items, dim=self._figures.shape, inputs=item_inputs, device=device)
        return np.array(self._figures.numpy())

    def _sum_forces(self) -> None:
        relaxation = self._relaxation
        self._forces.launch(relaxation.step)
        if relaxation.touch is not None:
            relaxation.touch.measure(relaxation.step, self._load)

    def pushes(self) -> NDArray[np.float64] | None:
        """Force with which each vertex presses on the avatar [N], shape [V]; None without contact. Waits."""
        model = self._model
        relaxation = self._relaxation
        if relaxation.contact is None:
            return None
        self._sum_forces()
        push = wp.zeros(model.vertex_count, dtype=wp.float64, device=model.device)
        wp.launch(
            push_kernel(model.precision, relaxation.contact, relaxation.collider_type),
            dim=model.vertex_count,
            inputs=[relaxation.step, CONTACT_SLACK, relaxation.collider_data, model.cloth, self._load, push],
            device=model.device,
        )
        return np.array(push.numpy())


def _chunks(vertices: slice) -> NDArray[np.int64]:
    """First vertices of an item's chunks: counted from its own first one, so that its company changes no sum."""
    return np.arange(vertices.start, vertices.stop, CHUNK)


def residual_summary(left: NDArray[np.float32], rms: float, relative_rms: float) -> Residual:
    """The residual with what needs all vertices; ``left`` [V, 2] holds weights and relative, -1 where pinned."""
    free = left[left[:, 0] >= 0.0].astype(np.float64)
    if not len(free):
        return Residual(0.0, 0.0, 0.0, 0.0, 0.0)
    p99, relative_p99 = np.quantile(free, 0.99, axis=0)
    return Residual(rms, float(p99), float(free[:, 0].max()), relative_rms, float(relative_p99))


def strain_summary(strain: NDArray[np.float64]) -> Strain:
    """Percentiles of |strain| and the extremes of strain."""
    size = np.abs(strain)
    p50, p99 = np.quantile(size, [0.5, 0.99])
    return Strain(float(p50), float(p99), float(strain.max()), float(strain.min()))


def edge_strains(model: ClothModel) -> NDArray[np.float64]:
    """Strain (r - L) / L of every edge, shape [E]."""
    return _measure_tension(model)[1]


def thread_strains(model: ClothModel) -> NDArray[np.float64]:
    """Strain of every woven triangle along weft, warp and both biases, shape [T, 4]."""
    return _measure_weave(model)[1]


def thread_summaries(strain: NDArray[np.float64]) -> dict[str, Strain]:
    """Strains along "warp", "weft" and both ways of the "bias", of ``thread_strains``; empty where nothing is woven."""
    if not len(strain):
        return {}
    ways = {"warp": strain[:, 1], "weft": strain[:, 0], "bias": strain[:, 2:].ravel()}
    return {way: strain_summary(along) for way, along in ways.items()}


def element_energies(model: ClothModel) -> tuple[NDArray[np.float64], ...]:
    """Energy of every edge, shape [E], hinge, shape [H], and woven triangle, shape [T] [J]."""
    fold = wp.zeros(model.hinge_count, dtype=wp.float64, device=model.device)
    if model.hinges is not None:
        kernel = bending_energy_kernel(model.precision, model.terms.angles)
        wp.launch(kernel, dim=model.hinge_count, inputs=[model.cloth, model.hinges, fold], device=model.device)
    return _measure_tension(model)[0], np.array(fold.numpy()), _measure_weave(model)[0]


def _measure_weave(model: ClothModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    energy = wp.zeros(model.weave_count, dtype=wp.float64, device=model.device)
    strain = wp.zeros(model.weave_count, dtype=wp.vec4d, device=model.device)
    if model.weave is not None:
        kernel = energy_kernels(model.precision).measure_weave
        wp.launch(kernel, dim=model.weave_count, inputs=[model.cloth, model.weave, energy, strain], device=model.device)
    return np.array(energy.numpy()), np.array(strain.numpy()).reshape(-1, 4)


def _measure_tension(model: ClothModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    energy = wp.zeros(model.edge_count, dtype=wp.float64, device=model.device)
    strain = wp.zeros(model.edge_count, dtype=wp.float64, device=model.device)
    wp.launch(
        energy_kernels(model.precision).measure_tension,
        dim=model.edge_count,
        inputs=[model.cloth, model.edges, energy, strain],
        device=model.device,
    )
    return np.array(energy.numpy()), np.array(strain.numpy())
