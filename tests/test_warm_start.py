"""Warm start: a fit that starts from an earlier result reaches the same rest as one that starts afresh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import warp_cloth
from warp_cloth.base.errors import InputError
from warp_cloth.export.save import write_meshes
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.warm_start import earlier_garments
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene

# Each is within the rest error that it certifies, 0.2 mm, of rest; twice that lies between two.
APART = 4e-4  # [m], rms
CURTAIN = {
    "garment": {
        "shape": {"kind": "square", "side": 1.0, "vertices_per_side": 13, "plane": "vertical", "height": 1.0},
        "fabric": "cotton",
        "pin": [
            {"box": [[-0.51, 0.99, -0.01], [-0.49, 1.01, 0.01]]},
            {"box": [[0.49, 0.99, -0.01], [0.51, 1.01, 0.01]]},
        ],
    },
    "avatar": {"shape": {"kind": "sphere", "radius": 0.2, "centre": [0.05, 0.5, 0.1]}, "friction": 0.0},
    "collision": {"pixel_mm": 5.0},
    "solver": {"tolerance_mm": 0.2},
}


@pytest.fixture(scope="module")
def first() -> Fit:
    return fitted()


def fitted(*changes: str, start: Fit | Path | None = None) -> Fit:
    worn = warp_cloth.fit(warp_cloth.load_scene(CURTAIN, changes), device="cpu", start=start)
    assert worn.status is Status.AT_REST
    return worn


def apart(one: Fit, other: Fit) -> float:
    """Rms distance of two fits' vertices [m]."""
    return float(np.sqrt(((one.garments[0].points - other.garments[0].points) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize(
    "change", ["garment.fabric=denim", "avatar.shape.centre=[0.0,0.45,0.15]", "collision.offset_mm=8"]
)
def test_a_warm_start_comes_to_the_same_rest_as_a_cold_one(first: Fit, change: str) -> None:
    cold, warm = fitted(change), fitted(change, start=first)
    assert apart(warm, cold) <= APART


def test_a_saved_result_starts_a_fit_as_the_fit_itself_does(first: Fit, tmp_path: Path) -> None:
    write_meshes(first, tmp_path, formats=("usdc", "obj", "glb"))
    name = first.scene.name
    change = "garment.fabric=denim"
    for file in (f"{name}.usdc", f"{name}.obj", f"{name}.glb"):
        assert apart(fitted(change, start=tmp_path / file), fitted(change, start=first)) <= APART


def sheets(*heights: float) -> dict[str, object]:
    """Two small sheets that hang side by side, called upper and lower."""
    garments = [
        {"name": name, "shape": {"kind": "square", "side": 0.2, "vertices_per_side": 5, "plane": "vertical",
         "height": height}, "pin": {"loop": "top"}}
        for name, height in zip(("upper", "lower"), heights, strict=False)
    ]  # fmt: skip
    ball = {"shape": {"kind": "sphere", "radius": 0.2, "centre": [0.0, 0.4, 0.0]}}
    return {"garment": garments, "avatar": ball, "collision": {"pixel_mm": 10}, "solver": {"iterations": 100}}


def test_garments_of_a_result_are_told_by_their_names(tmp_path: Path) -> None:
    both = warp_cloth.fit(sheets(0.9, 0.7), device="cpu")
    write_meshes(both, tmp_path, formats=("usdc", "glb", "obj"))
    lower = load_scene({**sheets(), "garment": sheets(0.9, 0.7)["garment"][1]})  # type: ignore[index]
    for start in (both, *(tmp_path / f"scene.{suffix}" for suffix in ("usdc", "glb", "obj"))):
        (worn,) = earlier_garments(start, lower)
        np.testing.assert_allclose(worn[1], both.garments[1].points, atol=1e-6)
        for names in (["another"], ["upper", "lower", "third"]):
            if names == ["another"] and str(start).endswith(".obj"):
                continue  # all of it may be one garment
            spec = {**sheets(), "garment": [{**sheets(0.9)["garment"][0], "name": name} for name in names]}  # type: ignore[index]
            told = rf'has "upper", "lower", but the scene has "{names[0]}".*garment\.name'
            with pytest.raises(InputError, match=told):
                earlier_garments(start, load_scene(spec))


def test_a_start_that_corresponds_to_nothing_is_refused(first: Fit, tmp_path: Path) -> None:
    stranger = tmp_path / "stranger.obj"
    stranger.write_text("v -0.5 1 0\nv 0.5 1 0\nv 0 0 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="neither the mesh nor the panels"):
        warp_cloth.fit({"garment": {"mesh": str(stranger), "units": "m"}}, device="cpu", start=first)
    with pytest.raises(InputError, match="start: WornGarment is neither a fit nor a file of one"):
        fitted(start=first.garments[0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"gone\.usdc: no such file; give a file that an earlier fit has written"):
        fitted(start=tmp_path / "gone.usdc")
    (tmp_path / "bad.usdc").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match=r"bad\.usdc"):
        fitted(start=tmp_path / "bad.usdc")
