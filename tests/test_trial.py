"""A lone garment is first sewn without contact of cloth with cloth; what crosses then begins again with it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import warp_cloth
from warp_cloth.batch import fit_many
from warp_cloth.fitting import predrape
from warp_cloth.fitting.problem import Problem
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.attempt import Attempt
from warp_cloth.model.first_attempt import dressed_trial, first_attempt, trial_attempt
from warp_cloth.scene import Scene, load_scene
from warp_cloth.scene.predrape import predrape_fabric
from warp_cloth.solver import goal
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


def crosses_in_its_own_fabric(self: Problem, items: list[int]) -> list[int]:
    """All items that are sewn in silk or cotton."""
    is_knit = self.scenes[0].garments[0].fabric == predrape_fabric()
    return [] if is_knit or self.attempts[0].starts_dressed else list(items)


def test_what_crosses_in_limp_cloth_though_it_began_sewn_starts_from_its_shape_in_a_knit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Problem, "crossing_items", crosses_in_its_own_fabric)
    tried = shirt("garment.fabric=silk")
    first, second = tried.report["attempts"]
    assert (first["start"], first["iterations"], first["chosen"]) == ("placed", 100, False)
    assert (second["start"], second["cloth_contact"], second["chosen"]) == ("dressed", False, True)
    assert tried.worn
    chosen = {each["key"]: each["value"] for each in tried.report["choices"]}
    assert chosen["solver.start"] == "dressed"


def test_that_start_is_made_once_for_all_fabrics_with_the_bits_of_each_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Problem, "crossing_items", crosses_in_its_own_fabric)
    made: list[str] = []

    def relaxed(*given: Any) -> None:
        made.append("")
        kept(*given)

    kept = predrape._relax_missing
    monkeypatch.setattr(predrape, "_relax_missing", relaxed)
    scenes = [load_scene("tshirt", [*SMALL_SHIRT, f"garment.fabric={fabric}"]) for fabric in ("silk", "cotton")]
    together = fit_many(scenes, "cpu", together=2)
    assert len(made) == 1
    for alone, one in zip(scenes, together, strict=True):
        assert np.array_equal(warp_cloth.fit(alone, device="cpu").garments[0].points, one.garments[0].points)


def test_what_crosses_from_there_too_begins_again_with_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Problem, "crossing_items", lambda self, items: list(items))
    monkeypatch.setattr(goal, "CROSSING_CHECKS", (100,))
    tried, contact = shirt("garment.fabric=silk"), shirt("garment.fabric=silk", "collision.cloth=true")
    first, second, *others = tried.report["attempts"]
    assert (first["start"], second["start"], second["iterations"]) == ("placed", "dressed", 100)
    assert others == contact.report["attempts"]
    assert np.array_equal(tried.garments[0].points, contact.garments[0].points)


def test_panels_far_apart_knits_and_stated_starts_are_not_dressed() -> None:
    outfit = load_outfit(load_scene("tshirt", [*SMALL_SHIRT, "garment.fabric=silk"]))
    (garment,) = outfit.garments
    apart = replace(outfit, garments=(replace(garment, points=garment.points * [1.0, 1.0, 4.0]),))
    for changes, worn, expected in (
        (["garment.fabric=silk"], outfit, True),
        (["garment.fabric=silk"], apart, False),
        ([], outfit, False),
        (["garment.fabric=silk", "solver.start=placed"], outfit, False),
    ):
        trial = trial_of(load_scene("tshirt", [*SMALL_SHIRT, *changes]))
        assert trial is not None
        assert (dressed_trial(trial, worn) is not None) == expected


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
