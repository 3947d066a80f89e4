"""The bytes of a plan are the sectors that the arrays' own numbers lead to."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp

from warp_cloth.fitting.problem import load_problem
from warp_cloth.kernels.avatar.field import ContactField, sample_field
from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.base.options import SINGLE
from warp_cloth.kernels.base.types import Patch
from warp_cloth.kernels.contact.narrow_phase_queue import ROUNDS
from warp_cloth.model.model import build_model
from warp_cloth.model.patches import on_device
from warp_cloth.scene import load_scene
from warp_cloth.solver.relax import Collider, Relaxation, StepOptions
from warp_cloth.study import sectors
from warp_cloth.study.launches import Launch, launches_of
from warp_cloth.study.pressed import block_of_pairs, looked_at, nearly_parallel, packets, stores
from warp_cloth.study.sectors import BLOCKS, SECTOR, STORES, field_nodes, moved_bytes
from warp_cloth.study.traffic import REGIONS, Uses, array_uses

SQUARE = {"kind": "square", "side": 0.5, "vertices_per_side": 19, "plane": "vertical", "height": 1.5}
WOVEN = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
EDGED = {"stretch": 2e4, "shear": "edges", "bending": 1e-6}


@pytest.fixture(scope="module")
def advance() -> tuple[Launch, Uses]:
    """A launch whose blocks work on patches, and what it uses."""
    scene = load_scene({"garment": {"shape": SQUARE, "fabric": WOVEN}})
    part = load_problem(scene, "cpu").wardrobe.parts[0]
    model = build_model([part], device="cpu", precision="mixed", gathers=True)
    relaxation = Relaxation(model, Collider(), StepOptions())
    _pack, launch, _unpack = launches_of(relaxation.iterate)
    return launch, array_uses(launch.kernel)


def rows_of(launch: Launch) -> np.ndarray:
    wide = launch.arrays()["patches.patch"].numpy().reshape(-1, 16)[:, : len(Patch.vars)]
    return np.ascontiguousarray(wide).view(Patch.numpy_dtype()).ravel()


def sectors_of(elements: object, size: int) -> set[int]:
    """Sectors in which elements of so many bytes lie, byte by byte."""
    return {(element * size + byte) // SECTOR for element in elements for byte in range(size)}


def asked(launch: Launch, uses: Uses, name: str) -> dict[str, set[tuple[int, int]]]:
    """Blocks and sectors by loop."""
    used = uses.read if name in uses.read else uses.written
    loops = sectors._Moved(launch, uses)._loops(name, used[name])
    return {loop: {divmod(int(key), sectors.BLOCK) for key in keys} for loop, keys in loops.items()}


@pytest.mark.parametrize("name", ["cloth.position", "cloth.move", "cloth.moved", "cloth.weight", "position_out"])
def test_each_patch_asks_for_its_vertices_and_for_its_own_once_more(advance: tuple[Launch, Uses], name: str) -> None:
    launch, uses = advance
    array = launch.arrays().get(name)
    if array is None or name not in uses.read | uses.written:
        pytest.skip("this cloth has no such array")
    vertex = launch.arrays()["patches.vertex"].numpy()
    size = wp.types.type_size_in_bytes(array.dtype)
    parts = [(0, size)]
    if name in uses.packed:
        parts = [(0, size * 2 // 3), (SECTOR * -(-len(array) * size * 2 // 3 // SECTOR), size // 3)]
    rows = rows_of(launch)
    assert len(rows) > 3
    found = asked(launch, uses, name)
    assert set(found) <= {"vertex_count", "owned_count"}
    for loop, some in found.items():
        assert some == {
            (block, sector + first // SECTOR)
            for block, row in enumerate(rows)
            for first, part in parts
            for sector in sectors_of(vertex[row["vertex_start"] :][: row[loop]], part)
        }


@pytest.mark.parametrize("name", ["patches.corners", "patches.threads", "patches.ends"])
def test_each_patch_asks_for_its_part_of_a_table(advance: tuple[Launch, Uses], name: str) -> None:
    launch, uses = advance
    array = launch.arrays().get(name)
    if array is None or name not in uses.read:
        pytest.skip("this cloth has no such table")
    size = wp.types.type_size_in_bytes(array.dtype)
    found = asked(launch, uses, name)
    assert found
    for loop, some in found.items():
        start = {"edge_count": "edge_start", "normal_count": "triangle_start", "triangle_count": "triangle_start"}[loop]
        parts = ((block, range(row[start], row[start] + row[loop])) for block, row in enumerate(rows_of(launch)))
        assert some == {(block, sector) for block, part in parts for sector in sectors_of(part, size)}


def test_threads_that_work_on_pairs_ask_for_all_edges_and_for_corners_of_other_triangles_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(on_device, "takes_pairs", lambda terms, vertices: True)
    part = load_problem(load_scene({"garment": {"shape": SQUARE, "fabric": EDGED}}), "cpu").wardrobe.parts[0]
    model = build_model([part], device="cpu", precision="mixed", gathers=True)
    _pack, launch, _unpack = launches_of(Relaxation(model, Collider(), StepOptions()).iterate)
    uses = array_uses(launch.kernel)
    rows = rows_of(launch)
    assert (rows["item_count"] > 0).all()
    first, end = rows["triangle_start"] + rows["triangle_count"], rows["triangle_start"] + rows["normal_count"]
    for name, begin, after in (
        ("patches.ends", rows["edge_start"], rows["edge_start"] + rows["edge_count"]),
        ("patches.corners", first, end),
    ):
        size = wp.types.type_size_in_bytes(launch.arrays()[name].dtype)
        parts = enumerate(zip(begin, after, strict=True))
        expected = {(block, sector) for block, part in parts for sector in sectors_of(range(*part), size)}
        assert set().union(*asked(launch, uses, name).values()) == expected


def test_what_lies_about_a_patch_is_listed_and_what_it_owns_is_not(advance: tuple[Launch, Uses]) -> None:
    launch, uses = advance
    expected = set()
    for block, row in enumerate(rows_of(launch)):
        first, count = row["vertex_start"], row["vertex_count"]
        expected |= {(block, sector) for sector in sectors_of(range(first + row["owned_count"], first + count), 4)}
    assert asked(launch, uses, "patches.vertex") == {"vertex_count": expected}


def test_all_that_meets_at_a_vertex_is_asked_for_once_however_many_words_it_takes(advance: tuple[Launch, Uses]) -> None:
    launch, uses = advance
    slots = launch.arrays()["patches.slot"]
    (found,) = asked(launch, uses, "patches.slot").values()
    assert {sector for _, sector in found} == sectors_of(range(len(slots)), 16)


def test_memory_counts_each_sector_once_and_the_cache_once_for_each_block(advance: tuple[Launch, Uses]) -> None:
    launch, uses = advance
    arrays = launch.arrays()
    memory, cache = moved_bytes(launch, uses)
    whole = sum(SECTOR * -(-a.size * wp.types.type_size_in_bytes(a.dtype) // SECTOR) for a in arrays.values())
    assert memory < whole + SECTOR * len(arrays)  # stiffness is read and written, much else not used
    blocks = len(rows_of(launch))
    assert memory < cache < blocks * memory


def test_patches_move_the_same_last_first() -> None:
    part = load_problem(load_scene({"garment": {"shape": SQUARE, "fabric": WOVEN}}), "cpu").wardrobe.parts[0]
    model = build_model([part], device="cpu", precision="mixed", gathers=True)
    relaxation = Relaxation(model, Collider(), StepOptions())
    _pack, there, back, _unpack = launches_of(lambda: relaxation.iterate(2))
    uses = array_uses(there.kernel)
    starts = [rows_of(launch)["slot_start"] for launch in (there, back)]
    assert (np.diff(starts[0]) > 0).all() != (np.diff(starts[1]) > 0).all()
    assert moved_bytes(there, uses) == moved_bytes(back, uses)


def test_a_point_reads_those_nodes_of_a_field_that_its_answer_depends_on() -> None:
    rng = np.random.default_rng(3)
    field = ContactField()
    values = rng.uniform(-0.01, 0.01, (7, 8, 9)).astype(np.float32)
    field.values = wp.array(values, dtype=wp.float32, ndim=3, device="cpu")
    field.origin, field.spacing, field.reach, field.near = wp.vec3d(0.1, 0.2, 0.3), 0.01, 0.02, 1.0
    inside = np.array([0.1, 0.2, 0.3]) + 0.01 * np.array([3.2, 4.4, 5.1])
    points = np.stack([inside, inside + 1.0])  # the second one beyond the field
    answer = wp.zeros(2, dtype=wp.vec4f, device="cpu")

    def answers(to: np.ndarray) -> np.ndarray:
        field.values.assign(to)
        given = [field, wp.array(points, dtype=wp.vec3d, device="cpu")]
        wp.launch(sample_field, dim=2, inputs=given, outputs=[answer], device="cpu")
        return answer.numpy().copy()

    before = answers(values)
    changed = set()
    for node in range(values.size):
        other = values.ravel().copy()
        other[node] += 1e-3
        if (answers(other.reshape(values.shape)) != before).any():
            changed.add(node)
    told = {"origin": np.array([0.1, 0.2, 0.3]), "spacing": 0.01, "reach": 0.02}
    blocks, nodes = field_nodes(told, values, np.array([4, 5]), points)
    assert set(blocks.tolist()) == {4}
    whole = set(nodes.tolist()) | {node for row in nodes.reshape(-1, 2) for node in range(row[0], row[1] + 1)}
    assert whole == changed
    assert len(changed) == 27


def pressed(*heights: float, name: str = "press_pairs") -> tuple[Launch, Uses]:
    """A launch, such as presses pairs, of sheets that are held at these heights [m], after some iterations."""
    shape = {**SQUARE, "vertices_per_side": 9, "plane": "horizontal"}
    held = {"vertices": list(range(80))}  # all but one
    sheets = [{"shape": {**shape, "height": 1.0 + height}, "pin": held} for height in heights]
    made = load_problem(load_scene({"garment": sheets, "collision": {"cloth": True}}), "cpu")
    assert made.relaxation.touch is not None
    made.relaxation.touch.untangles = False
    made.relaxation.touch.awaken()
    made.relaxation.iterate(4)
    made.relaxation.touch.data.moved.fill_(1)  # time for a search
    launches = launches_of(lambda: made.relaxation.iterate(2))
    launch = next(each for each in launches if each.kernel.key.endswith(name))
    return launch, array_uses(launch.kernel)


def gone_together(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """How far the regions of each pair's vertices have gone, shape [N]."""
    gone = arrays["contact.way"][0] + arrays["contact.stride"][arrays["contact.turn"][0] % 2]
    words = arrays["contact.regions"][: arrays["contact.count"][0]]
    together = [sum(gone[int(word) >> 16 * corner & 0xFFFF] for corner in range(4)) for word in words]
    return np.array(together, dtype=np.int64)


def has_come(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Whether the time of each pair has come, shape [N]."""
    return arrays["contact.due"][: arrays["contact.count"][0]] <= gone_together(arrays)


def test_leeway_is_asked_for_by_cloth_that_has_some() -> None:
    sphere = {"kind": "sphere", "radius": 0.2, "centre": [0.0, 1.2, -0.1], "edge_mm": 80}
    tree = {"garment": {"shape": SQUARE, "fabric": WOVEN}, "avatar": {"shape": sphere}, "collision": {"pixel_mm": 20}}
    made = load_problem(load_scene(tree), "cpu")
    found = []
    for residual in (1.0, 0.0):
        made.relaxation.loosen(np.array([residual]))
        launches = launches_of(lambda: made.relaxation.iterate(2))
        launch = next(each for each in launches if each.kernel.key.endswith("displace_vertices"))
        (keys,) = asked(launch, array_uses(launch.kernel), "cloth.leeway").values()
        found.append(len(keys))
    assert found[0] == 0
    assert found[1] > 0


def test_no_pairs_are_not_asked_for() -> None:
    launch, uses = pressed(0.0, 0.3)
    assert launch.arrays()["contact.count"].numpy()[0] == 0
    for name in ("contact.corners", "contact.due", "contact.sum", "cloth.position"):
        assert asked(launch, uses, name) == {"": set()}


def test_of_pairs_those_are_asked_for_whose_time_has_come_and_of_sums_those_of_pairs_that_press() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    arrays = {name: array.numpy() for name, array in launch.arrays().items() if name.startswith("contact.")}
    pairs = range(arrays["contact.count"][0])
    come = np.flatnonzero(has_come(arrays)).tolist()
    press = [pair for pair in come if arrays["contact.lean"][pair].any()]
    assert 0 < len(press) < len(come) < len(pairs)
    corners, pressed_corners = (
        {corner for pair in some for corner in arrays["contact.corners"][pair]} for some in (come, press)
    )
    for name, elements, size in (
        ("contact.due", pairs, 8),
        ("contact.kind", come, 4),
        ("cloth.position", corners, 24),
        ("cloth.move", corners, 12),
        ("contact.sum", pressed_corners, 32),
    ):
        (found,) = asked(launch, uses, name).values()
        assert {sector for _, sector in found} == sectors_of(elements, size)


def test_sums_are_asked_for_number_by_number_by_the_pairs_that_press() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    arrays = {name: array.numpy() for name, array in launch.arrays().items() if name.startswith("contact.")}
    count, come = arrays["contact.count"][0], has_come(arrays)
    press = come & arrays["contact.lean"][:count].any(axis=1)
    moved = sectors._Moved(launch, uses)
    rows, sent = [], []
    edges = np.flatnonzero(press & (arrays["contact.due"][:count] % 2 == 1))
    turning = edges[nearly_parallel(launch.arrays(), "contact", edges)]
    for pairs in (np.flatnonzero(press), turning):
        number = stores(np.zeros(len(pairs), dtype=np.int64), arrays["contact.due"][pairs] % 2 == 1)
        corners = arrays["contact.corners"][pairs]
        rows.append(len({(one, at, four[at]) for one, four in zip(number, corners, strict=True) for at in range(4)}))
        sent.append(corners.size)  # whoever adds to the same sum, too
    assert 0 < rows[1] < rows[0] < sent[0]  # edges that are nearly parallel turn, too
    assert moved._added_one_by_one("contact.sum") == 4 * sum(sent) - rows[0]
    assert moved._added_one_by_one("contact.room") > 0


def test_additions_to_one_element_are_sent_one_after_another_and_those_to_a_sector_together() -> None:
    instruction = np.array([0, 0, 0, 0, 1, 1])
    assert packets(instruction, np.array([3, 3, 3, 4, 3, 9]), 4) == 3 + 2
    assert packets(instruction, np.array([3, 4, 3, 4, 3, 4]), 32) == 2 + 2 + 1 + 1
    assert packets(instruction[:0], instruction[:0], 4) == 0


def test_pairs_are_stored_by_warps_of_a_kind_one_after_another_in_a_block_s_queue() -> None:
    rng = np.random.default_rng(2)
    pair = np.arange(2000)
    block, on_edge = block_of_pairs(pair, 3), rng.random(2000) < 0.7
    assert [set(pair[block == one] // 32 % 3) for one in range(3)] == [{0}, {1}, {2}]
    number = stores(block, on_edge)
    together = []
    for one in range(3):
        for sort in (False, True):
            queue = number[(block == one) & (on_edge == sort)].tolist()
            together += [set(queue[at : at + 32]) for at in range(0, len(queue), 32)]
    assert all(len(numbers) == 1 for numbers in together)
    assert len(set.union(*together)) == len(together)


def test_a_core_holds_what_patches_read_where_its_blocks_leave_room_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    moved = sectors._Moved(replace(launch, threads=8 * 192), uses)
    assert moved._holds(10**6)  # on the CPU
    monkeypatch.setattr(moved, "_device", SimpleNamespace(is_cuda=True, sm_count=4, alias="cpu"))
    monkeypatch.setattr(moved, "_patch", {"place": np.arange(2)})  # of eight blocks; the others press pairs
    monkeypatch.setitem(launch.kernel.options, "launch_bounds", (192, 2))
    monkeypatch.setattr(sectors, "core_bytes", lambda device: 2 * SINGLE.memory + 6400)  # two blocks at a time
    assert moved._holds(2 * 3200 // SECTOR)
    assert not moved._holds(2 * 3200 // SECTOR + 1)


def test_of_pairs_that_have_come_those_narrow_rooms_that_were_near_and_others_are_told_when_to_come_again() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    arrays = {name: array.numpy() for name, array in launch.arrays().items() if name.startswith("contact.")}
    come, given = np.flatnonzero(has_come(arrays)), launch.arrays()
    near, far = come[::2], come[1::2]
    arrays["contact.stride"][:] = 10
    arrays["contact.due"][far] = gone_together(arrays)[far] // 2 * 2 + arrays["contact.due"][far] % 2 - 2
    for name in ("contact.stride", "contact.due"):
        given[name].assign(arrays[name])
    moved = sectors._Moved(launch, uses)
    corners = set(arrays["contact.corners"][near].ravel().tolist())
    for name, elements, size in (("contact.room", corners, 4), ("contact.due", far.tolist(), 8)):
        found = [moved._sectors(name, chain, "", by=STORES) for chain in uses.written[name]]
        assert set((np.concatenate(found) % sectors.BLOCK).tolist()) == sectors_of(elements, size)


def test_edges_turn_that_are_nearly_parallel() -> None:
    corners = np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]], dtype=np.int32)
    places = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [2, 0, 1], [2, 0.19, 1], [2, 0.21, 1]])
    arrays = {
        "contact.corners": wp.array(corners, dtype=wp.vec4i, device="cpu"),
        "cloth.position": wp.array(places, dtype=wp.vec3d, device="cpu"),
    }
    assert nearly_parallel(arrays, "contact", np.arange(3)).tolist() == [True, True, False]


def test_a_gpu_looks_at_pairs_before_it_knows_how_many_there_are() -> None:
    turn = ROUNDS * BLOCK_THREADS * 10  # of ten blocks
    assert looked_at(1, 10 * turn, 10) == turn
    assert looked_at(turn + 1, 10 * turn, 10) == turn + 1
    assert looked_at(1, turn - 5, 10) == turn - 5


def test_blocks_of_a_core_that_press_share_what_they_read_and_store_each_by_itself() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    moved = sectors._Moved(replace(launch, threads=4 * 192), uses)
    (chain,) = (chain for chain in uses.read["contact.kind"] if "contact.due" in chain)
    blocks = set((moved._sectors("contact.kind", chain, "", by=BLOCKS) // sectors.BLOCK).tolist())
    stored = moved._added_one_by_one("contact.sum")
    moved._cores = 2
    assert {block % 2 for block in blocks} == set(
        (moved._sectors("contact.kind", chain, "", by=BLOCKS) // sectors.BLOCK).tolist()
    )
    assert len(blocks) > 2
    assert moved._added_one_by_one("contact.sum") == stored


def test_of_what_a_pair_has_of_its_cloth_the_first_and_the_last_corner_are_asked_for() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    assert uses.picked["contact.fabric"] == {0, 3}
    assert uses.picked["cloth.position"] == {0, 1, 2, 3}
    arrays = {name: array.numpy() for name, array in launch.arrays().items() if name.startswith("contact.")}
    come = has_come(arrays)
    corners = arrays["contact.corners"][: len(come)][come][:, [0, 3]]
    (found,) = asked(launch, uses, "contact.fabric").values()
    assert {sector for _, sector in found} <= sectors_of(set(corners.ravel().tolist()), 16)


def test_before_a_search_those_pairs_are_remembered_that_lean() -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011, name="start_search")
    arrays = {name: array.numpy() for name, array in launch.arrays().items()}
    count = arrays["contact.count"][0]
    leaning = np.flatnonzero(arrays["contact.lean"][:count].any(axis=1)).tolist()
    assert 0 < len(leaning) < count
    for name, pairs, size in (("contact.lean", range(count), 16), ("contact.corners", leaning, 16)):
        (found,) = asked(launch, uses, name).values()
        assert {sector for _, sector in found} == sectors_of(pairs, size)
    (places,) = asked(launch, uses, "memory.place").values()
    assert len(leaning) // 4 <= len(places) <= len(leaning)


def test_blocks_that_press_read_how_far_each_region_has_gone_and_warps_raise_it(
    monkeypatch: pytest.MonkeyPatch, advance: tuple[Launch, Uses]
) -> None:
    launch, uses = pressed(0.0, 0.0005, 0.0015, 0.011)
    moved = sectors._Moved(replace(launch, threads=3 * 192), uses)
    count = launch.arguments["contact"].region_count
    assert 1 < count <= launch.arrays()["contact.way"].shape[1]
    for name, size in (("contact.way", 8), ("contact.stride", 4)):
        (chain,) = (chain for chain in uses.written[name] if REGIONS in chain)
        assert chain in uses.read[name]
        for by, blocks in ((BLOCKS, 3), (STORES, 1)):
            found = {divmod(int(key), sectors.BLOCK) for key in moved._sectors(name, chain, "", by=by)}
            assert found == {(block, at) for block in range(blocks) for at in sectors_of(range(count), size)}
    of_patches, how = advance
    moved = sectors._Moved(of_patches, how)
    region = np.arange(moved._vertices, dtype=np.int32) // 40
    moved._arrays |= {"touch.region": wp.array(region, device="cpu"), "touch.stride": wp.zeros(9, wp.int32, "cpu")}
    monkeypatch.setattr(moved, "_device", SimpleNamespace(is_cuda=True))
    vertex = of_patches.arrays()["patches.vertex"].numpy()
    warps = [
        region[vertex[row["vertex_start"] :][first : min(first + 32, row["owned_count"])]]
        for row in rows_of(of_patches)
        for first in range(0, row["owned_count"], 32)
    ]
    assert moved._raised("touch.stride") == sum(
        max(np.bincount(warp[warp // 8 == sector])) for warp in warps for sector in set((warp // 8).tolist())
    )
