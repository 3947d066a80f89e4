"""Relaxes until the certificate says rest, the iterations are used up, or the numbers are lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.mesh import Points
from warp_cloth.result import Status
from warp_cloth.solver.certificate import Certifier, Check, Tolerance
from warp_cloth.solver.course import Course
from warp_cloth.solver.relax import Collider, Relaxation

Follow = Callable[[Points], "Collider | None"]
CHUNK = 20  # iterations in a captured graph: enough to hide a launch, few enough to follow a fall
CHUNKS_PER_CHECK = 5  # the certificate costs about two iterations
FALL = 0.01  # [m]; cloth that moved further since the last check is followed chunk by chunk


@dataclass
class Outcome:
    """How a relaxation ended."""

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


def _follow(relaxation: Relaxation, certifier: Certifier, follow: Follow | None, points: Points) -> None:
    """Goes on with a new collider where the old one no longer covers these positions."""
    collider = follow(points) if follow is not None else None
    if collider is not None:
        relaxation.meet(collider)
        certifier.meet(collider)


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
    """Runs iterations in chunks, and checks every few of them.

    Args:
        relaxation: what iterates.
        certifier: what measures it.
        tolerance: when to stop.
        limit: most iterations.
        frames: how many shapes on the way are wanted; some more are kept.
        follow: given the positions, a new collider where the old one no longer covers them.
        course: of garments that meet themselves and each other.
        on_check: told of every check and the seconds so far.
    """
    keeper = FrameKeeper(frames, limit)
    began = time.perf_counter()
    iteration = 0
    points = relaxation.model.points()
    check = certifier.check(0, points)
    if course is not None:
        course.advance(0, points)
    falling = True
    status = Status.ITERATION_LIMIT
    while iteration < limit:
        for _ in range(CHUNKS_PER_CHECK):
            count = min(CHUNK, limit - iteration)
            relaxation.run(count)
            iteration += count
            keeper.offer(iteration, relaxation)
            if falling:
                _follow(relaxation, certifier, follow, relaxation.model.points())
            if iteration >= limit:
                break
        shape = relaxation.model.points()
        check = certifier.check(iteration, shape)
        if not check.finite:
            status = Status.DIVERGED
            break
        last, points = points, shape
        _follow(relaxation, certifier, follow, points)
        falling = float(np.abs(points - last).max()) > FALL
        if on_check is not None:
            on_check(check, time.perf_counter() - began)
        settled = course is None or course.advance(iteration, points)
        if settled and check.within(tolerance):
            status = Status.AT_REST
            break
    wp.synchronize_device(relaxation.model.device)
    return Outcome(status, check, points, iteration, time.perf_counter() - began, keeper.frames)
