"""What meshes lead threads to is counted by what lies in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from warp_cloth.fitting.problem import load_problem
from warp_cloth.scene import load_scene
from warp_cloth.solver.anisotropic_step import _Gathered
from warp_cloth.study.asked import STORED, Part
from warp_cloth.study.gathered import gathered_work
from warp_cloth.study.launches import Launch, launches_of
from warp_cloth.study.traffic import Uses, array_uses

BLOCK, TEAM, LEAVES = 256, 32, 1024  # threads, those that go together, and what a block boxes
SHAPE = {"kind": "square", "side": 0.5, "vertices_per_side": 21}


@pytest.fixture(scope="module")
def look() -> dict[str, Launch]:
    """The launches of a look at leeway, thread by thread, as on a GPU; and of an iteration."""
    fabric = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
    made = load_problem(load_scene({"garment": {"shape": SHAPE, "fabric": fabric}}), "cpu")
    gathers = _Gathered(made.model)
    launches = launches_of(lambda: gathers.launch(made.relaxation.step, made.model.cloth))
    launches += launches_of(made.relaxation.iterate)
    return {launch.kernel.key.rpartition("__")[2]: launch for launch in launches}


@pytest.fixture(scope="module")
def tangled() -> dict[str, tuple[Launch, dict[str, Part]]]:
    """The launches of a search of two layers, of which one's rim lies under the other, and what they ask for then."""
    sheets = [{"shape": {**SHAPE, "height": height}} for height in (1.0, 0.9995)]
    tree = {"garment": sheets, "collision": {"cloth": True}, "avatar": {"shape": {"kind": "sphere", "radius": 0.2}}}
    made = load_problem(load_scene(tree), "cpu")
    touch = made.relaxation.touch
    assert touch is not None
    touch._untangling.layer.assign(np.repeat([0, 1], touch.sheets.vertex_count // 2).astype(np.int32))
    touch.layered = True
    touch._untangling.outward.fill_(1.0)
    touch.awaken()
    found = {}

    def see(launch: Launch) -> None:
        name = launch.kernel.key.rpartition("__")[2]
        found[name] = launch, gathered_work(launch, launch.arrays(), array_uses(launch.kernel))

    cloth = touch.cloth_now()
    launches_of(lambda: touch.search(cloth), see=see)
    return found


def together(part: Part) -> set[tuple[int, int]]:
    blocks, elements = part
    return set(zip(blocks.tolist(), elements.tolist(), strict=True))


def asked(launch: Launch, name: str) -> set[tuple[int, int]]:
    blocks, elements = gathered_work(launch, launch.arrays(), array_uses(launch.kernel))[name]
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
    launch = replace(look["find_leeway"], threads=len(corners))
    blocks, elements = gathered_work(launch, arrays, Uses())["cloth.position"]
    assert (elements == corners.ravel()).all()
    assert (blocks == np.repeat(np.arange(len(corners)) // BLOCK, 3)).all()


def test_threads_that_are_led_nowhere_are_left_as_they_are(look: dict[str, Launch]) -> None:
    launch = look["displace_vertices"]
    assert gathered_work(launch, launch.arrays(), array_uses(launch.kernel)) == {}


def test_a_block_that_boxes_leaves_asks_for_their_corners_and_stores_boxes_round_groups_one_by_one(
    tangled: dict[str, tuple[Launch, dict[str, Part]]],
) -> None:
    launch, found = tangled["box_sheets"]
    edge, triangle = numbers(launch, "search.edge_tree.leaf"), numbers(launch, "search.triangle_tree.leaf")
    ends, corners, sides = (numbers(launch, f"search.{name}") for name in ("ends", "corners", "sides"))
    blocks = len(edge) // LEAVES
    vertices = {(at // LEAVES, end) for at, leaf in enumerate(edge) if leaf >= 0 for end in ends[at]}
    lengths = {(at // LEAVES, leaf) for at, leaf in enumerate(edge) if leaf >= 0}
    for at, leaf in enumerate(triangle):
        if leaf >= 0:
            vertices |= {(blocks + at // LEAVES, corner) for corner in corners[at]}
            lengths |= {(blocks + at // LEAVES, side) for side in sides[leaf]}
    assert together(found["cloth.position"]) == together(found["contact.skin"]) == vertices
    assert together(found["search.longest"]) == lengths
    stored, first = found[STORED + "search.edge_tree.bound"], numbers(launch, "search.edge_tree.first")
    of_leaves, others = 6 * len(edge), 6 * (len(edge) // TEAM + len(edge) // LEAVES)
    assert len(set(stored[0].tolist())) == 1 + others
    assert sorted(stored[1].tolist()) == sorted(set(stored[1].tolist()))
    assert len(stored[1]) == of_leaves + others
    assert stored[1].max() < 6 * TEAM * first[-1]


def test_pairs_ask_whether_their_corners_are_tangled(tangled: dict[str, tuple[Launch, dict[str, Part]]]) -> None:
    launch, found = tangled["spare_tangled"]
    pairs = numbers(launch, "contact.corners")[: numbers(launch, "contact.count")[0]]
    assert pairs
    assert together(found["search.tangled"]) == {
        (at // BLOCK, corner) for at, four in enumerate(pairs) for corner in four
    }


def test_vertices_beyond_another_layer_ask_for_the_triangle_there(
    tangled: dict[str, tuple[Launch, dict[str, Part]]],
) -> None:
    launch, found = tangled["part_layers"]
    triangles, count = numbers(launch, "search.triangles"), numbers(launch, "untangling.count")[1]
    reach = np.array(launch.arguments["untangling"].layer_reach, dtype=np.float32).view(np.int32).item()
    near = {
        vertex: triangles[beyond % 2**32]
        for vertex, beyond in enumerate(numbers(launch, "untangling.beyond"))
        if beyond >> 32 < reach
    }
    assert 0 < count <= len(near)
    rim = {(vertex // BLOCK, corner) for vertex, corners in near.items() for corner in corners}
    assert together(found["untangling.rim"]) == rim
    assert together(found["cloth.position"]) == rim | {(vertex // BLOCK, vertex) for vertex in near}
    instruction, row = found[STORED + "untangling.sum"]
    assert len(row) == 4 * 4 * count
    assert all(vertex in near for vertex in row[instruction // 4 % 4 == 0])
