"""The certificate of rest: residual, rest error and growing folds (model: rest: a certificate, not a guess)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.bins import consecutive_bins
from warp_cloth.base.mesh import Points
from warp_cloth.base.quantiles import quantiles
from warp_cloth.garment.rest import Floats
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.certificate.pressure import normal_force_kernel
from warp_cloth.kernels.certificate.residual import residual_kernel
from warp_cloth.kernels.certificate.summary import (
    DISTANCES,
    FREE,
    LOWER,
    MOVED,
    RELATIVE,
    WEIGHTS,
    store_snapshot_kernel,
)
from warp_cloth.kernels.certificate.summary import GROWING as GROWING_COLUMN
from warp_cloth.model.model import ClothModel
from warp_cloth.model.result import Residual
from warp_cloth.solver.certificate.rest_error import GROWING, Snapshot, Snapshots, rest_error
from warp_cloth.solver.certificate.summary import PendingFigures, Summary
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.relax import Relaxation

# A vertex at rest on the avatar stands at the contact offset to within the rounding of a float32 distance and one
# iteration's fall; up to this far above it, it still counts as in contact.
CONTACT_SLACK = 2e-5  # [m]
HOST_VERTICES = 1 << 18  # vertices whose residuals the host has memory for at a time


@dataclass(frozen=True)
class Tolerance:
    """When a shape counts as at rest. All must hold."""

    relative_rms: float = 0.01  # of the forces that meet at a vertex: what a laboratory's tensile test resolves
    relative_p99: float = 0.05  # single vertices at folds may be five times worse
    rest_error: float = 1e-3  # [m]; below what a fitting shows
    # Longest displacement from one measurement to the next that may still grow [m]: a fold about to snap moves slowly
    # first, then ever faster; what carries it slips in the same way.
    growing: float = GROWING


@dataclass(frozen=True)
class Check:
    """The certificate's figures of an item after some iterations."""

    iteration: int
    residual: Residual
    rest_error: float  # [m]; inf while unknown
    finite: bool
    growing: float = 0.0  # longest growing displacement since the last measurement (kernels.certificate.summary) [m]

    def within(self, tolerance: Tolerance) -> bool:
        """Whether this is rest."""
        return (
            self.finite
            and self.residual.relative_rms <= tolerance.relative_rms
            and self.residual.relative_p99 <= tolerance.relative_p99
            and self.rest_error <= tolerance.rest_error
            and self.growing <= tolerance.growing
        )


@dataclass(frozen=True, eq=False)
class Measurement:
    """Figures of all items after some iterations that are sums over their vertices, shape [items]."""

    iteration: int
    rms: Floats  # of the residual, in weights
    relative_rms: Floats
    rest_error: Floats  # [m]; inf while unknown
    moved: Floats  # largest change of a coordinate since the last measurement [m]
    growing: Floats  # as in Check
    boxes: Floats  # lowest and highest corner of an item's garments [m], shape [items, 2, 3]
    finite: NDArray[np.bool_]

    def nearly_within(self, tolerances: Sequence[Tolerance]) -> NDArray[np.bool_]:
        """Whether each item may be at rest, by these figures alone."""
        limits = np.array([(each.relative_rms, each.rest_error, each.growing) for each in tolerances])
        figures = np.stack([self.relative_rms, self.rest_error, self.growing], axis=1)
        near: NDArray[np.bool_] = self.finite & (figures <= limits).all(axis=1)
        return near


@dataclass(frozen=True, eq=False)
class PendingMeasurement:
    """A measurement whose figures are still being copied from the device."""

    iteration: int
    snapshots: Sequence[Snapshot]
    figures: PendingFigures


class Certifier:
    """Measures the items of a relaxation with the forces and the contact that their iterations use.

    What is summed over an item's vertices is summed on the device, in the same order alone and in a batch. A
    measurement may be read later: it holds until the next one starts, whatever iterates meanwhile.
    """

    def __init__(self, relaxation: Relaxation) -> None:
        model = relaxation.model
        types, state = cloth_types(model.precision), model.state
        self._model = model
        self.relaxation = relaxation
        self._load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
        self._forces = ForcePass(model, Accumulate.MAGNITUDE, self._load)
        options = relaxation.avatar_contact, relaxation.collider_type, model.terms.pins
        self._measure_residual = residual_kernel(model.precision, *options)
        self._store_snapshot = store_snapshot_kernel(model.precision)
        self._summary = Summary(model, relaxation.active_set)
        self._residual = wp.zeros(model.vertex_count, dtype=wp.vec2f, device=model.device)
        self._last = wp.clone(state.position)  # at the last check
        self._before = wp.clone(state.position)  # at the one before
        self._earlier = wp.clone(state.position)  # at the one before that
        self._lower_half = wp.array(_lower_half(model), dtype=wp.uint8, device=model.device)
        self._snapshots = Snapshots()
        self._spare: list[wp.array] = []  # memory of snapshots that were dropped
        self._all_items = wp.full(model.item_count, 1, dtype=wp.uint8, device=model.device)
        self._some_items = wp.zeros(model.item_count, dtype=wp.uint8, device=model.device)
        # at the last check; the residual above the offset depends on these bounds
        with_bounds = relaxation.avatar_contact is not None and state.stiffness
        self._bounds: wp.array | None = wp.clone(state.stiffness) if with_bounds else None
        self._stream: wp.Stream | None = None
        self._host_vertices = model.vertex_count
        if wp.get_device(model.device).is_cuda:
            self._stream = wp.Stream(model.device)
            largest = int(np.diff(model.item_start).max())
            self._host_vertices = max(largest, min(model.vertex_count, HOST_VERTICES))
            self._host_residual = wp.empty(self._host_vertices, dtype=wp.vec2f, device="cpu", pinned=True)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a check launches."""
        return [*self._forces.kernels(), self._measure_residual, *self._summary.kernels(), self._store_snapshot]

    def measure(self, iteration: int) -> Measurement:
        """Measures all items that iterate, as they are now. Waits for the device."""
        return self.read(self.start_measurement(iteration))

    def start_measurement(self, iteration: int) -> PendingMeasurement:
        """Measures all items that iterate, as they are now, without waiting for the device."""
        relaxation, model = self.relaxation, self._model
        self._sum_forces()
        active = relaxation.active_set.vertices
        inputs = [relaxation.step, CONTACT_SLACK, relaxation.collider_data, self._load, self._residual]
        inputs = [model.vertices, model.state, active.groups, *inputs]
        wp.launch(self._measure_residual, dim=active.size, inputs=inputs, device=model.device)
        snapshots = self._snapshots.at_spans(iteration)
        return PendingMeasurement(iteration, snapshots, self._request(snapshots, self._all_items))

    def read(self, pending: PendingMeasurement) -> Measurement:
        """The figures of the last measurement. Waits for it, not for what was launched after it."""
        iteration, snapshots, figures = pending.iteration, pending.snapshots, pending.figures.read()
        finite = np.asarray(np.isfinite(figures[:, :MOVED]).all(axis=1))
        sums = np.where(finite[:, None], figures[:, :MOVED], np.inf)
        with np.errstate(invalid="ignore"):  # inf / inf, of items that are not finite
            residual = np.sqrt(sums[:, [WEIGHTS, RELATIVE]] / np.maximum(sums[:, [FREE]], 1.0))
            residual[~finite] = np.inf
            distances = np.sqrt(sums[:, DISTANCES:MOVED] / np.diff(self._model.item_start)[:, None])
            error = np.where(finite, rest_error(iteration, snapshots, distances), np.inf)
        boxes = figures[:, LOWER:].reshape(-1, 2, 3)
        moved, growing = figures[:, MOVED], figures[:, GROWING_COLUMN]
        return Measurement(iteration, residual[:, 0], residual[:, 1], error, moved, growing, boxes, finite)

    def check(self, measurement: Measurement, item: int) -> Check:
        """All figures of one item at that measurement, the last one. Waits for it."""
        return self.checks(measurement, [item])[item]

    def checks(self, measurement: Measurement, items: Sequence[int]) -> dict[int, Check]:
        """All figures of several items, copied to the host together."""
        lost = Check(measurement.iteration, Residual(*([math.inf] * 5)), math.inf, False)
        found = dict.fromkeys(items, lost)
        for some in self._bins([item for item in items if measurement.finite[item]]):
            for item, residual in zip(some, self._residuals(some), strict=True):
                rms, relative_rms = float(measurement.rms[item]), float(measurement.relative_rms[item])
                summary = residual_summary(residual, rms, relative_rms)
                error, growing = float(measurement.rest_error[item]), float(measurement.growing[item])
                found[item] = Check(measurement.iteration, summary, error, True, growing)
        return found

    def _bins(self, items: Sequence[int]) -> list[list[int]]:
        """Items in bins whose residuals fit into the host's memory."""
        sizes = [self._model.item_start[item + 1] - self._model.item_start[item] for item in items]
        return [[items[at] for at in each] for each in consecutive_bins(sizes, self._host_vertices)]

    def _residuals(self, items: Sequence[int]) -> list[NDArray[np.float32]]:
        """Residuals of the last measurement, which has been read, shape [V, 2]; copied on a stream of their own."""
        residuals = [self._residual[self._model.of_item(item)] for item in items]
        if self._stream is None:
            return [own.numpy() for own in residuals]
        ends = np.cumsum([0, *(len(own) for own in residuals)]).tolist()
        for own, first in zip(residuals, ends, strict=False):
            wp.copy(self._host_residual, own, dest_offset=first, count=len(own), stream=self._stream)
        wp.synchronize_stream(self._stream)
        there = self._host_residual.numpy()
        return [there[first:end] for first, end in itertools.pairwise(ends)]

    def request_bounds(self, items: Sequence[int]) -> PendingFigures:
        """Measures where these items are, without waiting for the device; ``read_bounds`` takes the result.

        Items that do not iterate, or are not among these, have the bounds of the last measurement.
        """
        selected = np.zeros(self._model.item_count, dtype=np.uint8)
        selected[list(items)] = 1
        self._some_items.assign(selected)
        return self._request([], self._some_items)

    def take_snapshot(self, iteration: int) -> None:
        """Stores the shapes of a measurement of all items, which the next one compares with."""
        self._last, self._before, self._earlier = self._earlier, self._last, self._before
        wp.copy(self._last, self._model.state.position)
        if self._bounds is not None:
            wp.copy(self._bounds, self._model.state.stiffness)
        if self._snapshots.due(iteration):
            model = self._model
            shape = self._spare.pop() if self._spare else wp.zeros(model.vertex_count, wp.vec3f, device=model.device)
            inputs = [model.vertices, model.state, shape]
            wp.launch(self._store_snapshot, dim=len(shape), inputs=inputs, device=model.device)
            self._snapshots.store(Snapshot(iteration, shape))
        self._spare += self._snapshots.drop(iteration)

    @property
    def snapshot_bytes(self) -> tuple[int, int]:
        """Memory of the snapshots: now, and at most."""
        size = wp.types.type_size_in_bytes(wp.vec3f) * self._model.vertex_count
        now = len(self._snapshots.shapes) + len(self._spare)
        return now * size, self._snapshots.most() * size

    def last_points(self, item: int) -> Points:
        """An item's last finite points at a check of all items [m], shape [V, 3]."""
        part = self._model.of_item(item)
        last = np.array(self._last[part].numpy(), dtype=np.float64)
        return last if np.isfinite(last).all() else np.array(self._before[part].numpy(), dtype=np.float64)

    def last_motion(self, item: int) -> Floats:
        """How far an item's vertices have moved since the last check of all items before this one [m], shape [V]."""
        part, shapes = self._model.of_item(item), (self._model.state.position, self._last, self._before)
        now, last, before = (np.asarray(shape[part].numpy(), dtype=np.float64) for shape in shapes)
        return np.asarray(np.linalg.norm(now - (before if np.array_equal(now, last) else last), axis=1))

    def restore(self, item: int) -> None:
        """Restores an item as it was at the last snapshot, before iterations that came too late to be stopped."""
        part, state = self._model.of_item(item), self._model.state
        wp.copy(state.position[part], self._last[part])
        self._model.forget_clearance(item)
        if self._bounds is not None:
            wp.copy(state.stiffness[part], self._bounds[part])

    def _request(self, snapshots: Sequence[Snapshot], items: wp.array) -> PendingFigures:
        shapes = self._summary.shapes_type()
        shapes.selected = items
        shapes.last, shapes.before, shapes.earlier = self._last, self._before, self._earlier
        shapes.lower_half, shapes.snapshot_count = self._lower_half, len(snapshots)
        for number, snapshot in enumerate(snapshots, start=1):
            setattr(shapes, f"snapshot_{number}", snapshot.shape)
        return self._summary.request(self._residual, shapes)

    def _sum_forces(self) -> None:
        relaxation = self.relaxation
        self._forces.launch(relaxation.step)
        if relaxation.cloth_contact is not None and relaxation.cloth_contact.awake:
            relaxation.cloth_contact.measure(relaxation.contact_state(), relaxation.step, self._load)

    def normal_forces(self) -> NDArray[np.float64] | None:
        """Force with which each vertex presses on the avatar [N], shape [V]; None without contact. Waits."""
        model, relaxation = self._model, self.relaxation
        if relaxation.avatar_contact is None:
            return None
        self._sum_forces()
        force = wp.zeros(model.vertex_count, dtype=wp.float64, device=model.device)
        inputs = [relaxation.step, CONTACT_SLACK, relaxation.collider_data, self._load, force]
        options = relaxation.avatar_contact, relaxation.collider_type, model.terms.pins
        wp.launch(
            normal_force_kernel(model.precision, *options),
            dim=model.vertex_count,
            inputs=[model.vertices, model.state, *inputs],
            device=model.device,
        )
        return np.array(force.numpy())


def _lower_half(model: ClothModel) -> NDArray[np.uint8]:
    """1 for vertices below the median height of their item, as it is placed, shape [V]."""
    height = model.points()[:, 1]
    low = np.zeros(len(height), dtype=np.uint8)
    for first, end in itertools.pairwise(model.item_start):
        low[first:end] = height[first:end] < np.median(height[first:end])
    return low


def read_bounds(pending: PendingFigures) -> Floats:
    """Lowest and highest corner of every item [m], shape [items, 2, 3]; NaN where a point is not finite.

    Waits for the result of ``Certifier.request_bounds``.
    """
    figures = pending.read()
    figures[~np.isfinite(figures[:, FREE])] = np.nan  # comparisons do not see NaN, sums do
    return figures[:, LOWER:].reshape(-1, 2, 3)


def residual_summary(residual: NDArray[np.float32], rms: float, relative_rms: float) -> Residual:
    """The residual with its percentiles and maximum; ``residual`` [V, 2] in weights and relative, -1 where pinned."""
    weights, relative = np.ascontiguousarray(residual.T)  # contiguous, which NumPy sorts faster
    free = weights >= 0.0
    if not free.all():
        weights, relative = weights[free], relative[free]
    if not len(weights):
        return Residual(0.0, 0.0, 0.0, 0.0, 0.0)
    (p99,), (relative_p99,) = (quantiles(each, 0.99) for each in (weights, relative))
    return Residual(rms, p99, float(weights.max()), relative_rms, relative_p99)
