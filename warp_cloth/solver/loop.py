"""Relaxes until the certificate says rest, the iterations are used up, or the numbers are lost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Points
from warp_cloth.garment.rest import Floats
from warp_cloth.model.result import Status
from warp_cloth.solver.certificate.certifier import (
    Certifier,
    Check,
    Measurement,
    PendingMeasurement,
    Tolerance,
    read_bounds,
)
from warp_cloth.solver.certificate.summary import PendingFigures
from warp_cloth.solver.contact_schedule import ContactSchedule
from warp_cloth.solver.relax import Relaxation

Boxes = Floats  # lowest and highest corner of some items [m], shape [N, 2, 3]
Follow = Callable[[Sequence[int], Boxes], dict[int, Collider]]
CHUNK = 20  # iterations in a captured graph: enough to hide a launch, few enough to follow a fall
CHUNKS_PER_CHECK = 5  # the certificate costs about two iterations
FALL = 0.01  # [m]; cloth that moved further since the last check is followed chunk by chunk


@dataclass(frozen=True)
class Goal:
    """What an item is to reach, and how long it may try."""

    tolerance: Tolerance
    limit: int  # iterations


@dataclass
class Outcome:
    """How an item's relaxation ended."""

    status: Status
    check: Check
    points: Points  # the last finite shape [m], shape [V, 3]
    iterations: int
    seconds: float  # in the loop, checks and new colliders included
    frames: list[tuple[int, NDArray[np.float32]]] = field(default_factory=list)  # iteration and shape


def chunks(relaxation: Relaxation) -> tuple[int, ...]:
    """Iterations of each graph between two checks, where nothing else is to see or to do in between."""
    return (CHUNK * CHUNKS_PER_CHECK,) if relaxation.runs_long else (CHUNK,) * CHUNKS_PER_CHECK


class FrameKeeper:
    """Keeps shapes on the way at iteration counts that grow geometrically: cloth moves most at the start."""

    def __init__(self, count: int, limit: int) -> None:
        wanted = np.geomspace(CHUNK, max(limit, CHUNK), 4 * count) if count else np.zeros(0)
        self._due = sorted({round(number / CHUNK) * CHUNK for number in wanted})
        self.frames: list[tuple[int, NDArray[np.float32]]] = []

    def offer(self, iteration: int, relaxation: Relaxation) -> None:
        """Keeps the shape after this iteration if it is due."""
        if self._due and iteration >= self._due[0]:
            self._due = [due for due in self._due if due > iteration]
            relaxation.show()
            self.frames.append((iteration, relaxation.model.points().astype(np.float32)))


def relax_to_rest(
    relaxation: Relaxation,
    certifier: Certifier,
    tolerance: Tolerance,
    limit: int,
    *,
    frames: int = 0,
    follow: Follow | None = None,
    schedule: ContactSchedule | None = None,
    on_check: Callable[[Check, float], None] | None = None,
    ahead: bool | None = None,
) -> Outcome:
    """Runs the iterations of a single item; ``relax_items`` says how.

    Args:
        relaxation: what iterates.
        certifier: what measures it.
        tolerance: when to stop.
        limit: most iterations.
        frames: how many shapes on the way are wanted; some more are kept.
        follow: given items and their bounding boxes, new colliders where the old ones no longer cover them.
        schedule: of contact of cloth with cloth.
        on_check: told of every check and the seconds so far.
        ahead: as of relax_items.
    """
    keeper = FrameKeeper(frames, limit)

    def told(measured: Measurement, seconds: float) -> None:
        if on_check is not None:
            on_check(certifier.check(measured, 0), seconds)

    (outcome,) = relax_items(
        relaxation,
        certifier,
        [Goal(tolerance, limit)],
        follow=follow,
        schedule=schedule,
        on_check=told if on_check is not None else None,
        on_chunk=keeper.offer if frames else None,
        ahead=ahead,
    )
    outcome.frames = keeper.frames
    return outcome


def relax_items(
    relaxation: Relaxation,
    certifier: Certifier,
    goals: Sequence[Goal],
    *,
    follow: Follow | None = None,
    schedule: ContactSchedule | None = None,
    on_check: Callable[[Measurement, float], None] | None = None,
    on_chunk: Callable[[int, Relaxation], None] | None = None,
    ahead: bool | None = None,
) -> list[Outcome]:
    """Runs iterations of all items in chunks, checks every few of them, and retires each item as it ends.

    Every item is checked after the same iterations as it would be alone: that, and arithmetic that knows nothing of
    the other items, gives it the same bits in any company.

    A GPU goes on with the next chunk while a check is read, unless what comes next hangs on that. An item that turns
    out to have ended goes back to where the check saw it; new colliders, and room for more pairs of worn cloth, come a
    chunk after what asked for them, on every device.

    Args:
        relaxation: what iterates.
        certifier: what measures it.
        goals: of the items, in their order.
        follow: given items and their bounding boxes, new colliders where the old ones no longer cover them.
        schedule: of contact of cloth with cloth; such a scene is a single item.
        on_check: called with every measurement of all items, and the seconds so far.
        on_chunk: told of every chunk's last iteration; who asks where the cloth is then has it shown (Relaxation.show).
        ahead: whether iterations go on while a check is read; None: where that saves time. Not where more iterations
            are to follow the end: displacements and stiffness bounds are not those that the check saw.
    """
    return _Loop(relaxation, certifier, goals, follow, schedule, on_check, ahead).run(on_chunk)


@dataclass(frozen=True, eq=False)
class _Seen:
    """What was asked of the device after some iterations, and is not read yet."""

    iteration: int
    measurement: PendingMeasurement | None  # of a check
    bounds: PendingFigures | None  # of cloth that falls, between checks
    ending: frozenset[int]  # items that have no iterations left

    @property
    def whole(self) -> bool:
        """Whether the check is of all items, not only of those that end by their limit."""
        return self.iteration % (CHUNK * CHUNKS_PER_CHECK) == 0


@dataclass(frozen=True, eq=False)
class _BoxesSeen:
    """Where the items were after some iterations; ``moved`` as of a check [m]."""

    iteration: int
    boxes: Boxes
    moved: Floats | None
    relative_rms: Floats | None = None  # of the residual, as of a check


class _Loop:
    """The items of one relaxation on their way to rest."""

    def __init__(
        self,
        relaxation: Relaxation,
        certifier: Certifier,
        goals: Sequence[Goal],
        follow: Follow | None,
        schedule: ContactSchedule | None,
        on_check: Callable[[Measurement, float], None] | None,
        ahead: bool | None,
    ) -> None:
        self._relaxation, self._certifier = relaxation, certifier
        self._goals, self._follow, self._schedule, self._on_check = goals, follow, schedule, on_check
        self._saves = wp.get_device(relaxation.model.device).is_cuda if ahead is None else ahead
        self._active = list(range(len(goals)))
        self._falling = list(self._active)
        self._boxes_seen: _BoxesSeen | None = None  # that is to be followed at the next chunk's end
        self._boxes = np.zeros((len(goals), 2, 3))  # of each item when it was last followed,
        self._followed = np.zeros(len(goals), dtype=np.int64)  # and after which iteration that was
        self._outcomes: dict[int, Outcome] = {}
        self._tolerances = [goal.tolerance for goal in goals]
        self._began = time.perf_counter()

    def run(self, on_chunk: Callable[[int, Relaxation], None] | None) -> list[Outcome]:
        relaxation = self._relaxation
        relaxation.start_anew()
        iteration = 0
        while True:
            seen = self._see(iteration)
            late = self._runs_ahead(seen)
            if not late:
                self._decide(seen)
            if not self._active:
                break
            # every item stops at its own limit, and nobody else looks there
            chunk = self._chunk(seen, on_chunk is not None)
            count = min(chunk, min(self._goals[item].limit for item in self._active) - iteration)
            iteration += count
            relaxation.run(count, **self._shown(iteration))
            if on_chunk is not None:
                on_chunk(iteration, relaxation)
            if late:
                self._decide(seen, late=True)
            if iteration % CHUNK == 0:
                self._go_on()
            if not self._active:
                break
        relaxation.start_anew()  # what is measured next is measured of all
        points = relaxation.model.points()  # which have stayed where their items ended
        for item, outcome in self._outcomes.items():
            if outcome.status is not Status.DIVERGED:
                outcome.points = points[relaxation.model.of_item(item)].copy()
        return [self._outcomes[item] for item in range(len(self._goals))]

    def _runs_ahead(self, seen: _Seen) -> bool:
        """Whether the next chunk may begin before what was seen is read."""
        if not self._saves or seen.ending:
            return False
        return self._schedule is None or seen.measurement is None or not self._schedule.must_wait

    def _chunk(self, seen: _Seen, told: bool) -> int:
        """Iterations from here to where something may be to see or to do; ``told``: every chunk's end is told."""
        follows = self._follow is not None and bool(self._falling)
        whole = CHUNK if told or follows or not self._relaxation.runs_long else CHUNK * CHUNKS_PER_CHECK
        return whole - seen.iteration % whole

    def _shown(self, iteration: int) -> dict[str, bool]:
        """How a chunk is to be run that ends after so many iterations: it need not be shown where nobody looks.

        A lone garment is shown in less time than it takes to capture another graph.
        """
        at_limit = any(self._goals[item].limit <= iteration for item in self._active)
        follows = self._follow is not None and bool(self._falling)
        looks = follows or at_limit or iteration % (CHUNK * CHUNKS_PER_CHECK) == 0
        lone = self._schedule is None and len(self._goals) == 1
        return {} if looks or lone or not self._relaxation.stays_packed else {"shown": False}

    def _see(self, iteration: int) -> _Seen:
        """Asks of the device what there is to decide after these iterations."""
        ending = frozenset(item for item in self._active if self._goals[item].limit <= iteration)
        if iteration % (CHUNK * CHUNKS_PER_CHECK) == 0:
            if self._schedule is not None:
                self._schedule.request(iteration, ahead=self._saves)
            measurement = self._certifier.start_measurement(iteration)
            self._certifier.take_snapshot(iteration)
            return _Seen(iteration, measurement, None, ending)
        if ending:
            return _Seen(iteration, self._certifier.start_measurement(iteration), None, ending)
        follows = self._follow is not None and self._falling and iteration % CHUNK == 0
        if follows:
            self._relaxation.show()
        return _Seen(iteration, None, self._certifier.request_bounds(self._falling) if follows else None, ending)

    def _decide(self, seen: _Seen, *, late: bool = False) -> None:
        """Reads what was seen, and retires the items that had ended then; ``late``: they have iterated since."""
        if seen.bounds is not None:
            self._boxes_seen = _BoxesSeen(seen.iteration, read_bounds(seen.bounds), None)
        if seen.measurement is None:
            return
        measured = self._certifier.read(seen.measurement)
        settled = self._advance(measured)
        near = measured.nearly_within(self._tolerances) | ~measured.finite
        ended = []
        asked = self._active if seen.whole else sorted(seen.ending)
        asked = [item for item in asked if item in seen.ending or (near[item] and measured.iteration > 0)]
        for item, check in self._certifier.checks(measured, asked).items():
            status = self._status(item, check, settled, item in seen.ending)
            if status is not None:
                if late:
                    self._certifier.restore(item)
                    if self._schedule is not None:
                        self._schedule.restore()
                self._end(item, status, check)
                ended.append(item)
        self._active = [item for item in self._active if item not in self._outcomes]
        if seen.whole:
            self._boxes_seen = _BoxesSeen(measured.iteration, measured.boxes, measured.moved, measured.relative_rms)
        self._relaxation.retire(ended)
        if self._on_check is not None and measured.iteration > 0:
            self._on_check(measured, time.perf_counter() - self._began)

    def _advance(self, measured: Measurement) -> bool:
        """Advances the contact schedule; returns whether the present shape may be the rest shape."""
        if self._schedule is None or not measured.finite.all():
            return True
        return self._schedule.advance(measured.iteration)

    def _status(self, item: int, check: Check, settled: bool, ending: bool) -> Status | None:
        """How an item has ended; None while it has not. The start is an end only where it is the limit."""
        if check.iteration > 0:
            if not check.finite:
                return Status.DIVERGED
            if settled and check.within(self._goals[item].tolerance):
                return Status.AT_REST
        return Status.ITERATION_LIMIT if ending else None

    def _end(self, item: int, status: Status, check: Check) -> None:
        """Notes how an item has ended; where it lies is read at last, once for all."""
        points = self._certifier.last_points(item) if status is Status.DIVERGED else np.zeros((0, 3))
        self._outcomes[item] = Outcome(status, check, points, check.iteration, time.perf_counter() - self._began)

    def _go_on(self) -> None:
        """Goes on with new colliders where cloth has left the old ones, or will have in a chunk."""
        seen, self._boxes_seen = self._boxes_seen, None
        if self._schedule is not None:
            self._schedule.react()
        if seen is None:
            return
        if seen.relative_rms is not None and seen.iteration > 0:
            self._relaxation.loosen(seen.relative_rms)
        if seen.moved is not None and seen.iteration > 0:
            self._falling = [item for item in self._active if seen.moved[item] > FALL]
        going = self._active if seen.moved is not None else [item for item in self._falling if item in self._active]
        known = np.asarray(np.isfinite(seen.boxes).all(axis=(1, 2)))  # of the others the next check tells
        items = [item for item in going if known[item]]
        now = seen.boxes[items]
        if seen.iteration > 0 and self._follow is not None and items:
            way = (now - self._boxes[items]) * (CHUNK / (seen.iteration - self._followed[items]))[:, None, None]
            soon = now + way
            room = np.stack([np.minimum(now, soon)[:, 0], np.maximum(now, soon)[:, 1]], axis=1)
            for item, collider in self._follow(items, room).items():
                self._relaxation.meet(item, collider)
        self._boxes[items], self._followed[items] = now, seen.iteration
