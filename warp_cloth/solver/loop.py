"""Relaxes until the certificate says rest, the iterations are used up, or the numbers are lost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.mesh import Points
from warp_cloth.rest import Floats
from warp_cloth.result import Status
from warp_cloth.solver.certificate import Certifier, Check, Look, Tolerance
from warp_cloth.solver.course import Course
from warp_cloth.solver.relax import Collider, Relaxation

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
            self.frames.append((iteration, relaxation.model.points().astype(np.float32)))


def relax_to_rest(
    relaxation: Relaxation,
    certifier: Certifier,
    tolerance: Tolerance,
    limit: int,
    *,
    frames: int = 0,
    follow: Follow | None = None,
    course: Course | None = None,
    on_check: Callable[[Check, float], None] | None = None,
) -> Outcome:
    """Runs the iterations of a single item; ``relax_items`` says how.

    Args:
        relaxation: what iterates.
        certifier: what measures it.
        tolerance: when to stop.
        limit: most iterations.
        frames: how many shapes on the way are wanted; some more are kept.
        follow: given items and their bounding boxes, new colliders where the old ones no longer cover them.
        course: of garments that meet themselves and each other.
        on_check: told of every check and the seconds so far.
    """
    keeper = FrameKeeper(frames, limit)

    def told(look: Look, seconds: float) -> None:
        if on_check is not None:
            on_check(certifier.check(look, 0), seconds)

    goals = [Goal(tolerance, limit)]
    (outcome,) = relax_items(
        relaxation, certifier, goals, follow=follow, course=course, on_check=told, on_chunk=keeper.offer
    )
    outcome.frames = keeper.frames
    return outcome


def relax_items(
    relaxation: Relaxation,
    certifier: Certifier,
    goals: Sequence[Goal],
    *,
    follow: Follow | None = None,
    course: Course | None = None,
    on_check: Callable[[Look, float], None] | None = None,
    on_chunk: Callable[[int, Relaxation], None] | None = None,
) -> list[Outcome]:
    """Runs iterations of all items in chunks, checks every few of them, and retires each item as it ends.

    Every item is checked after the same iterations as it would be alone: that, and arithmetic that knows nothing of
    the other items, gives it the same bits in any company.

    Args:
        relaxation: what iterates.
        certifier: what measures it.
        goals: of the items, in their order.
        follow: given items and their bounding boxes, new colliders where the old ones no longer cover them.
        course: of garments that meet themselves and each other; such a scene is an item alone.
        on_check: told of every look at all items, and the seconds so far.
        on_chunk: told of every chunk's last iteration.
    """
    return _Loop(relaxation, certifier, goals, follow, course).run(on_check, on_chunk)


class _Loop:
    """The items of one relaxation on their way to rest."""

    def __init__(
        self,
        relaxation: Relaxation,
        certifier: Certifier,
        goals: Sequence[Goal],
        follow: Follow | None,
        course: Course | None,
    ) -> None:
        self._relaxation, self._certifier = relaxation, certifier
        self._goals, self._follow, self._course = goals, follow, course
        self._active = list(range(len(goals)))
        self._falling = list(self._active)
        self._outcomes: dict[int, Outcome] = {}
        self._relative_rms = np.array([goal.tolerance.relative_rms for goal in goals])
        self._rest_error = np.array([goal.tolerance.rest_error for goal in goals])
        self._began = time.perf_counter()

    def run(
        self,
        on_check: Callable[[Look, float], None] | None,
        on_chunk: Callable[[int, Relaxation], None] | None,
    ) -> list[Outcome]:
        self._relaxation.start_anew()
        iteration = 0
        self._look(iteration)
        while self._active:
            # every item stops at its own limit, and nobody else looks there
            count = min(CHUNK - iteration % CHUNK, min(self._goals[item].limit for item in self._active) - iteration)
            self._relaxation.run(count)
            iteration += count
            if on_chunk is not None:
                on_chunk(iteration, self._relaxation)
            if iteration % CHUNK == 0:
                self._follow_falling()
            look = self._look(iteration)
            if look is not None and on_check is not None:
                on_check(look, time.perf_counter() - self._began)
        self._relaxation.start_anew()  # what is measured next is measured of all
        wp.synchronize_device(self._relaxation.model.device)
        return [self._outcomes[item] for item in range(len(self._goals))]

    def _look(self, iteration: int) -> Look | None:
        """Looks at the items whose turn it is, retires those that have ended, follows the others."""
        ending = {item for item in self._active if self._goals[item].limit <= iteration}
        at_all = iteration % (CHUNK * CHUNKS_PER_CHECK) == 0
        if not at_all and not ending:
            return None
        look = self._certifier.look(iteration)
        settled = self._advance(look)
        near = look.nearly_within(self._relative_rms, self._rest_error) | ~look.finite
        ended = []
        for item in self._active if at_all else sorted(ending):
            if item in ending or (near[item] and iteration > 0):
                check = self._certifier.check(look, item)
                status = self._status(item, check, settled, item in ending)
                if status is not None:
                    self._end(item, status, check)
                    ended.append(item)
        self._active = [item for item in self._active if item not in self._outcomes]
        if at_all:
            if iteration > 0:
                self._falling = [item for item in self._active if look.moved[item] > FALL]
                self._go_on(self._active, look.boxes[self._active])
            self._certifier.turn_page(iteration)
        self._relaxation.retire(ended)
        return look

    def _advance(self, look: Look) -> bool:
        """Goes on along the course; whether what is now may be the rest shape."""
        if self._course is None or not look.finite.all():
            return True
        return self._course.advance(look.iteration, self._relaxation.model.points())

    def _status(self, item: int, check: Check, settled: bool, ending: bool) -> Status | None:
        """How an item has ended; None while it has not. The start is an end only where it is the limit."""
        if check.iteration > 0:
            if not check.finite:
                return Status.DIVERGED
            if settled and check.within(self._goals[item].tolerance):
                return Status.AT_REST
        return Status.ITERATION_LIMIT if ending else None

    def _end(self, item: int, status: Status, check: Check) -> None:
        lost = status is Status.DIVERGED
        points = self._certifier.last_points(item) if lost else self._relaxation.model.points(item)
        self._outcomes[item] = Outcome(status, check, points, check.iteration, time.perf_counter() - self._began)

    def _follow_falling(self) -> None:
        """Goes on with new colliders where cloth that falls fast has left the old ones."""
        if self._follow is None or not self._falling:
            return
        boxes = self._certifier.bounds()[self._falling]
        known = np.asarray(np.isfinite(boxes).all(axis=(1, 2)))  # of the others the next check tells
        self._go_on([item for item, there in zip(self._falling, known, strict=True) if there], boxes[known])

    def _go_on(self, items: Sequence[int], boxes: Boxes) -> None:
        if self._follow is not None and len(items):
            for item, collider in self._follow(items, boxes).items():
                self._relaxation.meet(item, collider)
