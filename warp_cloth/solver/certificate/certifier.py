"""The certificate of rest: residual and rest error (model: rest: a certificate, not a guess)."""

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
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.certificate.pressure import push_kernel
from warp_cloth.kernels.certificate.residual import residual_kernel
from warp_cloth.kernels.certificate.summary import FASTER, FREE, LOWER, MOVED, RELATIVE, WAYS, WEIGHTS, keep_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.model.result import Residual
from warp_cloth.solver.certificate.rest_error import GROWING, Mark, RestError, rest_error
from warp_cloth.solver.certificate.summary import Answer, Summary
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.relax import Relaxation

# A vertex at rest on the avatar stands at the contact offset to within the rounding of a float32 distance and one
# iteration's fall; this far above it still counts as held.
CONTACT_SLACK = 2e-5  # [m]
ROOM = 1 << 18  # vertices whose residuals a host has room for


@dataclass(frozen=True)
class Tolerance:
    """When a shape counts as at rest. All must hold.

    relative_rms: 1 % of the forces that meet at a vertex is what a laboratory's tensile test resolves.
    relative_p99: single vertices at folds may be five times worse.
    rest_error: 1 mm is below what a fitting shows.

    growing: a fold about to snap goes slowly first, and ever faster; what carries it slips as it does.
    """

    relative_rms: float = 0.01
    relative_p99: float = 0.05
    rest_error: float = 1e-3  # [m]
    growing: float = GROWING  # [m]; longest way from one look to the next that may be longer than the one before


@dataclass(frozen=True)
class Check:
    """The certificate's figures of an item after some iterations."""

    iteration: int
    residual: Residual
    rest_error: float  # [m]; inf while nothing is known of it
    finite: bool
    growing: float = 0.0  # longest way since the last look that grows, by kernels.certificate.summary [m]

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
class Look:
    """What sums over their vertices tell of all items after some iterations, shape [items]."""

    iteration: int
    rms: Floats  # of the residual, in weights
    relative_rms: Floats
    rest_error: Floats  # [m]; inf while nothing is known of it
    moved: Floats  # largest change of a coordinate since the last look at all [m]
    growing: Floats  # as of Check
    boxes: Floats  # lowest and highest corner of an item's garments [m], shape [items, 2, 3]
    finite: NDArray[np.bool_]

    def nearly_within(self, asked: Sequence[Tolerance]) -> NDArray[np.bool_]:
        """Whether each may be at rest, as far as sums tell."""
        limits = np.array([(each.relative_rms, each.rest_error, each.growing) for each in asked])
        figures = np.stack([self.relative_rms, self.rest_error, self.growing], axis=1)
        near: NDArray[np.bool_] = self.finite & (figures <= limits).all(axis=1)
        return near


@dataclass(frozen=True, eq=False)
class Glance:
    """A look whose figures are still on their way from the device."""

    iteration: int
    marks: Sequence[Mark]
    answer: Answer


class Certifier:
    """Measures the items of a relaxation with the forces and the contact that their iterations use.

    What is summed over an item's vertices is summed on the device, in the same order whatever else is there. A look
    may be read later: till the next glance, what it saw stays, whatever iterates meanwhile.
    """

    def __init__(self, relaxation: Relaxation) -> None:
        model = relaxation.model
        types = cloth_types(model.precision)
        self._model = model
        self._relaxation = relaxation
        self._load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
        self._forces = ForcePass(model, "size", self._load)
        asked = relaxation.avatar_contact, relaxation.collider_type, model.terms.pins
        self._residual = residual_kernel(model.precision, *asked)
        self._keep = keep_kernel(model.precision)
        self._summary = Summary(model, relaxation.at_work)
        self._left = wp.zeros(model.vertex_count, dtype=wp.vec2f, device=model.device)
        self._last = wp.clone(model.state.position)  # at the last check
        self._before = wp.clone(model.state.position)  # at the one before
        self._earlier = wp.clone(model.state.position)  # at the one before that
        self._low = wp.array(_lower_half(model), dtype=wp.uint8, device=model.device)
        self._rest_error = RestError()
        self._spare: list[wp.array] = []  # shapes that are kept no longer
        self._every = wp.full(model.item_count, 1, dtype=wp.uint8, device=model.device)  # item, and those that fall
        self._falling = wp.zeros(model.item_count, dtype=wp.uint8, device=model.device)
        judged = (
            relaxation.avatar_contact is not None and model.state.stiffness
        )  # by which contact's share of a force is
        self._bounds: wp.array | None = wp.clone(model.state.stiffness) if judged else None  # at the last check
        self._beside: wp.Stream | None = None
        self._room = model.vertex_count
        if wp.get_device(model.device).is_cuda:
            self._beside = wp.Stream(model.device)
            self._room = max(int(np.diff(model.item_start).max()), min(model.vertex_count, ROOM))
            self._left_there = wp.empty(self._room, dtype=wp.vec2f, device="cpu", pinned=True)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a check launches."""
        return [*self._forces.kernels(), self._residual, *self._summary.kernels(), self._keep]

    def look(self, iteration: int) -> Look:
        """Measures all items that iterate, as they stand. Waits for the device."""
        return self.read(self.glance(iteration))

    def glance(self, iteration: int) -> Glance:
        """Measures all items that iterate, as they stand, without waiting for the device."""
        relaxation, model = self._relaxation, self._model
        self._sum_forces()
        some = relaxation.at_work.vertices
        arguments = [relaxation.step, CONTACT_SLACK, relaxation.collider_data, self._load, self._left]
        wp.launch(
            self._residual,
            dim=some.size,
            inputs=[model.vertices, model.state, some.groups, *arguments],
            device=model.device,
        )
        marks = self._rest_error.marks(iteration)
        return Glance(iteration, marks, self._asked(marks, self._every))

    def read(self, glance: Glance) -> Look:
        """What the last glance has seen. Waits for it, not for what was launched after it."""
        iteration, marks, figures = glance.iteration, glance.marks, glance.answer.read()
        finite = np.asarray(np.isfinite(figures[:, :MOVED]).all(axis=1))
        sums = np.where(finite[:, None], figures[:, :MOVED], np.inf)
        with np.errstate(invalid="ignore"):  # inf over inf, of what is lost
            residual = np.sqrt(sums[:, [WEIGHTS, RELATIVE]] / np.maximum(sums[:, [FREE]], 1.0))
            residual[~finite] = np.inf
            ways = np.sqrt(sums[:, WAYS:MOVED] / np.diff(self._model.item_start)[:, None])
            error = np.where(finite, rest_error(iteration, marks, ways), np.inf)
        boxes = figures[:, LOWER:].reshape(-1, 2, 3)
        moved, growing = figures[:, MOVED], figures[:, FASTER]
        return Look(iteration, residual[:, 0], residual[:, 1], error, moved, growing, boxes, finite)

    def check(self, look: Look, item: int) -> Check:
        """All figures of one item, as it stood at that look, the last one. Waits for what it saw."""
        return self.checks(look, [item])[item]

    def checks(self, look: Look, items: Sequence[int]) -> dict[int, Check]:
        """The same of several items: what they wait for comes in one go."""
        lost = Check(look.iteration, Residual(*([math.inf] * 5)), math.inf, False)
        found = dict.fromkeys(items, lost)
        for some in self._piecewise([item for item in items if look.finite[item]]):
            for item, left in zip(some, self._residuals(some), strict=True):
                residual = residual_summary(left, float(look.rms[item]), float(look.relative_rms[item]))
                error, growing = float(look.rest_error[item]), float(look.growing[item])
                found[item] = Check(look.iteration, residual, error, True, growing)
        return found

    def _piecewise(self, items: Sequence[int]) -> list[list[int]]:
        """Items so many at a time that their residuals have room on the host."""
        sizes = [self._model.item_start[item + 1] - self._model.item_start[item] for item in items]
        return [[items[at] for at in piece] for piece in consecutive_bins(sizes, self._room)]

    def _residuals(self, items: Sequence[int]) -> list[NDArray[np.float32]]:
        """What ``residual_summary`` takes, of the last look, which has been read: on a stream of its own."""
        left = [self._left[self._model.of_item(item)] for item in items]
        if self._beside is None:
            return [own.numpy() for own in left]
        ends = np.cumsum([0, *(len(own) for own in left)]).tolist()
        for own, first in zip(left, ends, strict=False):
            wp.copy(self._left_there, own, dest_offset=first, count=len(own), stream=self._beside)
        wp.synchronize_stream(self._beside)
        there = self._left_there.numpy()
        return [there[first:end] for first, end in itertools.pairwise(ends)]

    def ask_bounds(self, items: Sequence[int]) -> Answer:
        """Asks where those of these items are that iterate, without waiting for the device.

        ``bounds`` takes the answer. Of the others it tells what the last look has seen.
        """
        asked = np.zeros(self._model.item_count, dtype=np.uint8)
        asked[list(items)] = 1
        self._falling.assign(asked)
        return self._asked([], self._falling)

    def turn_page(self, iteration: int) -> None:
        """Goes on from a glance at all items: the shapes of now are what the next one compares with."""
        self._last, self._before, self._earlier = self._earlier, self._last, self._before
        wp.copy(self._last, self._model.state.position)
        if self._bounds is not None:
            wp.copy(self._bounds, self._model.state.stiffness)
        if self._rest_error.due(iteration):
            model = self._model
            shape = self._spare.pop() if self._spare else wp.zeros(model.vertex_count, wp.vec3f, device=model.device)
            wp.launch(self._keep, dim=len(shape), inputs=[model.vertices, model.state, shape], device=model.device)
            self._rest_error.keep(Mark(iteration, shape))
        self._spare += self._rest_error.dropped(iteration)

    @property
    def kept_bytes(self) -> tuple[int, int]:
        """Memory of the shapes that are kept on the way: now, and at most."""
        size = wp.types.type_size_in_bytes(wp.vec3f) * self._model.vertex_count
        now = len(self._rest_error.shapes) + len(self._spare)
        return now * size, self._rest_error.most_kept() * size

    def last_points(self, item: int) -> Points:
        """An item's last finite points at a check of all items [m], shape [V, 3]."""
        part = self._model.of_item(item)
        last = np.array(self._last[part].numpy(), dtype=np.float64)
        return last if np.isfinite(last).all() else np.array(self._before[part].numpy(), dtype=np.float64)

    def put_back(self, item: int) -> None:
        """Puts an item back where the last glance at all items saw it, from iterations that came too late to stop."""
        part = self._model.of_item(item)
        wp.copy(self._model.state.position[part], self._last[part])
        self._model.look_again(item)
        if self._bounds is not None:
            wp.copy(self._model.state.stiffness[part], self._bounds[part])

    def _asked(self, marks: Sequence[Mark], items: wp.array) -> Answer:
        looks = self._summary.looks_type()
        looks.asked = items
        looks.last, looks.before, looks.earlier = self._last, self._before, self._earlier
        looks.low, looks.marks = self._low, len(marks)
        for number, mark in enumerate(marks, start=1):
            setattr(looks, f"mark_{number}", mark.shape)
        return self._summary.ask(self._left, looks)

    def _sum_forces(self) -> None:
        relaxation = self._relaxation
        self._forces.launch(relaxation.step)
        if relaxation.cloth_contact is not None:
            relaxation.cloth_contact.measure(relaxation.step, self._load)

    def pushes(self) -> NDArray[np.float64] | None:
        """Force with which each vertex presses on the avatar [N], shape [V]; None without contact. Waits."""
        model = self._model
        relaxation = self._relaxation
        if relaxation.avatar_contact is None:
            return None
        self._sum_forces()
        push = wp.zeros(model.vertex_count, dtype=wp.float64, device=model.device)
        wp.launch(
            push_kernel(model.precision, relaxation.avatar_contact, relaxation.collider_type, model.terms.pins),
            dim=model.vertex_count,
            inputs=[
                model.vertices,
                model.state,
                relaxation.step,
                CONTACT_SLACK,
                relaxation.collider_data,
                self._load,
                push,
            ],
            device=model.device,
        )
        return np.array(push.numpy())


def _lower_half(model: ClothModel) -> NDArray[np.uint8]:
    """1 for what is below the middle of its garments' vertices, as they are placed, shape [V]."""
    height = model.points()[:, 1]
    low = np.zeros(len(height), dtype=np.uint8)
    for first, end in itertools.pairwise(model.item_start):
        low[first:end] = height[first:end] < np.median(height[first:end])
    return low


def bounds(answer: Answer) -> Floats:
    """Lowest and highest corner of every item [m], shape [items, 2, 3]; NaN where a point is not finite.

    Waits for the answer to ``Certifier.ask_bounds``.
    """
    figures = answer.read()
    figures[~np.isfinite(figures[:, FREE])] = np.nan  # the sums tell, comparisons pass over it
    return figures[:, LOWER:].reshape(-1, 2, 3)


def residual_summary(left: NDArray[np.float32], rms: float, relative_rms: float) -> Residual:
    """The residual with what needs all vertices; ``left`` [V, 2] holds weights and relative, -1 where pinned."""
    weights, relative = np.ascontiguousarray(left.T)  # side by side, which NumPy is quicker with
    free = weights >= 0.0
    if not free.all():
        weights, relative = weights[free], relative[free]
    if not len(weights):
        return Residual(0.0, 0.0, 0.0, 0.0, 0.0)
    (p99,), (relative_p99,) = (quantiles(each, 0.99) for each in (weights, relative))
    return Residual(rms, p99, float(weights.max()), relative_rms, relative_p99)
