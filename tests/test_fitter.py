"""A fitter answers again with the bits of a fit of its own."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import sheet, write_obj

import warp_cloth
from warp_cloth.base.cache import Cache
from warp_cloth.fitting import fit as module
from warp_cloth.fitting.fit import Fit

SHIRT = {"garment.shape.edge_mm": 60, "collision.pixel_mm": 10, "solver.iterations": 200}


def same_bits(one: Fit, other: Fit) -> bool:
    pairs = zip(one.garments, other.garments, strict=True)
    return one.scene == other.scene and all(np.array_equal(a.points, b.points) for a, b in pairs)


CHANGES: list[dict[str, Any]] = [
    {},
    {"fabric": "denim"},
    {"fabric": {"stretch": 3e4}},
    {"size": "L"},
    {"offset_mm": 5.0},
    {"avatar_shape": {"chest": 1.02}},
    {"overrides": ["garment.fabric={stretch=5e4}", "collision.cloth=true"]},
    {},
]
KEYS = {
    "fabric": "garment.fabric",
    "size": "garment.shape.size",
    "offset_mm": "collision.offset_mm",
    "avatar_shape": "avatar.shape",
}


def fresh(change: dict[str, Any]) -> Fit:
    """The same by ``warp_cloth.fit``."""
    named = {KEYS[name]: value for name, value in change.items() if name in KEYS}
    scene: Any = warp_cloth.load_scene("tshirt", {**SHIRT, **named})
    if "overrides" in change:
        first = [f"{key}={value}" for key, value in SHIRT.items()]
        own = change["overrides"]
        own = own if isinstance(own, list) else [f"{key}={value}" for key, value in own.items()]
        scene = warp_cloth.load_scene("tshirt", first + own)
    return warp_cloth.fit(scene, device="cpu")


def test_every_answer_has_the_bits_of_a_fit_of_its_own() -> None:
    fitter = warp_cloth.Fitter("tshirt", device="cpu", overrides=SHIRT)
    for change in CHANGES:
        assert same_bits(fitter.fit(**change), fresh(change)), change


def test_an_answer_starts_from_the_last_one_with_the_bits_of_a_fit_that_does() -> None:
    fitter = warp_cloth.Fitter("tshirt", device="cpu", overrides=SHIRT)
    last = fitter.fit()
    scene = warp_cloth.load_scene("tshirt", {**SHIRT, "garment.fabric": "denim"})
    assert same_bits(fitter.fit(fabric="denim", start=last), warp_cloth.fit(scene, device="cpu", start=last))


def test_what_is_kept_is_made_once_and_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    made = list[str]()
    derive = Cache._derive

    def counted(self: Cache, name: str, *rest: Any) -> Any:
        made.append(name)
        return derive(self, name, *rest)

    monkeypatch.setattr(Cache, "_derive", counted)
    fitter = warp_cloth.Fitter("tshirt", device="cpu", overrides=SHIRT)
    fitter.fit()
    first = set(made)
    made.clear()
    fitter.fit(fabric="denim")
    assert {"mesh", "avatar", "contact", "skeleton"} <= first
    assert not {"mesh", "avatar", "contact", "skeleton", "geometry"} & set(made)
    monkeypatch.setattr(module, "MOST_KEPT", 1)
    made.clear()
    fitter.fit(fabric="denim")
    assert first <= set(made)


def test_files_that_change_are_read_again(tmp_path: Path) -> None:
    file = tmp_path / "sheet.obj"
    write_obj(file, *sheet())
    scene = {"garment": {"mesh": str(file), "units": "m", "pin": {"vertices": [0]}}, "solver": {"iterations": 20}}
    fitter = warp_cloth.Fitter(scene, device="cpu")
    before = fitter.fit()
    points, *rest = sheet()
    write_obj(file, 1.5 * np.asarray(points), *rest)
    after = fitter.fit()
    assert not np.array_equal(before.garments[0].points, after.garments[0].points)
    assert same_bits(after, warp_cloth.fit(scene, device="cpu"))


def test_threads_get_the_same_bits() -> None:
    fitter = warp_cloth.Fitter("hanging", device="cpu", overrides={"solver.iterations": 100})
    fabrics = ["cotton", "denim", "jersey", "cotton"]
    with ThreadPoolExecutor(4) as pool:
        fits = list(pool.map(lambda fabric: fitter.fit(fabric=fabric), fabrics))
    for fabric, fitted in zip(fabrics, fits, strict=True):
        overrides = {"solver.iterations": 100, "garment.fabric": fabric}
        assert same_bits(fitted, warp_cloth.fit("hanging", overrides=overrides, device="cpu"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fabric": "unobtainium"}, "unobtainium"),
        ({"size": "XXXXL"}, "size"),
        ({"offset_mm": float("nan")}, "offset_mm"),
        ({"offset_mm": 1e300}, "offset_mm"),
        ({"avatar_shape": {"chest": 9.0}}, "chest"),
        ({"avatar_shape": {"nonsense": 1.0}}, "nonsense"),
        ({"overrides": ["nonsense"]}, "nonsense"),
        ({"overrides": {"garment.nonsense": 1}}, "nonsense"),
        ({"frames": -1}, "frames"),
        ({"start": 7}, "start"),
        ({"maps": "nonsense"}, "nonsense"),
    ],
)
def test_bad_changes_are_refused_and_the_fitter_stays(change: dict[str, Any], message: str) -> None:
    fitter = warp_cloth.Fitter("tshirt", device="cpu", overrides=SHIRT)
    with pytest.raises(warp_cloth.InputError, match=message):
        fitter.fit(**change)


@pytest.mark.parametrize("garment", ["no such scene", 7, {"garment": {}}, "missing.obj"])
def test_a_garment_that_cannot_be_used_is_refused_at_once(garment: Any) -> None:
    with pytest.raises(warp_cloth.InputError):
        warp_cloth.Fitter(garment, device="cpu")


def test_a_loaded_scene_is_refused() -> None:
    scene: Any = warp_cloth.load_scene("hanging")
    with pytest.raises(warp_cloth.InputError, match="loaded scene"):
        warp_cloth.Fitter(scene, device="cpu")
