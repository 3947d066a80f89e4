"""What a caller gives the Python interface in a wrong type is refused in one line, before any work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from refusals import refusal

import warp_cloth
from warp_cloth.base import arguments
from warp_cloth.base.errors import InputError
from warp_cloth.batch import fit_many, fit_sizes, run_batch
from warp_cloth.view.live import LiveFit


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: warp_cloth.load_scene(5), "scene: must be a path, not 5"),
        (lambda: warp_cloth.load_scene(b"tshirt"), "scene: must be a path, not an object of type bytes"),
        (lambda: warp_cloth.fit(["tshirt"]), "scene: must be a path, not an object of type list"),
        (lambda: warp_cloth.fit("tshirt", overrides=5), "overrides: must be a string or a list of strings, not 5"),
        (lambda: warp_cloth.fit("tshirt", overrides=[5]), "overrides: must be a string or a list of strings"),
        (lambda: warp_cloth.fit("tshirt", overrides={"a": "b"}), "override a=b: unknown key a"),
        (lambda: warp_cloth.fit("tshirt", on=5), "on: must be a path, not 5"),
        (lambda: warp_cloth.fit("pyproject.obj", on=5), "pyproject.obj: no such file"),
        (lambda: warp_cloth.fit("tshirt", fabric="slik"), 'fabric: unknown fabric "slik"; did you mean "silk"'),
        (lambda: warp_cloth.fit("tshirt", maps=5), "maps: must be a string or a list of strings, not 5"),
        (lambda: warp_cloth.fit("tshirt", maps=[None]), "maps: must be a string or a list of strings"),
        (lambda: warp_cloth.fit("tshirt", frames="3"), "frames: must be an integer from 0 to"),
        (lambda: warp_cloth.fit("tshirt", device=5), 'there is no device "5" on this machine'),
        (lambda: warp_cloth.fit("tshirt", progress=5), "progress: must be a function, not 5"),
        (lambda: fit_many("tshirt", device="cpu"), "scenes: must be a list of scenes, not of type str"),
        (lambda: fit_many(5), "scenes: must be a list of scenes, not of type int"),
        (lambda: fit_sizes("tshirt", [5]), "sizes: must be a string or a list of strings"),
        (lambda: fit_sizes("tshirt", ease="4"), "ease: must be a number, not 4"),
        (lambda: run_batch(5), "jobs: must be a job file or a list of items"),
        (lambda: run_batch([]), "jobs: has no items"),
        (lambda: run_batch("jobs.csv", workers="2"), "workers: must be an integer, not 2"),
        (lambda: run_batch("jobs.csv", shard=1.5), "shard: must be an integer, not 1.5"),
        (lambda: LiveFit(5, {}, "cpu"), "scene: must be a path, not 5"),
    ],
)
def test_wrong_types_are_refused_in_one_line(call: Callable[[], Any], told: str) -> None:
    assert told in str(refusal(call))


def test_what_changes_a_scene_comes_before_it_is_loaded() -> None:
    scene = warp_cloth.load_scene("hanging", np.array(["solver.iterations=1", "name=x"]))
    assert warp_cloth.fit("hanging", overrides=np.array(["solver.iterations=1", "name=x"]), device="cpu").scene == scene
    for name, value in (("overrides", ["name=y"]), ("on", "mannequin"), ("fabric", "silk")):
        with pytest.raises(InputError, match=f"^{name}: the scene is loaded already; pass it to load_scene"):
            warp_cloth.fit(scene, **{name: value})  # type: ignore[arg-type]


def test_several_texts_may_come_in_any_collection() -> None:
    for several in (["gap"], ("gap",), {"gap"}, np.array(["gap"]), (name for name in ["gap"]), "gap"):
        assert arguments.strings(several, "maps") == ("gap",)
