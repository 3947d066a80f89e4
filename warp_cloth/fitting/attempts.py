"""Attempts at a scene, one after another, until one has ended well or there is nothing else to try."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import exact_colliders
from warp_cloth.avatar.padding import padded
from warp_cloth.avatar.penetration import VISIBLE, Overlap
from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.forks import map_in_forks
from warp_cloth.base.threads import concatenate
from warp_cloth.contact.garments import GarmentCrossings, model_crossings, modelled_crossings, worn_crossings
from warp_cloth.fitting.overlap import avatar_overlaps
from warp_cloth.fitting.placement import LimbPlacement
from warp_cloth.fitting.problem import Problem, build_problem, collider_updates, usual_first_attempt
from warp_cloth.garment.garment import garments_in
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import TORN, Attempt, CutShort, Ended, best_of
from warp_cloth.model.first_attempt import dressed_trial
from warp_cloth.model.next_attempt import is_locked, next_attempt
from warp_cloth.model.result import AttemptRun, LevelRun, Status
from warp_cloth.scene.predrape import predrape_fabric
from warp_cloth.solver.certificate.certifier import Measurement
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.goal import Outcome
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.relax import Relaxation

Begin = Callable[[Problem], tuple[LevelRun, ...]]  # brings a lone scene to its start; returns what that relaxed
Relax = Callable[[Problem], Outcome]  # relaxes a lone scene


@dataclass(frozen=True, eq=False)
class Run:
    """One item's attempt, relaxed."""

    problem: Problem
    item: int
    outcome: Outcome
    crossings: GarmentCrossings
    torn: int  # edges stretched as no worn cloth is
    placement: LimbPlacement
    overlap: Overlap | None = None  # with the avatar; None: there is none
    levels: tuple[LevelRun, ...] = ()

    @property
    def attempt(self) -> Attempt:
        return self.problem.attempts[self.item]

    @property
    def outfit(self) -> Outfit:
        """The garments as they started, and their avatar."""
        return self.problem.outfits[self.item]

    @functools.cached_property
    def modelled(self) -> tuple[GarmentCrossings, ...]:
        """Where each garment passes through its own cloth in its file."""
        return modelled_crossings(self.outfit, self.problem.model.device)

    @property
    def ended(self) -> Ended:
        outcome, pairs = self.outcome, self.crossings.pairs
        passes = self.overlap is not None and len(self.overlap.edges) > 0
        return Ended(
            self.attempt,
            outcome.status,
            pairs,
            len(outcome.points),
            torn=self.torn,
            misplaced=self.placement.is_astray or passes,
            caught=passes and not self.placement.is_astray,
            sunk=self.placement.sunk,
            slipped=self.placement.slipped,
            shown=self.overlap is not None and float(self.overlap.face_depths.max(initial=0.0)) > 1e-3 * VISIBLE,
            cut_short=outcome.cut_short,
        )


@dataclass(frozen=True, eq=False)
class Course:
    """An item's attempts, and the best of them."""

    runs: tuple[Run, ...]
    trials: tuple[Run, ...] = ()  # that came before, and are none of them

    @property
    def modelled(self) -> tuple[GarmentCrossings, ...]:
        """Where each garment passes through its own cloth in its file, the same in every run."""
        return (*self.trials, *self.runs)[0].modelled

    @property
    def best(self) -> Run:
        """The last of the best runs."""
        return self.runs[best_of([run.ended for run in self.runs])]

    @property
    def seconds(self) -> float:
        """Of relaxing, in all attempts."""
        return sum(run.outcome.seconds for run in (*self.trials, *self.runs))

    def summary(self) -> list[AttemptRun]:
        """The attempts, for the report."""
        best = self.best
        return [
            AttemptRun(
                run.attempt.scene.solver.method,
                run.attempt.touches,
                run.outcome.iterations,
                run.outcome.status,
                run.crossings.pairs,
                start=run.attempt.start,
                chosen=run is best,
            )
            for run in (*self.trials, *self.runs)
        ]


def finished_runs(
    problem: Problem, outcomes: Sequence[Outcome], levels: Sequence[tuple[LevelRun, ...]], *, copies: int = 0
) -> list[Run]:
    """The runs of a problem's items, with what is measured of them to decide whether they have ended well.

    ``copies``: of this process, that measure some items each, at most.
    """
    model, worn, crossings = problem.model, [outcome.points for outcome in outcomes], end_crossings(problem, outcomes)
    every_strain = edge_strains(model)
    strains = [every_strain[model.of_item(item, model.edge_start)] for item in range(len(outcomes))]
    position = model.state.position if model.state.position.dtype is wp.vec3d else None
    is_over = [_is_over(attempt, outcome) for attempt, outcome in zip(problem.attempts, outcomes, strict=True)]
    overlaps: list[Overlap | None] = [None] * len(outcomes)
    if not all(is_over):
        exact = exact_colliders(problem.avatar_surfaces(), model.device)
        exact = [None if over else each for over, each in zip(is_over, exact, strict=True)]
        overlaps = avatar_overlaps(problem.outfits, worn, strains, exact, position)

    def placement_of(item: int) -> LimbPlacement:
        outfit, outcome = problem.loaded[item], outcomes[item]
        if is_over[item] or outcome.status is Status.DIVERGED:
            return LimbPlacement(((),) * len(outfit.garments))
        return LimbPlacement.of(outfit, outcome.points)

    # not in threads: many short calls of NumPy wait for Python's lock, on 16 cores ten times as long as they take
    placements = map_in_forks(placement_of, range(len(outcomes)), copies)
    return [
        Run(
            problem,
            item,
            outcome,
            crossings[item],
            int((strains[item] > TORN).sum()),
            placements[item],
            overlaps[item],
            levels[item],
        )
        for item, outcome in enumerate(outcomes)
    ]


def _is_over(attempt: Attempt, outcome: Outcome) -> bool:
    """Whether nothing more is asked of an attempt: a trial in which cloth crossed."""
    return attempt.trial and outcome.cut_short is CutShort.CROSSING


def end_crossings(problem: Problem, outcomes: Sequence[Outcome]) -> list[GarmentCrossings]:
    """Where the cloth of a problem's items passes through cloth as they have ended."""
    model = problem.model
    for item, outcome in enumerate(outcomes):
        if outcome.status is Status.DIVERGED:
            model.set_points(outcome.points, item)
    if all(np.isfinite(outcome.points).all() for outcome in outcomes):
        return model_crossings(model, problem.outfits)
    return worn_crossings(problem.outfits, [outcome.points for outcome in outcomes], model.device)


def dressed_after(first: Run, cache: Cache) -> tuple[Attempt, Outfit] | None:
    """The second trial that follows an item's first run, and the outfit with what it drapes; None: none does."""
    outfit = first.problem.loaded[first.item]
    if not first.attempt.trial or first.outcome.cut_short is None:
        return None
    attempt = dressed_trial(first.attempt, outfit)
    if attempt is None:
        return None
    return attempt, replace(outfit, predrape_garments=garments_in(predrape_fabric(), outfit.garments, cache))


def tried_further(
    first: Run, begin: Begin, relax: Relax, *, cache: Cache, clock: StageClock, second: Run | None = None
) -> Course:
    """Further attempts at an item, until one has ended well or there is nothing else to try.

    Args:
        first: the item's first run.
        begin: brings a problem to where the first run started.
        relax: relaxes the problem of a lone scene.
        cache: what earlier problems left of the same garments and avatars.
        clock: of the stages.
        second: that of ``dressed_after``, where it has been made already.
    """
    device, outfit = first.problem.model.device, first.problem.loaded[first.item]
    trials: list[Run] = []
    runs: list[Run] = []

    def note(run: Run) -> None:
        (trials if run.attempt.trial and not run.ended.good else runs).append(run)

    def locked() -> bool:
        return _is_locked(outfit, first.modelled)

    def after_trial() -> Iterator[tuple[Attempt, Outfit]]:
        dressed = dressed_after(first, cache) if second is None else None
        if dressed is not None:
            yield dressed
        yield usual_first_attempt(first.attempt.stated, outfit, device, cache), outfit

    others = after_trial()

    def following() -> tuple[Attempt, Outfit] | None:
        if not runs:
            return next(others)
        ended = [run.ended for run in runs]
        crossing = any(each.crossings for each in ended) and not all(each.good for each in ended)
        attempt = next_attempt(ended, outfit, locked=crossing and locked())
        if attempt is None or attempt.begins_after is None:
            return None if attempt is None else (attempt, outfit)
        return attempt, _worn_after(runs[attempt.begins_after], attempt.paddings)

    for run in (first, second):
        if run is not None:
            note(run)
    while (further := following()) is not None:
        attempt, worn_by = further
        problem = build_problem([attempt], [worn_by], device, cache=cache, clock=clock)
        levels: tuple[LevelRun, ...] = ()
        if attempt.begins_after is not None:
            before = runs[attempt.begins_after]
            problem.place(before.outcome.points, before.problem.contacts[before.item])
        if attempt.begins_after is None or attempt.thins:
            levels = begin(problem)
        clock.begin("relax")
        outcome = relax(problem)
        clock.lap("relax")
        note(*finished_runs(problem, [outcome], [levels]))
        clock.lap("measure")
    return Course(tuple(runs), tuple(trials))


def _worn_after(run: Run, paddings: int) -> Outfit:
    """A run's outfit, its avatar padded where it showed through unless it has been padded that often already."""
    outfit, overlap = run.problem.loaded[run.item], run.overlap
    if paddings == run.attempt.paddings:
        return outfit
    surface = outfit.starting_avatar
    if surface is None or overlap is None:
        raise ValueError("there is no avatar to pad")
    starts = np.cumsum([0, *(len(garment.points) for garment in outfit.garments)]).tolist()
    triangles = concatenate([garment.triangles for garment in outfit.garments], starts)
    points = padded(surface, run.outcome.points, triangles, overlap)
    return replace(outfit, padded=replace(surface, points=points))


def relax_problem(
    problem: Problem,
    on_burst: Callable[[int, Relaxation], None] | None = None,
    on_check: Callable[[Measurement, float], None] | None = None,
) -> list[Outcome]:
    """Relaxes the items of a problem; ``on_burst`` and ``on_check`` as in ``relax_items``."""
    return relax_items(
        problem.certifier,
        problem.goals(),
        follow=collider_updates(problem),
        schedule=problem.schedule,
        crosses=problem.crossing_items,
        astray=problem.is_astray,
        falls=problem.falling_items,
        misworn=functools.partial(_is_misworn, problem),
        on_check=on_check,
        on_burst=on_burst,
    )


def _is_misworn(problem: Problem) -> bool:
    """Whether a lone scene's cloth is off a shoulder or the waist now, or through a limb, as a posed start may mend."""
    problem.relaxation.update_model()
    model, outfit, points = problem.model, problem.loaded[0], problem.model.points()
    if not np.isfinite(points).all():
        return False
    placement = LimbPlacement.of(outfit, points)
    if not (placement.is_astray or placement.sunk or placement.slipped):
        exact = exact_colliders(problem.avatar_surfaces(), model.device)
        (overlap,) = avatar_overlaps(problem.outfits, [points], [edge_strains(model)], exact)
        if overlap is None or not len(overlap.edges):
            return False
    return not _is_locked(outfit, modelled_crossings(outfit, model.device))


def _is_locked(outfit: Outfit, modelled: Sequence[GarmentCrossings]) -> bool:
    """Whether a garment crosses itself in its file too much for a posed body to part it."""
    own = zip(modelled, outfit.meshes, strict=True)
    return any(is_locked(crossings.pairs, mesh.vertex_count) for crossings, mesh in own)


def relax_alone(problem: Problem) -> Outcome:
    """Relaxes the problem of a lone scene."""
    (outcome,) = relax_problem(problem)
    return outcome
