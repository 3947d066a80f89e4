"""What each term of a scene costs: the time that an iteration takes less without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warp_cloth.fitting.plan import make_plan
from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.scene_garments import Wardrobe
from warp_cloth.scene import Scene
from warp_cloth.study.timing import FEWEST_ROUNDS, LONG, SHORTEST_RUN, Way

Variant = tuple[Scene, Wardrobe]
REST = "the others"  # terms that no cloth can do without


@dataclass(frozen=True)
class Saving:
    """A term, and the share of its time that an iteration takes less without it."""

    term: str
    share: float


def savings_of(scene: Scene, wardrobe: Wardrobe, device: str) -> tuple[Saving, ...]:
    """Runs the scene beside itself without each of its terms that it can do without; the last one is what remains.

    The kernels without a term are others, which are compiled first. Forces and displacement are worked out in one go,
    so that no clock tells them apart.
    """
    used = {term.name for term in make_plan(scene, wardrobe) if term.used}
    savings = []
    for term, without in WITHOUT.items():
        if term in used:
            seconds, less = _seconds_beside((scene, wardrobe), without(scene, wardrobe), device)
            savings.append(Saving(term, 1.0 - less / seconds))
    return *savings, Saving(REST, 1.0 - sum(saving.share for saving in savings))


def _without_bending(scene: Scene, wardrobe: Wardrobe) -> Variant:
    parts = (
        replace(part, rest=replace(part.rest, hinge_stiffness=np.zeros_like(part.rest.hinge_stiffness)))
        for part in wardrobe.parts
    )
    return scene, replace(wardrobe, parts=tuple(parts))


def _without_collision(**changes: Any) -> Callable[[Scene, Wardrobe], Variant]:
    def without(scene: Scene, wardrobe: Wardrobe) -> Variant:
        return scene.model_copy(update={"collision": scene.collision.model_copy(update=changes)}), wardrobe

    return without


WITHOUT: dict[str, Callable[[Scene, Wardrobe], Variant]] = {
    "bending": _without_bending,
    "avatar contact": _without_collision(avatar="none"),
    "cloth contact": _without_collision(cloth=False),
}


def _seconds_beside(one: Variant, other: Variant, device: str) -> tuple[float, float]:
    """Seconds of an iteration of two scenes that take turns, from the start on: whatever else a machine does."""
    ways = [Way(build_problem([scene], [wardrobe], device)) for scene, wardrobe in (one, other)]
    rates: list[list[float]] = [[], []]
    passed = 0.0
    while passed < 2.0 * SHORTEST_RUN or (len(rates[0]) < FEWEST_ROUNDS and passed < 2.0 * LONG):
        rounds = [way.go() for way in ways]
        if all(way.warm for way in ways):
            passed += sum(seconds for _, seconds in rounds)
            for rate, (done, seconds) in zip(rates, rounds, strict=True):
                rate.append(seconds / done)
        for way in ways:
            way.check()
    return float(np.median(rates[0])), float(np.median(rates[1]))
