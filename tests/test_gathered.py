"""What meshes lead threads to is counted by what lies in them."""

from __future__ import annotations

import numpy as np
import pytest

from warp_cloth.scene import load_scene
from warp_cloth.set_up import set_up_one
from warp_cloth.solver.leeway import _Gathered
from warp_cloth.study.gathered import gathered_work
from warp_cloth.study.launches import Launch, launches_of

BLOCK = 256  # threads
SHAPE = {"kind": "square", "side": 0.5, "vertices_per_side": 21}


@pytest.fixture(scope="module")
def look() -> dict[str, Launch]:
    """The launches of a look at leeway, thread by thread, as on a GPU."""
    fabric = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
    made = set_up_one(load_scene({"garment": {"shape": SHAPE, "fabric": fabric}}), "cpu")
    gathers = _Gathered(made.model)
    launches = launches_of(lambda: gathers.launch(made.relaxation.step, made.model.cloth))
    return {launch.kernel.key.rpartition("__")[2]: launch for launch in launches}


def asked(launch: Launch, name: str) -> set[tuple[int, int]]:
    blocks, elements = gathered_work(launch.arrays(), launch.threads)[name]
    return set(zip(blocks.tolist(), elements.tolist(), strict=True))


def numbers(launch: Launch, name: str) -> list:
    return launch.arrays()[name].numpy().tolist()


def test_an_edge_asks_for_its_ends_and_the_triangles_beside_it(look: dict[str, Launch]) -> None:
    launch = look["bound_folds"]
    ends, beside = numbers(launch, "edges.ends"), numbers(launch, "edges.beside")
    assert asked(launch, "cloth.move") == {(edge // BLOCK, end) for edge, both in enumerate(ends) for end in both}
    assert asked(launch, "normal") == {
        (edge // BLOCK, triangle) for edge, both in enumerate(beside) for triangle in both if triangle >= 0
    }


def test_a_vertex_asks_for_all_of_the_triangles_round_it(look: dict[str, Launch]) -> None:
    launch = look["find_leeway"]
    corners, edges = numbers(launch, "triangles.corners"), numbers(launch, "triangles.edges")
    triangles = {(vertex // BLOCK, at) for at, three in enumerate(corners) for vertex in three}
    assert asked(launch, "triangles.slope") == triangles
    assert asked(launch, "cloth.position") == {(block, corner) for block, at in triangles for corner in corners[at]}
    assert asked(launch, "bound") == {
        (block, edge if edge >= 0 else -1 - edge) for block, at in triangles for edge in edges[at]
    }


def test_a_triangle_asks_for_its_corners(look: dict[str, Launch]) -> None:
    arrays = {"triangles.corners": look["find_leeway"].arrays()["triangles.corners"]}
    corners = arrays["triangles.corners"].numpy()
    blocks, elements = gathered_work(arrays, len(corners))["cloth.position"]
    assert (elements == corners.ravel()).all()
    assert (blocks == np.repeat(np.arange(len(corners)) // BLOCK, 3)).all()


def test_threads_that_are_led_nowhere_are_left_as_they_are(look: dict[str, Launch]) -> None:
    assert gathered_work(look["take_leeway"].arrays(), look["take_leeway"].threads) == {}
