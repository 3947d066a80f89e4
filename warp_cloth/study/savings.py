"""What each term of a scene costs: how much shorter an iteration is without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.plan import make_plan
from warp_cloth.scene import Scene
from warp_cloth.study.timing import FEWEST_ROUNDS, LONG, SHORTEST_RUN, TimedFit

Variant = tuple[Scene, Outfit]
REST = "the others"  # terms that cloth cannot be without


@dataclass(frozen=True)
class Saving:
    """A term, and the fraction of an iteration's time that is saved without it."""

    term: str
    share: float


def savings_of(scene: Scene, outfit: Outfit, device: str) -> tuple[Saving, ...]:
    """Runs the scene against variants of it, each without one term; the last saving is what remains.

    The kernels of a variant are compiled first. One kernel computes forces and displacement, so that a timer of
    launches cannot tell terms apart.
    """
    used = {term.name for term in make_plan(scene, outfit) if term.used}
    savings = []
    for term, without in WITHOUT.items():
        if term in used:
            seconds, shorter = _alternated((scene, outfit), without(scene, outfit), device)
            savings.append(Saving(term, 1.0 - shorter / seconds))
    return *savings, Saving(REST, 1.0 - sum(saving.share for saving in savings))


def _without_bending(scene: Scene, outfit: Outfit) -> Variant:
    garments = (
        replace(garment, rest=replace(garment.rest, hinge_stiffness=np.zeros_like(garment.rest.hinge_stiffness)))
        for garment in outfit.garments
    )
    return scene, replace(outfit, garments=tuple(garments))


def _without_collision(**changes: Any) -> Callable[[Scene, Outfit], Variant]:
    def without(scene: Scene, outfit: Outfit) -> Variant:
        return scene.model_copy(update={"collision": scene.collision.model_copy(update=changes)}), outfit

    return without


WITHOUT: dict[str, Callable[[Scene, Outfit], Variant]] = {
    "bending": _without_bending,
    "avatar contact": _without_collision(avatar="none"),
    "cloth contact": _without_collision(cloth=False),
}


def _alternated(one: Variant, other: Variant, device: str) -> tuple[float, float]:
    """Seconds of an iteration of two scenes that alternate from the start, so that other load falls on both alike."""
    runs = [TimedFit(build_problem([scene], [outfit], device)) for scene, outfit in (one, other)]
    rates: list[list[float]] = [[], []]
    passed = 0.0
    while passed < 2.0 * SHORTEST_RUN or (len(rates[0]) < FEWEST_ROUNDS and passed < 2.0 * LONG):
        rounds = [run.advance() for run in runs]
        if all(run.warm for run in runs):
            passed += sum(seconds for _, seconds in rounds)
            for rate, (done, seconds) in zip(rates, rounds, strict=True):
                rate.append(seconds / done)
        for run in runs:
            run.check()
    return float(np.median(rates[0])), float(np.median(rates[1]))
