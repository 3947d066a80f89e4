"""Dressed starts: garments come down in one fabric first, and each fit goes on from there in its own."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Points
from warp_cloth.fitting.problem import Problem, build_problem, collider_updates, start_coarse, tolerance_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.scene import Scene
from warp_cloth.scene.predrape import dressing_of
from warp_cloth.solver.loop import Goal, relax_items


@dataclass(frozen=True, eq=False)
class _Dressed:
    """Garments as they lie once they are dressed."""

    points: Points | None  # [m], shape [V, 3]; None: they lost themselves on the way
    run: LevelRun


@dataclass(frozen=True, eq=False)
class Predrape:
    """What fits are dressed by: what was dressed before is kept, the rest is ready to relax."""

    asked: tuple[tuple[Any, ...], ...]  # what each item's dressing is kept by, as of Cache.get_or_make
    missing: tuple[tuple[Any, ...], ...]  # those that are not there yet, each once,
    made: Problem | None  # and these garments, in the fabric that they are dressed in
    cache: Cache


def build_predrape(made: Problem, cache: Cache) -> Predrape | None:
    """What the scenes are dressed by; None where they start as they are placed. ``cache`` as of ``build_problem``."""
    device = made.model.device
    asked: list[tuple[Any, ...]] = []
    missing: dict[Hashable, tuple[tuple[Any, ...], Scene, Outfit]] = {}
    for scene, outfit in zip(made.scenes, made.outfits, strict=True):
        dressing = dressing_of(scene)
        if dressing is None:
            return None
        asked.append(((outfit.avatar, *outfit.dressing), dressing.collision, dressing.solver, device))
        key = Cache.key("dressed", *asked[-1])
        if key not in cache:
            missing[key] = asked[-1], dressing, replace(outfit, parts=outfit.dressing, dressing=())
    by, scenes, outfits = zip(*missing.values(), strict=True) if missing else ((), (), ())
    like = made.model.vertex_count
    first = build_problem(scenes, outfits, device, cache=cache, like=like) if missing else None
    return Predrape(tuple(asked), by, first, cache)


def prepare_start(made: Problem, cache: Cache) -> tuple[LevelRun, ...]:
    """Brings a lone scene's garments to where its fit begins, by its method and its start; tells what it came to."""
    dressing = build_predrape(made, cache)
    return start_coarse(made) if dressing is None else start_predraped(made, dressing)[0]


def start_predraped(made: Problem, dressing: Predrape) -> list[tuple[LevelRun, ...]]:
    """Dresses the garments, and puts those of the fits where they lie then; tells what it came to for each fit.

    What lost itself on the way starts as it is placed.
    """
    if dressing.made is not None:
        _dress(dressing.made, dressing)
    runs: list[tuple[LevelRun, ...]] = []
    there: dict[_Dressed, tuple[Any, Points, Points]] = {}  # on the device, and its box [m]: once for all fabrics
    for item, (of, *more) in enumerate(dressing.asked):
        dressed = dressing.cache.get_or_make("dressed", of, _absent, *more)
        runs.append((dressed.run,))
        points = dressed.points
        if points is None:
            continue
        if dressed not in there:
            there[dressed] = made.model.put_there(points), points.min(axis=0), points.max(axis=0)
        lying, low, high = there[dressed]
        made.model.set_points(lying, item)
        if not made.contacts[item].covers_box(low, high):
            made.relaxation.meet(item, made.contacts[item].collider(points))
    return runs


def _dress(first: Problem, dressing: Predrape) -> None:
    goals = [Goal(tolerance_of(scene), scene.solver.iterations) for scene in first.scenes]
    outcomes = relax_items(first.relaxation, first.certifier, goals, follow=collider_updates(first))
    for (of, *more), outcome in zip(dressing.missing, outcomes, strict=True):
        points = None if outcome.status is Status.DIVERGED else outcome.points
        run = LevelRun(len(outcome.points), outcome.iterations, outcome.status)
        dressing.cache.get_or_make("dressed", of, partial(_Dressed, points, run), *more)


def _absent() -> _Dressed:
    raise RuntimeError("a garment was not dressed")
