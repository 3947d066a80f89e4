"""Predrape (dressed starts): garments drape in one fabric first; each fit starts from there in its own."""

from __future__ import annotations

import itertools
from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Points
from warp_cloth.fitting.attempts import end_crossings, relax_alone
from warp_cloth.fitting.film import Dressing
from warp_cloth.fitting.posed_start import start_posed, start_thinned
from warp_cloth.fitting.problem import Problem, build_problem, collider_updates, start_coarse
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import Patience
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.scene import Scene
from warp_cloth.scene.predrape import predrape_scene_of
from warp_cloth.solver.goal import Outcome
from warp_cloth.solver.loop import relax_items

CACHE_NAME = "predraped"

CacheArguments = tuple[Any, ...]  # the objects that something is made of, then values; see Cache.get_or_make


@dataclass(frozen=True, eq=False)
class _Draped:
    """Garments at rest in the fabric of their predrape."""

    points: Points | None  # [m], shape [V, 3]; None: they diverged
    runs: tuple[LevelRun, ...]  # relaxations that this took


@dataclass(frozen=True, eq=False)
class Predrape:
    """The predrapes of some fits: those in the cache, and a problem that yields the missing ones."""

    keys: tuple[CacheArguments, ...]  # of each item's predrape in the cache
    missing: tuple[CacheArguments, ...]  # those not in the cache yet, each once
    problem: Problem | None  # the garments of the missing ones, in the fabric of their predrape
    untangles: tuple[bool, ...]  # of these, whether what crosses goes on with contact
    cache: Cache


def build_predrape(problem: Problem, cache: Cache, clock: StageClock | None = None) -> Predrape | None:
    """The predrapes of the problem's scenes; None where the garments start as they are placed."""
    device = problem.model.device
    keys: list[CacheArguments] = []
    missing: dict[Hashable, tuple[CacheArguments, Scene, Outfit, bool]] = {}
    for attempt, outfit in zip(problem.attempts, problem.outfits, strict=True):
        predrape_scene = predrape_scene_of(attempt.scene)
        if predrape_scene is None:
            return None
        cut = [(each.points, each.rest.topology, each.rest.edge_length) for each in outfit.predrape_garments]
        sources = outfit.avatar, *itertools.chain.from_iterable(cut)
        untangles = attempt.stated.collision.cloth is not False
        keys.append((sources, predrape_scene.collision, predrape_scene.solver, device, untangles))
        key = cache.key(CACHE_NAME, *keys[-1])
        if key not in cache:
            missing[key] = (
                keys[-1],
                predrape_scene,
                replace(outfit, garments=outfit.predrape_garments, predrape_garments=()),
                untangles,
            )
    if not missing:
        return Predrape(tuple(keys), (), None, (), cache)
    missing_keys, scenes, outfits, untangled = zip(*missing.values(), strict=True)
    own = build_problem(scenes, outfits, device, cache=cache, like=problem.model.vertex_count, clock=clock)
    return Predrape(tuple(keys), missing_keys, own, untangled, cache)


def prepare_start(
    problem: Problem, cache: Cache, clock: StageClock, watched: list[Dressing] | None = None
) -> tuple[LevelRun, ...]:
    """Brings a lone scene's garments to where its fit starts; returns the relaxations that this took.

    ``watched`` takes the shapes of each garment while it is dressed.
    """
    if problem.attempts[0].thins:
        return start_thinned(problem, cache, clock)
    if problem.attempts[0].posed:
        return start_posed(problem, cache, clock, watched)
    predrape = build_predrape(problem, cache, clock)
    clock.lap("build")
    if predrape is None:
        return start_coarse(problem, clock)
    clock.begin("dress")
    (levels,) = start_predraped(problem, predrape)
    clock.lap("dress")
    return levels


def start_predraped(problem: Problem, predrape: Predrape) -> list[tuple[LevelRun, ...]]:
    """Relaxes missing predrapes, and moves the problem's garments there; returns the relaxations of each item.

    Garments whose predrape diverged start as they are placed.
    """
    if predrape.problem is not None:
        _relax_missing(predrape.problem, predrape)
    runs: list[tuple[LevelRun, ...]] = []
    uploaded: dict[
        _Draped, tuple[Any, Points, Points]
    ] = {}  # points on the device, and their box [m]: once for all fabrics
    for item, (sources, *values) in enumerate(predrape.keys):
        draped = predrape.cache.get_or_make(CACHE_NAME, sources, _not_relaxed, *values)
        runs.append(draped.runs)
        points = draped.points
        if points is None:
            continue
        if draped not in uploaded:
            uploaded[draped] = problem.model.to_device(points), points.min(axis=0), points.max(axis=0)
        on_device, low, high = uploaded[draped]
        problem.model.set_points(on_device, item)
        if not problem.contacts[item].covers_box(low, high):
            problem.relaxation.set_collider(item, problem.contacts[item].collider(points))
    return runs


def _relax_missing(problem: Problem, predrape: Predrape) -> None:
    """Relaxes the missing predrapes, and puts them into the cache.

    What crosses there goes on with contact, once for all fabrics, each of which would cross there, too.
    """
    outcomes = relax_items(problem.certifier, problem.goals(), follow=collider_updates(problem))
    crossings = end_crossings(problem, outcomes) if any(predrape.untangles) else []
    for item, ((sources, *values), outcome) in enumerate(zip(predrape.missing, outcomes, strict=True)):
        if outcome.status is Status.DIVERGED:
            make = partial(_Draped, None, (_run_of(outcome),))
        elif predrape.untangles[item] and crossings[item].pairs:
            make = partial(_untangled, problem, item, outcome, crossings[item].pairs, predrape.cache)
        else:
            make = partial(_Draped, outcome.points, (_run_of(outcome),))
        predrape.cache.get_or_make(CACHE_NAME, sources, make, *values)


def _untangled(problem: Problem, item: int, before: Outcome, pairs: int, cache: Cache) -> _Draped:
    """A predrape from where so many pairs of triangles cross, with contact; as it was unless fewer do then."""
    scene, outfit = problem.scenes[item], problem.loaded[item]
    touching = scene.model_copy(update={"collision": scene.collision.model_copy(update={"cloth": True})})
    attempt = replace(first_attempt(touching, outfit), patience=Patience.SHORT)
    alone = build_problem([attempt], [outfit], problem.model.device, cache=cache)
    alone.place(before.points)
    after = relax_alone(alone)
    (left,) = end_crossings(alone, [after])
    is_better = after.status is not Status.DIVERGED and left.pairs < pairs
    return _Draped(after.points if is_better else before.points, (_run_of(before), _run_of(after)))


def _run_of(outcome: Outcome) -> LevelRun:
    return LevelRun(len(outcome.points), outcome.iterations, outcome.status)


def _not_relaxed() -> _Draped:
    raise RuntimeError("a predrape is missing from the cache")
