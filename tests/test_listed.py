"""What searches list is counted as the threads that go through the lists ask for it."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pytest
import warp as wp

from warp_cloth.contact.box_tree import lists_of
from warp_cloth.fitting.problem import load_problem
from warp_cloth.kernels.contact.arrays import ON_EDGE
from warp_cloth.kernels.contact.crossing_search import BY_TRIANGLE
from warp_cloth.scene import load_scene
from warp_cloth.study import sectors
from warp_cloth.study.asked import STORED
from warp_cloth.study.launches import Launch, launches_of
from warp_cloth.study.listed import groups_that_go_on, leaf_corners, listed_groups, listed_leaves, work_on_lists
from warp_cloth.study.traffic import array_uses

SHEET = {"kind": "square", "side": 0.5, "vertices_per_side": 17}
TEAM, BLOCK = 32, 256  # threads
PARTS, ROOM = 32, 32768  # of the leaves' list, and in each of them
GROUPS, LEAVES = 2048, PARTS * ROOM + 5  # room in the lists

Asked = dict[str, set[tuple[int, int]]]  # by array blocks and elements


@pytest.fixture(scope="module")
def search() -> dict[str, Launch]:
    """The launches of a search of two sheets that lie on each other."""
    sheets = [{"shape": {**SHEET, "height": height}} for height in (1.0, 1.0004)]
    made = load_problem(load_scene({"garment": sheets, "collision": {"cloth": True}}), "cpu")
    touch = made.relaxation.touch
    assert touch is not None
    touch.untangles = False
    touch._near_met, touch._crossing_met = lists_of(GROUPS, LEAVES), lists_of(GROUPS, LEAVES)
    touch.awaken()
    made.relaxation.iterate(2)
    touch.data.moved.fill_(1)
    launches = launches_of(made.relaxation.iterate)
    share_out(touch._near_met)
    return {launch.kernel.key.rpartition("__")[2]: launch for launch in launches}


def share_out(meetings: Any) -> None:
    """Puts what teams listed one after another, as they do on the CPU, into all parts, as those of a GPU do."""
    count = int(meetings.count.numpy()[32])
    leaves = meetings.leaf.numpy()
    listed = leaves[:count].copy()
    group = np.where(listed[:, 0] < 0, -1, listed[:, 0] // TEAM)
    team = np.cumsum((np.diff(group, prepend=-2) != 0) | (np.diff(listed[:, 1] // TEAM, prepend=-1) != 0))
    counts = meetings.count.numpy()
    for part in range(PARTS):
        here = listed[team % PARTS == part]
        leaves[part * ROOM :][: len(here)] = here
        counts[(1 + part) * PARTS] = len(here)
    meetings.leaf.assign(leaves)
    meetings.count.assign(counts)


def worked(launch: Launch) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    uses = array_uses(launch.kernel)
    return work_on_lists(launch.arrays(), uses.read, uses.written, launch.threads)


def numbers(launch: Launch, name: str) -> list:
    return launch.arrays()[name].numpy().tolist()


def same(found: dict[str, tuple[np.ndarray, np.ndarray]], expected: Asked, launch: Launch) -> None:
    """Compares the sectors that blocks ask for."""
    for name, elements in expected.items():
        size = wp.types.type_size_in_bytes(launch.arrays()[name].dtype)
        keys = {divmod(int(key), sectors.BLOCK) for key in sectors._keys(*found[name], size)}
        assert keys == {
            (block, byte // sectors.SECTOR)
            for block, element in elements
            for byte in range(element * size, (element + 1) * size)
        }, name


def test_a_team_asks_for_both_groups_of_each_listed_pair(search: dict[str, Launch]) -> None:
    launch = search["find_near_leaves"]
    firsts = {tree: numbers(launch, f"search.{tree}_tree.first") for tree in ("edge", "triangle")}
    vertices, rows = numbers(launch, "search.vertex"), listed_groups(launch.arrays()).tolist()
    assert {kind for kind, _, _ in rows} == {0, 1}
    expected: Asked = defaultdict(set)
    for row, (kind, group, met) in enumerate(rows):
        block = row % (launch.threads // TEAM) * TEAM // BLOCK
        tree, leaves = ("edge", "ends") if kind == 1 else ("triangle", "corners")
        round_it = 192 * (firsts[tree][1] + met // TEAM) + met % TEAM
        of_boxes = {192 * met + at for at in range(192)} | {round_it + TEAM * axis for axis in range(6)}
        lanes = range(TEAM)
        if kind == 1:
            of_boxes |= {192 * group + at for at in range(192)}
            expected["search.ends"] |= {(block, TEAM * group + lane) for lane in lanes}
        else:
            expected["search.vertex"] |= {(block, TEAM * group + lane) for lane in lanes}
            for name in ("cloth.position", "contact.skin"):
                expected[name] |= {(block, max(vertices[TEAM * group + lane], 0)) for lane in lanes}
        expected[f"search.{tree}_tree.bound"] |= {(block, at) for at in of_boxes}
        expected[f"search.{leaves}"] |= {(block, TEAM * met + lane) for lane in lanes}
        expected["meetings.group"].add((block, row))
    same(worked(launch), expected, launch)


def test_leaves_are_listed_by_each_thread_one_after_another(search: dict[str, Launch]) -> None:
    launch = search["find_near_leaves"]
    part, row, asking, met = listed_leaves(launch.arrays())
    instruction, place = worked(launch)["meetings.leaf"]
    assert (place == part * (ROOM) + row).all()
    threads, turns = defaultdict(list), defaultdict(set)
    for number, a, m, at in zip(instruction.tolist(), asking.tolist(), met.tolist(), place.tolist(), strict=True):
        threads[a, m // TEAM].append((at, number))
        turns[number].add((a, m // TEAM))
    for listed in threads.values():  # one more place, one instruction later
        assert np.diff(listed, axis=0).tolist() == [[1, 1]] * (len(listed) - 1)
    for together in turns.values():  # of one team, that is one pair of groups
        assert len({(a // TEAM if a >= 0 else -1, m) for a, m in together}) == 1


def test_a_team_that_lists_anything_counts_it_at_once_and_is_told_what_the_count_was(search: dict[str, Launch]) -> None:
    launch = search["find_near_leaves"]
    # the second where the list is full
    assert array_uses(launch.kernel).answered == {"meetings.count", "contact.count"}
    part, _, asking, met = (each.tolist() for each in listed_leaves(launch.arrays()))
    teams = {(p, a // TEAM if a >= 0 else -1, m // TEAM) for p, a, m in zip(part, asking, met, strict=True)}
    instruction, place = worked(launch)[STORED + "meetings.count"]
    assert len(set(instruction.tolist())) >= len(teams)
    assert place.tolist() == [(1 + p) * PARTS for p in part]
    walks = search["meet_near"]
    walked = {(kind, group) for kind, group, _ in listed_groups(walks.arrays()).tolist()}
    counted, places = worked(walks)[STORED + "meetings.count"]
    assert len(set(counted.tolist())) == len(counted) == len(walked)
    assert not places.any()


def test_a_thread_asks_for_all_of_a_listed_pair_of_leaves_and_keeps_those_that_are_near(
    search: dict[str, Launch],
) -> None:
    launch = search["find_pairs"]
    arrays = launch.arrays()
    part, row, asking, met = listed_leaves(arrays)
    corners, on_edge = leaf_corners(arrays, asking, met)
    pairs = numbers(launch, "contact.corners")[: numbers(launch, "contact.count")[0]]
    kinds = numbers(launch, "contact.kind")
    known = {(*pair, kinds[at] % 2) for at, pair in enumerate(pairs)}
    start = numbers(launch, "search.near_start")
    assert 0 < len(pairs) < len(part)
    expected: Asked = defaultdict(set)
    kept = set()
    for p, r, a, m, four, edges in zip(
        *(each.tolist() for each in (part, row, asking, met, corners, on_edge)), strict=True
    ):
        thread = r % (launch.threads // TEAM // TEAM * TEAM) // TEAM * TEAM * TEAM + p * TEAM + r % TEAM
        block = thread // BLOCK
        expected["meetings.leaf"].add((block, p * (ROOM) + r))
        if edges:
            expected["search.ends"] |= {(block, a), (block, m)}
            expected["search.edge_tree.leaf"] |= {(block, a), (block, m)}
        else:
            expected["search.corners"].add((block, m))
        for name in ("cloth.position", "contact.skin"):
            expected[name] |= {(block, corner) for corner in four}
        if (*four, int(edges)) in known:
            kept.add((*four, int(edges)))
            expected["contact.thickness"] |= {(block, four[0]), (block, four[3])}
            for corner in four[: 1 + edges]:
                expected["search.near_start"] |= {(block, corner), (block, corner + 1)}
                expected["search.near"] |= {(block, at) for at in range(start[corner], start[corner + 1])}
    assert kept == known
    found = worked(launch)
    same(found, expected, launch)
    assert sorted(found["contact.corners"][1].tolist()) == list(range(len(pairs)))


def test_a_walk_looks_at_the_highest_boxes_and_at_those_round_what_it_meets(search: dict[str, Launch]) -> None:
    launch = search["meet_near"]
    first = numbers(launch, "search.triangle_tree.first")
    rows = [row for row in listed_groups(launch.arrays()).tolist() if row[0] == 0]
    groups = len(numbers(launch, "search.edge_tree.leaf")) // TEAM
    vertices = numbers(launch, "search.vertex")
    looked = {((groups + group) // 2, first[1] + met // TEAM) for _, group, met in rows}
    some = [group for group in range(len(vertices) // TEAM) if vertices[TEAM * group] >= 0]
    looked |= {((groups + group) // 2, at) for group in some for at in range(first[2], first[3])}
    same(
        worked(launch),
        {"search.triangle_tree.bound": {(block, 192 * at + one) for block, at in looked for one in range(192)}},
        launch,
    )


def test_what_found_no_room_does_not_count_nor_do_kernels_without_lists(search: dict[str, Launch]) -> None:
    launch = search["find_pairs"]
    counts = launch.arrays()["meetings.count"]
    before = counts.numpy().copy()
    counts.fill_(10**6)
    assert len(listed_groups(launch.arrays())) == GROUPS
    assert len(listed_leaves(launch.arrays())[0]) == PARTS * ROOM
    counts.assign(before)
    assert worked(search["displace_vertices"]) == worked(search["press_pairs"]) == {}


def test_what_may_cross_is_counted_while_its_lists_last() -> None:
    sheets = [{"shape": {**SHEET, "height": height}} for height in (1.0, 1.0004)]
    made = load_problem(load_scene({"garment": sheets, "collision": {"cloth": True}}), "cpu")
    touch, cloth = made.relaxation.touch, made.model.cloth
    assert touch is not None
    touch._near_met, touch._crossing_met = lists_of(GROUPS, LEAVES), lists_of(GROUPS, LEAVES)
    touch.awaken()
    seen: dict[str, dict[str, set[int]]] = {}

    def see(launch: Launch) -> None:
        arrays, found = launch.arrays(), worked(launch)
        name = launch.kernel.key.rpartition("__")[2]
        seen[name] = {array: set(elements.tolist()) for array, (_, elements) in found.items()}
        if name == "find_crossing_leaves":
            kind, group, met = listed_groups(arrays).T
            triangles, edges = np.where(kind == BY_TRIANGLE, group, met), group[kind == ON_EDGE]
            on = groups_that_go_on(arrays)
            assert on[kind != BY_TRIANGLE].all()
            assert seen[name]["search.corners"] == {TEAM * one + lane for one in triangles[on] for lane in range(TEAM)}
            assert seen[name]["search.ends"] >= {TEAM * one + lane for one in edges for lane in range(TEAM)}
        if name == "part_crossings":
            _, _, asking, met = listed_leaves(arrays)
            assert seen[name]["search.triangle_tree.leaf"] == set(met.tolist())
            assert seen[name]["untangling.beyond"] == set((-1 - asking[asking < 0]).tolist())
            assert len(found["untangling.crosses"][0]) == 5 * arrays["untangling.count"].numpy()[0]

    touch._search.whole.fill_(1)
    launches_of(lambda: touch.search(cloth), see=see)
    assert seen["find_pairs"]["cloth.position"]
    assert seen["part_crossings"]["cloth.position"]
    assert seen["meet_crossing"]["search.triangle_tree.bound"]
    assert not seen["settle_shifts"]
