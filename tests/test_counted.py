"""What a GPU would launch is counted for all kinds of cloth, as far as that goes without one."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from warp_cloth.contact.box_tree import lists_of
from warp_cloth.contact.cloth import ClothTouch
from warp_cloth.fitting import problem
from warp_cloth.fitting.problem import Problem, load_problem
from warp_cloth.kernels.contact.box_tree import WIDTH
from warp_cloth.model.model import build_model
from warp_cloth.model.patches import on_device
from warp_cloth.scene import load_scene
from warp_cloth.study import sectors
from warp_cloth.study.launches import Launch, launches_of
from warp_cloth.study.traffic import Uses, array_uses

WOVEN = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
EDGED = {**WOVEN, "shear": "edges"}
BALL = {"shape": {"kind": "sphere", "radius": 0.3, "centre": [0.0, 0.6, 0.0]}, "friction": 0.5}
HELD = [{"box": [[-0.51, 0.9, -0.51], [-0.4, 1.1, 0.51]]}]


def sheet(height: float, fabric: dict[str, Any] = WOVEN, **more: Any) -> dict[str, Any]:
    shape = {"kind": "square", "side": 1.0, "vertices_per_side": 17, "height": height}
    return {"shape": shape, "fabric": fabric, **more}


SCENES = {
    "hanging": {"garment": sheet(1.0, pin=HELD)},
    "hanging by edges": {"garment": sheet(1.0, EDGED, pin=HELD)},
    "over a ball": {"garment": sheet(0.91), "avatar": BALL},
    "layers over a ball": {"garment": [sheet(0.91), sheet(0.914)], "avatar": BALL, "collision": {"cloth": True}},
    "in a hammock": {"garment": [sheet(1.0, pin=HELD), sheet(1.0004)], "collision": {"cloth": True}},
}


class OnGpu(sectors._Moved):
    """What a launch moves where its arrays are a GPU's."""

    @property
    def _device(self) -> Any:
        return SimpleNamespace(is_cuda=True, sm_count=132, alias="cuda:0")

    @_device.setter
    def _device(self, _: Any) -> None:
        pass


@pytest.fixture(params=SCENES)
def made(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Problem:
    """A scene whose forces are gathered, and whose searches fill lists, as on a GPU."""

    def lists(touch: ClothTouch) -> Any:
        leaves = len(touch.sheets.edges) + touch.sheets.vertex_count
        return lists_of(int(WIDTH) * leaves, 1024 * leaves // 32 * 32)

    monkeypatch.setattr(problem, "build_model", partial(build_model, gathers=True))
    monkeypatch.setattr(ClothTouch, "_lists", lists)
    monkeypatch.setattr(on_device, "takes_pairs", lambda terms, vertices: terms.edges)
    monkeypatch.setattr(sectors, "spilled_bytes", lambda command, device: 100)
    monkeypatch.setattr(sectors, "core_bytes", lambda device: 228 * 1024)
    return load_problem(load_scene(SCENES[request.param]), "cpu")


def test_whatever_is_launched_moves_something(made: Problem) -> None:
    touch, counted = made.relaxation.touch, set[str]()
    if touch is not None:
        touch.awaken()
    made.relaxation.loosen(made.certifier.read(made.certifier.glance(0)).relative_rms * 0.0)

    def see(launch: Launch) -> None:
        uses: Uses = array_uses(launch.kernel)
        memory, cache = OnGpu(launch, uses).total()
        assert 0 < memory <= cache, launch.kernel.key
        counted.add(launch.kernel.key.rpartition("__")[2])

    made.relaxation.iterate(20)
    launches_of(lambda: made.relaxation.iterate(40), see=see)
    assert "advance_vertices" in counted
    if touch is not None:
        cloth = touch.cloth_now()
        launches_of(lambda: touch.search(cloth), see=see)
        assert {"find_near_leaves", "find_pairs", "find_crossing_leaves", "part_crossings"} <= counted
