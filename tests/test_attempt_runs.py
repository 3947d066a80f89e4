"""Fits of several attempts: where each begins, what the report says of it, the same bits alone and in a batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import warp_cloth
from warp_cloth.batch import fit_many
from warp_cloth.fitting import attempts
from warp_cloth.fitting.problem import Problem
from warp_cloth.fitting.warm_start import start_from
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import Attempt, Ended
from warp_cloth.scene import Scene, load_scene

fit_module = import_module("warp_cloth.fitting.fit")  # the package has a function of that name
DRAPED = ["garment.shape.vertices_per_side=17", "collision.pixel_mm=10"]
ON_EDGE = [*DRAPED, "garment.shape.plane=vertical", "garment.shape.height=1.0"]  # it falls on the ball, and crosses


@pytest.fixture(scope="module")
def draped() -> warp_cloth.Fit:
    return warp_cloth.fit("sphere", device="cpu", overrides=DRAPED)


def test_cloth_over_a_ball_ends_apart_by_itself(draped: warp_cloth.Fit) -> None:
    assert draped.worn
    assert draped.report["crossings"]["pairs"] == 0
    # the second one pads the ball, which shows through faces of 6 cm by a little more than 1 mm
    assert [attempt["cloth_contact"] for attempt in draped.report["attempts"]] == [True, True]
    choices = {choice["key"]: choice["value"] for choice in draped.report["choices"]}
    assert choices["collision.cloth"] is True
    assert choices["collision.offset_mm"] == "raised"


def test_settings_are_as_stated(draped: warp_cloth.Fit) -> None:
    settings = draped.report["settings"]
    assert (settings["collision"]["cloth"], settings["solver"]["method"]) == ("auto", "auto")
    assert isinstance(draped.scene, Scene)


def test_attempts_of_a_batch_have_the_bits_of_each_alone() -> None:
    alone = warp_cloth.fit("sphere", device="cpu", overrides=ON_EDGE)
    assert [attempt["cloth_contact"] for attempt in alone.report["attempts"]][:2] == [False, True]
    scenes = [load_scene("sphere", ON_EDGE), load_scene("sphere", [*ON_EDGE, "garment.fabric=felt"])]
    both = fit_many(scenes, "cpu", together=2)
    assert np.array_equal(both[0].garments[0].points, alone.garments[0].points)
    assert both[0].report["attempts"] == alone.report["attempts"]


def test_cloth_that_touches_nothing_needs_one_attempt() -> None:
    fit = warp_cloth.fit("hanging", device="cpu")
    assert [attempt["cloth_contact"] for attempt in fit.report["attempts"]] == [False]


def in_vain(history: Sequence[Ended], _: Outfit, *, locked: bool) -> Attempt | None:
    """One more attempt, of a single iteration."""
    assert not locked  # a square crosses itself nowhere
    attempt = history[0].attempt
    solver = attempt.scene.solver.model_copy(update={"iterations": 1})
    worse = replace(attempt, scene=attempt.scene.model_copy(update={"solver": solver}))
    return worse if len(history) == 1 else None


def test_attempts_in_vain_are_reported_alike_alone_and_in_a_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempts, "next_attempt", in_vain)
    scene = load_scene("hanging", ["garment.shape.vertices_per_side=5"])
    alone, (batched,) = warp_cloth.fit(scene, device="cpu"), fit_many([scene], "cpu")
    assert [attempt["chosen"] for attempt in alone.report["attempts"]] == [True, False]
    assert batched.report["attempts"] == alone.report["attempts"]


def test_further_attempts_begin_at_the_given_start(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load_scene("hanging", ["garment.shape.vertices_per_side=5"])
    earlier = warp_cloth.fit(scene, device="cpu")
    monkeypatch.setattr(attempts, "next_attempt", in_vain)
    begun = []

    def counted(problem: Problem, worn: Any) -> bool:
        begun.append(problem)
        return start_from(problem, worn)

    monkeypatch.setattr(fit_module, "start_from", counted)
    warp_cloth.fit(scene, device="cpu", start=earlier)
    assert len(begun) == 2
