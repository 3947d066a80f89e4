"""A lone garment is first sewn without contact of cloth with cloth; what crosses then begins again with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import warp_cloth
from warp_cloth.batch import fit_many
from warp_cloth.fitting.problem import Problem
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.attempt import Attempt
from warp_cloth.model.first_attempt import first_attempt, trial_attempt
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import CALM

SMALL_SHIRT = ["garment.shape.edge_mm=30"]


def trial_of(scene: Scene) -> Attempt | None:
    outfit = load_outfit(scene)
    return trial_attempt(first_attempt(scene, outfit), outfit)


def shirt(*changes: str) -> warp_cloth.Fit:
    return warp_cloth.fit("tshirt", device="cpu", overrides=[*SMALL_SHIRT, *changes])


def test_what_does_not_cross_is_worn_without_contact() -> None:
    tried = shirt()
    assert [each["cloth_contact"] for each in tried.report["attempts"]] == [False]
    assert tried.worn
    reason = next(each["reason"] for each in tried.report["choices"] if each["key"] == "collision.cloth")
    assert reason == "nothing crosses as it is sewn"


def test_what_crosses_begins_again_as_if_it_had_not_been_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Problem, "crossing_items", lambda self, items: list(items))
    tried, contact = shirt(), shirt("collision.cloth=true")
    first, *others = tried.report["attempts"]
    assert (first["iterations"], first["cloth_contact"], first["chosen"]) == (100, False, False)
    assert others == contact.report["attempts"]
    assert np.array_equal(tried.garments[0].points, contact.garments[0].points)


def test_tried_in_company_they_have_the_bits_of_each_alone() -> None:
    scenes = [load_scene("tshirt", [*SMALL_SHIRT, f"garment.fabric={fabric}"]) for fabric in ("cotton", "denim")]
    for alone, together in zip(scenes, fit_many(scenes, "cpu", together=2), strict=True):
        fit = warp_cloth.fit(alone, device="cpu")
        assert fit.report["attempts"] == together.report["attempts"]
        assert np.array_equal(fit.garments[0].points, together.garments[0].points)


def test_momentum_is_held_back_while_panels_are_sewn(monkeypatch: pytest.MonkeyPatch) -> None:
    held: list[float] = []

    def set_momentum(self: Relaxation, momentum: float) -> None:
        held.append(momentum)
        kept(self, momentum)

    kept = Relaxation.set_momentum
    monkeypatch.setattr(Relaxation, "set_momentum", set_momentum)
    shirt()
    assert held[0] == CALM
    assert held[1] == held[2] > CALM


@pytest.mark.parametrize(
    ("changes", "tried"),
    [
        ((), True),
        (("collision.cloth=true",), False),
        (("collision.cloth=false",), False),
        (("solver.iterations=500",), False),  # as many as the scene wants, of one attempt
        (("solver.method=multilevel",), False),
        (("solver.start=dressed",), False),
    ],
)
def test_what_the_scene_states_is_not_tried_otherwise(changes: tuple[str, ...], tried: bool) -> None:
    scene = load_scene("tshirt", [*SMALL_SHIRT, *changes])
    assert (trial_of(scene) is not None) == tried


def test_layers_are_not_tried() -> None:
    garment: dict[str, Any] = {"shape": {"kind": "tshirt", "edge_mm": 30}}
    scene = load_scene({"garment": [garment, garment], "avatar": {"shape": {"kind": "mannequin"}}})
    assert trial_of(scene) is None
