"""The relax loop: iterates until the certificate says rest, the iterations are used up, or the shape is not finite."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.garment.rest import Floats
from warp_cloth.model.attempt import CutShort, Patience
from warp_cloth.model.result import Status
from warp_cloth.solver.certificate.certifier import (
    Certifier,
    Check,
    Measurement,
    PendingMeasurement,
    read_bounds,
)
from warp_cloth.solver.certificate.summary import PendingFigures
from warp_cloth.solver.contact_schedule import ContactSchedule
from warp_cloth.solver.goal import SEWN, Goal, Outcome
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.stall import StallWatch
from warp_cloth.solver.step_options import CALM

Boxes = Floats  # lowest and highest corner of some items [m], shape [N, 2, 3]
# Given items and their boxes, new colliders for those that the old ones no longer cover.
Follow = Callable[[Sequence[int], Boxes], dict[int, Collider]]
Crosses = Callable[[Sequence[int]], Sequence[int]]  # which of some items' cloth passes through cloth now
Falls = Callable[[Sequence[int]], Sequence[int]]  # of which of some items cloth falls that nothing can catch
Astray = Callable[[], bool]  # whether a limb of the only item's avatar is outside its opening now, or within the cloth
Misworn = Callable[[], bool]  # whether the only item is not worn now as it should be, and another start may mend it
BURST = 20  # iterations in a captured graph: enough to hide a launch, few enough to follow a fall
BURSTS_PER_CHECK = 5  # the certificate costs about two iterations
FALL = 0.01  # [m]; the boxes of cloth that moved further since the last check are measured after every burst


# Iterations after which what still crosses stays tangled. Random designs came apart 300 to 500 after being sewn; one
# that the multilevel method had left with crossings, after more than 4,000.
TANGLED = {Patience.NONE: math.inf, Patience.SHORT: 4000, Patience.LONG: 10_000}
# Every so many iterations cloth that came down farther than this is asked whether anything can catch it. Free cloth
# falls by 20 mm in as many, settling hems by less than this.
FALL_CHECK, CAME_DOWN = 500, 0.01  # [m]
ASTRAY = 1000  # the same, where cloth is wound round a limb, too, and another attempt may do better


# Cloth still falls while more than this fraction of its forces is out of balance. Without contact: after 4,000
# iterations sheets of up to 16,000 vertices that hang have a hundredth at most, strips that swing a twelfth at least.
FALLING = 0.05
# With contact, where the other kind of steps costs ten times as much, that fraction times the iterations so far: with
# less, 12 of 13 scenes rested sooner by the steps that they had, most in half the time.
FALLING_IN_CONTACT = 600.0


def bursts(relaxation: Relaxation) -> tuple[int, ...]:
    """Iterations of each graph between two checks, if nothing has to be done in between."""
    return (BURST * BURSTS_PER_CHECK,) if relaxation.runs_long else (BURST,) * BURSTS_PER_CHECK


def relax_items(
    certifier: Certifier,
    goals: Sequence[Goal],
    *,
    follow: Follow | None = None,
    schedule: ContactSchedule | None = None,
    crosses: Crosses | None = None,
    astray: Astray | None = None,
    falls: Falls | None = None,
    misworn: Misworn | None = None,
    on_check: Callable[[Measurement, float], None] | None = None,
    on_burst: Callable[[int, Relaxation], None] | None = None,
    ahead: bool | None = None,
) -> list[Outcome]:
    """Runs iterations of all items in bursts, checks every few of them, and retires each item as it ends.

    Every item is checked after the same iterations as it would be alone: that, and arithmetic that does not depend on
    the other items, gives it the same bits alone and in a batch.

    A GPU runs the next burst while a check is read, unless what comes next depends on it. An item that turns out to
    have ended is restored to the shape that was checked; new colliders, and memory for more contact pairs, take effect
    a burst after the measurement that called for them, on every device.

    Args:
        certifier: of the relaxation that iterates.
        goals: of the items, in their order.
        follow: gives new colliders to items that leave the region of the old ones.
        schedule: of contact of cloth with cloth; such a scene is a single item.
        crosses: tells which items' cloth passes through cloth, for goals that end there.
        astray: tells whether the cloth of a scene with contact is wound round a limb, where it stays tangled.
        falls: tells which items' cloth falls where nothing can catch it, asked where it comes down.
        misworn: tells whether the only item is worn otherwise than it should be, for a goal that ends there.
        on_check: called with every measurement of all items, and the seconds so far.
        on_burst: called after every burst with its last iteration; positions are those of the last update_model.
        ahead: whether iterations run while a check is read; None: if that saves time. Must be off if more iterations
            follow the end: displacements and stiffness bounds are not restored.
    """
    return _Loop(certifier, goals, follow, schedule, crosses, astray, falls, misworn, on_check, ahead).run(on_burst)


@dataclass(frozen=True, eq=False)
class _Pending:
    """What was requested of the device after some iterations, and is not read yet."""

    iteration: int
    measurement: PendingMeasurement | None  # of a check
    bounds: PendingFigures | None  # of cloth that falls, between checks
    ending: frozenset[int]  # items that have no iterations left

    @property
    def whole(self) -> bool:
        """Whether the check is of all items, not only of those that end by their limit."""
        return self.iteration % (BURST * BURSTS_PER_CHECK) == 0


@dataclass(frozen=True, eq=False)
class _Positions:
    """Where the items were after some iterations; the last two only of a check."""

    iteration: int
    boxes: Boxes
    moved: Floats | None = None  # largest change of a coordinate [m]
    relative_rms: Floats | None = None  # of the residual


class _Loop:
    """The items of one relaxation, until all have ended."""

    def __init__(
        self,
        certifier: Certifier,
        goals: Sequence[Goal],
        follow: Follow | None,
        schedule: ContactSchedule | None,
        crosses: Crosses | None,
        astray: Astray | None,
        falls: Falls | None,
        misworn: Misworn | None,
        on_check: Callable[[Measurement, float], None] | None,
        ahead: bool | None,
    ) -> None:
        self._relaxation, self._certifier = certifier.relaxation, certifier
        if schedule is None and self._relaxation.cloth_contact is not None:
            raise ValueError("contact of cloth with cloth needs its schedule, which finds the pairs that touch")
        self._goals, self._follow, self._schedule, self._on_check = goals, follow, schedule, on_check
        self._ahead = wp.get_device(certifier.relaxation.model.device).is_cuda if ahead is None else ahead
        self._active = list(range(len(goals)))
        self._falling = list(self._active)
        self._positions: _Positions | None = None  # which colliders are to follow after the next burst
        self._boxes = np.zeros((len(goals), 2, 3))  # of each item when its collider last followed,
        self._followed_at = np.zeros(len(goals), dtype=np.int64)  # and after which iteration that was
        self._outcomes: dict[int, Outcome] = {}
        self._tolerances = [goal.tolerance for goal in goals]
        self._stall_watch = StallWatch([goal.patience for goal in goals], self._tolerances)
        self._crosses = crosses if any(goal.ends_crossing for goal in goals) else None
        self._astray = astray  # None once it has been asked
        self._falls = falls
        self._misworn = misworn if len(goals) == 1 else None
        self._lowest: Floats | None = None  # of each item when it was last looked whether it falls [m], shape [items]
        self._began = time.perf_counter()

    def run(self, on_burst: Callable[[int, Relaxation], None] | None) -> list[Outcome]:
        relaxation = self._relaxation
        relaxation.restart()
        momentum, sews = float(relaxation.step.momentum), self._goals[0].sews  # as all do, or none
        if sews:
            relaxation.set_momentum(min(CALM, momentum))
        iteration = 0
        while True:
            pending = self._request(iteration)
            late = self._runs_ahead(pending)
            if not late:
                self._decide(pending)
            if not self._active:
                break
            if sews and iteration == SEWN:
                relaxation.set_momentum(momentum)
            # every item stops at its own limit; others are not checked there
            burst = self._burst(pending, on_burst is not None)
            count = min(burst, min(self._goals[item].limit for item in self._active) - iteration)
            iteration += count
            relaxation.run(count, **self._shown(iteration))
            if on_burst is not None:
                on_burst(iteration, relaxation)
            if late:
                self._decide(pending, late=True)
            if iteration % BURST == 0:
                self._react()
            if not self._active:
                break
        if sews:
            relaxation.set_momentum(momentum)
        relaxation.restart()  # so that later measurements are of all items
        points = relaxation.model.points()  # which stayed where their items ended
        for item, outcome in self._outcomes.items():
            if outcome.status is not Status.DIVERGED:
                outcome.points = points[relaxation.model.of_item(item)].copy()
        return [self._outcomes[item] for item in range(len(self._goals))]

    def _runs_ahead(self, pending: _Pending) -> bool:
        """Whether the next burst may begin before the pending measurement is read."""
        if not self._ahead or pending.ending or (self._crosses is not None and self._watched(pending.iteration)):
            return False
        if self._looks_how_it_is_worn(pending.iteration):
            return False
        if self._falls is not None and pending.iteration % FALL_CHECK == 0:
            return False
        return self._schedule is None or pending.measurement is None or not self._schedule.must_wait

    def _watched(self, iteration: int) -> list[int]:
        """Active items that end here if they pass through themselves."""
        return [item for item in self._active if self._goals[item].looks_for_crossings(iteration)]

    def _looks_how_it_is_worn(self, iteration: int) -> bool:
        return self._misworn is not None and self._goals[0].looks_how_it_is_worn(iteration)

    def _burst(self, pending: _Pending, reported: bool) -> int:
        """Iterations until something may have to be done; ``reported``: every burst is."""
        follows = self._follow is not None and bool(self._falling)
        whole = BURST if reported or follows or not self._relaxation.runs_long else BURST * BURSTS_PER_CHECK
        return whole - pending.iteration % whole

    def _shown(self, iteration: int) -> dict[str, bool]:
        """Options of a burst that ends after so many iterations: positions are unpacked only if they will be read.

        Those of a single garment always are: capturing another graph would take longer.
        """
        at_limit = any(self._goals[item].limit <= iteration for item in self._active)
        follows = self._follow is not None and bool(self._falling)
        read = follows or at_limit or iteration % (BURST * BURSTS_PER_CHECK) == 0
        lone = self._schedule is None and len(self._goals) == 1
        return {} if read or lone or not self._relaxation.stays_packed else {"shown": False}

    def _request(self, iteration: int) -> _Pending:
        """Requests from the device what is to be decided after these iterations."""
        ending = frozenset(item for item in self._active if self._goals[item].limit <= iteration)
        if iteration % (BURST * BURSTS_PER_CHECK) == 0:
            if self._schedule is not None:
                self._schedule.request(iteration, ahead=self._ahead)
            measurement = self._certifier.start_measurement(iteration)
            self._certifier.take_snapshot(iteration)
            return _Pending(iteration, measurement, None, ending)
        if ending:
            return _Pending(iteration, self._certifier.start_measurement(iteration), None, ending)
        follows = self._follow is not None and self._falling and iteration % BURST == 0
        if follows:
            self._relaxation.update_model()
        return _Pending(iteration, None, self._certifier.request_bounds(self._falling) if follows else None, ending)

    def _decide(self, pending: _Pending, *, late: bool = False) -> None:
        """Reads what was requested, deactivates items that had ended by then; ``late``: they have iterated since."""
        if pending.bounds is not None:
            self._positions = _Positions(pending.iteration, read_bounds(pending.bounds))
        if pending.measurement is None:
            return
        measured = self._certifier.read(pending.measurement)
        settled = self._advance(measured)
        near = measured.nearly_within(self._tolerances) | ~measured.finite
        ended = []
        items = self._active if pending.whole else sorted(pending.ending)
        cut_short = self._cut_short(measured) if pending.whole else {}
        candidates = cut_short.keys() | pending.ending
        items = [item for item in items if item in candidates or (near[item] and measured.iteration > 0)]
        for item, check in self._certifier.checks(measured, items).items():
            status = self._status(item, check, settled, item in candidates)
            if status is not None:
                if late:
                    self._certifier.restore(item)
                    if self._schedule is not None:
                        self._schedule.restore()
                self._end(item, status, check, cut_short.get(item))
                ended.append(item)
        self._active = [item for item in self._active if item not in self._outcomes]
        if pending.whole:
            self._positions = _Positions(measured.iteration, measured.boxes, measured.moved, measured.relative_rms)
        self._relaxation.deactivate(ended)
        if self._on_check is not None and measured.iteration > 0:
            self._on_check(measured, time.perf_counter() - self._began)

    def _cut_short(self, measured: Measurement) -> dict[int, CutShort]:
        """Active items that end here though they are not at rest, as their goals say."""
        stalled = self._stall_watch.stalled(measured)
        found = {item: CutShort.STALLED for item in self._active if stalled[item]}
        if self._schedule is not None:
            waited = self._schedule.tangled_for
            given_up = [item for item in self._active if waited >= TANGLED[self._goals[item].patience]]
            if self._astray is not None and waited >= ASTRAY and self._goals[0].patience is Patience.SHORT:
                if self._astray():
                    given_up = self._active
                self._astray = None
            found |= dict.fromkeys(given_up, CutShort.CROSSING)
        found |= dict.fromkeys(self._turning(measured), CutShort.SLOW)
        found |= dict.fromkeys(self._falling_free(measured), CutShort.FALLING)
        if self._misworn is not None and self._looks_how_it_is_worn(measured.iteration) and self._misworn():
            found |= dict.fromkeys(self._active, CutShort.MISWORN)
        watched = [item for item in self._watched(measured.iteration) if measured.finite[item]]
        if self._crosses is not None and watched:
            found |= dict.fromkeys(self._crosses(watched), CutShort.CROSSING)
        return found

    def _falling_free(self, measured: Measurement) -> Sequence[int]:
        """Active items of which cloth falls that nothing can catch, and that may end without being at rest."""
        if self._falls is None or measured.iteration == 0 or measured.iteration % FALL_CHECK:
            return ()
        lowest = measured.boxes[:, 0, 1]
        before, self._lowest = self._lowest, lowest
        if before is None:
            return ()
        came_down = measured.finite & (before - lowest > CAME_DOWN)
        watched = [each for each in self._active if came_down[each] and self._goals[each].patience is not Patience.NONE]
        return self._falls(watched) if watched else ()

    def _turning(self, measured: Measurement) -> list[int]:
        """Active items whose turn is over, so that the other kind of steps continues with them."""
        if measured.iteration == 0 or (self._schedule is not None and not self._schedule.worn):
            return []
        unbalanced = measured.relative_rms
        falls = unbalanced > FALLING if self._schedule is None else unbalanced * measured.iteration > FALLING_IN_CONTACT
        if isinstance(self._relaxation, MultilevelRelaxation):
            falls[:] = True
        after = {item: self._goals[item].turn_after for item in self._active if falls[item]}
        return [item for item, each in after.items() if each is not None and measured.iteration % each == 0]

    def _advance(self, measured: Measurement) -> bool:
        """Advances the contact schedule; returns whether the present shape may be the rest shape."""
        if self._schedule is None or not measured.finite.all():
            return True
        return self._schedule.advance(measured.iteration)

    def _status(self, item: int, check: Check, settled: bool, ending: bool) -> Status | None:
        """How an item has ended; None while it has not. The start is an end only if it is the limit."""
        if check.iteration > 0:
            if not check.finite:
                return Status.DIVERGED
            if settled and check.within(self._goals[item].tolerance):
                return Status.AT_REST
        return Status.ITERATION_LIMIT if ending else None

    def _end(self, item: int, status: Status, check: Check, cut_short: CutShort | None) -> None:
        """Records how an item has ended; the points are read in the end, all at once."""
        points = self._certifier.last_points(item) if status is Status.DIVERGED else np.zeros((0, 3))
        seconds = time.perf_counter() - self._began
        moved = self._certifier.last_motion(item) if status is Status.ITERATION_LIMIT else None
        why = cut_short if status is Status.ITERATION_LIMIT else None
        self._outcomes[item] = Outcome(status, check, points, check.iteration, seconds, moved=moved, cut_short=why)

    def _react(self) -> None:
        """Applies what the last positions call for: contact, the anisotropic step, and colliders."""
        positions, self._positions = self._positions, None
        if self._schedule is not None:
            self._schedule.react()
        if positions is None:
            return
        if positions.relative_rms is not None and positions.iteration > 0:
            self._relaxation.update_anisotropy(positions.relative_rms)
        if positions.moved is not None and positions.iteration > 0:
            self._falling = [item for item in self._active if positions.moved[item] > FALL]
        self._update_colliders(positions)

    def _update_colliders(self, positions: _Positions) -> None:
        """Gives new colliders to items that have left the region of the old ones, or will have in a burst."""
        checked = positions.moved is not None
        moving = self._active if checked else [item for item in self._falling if item in self._active]
        finite = np.asarray(np.isfinite(positions.boxes).all(axis=(1, 2)))  # the next check retires the others
        items = [item for item in moving if finite[item]]
        now = positions.boxes[items]
        if positions.iteration > 0 and self._follow is not None and items:
            since = positions.iteration - self._followed_at[items]
            soon = now + (now - self._boxes[items]) * (BURST / since)[:, None, None]
            region = np.stack([np.minimum(now, soon)[:, 0], np.maximum(now, soon)[:, 1]], axis=1)
            for item, collider in self._follow(items, region).items():
                self._relaxation.set_collider(item, collider)
        self._boxes[items], self._followed_at[items] = now, positions.iteration
