"""How long iterations take, as a fit runs them, and each launch in them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.fitting.problem import Problem, collider_updates
from warp_cloth.solver.loop import bursts
from warp_cloth.study.launches import Launch, launches_of

# Iterations recorded launch by launch: an even number, as two iterations swap arrays where forces are gathered.
# Where cloth meets cloth enough of them to include searches for near pairs, which few iterations run.
RECORDED, RECORDED_TOUCHING = 20, 100
WARM_UP_TOUCHING = 12  # rounds of warm-up where cloth meets cloth: contact begins when the seams have closed
SHORTEST_RUN = 0.5  # [s] of timing
FEWEST_ROUNDS = 5
LONG = 5.0  # [s] of iterations after which the next burst, or the next round, is left out
EMPTY_CHECKS = 100  # timed together
OUTLIER = 4.0  # times the median of repeated timings: anything longer was another process
LEAST = 0.02  # fraction of a launch's timing that counts as its own: less cannot be distinguished from none


@dataclass
class Times:
    """Seconds of a fit's iterations, and of the launches of others between them."""

    begin: int = 0  # iterations before the first timed one,
    end: int = 0  # and with the last one
    seconds: float = 0.0  # of an iteration, captured, as a fit runs it
    search_check: float = 0.0  # of these, the checks whether to search for cloth near cloth again
    search_checks: float = 0.0  # per iteration
    count: dict[str, float] = field(default_factory=dict)  # launches per iteration, by the kernel's key
    spent: dict[str, float] = field(default_factory=dict)  # seconds per iteration, from a launch to the next one
    launches: list[Launch] = field(default_factory=list)  # the last one of every kernel


def times_of(problem: Problem) -> Times:
    """Runs some hundreds of iterations from the start, and times some of them whole and others launch by launch.

    The two alternate, as contacts and the number of searches change during a fit. On a GPU a timer round a launch adds
    the same time to every launch, and so does the pause between two: both follow from the time of all launches together
    as a fit runs them (or would run them one after another).
    """
    run, times = TimedFit(problem), Times()
    while not run.warm:
        run.advance()
        run.check()
    times.begin = run.iteration
    took = dict[tuple[str, int], list[float]]()  # seconds of each launch, by kernel and threads
    last = dict[str, Launch]()
    rates, checks, recorded, passed = list[float](), list[float](), 0, 0.0
    while passed < SHORTEST_RUN or (len(rates) < FEWEST_ROUNDS and passed < LONG):
        done, seconds = run.advance()
        passed += seconds
        rates.append(seconds / done)
        checks.append(run.search_checks)
        launches, each = run.record()
        last |= {launch.kernel.key: launch for launch in launches}
        for launch, elapsed in zip(launches, each, strict=True):
            took.setdefault((launch.kernel.key, launch.threads), []).append(elapsed)
        recorded += run.recorded
        run.check()
    times.launches = list(last.values())
    times.end, times.seconds = run.iteration, _sum(rates) / len(rates)
    times.search_checks = sum(checks) / len(checks)
    if times.search_checks:
        times.search_check = min(times.search_checks * _seconds_of_empty_check(problem.model.device), times.seconds)
    serial = None
    if wp.get_device(problem.model.device).is_cuda:
        serial = run.serial_seconds() if run.overlaps else times.seconds
    _attribute(times, took, recorded, serial)
    return times


def _attribute(times: Times, took: dict[tuple[str, int], list[float]], recorded: int, serial: float | None) -> None:
    """Attributes the time of an iteration to its launches, from timings of them in ``recorded`` iterations.

    ``serial``: seconds of an iteration whose launches run one after another; None: timers add nothing to a launch.
    """
    spent: dict[str, float] = {}
    for (key, _), timings in took.items():
        times.count[key] = times.count.get(key, 0.0) + len(timings) / recorded
        spent[key] = spent.get(key, 0.0) + _sum(timings) / recorded
    whole, added = times.seconds - times.search_check, 0.0
    if serial is not None:
        added = (sum(spent.values()) - serial + times.search_check) / sum(times.count.values())
    own = {key: max(seconds - added * times.count[key], LEAST * seconds) for key, seconds in spent.items()}
    ratio = whole / sum(own.values())  # on a GPU 1, unless LEAST applied to a launch, or launches overlap
    times.spent = {key: ratio * seconds for key, seconds in own.items()}


def _sum(seconds: Sequence[float]) -> float:
    """Sum of repeated timings, outliers cut: another process had the machine meanwhile."""
    return float(np.minimum(seconds, OUTLIER * np.median(seconds)).sum())


class TimedFit:
    """A fit from its start: iterations in graphs, with a check of the cloth every so many."""

    def __init__(self, problem: Problem) -> None:
        self._problem, self._follow = problem, collider_updates(problem)
        self.iteration = 0
        self._bursts = bursts(problem.relaxation)
        at_once = RECORDED if problem.schedule is None else RECORDED_TOUCHING
        self._recorded = self._bursts if problem.relaxation.runs_long else (at_once,)
        self.recorded = sum(self._recorded)
        self._wake = [wp.zeros(1, dtype=wp.int32, device=problem.model.device) for _ in range(2)]
        self._cold = 1 if problem.schedule is None else WARM_UP_TOUCHING  # rounds of warm-up left
        problem.relaxation.restart()

    @property
    def warm(self) -> bool:
        """Whether the warm-up is over."""
        return self._cold <= 0

    @property
    def search_checks(self) -> float:
        """How often an iteration checks whether to search for cloth near cloth again."""
        cloth_contact = self._problem.relaxation.cloth_contact
        return 1.0 / cloth_contact.check_interval if cloth_contact is not None and cloth_contact.awake else 0.0

    def advance(self) -> tuple[int, float]:
        """Iterates to the next check, or less far where that takes long; returns the iterations and their seconds."""
        relaxation, device = self._problem.relaxation, self._problem.model.device
        for count in set(self._bursts):
            relaxation.capture(count)
        wp.synchronize_device(device)
        done, began = 0, time.perf_counter()
        for count in self._bursts:
            if time.perf_counter() - began <= LONG:
                relaxation.run(count)
                done += count
        wp.synchronize_device(device)
        self.iteration += done
        return done, time.perf_counter() - began

    @property
    def overlaps(self) -> bool:
        """Whether some launches of a graph run side by side."""
        cloth_contact = self._problem.relaxation.cloth_contact
        return cloth_contact is not None and cloth_contact.awake and cloth_contact.untangles

    def serial_seconds(self) -> float:
        """Seconds of an iteration whose launches run one after another, as those do that are recorded."""
        relaxation = self._problem.relaxation
        with self._serial():
            relaxation.drop_graphs()
            done, seconds = self.advance()
        relaxation.drop_graphs()
        return seconds / done

    def iterate_recorded(self) -> None:
        """Iterates launch by launch, and packs vertices as often as a fit does."""
        with self._serial():
            for count in self._recorded:
                self._problem.relaxation.iterate(count)
        self.iteration += self.recorded

    def _serial(self) -> AbstractContextManager[None]:
        cloth_contact = self._problem.relaxation.cloth_contact
        return nullcontext() if cloth_contact is None else cloth_contact.searches_in_sequence()

    def record(self) -> tuple[list[Launch], list[float]]:
        """Iterates launch by launch; returns the launches, and the seconds of each with all that a timer adds."""
        seconds = list[float]()
        host_timer = not wp.get_device(self._problem.model.device).is_cuda
        if not host_timer:
            wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
            wp.copy(*self._wake)  # the first work after a pause takes a GPU longer
        launches = launches_of(self.iterate_recorded, seconds if host_timer else None)
        if not host_timer:
            results: list[Any] = wp.timing_end()
            seconds = [1e-3 * result.elapsed for result in results]
        return launches, seconds

    def check(self) -> None:
        """Checks the cloth as a fit does, and adapts the relaxation to the outcome."""
        problem, certifier = self._problem, self._problem.certifier
        self._cold -= 1
        pending = certifier.start_measurement(self.iteration)
        certifier.take_snapshot(self.iteration)
        measured = certifier.read(pending)
        if not measured.finite.all():
            return
        if problem.schedule is not None:
            problem.schedule.advance(self.iteration)
        problem.relaxation.update_anisotropy(measured.relative_rms)
        for item, collider in self._follow(range(len(measured.boxes)), measured.boxes).items():
            problem.relaxation.set_collider(item, collider)


def _seconds_of_empty_check(device: str) -> float:
    """Seconds that a captured graph takes to find that a conditional branch is not taken."""
    if not wp.get_device(device).is_cuda:
        return 0.0
    never, other = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))
    with wp.ScopedCapture(device=device) as capture:
        for _ in range(EMPTY_CHECKS):
            wp.capture_if(never, on_true=other.zero_)
    spent = []
    for _ in range(FEWEST_ROUNDS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        wp.capture_launch(capture.graph)
        wp.synchronize_device(device)
        spent.append(time.perf_counter() - began)
    return float(np.min(spent)) / EMPTY_CHECKS
