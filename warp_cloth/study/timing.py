"""How long iterations take, and each launch in them, on the way that a fit goes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.fitting.problem import Problem, collider_updates
from warp_cloth.solver.loop import CHUNK, CHUNKS_PER_CHECK, chunks
from warp_cloth.study.launches import Launch, launches_of

# Iterations that are watched: an even number, as every second one goes back to the first one's arrays where forces are
# gathered. Where cloth meets cloth enough of them to hold searches for what is near, which few iterations do.
WATCHED, WATCHED_TOUCHING = 20, 100
TIMED = CHUNK * CHUNKS_PER_CHECK  # iterations between two checks of a fit
WAKING = 12  # times as many before the clock runs, where cloth meets cloth: that begins when the seams have closed
SHORTEST_RUN = 0.5  # [s] of timing
FEWEST_ROUNDS = 5
SEEN = 12  # times, evenly over that, that what launches move is counted where cloth meets cloth
LONG = 5.0  # [s] that iterations take before the next chunk, or the next round, is left out
LOOKS = 100  # that are timed together
OUTLIER = 4.0  # times the median of what is timed again and again: longer was something else
LEAST = 0.02  # of what a launch was timed at, that it takes itself: less cannot be told apart from none


@dataclass
class Times:
    """Seconds of a fit's iterations, and of the launches in others between them."""

    begin: int = 0  # iterations before the first one that was timed,
    end: int = 0  # and with the last one
    seconds: float = 0.0  # of an iteration, captured, as a fit runs it
    look: float = 0.0  # of these, what it takes to look whether cloth near cloth is to be looked for anew
    looks: float = 0.0  # per iteration
    count: dict[str, float] = field(default_factory=dict)  # launches per iteration, by the kernel's key
    spent: dict[str, float] = field(default_factory=dict)  # seconds per iteration, from a launch to the next one
    launches: list[Launch] = field(default_factory=list)  # the last ones of every kernel


def times_of(made: Problem, see: Callable[[list[Launch], int], None] = lambda _launches, _iteration: None) -> Times:
    """Runs some hundreds of iterations from the start, and times some of them whole and others launch by launch.

    ``see``: told now and then of the launches in some iterations, when these are done, and of how many are.

    The two take turns, as what meets, and how often that is looked for, changes on the way. On a GPU a clock round a
    launch adds the same to every one, and pauses between two are as long whichever they are: both are known by what
    all launches take together as a fit runs them, or would run them one after another.
    """
    way, times = Way(made), Times()
    while not way.warm:
        way.go()
        way.check()
    times.begin = way.iteration
    took = dict[tuple[str, int], list[float]]()  # seconds of each launch, by kernel and threads
    rates, looks, told, watched, passed = list[float](), list[float](), list[float](), 0, 0.0
    while passed < SHORTEST_RUN or (len(rates) < FEWEST_ROUNDS and passed < LONG):
        done, seconds = way.go()
        passed += seconds
        rates.append(seconds / done)
        looks.append(way.looks)
        launches, each = way.watch()
        if passed >= len(told) * SHORTEST_RUN / SEEN:
            told.append(passed)
            see(launches, way.iteration)
        seen = {launch.kernel.key for launch in launches}
        times.launches = [*launches, *(launch for launch in times.launches if launch.kernel.key not in seen)]
        for launch, elapsed in zip(launches, each, strict=True):
            took.setdefault((launch.kernel.key, launch.threads), []).append(elapsed)
        watched += way.watched
        way.check()
    times.end, times.seconds = way.iteration, _sum(rates) / len(rates)
    times.looks = sum(looks) / len(looks)
    if times.looks:
        times.look = min(times.looks * _seconds_of_look(made.model.device), times.seconds)
    in_turn = None
    if wp.get_device(made.model.device).is_cuda:
        in_turn = way.in_turn() if way.beside else times.seconds
    _share_out(times, took, watched, in_turn)
    return times


def _share_out(times: Times, took: dict[tuple[str, int], list[float]], watched: int, in_turn: float | None) -> None:
    """Tells what launches take of an iteration, given what clocks told of those in so many ``watched`` ones.

    ``in_turn``: seconds of an iteration whose launches follow each other; None: clocks add nothing to a launch.
    """
    spent: dict[str, float] = {}
    for (key, _), all_of_it in took.items():
        times.count[key] = times.count.get(key, 0.0) + len(all_of_it) / watched
        spent[key] = spent.get(key, 0.0) + _sum(all_of_it) / watched
    whole, added = times.seconds - times.look, 0.0
    if in_turn is not None:
        added = (sum(spent.values()) - in_turn + times.look) / sum(times.count.values())
    own = {key: max(seconds - added * times.count[key], LEAST * seconds) for key, seconds in spent.items()}
    rest = whole / sum(own.values())  # on a GPU 1, unless a launch took least, or some go side by side
    times.spent = {key: rest * seconds for key, seconds in own.items()}


def _sum(seconds: Sequence[float]) -> float:
    """The sum of times of the same thing, without what else kept the machine meanwhile."""
    return float(np.minimum(seconds, OUTLIER * np.median(seconds)).sum())


class Way:
    """A fit's way from the start: iterations, and a look at the cloth every so many."""

    def __init__(self, made: Problem) -> None:
        self._made, self._follow = made, collider_updates(made)
        self.iteration = 0
        self._chunks = chunks(made.relaxation)
        at_once = WATCHED if made.course is None else WATCHED_TOUCHING
        self._watched = self._chunks if made.relaxation.runs_long else (at_once,)
        self.watched = sum(self._watched)
        self._wake = [wp.zeros(1, dtype=wp.int32, device=made.model.device) for _ in range(2)]
        self._cold = 1 if made.course is None else WAKING  # rounds before it is warm
        made.relaxation.start_anew()

    @property
    def warm(self) -> bool:
        """Whether what iterations take is worth a clock."""
        return self._cold <= 0

    @property
    def looks(self) -> float:
        """How often an iteration looks whether cloth near cloth is to be looked for anew."""
        touch = self._made.relaxation.touch
        return 1.0 / touch.look_every if touch is not None and touch.awake else 0.0

    def go(self) -> tuple[int, float]:
        """Iterates as far as the next check, or less far where that takes long; tells how far, and the seconds."""
        relaxation, device = self._made.relaxation, self._made.model.device
        for count in set(self._chunks):
            relaxation.capture(count)
        wp.synchronize_device(device)
        done, began = 0, time.perf_counter()
        for count in self._chunks:
            if time.perf_counter() - began <= LONG:
                relaxation.run(count)
                done += count
        wp.synchronize_device(device)
        self.iteration += done
        return done, time.perf_counter() - began

    @property
    def beside(self) -> bool:
        """Whether some launches of a graph go side by side."""
        touch = self._made.relaxation.touch
        return touch is not None and touch.awake and touch.untangles

    def in_turn(self) -> float:
        """Seconds of an iteration whose launches follow each other, as those do that are watched."""
        relaxation = self._made.relaxation
        with self._one_by_one():
            relaxation.forget_graphs()
            done, seconds = self.go()
        relaxation.forget_graphs()
        return seconds / done

    def iterate_watched(self) -> None:
        """Iterates launch by launch, and packs vertices as often as a fit does."""
        with self._one_by_one():
            for count in self._watched:
                self._made.relaxation.iterate(count)
        self.iteration += self.watched

    def _one_by_one(self) -> AbstractContextManager[None]:
        touch = self._made.relaxation.touch
        return nullcontext() if touch is None else touch.in_turn()

    def watch(self) -> tuple[list[Launch], list[float]]:
        """Iterates launch by launch; tells the launches, and the seconds of each with all that a clock adds."""
        seconds = list[float]()
        clock = not wp.get_device(self._made.model.device).is_cuda
        if not clock:
            wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
            wp.copy(*self._wake)  # what a GPU is asked first after a pause takes it longer
        launches = launches_of(self.iterate_watched, seconds if clock else None)
        if not clock:
            results: list[Any] = wp.timing_end()
            seconds = [1e-3 * result.elapsed for result in results]
        return launches, seconds

    def check(self) -> None:
        """Looks at the cloth as a fit does, and has it go on by what it sees."""
        made, certifier = self._made, self._made.certifier
        self._cold -= 1
        glance = certifier.glance(self.iteration)
        certifier.turn_page(self.iteration)
        look = certifier.read(glance)
        if not look.finite.all():
            return
        if made.course is not None:
            made.course.advance(self.iteration)
        made.relaxation.loosen(look.relative_rms)
        for item, collider in self._follow(range(len(look.boxes)), look.boxes).items():
            made.relaxation.meet(item, collider)


def _seconds_of_look(device: str) -> float:
    """Seconds that a captured graph takes to see that a branch of it is not to be gone."""
    if not wp.get_device(device).is_cuda:
        return 0.0
    never, other = (wp.zeros(1, dtype=wp.int32, device=device) for _ in range(2))
    with wp.ScopedCapture(device=device) as capture:
        for _ in range(LOOKS):
            wp.capture_if(never, on_true=other.zero_)
    spent = []
    for _ in range(FEWEST_ROUNDS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        wp.capture_launch(capture.graph)
        wp.synchronize_device(device)
        spent.append(time.perf_counter() - began)
    return float(np.min(spent)) / LOOKS
