"""What each block of threads asks for that works on lists of what may be near, or cross: groups, then leaves.

The lists (kernels.contact.broad_phase) are read where they lie, after each launch of a search.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from warp_cloth.contact.cloth import LOOKING
from warp_cloth.kernels.contact.arrays import ON_EDGE, ON_TRIANGLE
from warp_cloth.kernels.contact.box_tree import WIDTH
from warp_cloth.kernels.contact.broad_phase import APART, GROUPS, LEAVES_MET, LISTING, PARTS
from warp_cloth.kernels.contact.crossing_search import BY_TRIANGLE
from warp_cloth.kernels.contact.stick_memory import SPREAD_1, SPREAD_2, SPREAD_3, SPREAD_4, SPREAD_5
from warp_cloth.study.asked import STORED, Arrays, Numbers, Part, integers, joined, ranges

TEAM, TEAMS = int(WIDTH), LISTING[0] // int(WIDTH)  # threads of a team, and teams of a block
WALKERS = LOOKING // int(WIDTH)  # teams of a block that walks a tree
BOUND = 6 * TEAM  # numbers that the boxes of a group are
MOVED = 8  # of these that are moved together
SPREAD = np.array([each.value for each in (SPREAD_1, SPREAD_2, SPREAD_3, SPREAD_4, SPREAD_5)], dtype=np.uint64)


def work_on_lists(arrays: Arrays, read: Collection[str], written: Collection[str], threads: int) -> dict[str, Part]:
    """What a launch asks for of each array that goes through a list, or makes the first of what is near; else empty.

    What found no room in a list, which is seldom, does not count.
    """
    if not arrays.keys() >= {"meetings.group", "meetings.leaf"}:
        return {}
    near = "contact.due" in written  # or what crosses is looked for
    if "meetings.group" in written:
        return walks_work(arrays) if near else crossing_walks_work(arrays, threads)
    if "meetings.group" in read:
        return groups_work(arrays, threads) if near else crossing_groups_work(arrays, threads)
    if "meetings.leaf" in read:
        return leaves_work(arrays, threads) if near else crossing_leaves_work(arrays, threads)
    return {}


def walks_work(arrays: Arrays) -> dict[str, Part]:
    """What ``meet_near`` asks for of each array, a team for each group that walks a tree; and the groups that it lists.

    Of these blocks are instructions. A walk looks at the highest boxes of all, and at those round what it meets.
    """
    edge, vertex = integers(arrays["search.edge_tree.leaf"]), integers(arrays["search.vertex"])
    edges, vertices = (np.flatnonzero(leaf[::TEAM] >= 0) for leaf in (edge, vertex))
    count = len(edge) // TEAM
    kind, group, met = listed_groups(arrays).T
    team = np.where(kind == int(ON_EDGE), group, count + group)
    own = _leaves((count + vertices) // WALKERS, vertices)
    corner = np.maximum(vertex[own[1]], 0)
    first = np.concatenate([integers(arrays["search.edges"])[edge[edges * TEAM], 0], vertex[vertices * TEAM]])
    blocks = np.concatenate([edges, count + vertices]) // WALKERS
    item = integers(arrays["search.item"])[first]
    bounds = {
        f"search.{tree}_tree.bound": _walked(integers(arrays[f"search.{tree}_tree.first"]), teams, team[on], met[on])
        for tree, teams, on in (
            ("edge", edges, kind == int(ON_EDGE)),
            ("triangle", count + vertices, kind != int(ON_EDGE)),
        )
    }
    round_edges = _box(edges // WALKERS, edges, integers(arrays["search.edge_tree.first"]))
    bounds["search.edge_tree.bound"] = joined(bounds["search.edge_tree.bound"], round_edges)
    return bounds | {
        **_put_groups(team, met),
        "search.edge_tree.leaf": (np.arange(count) // WALKERS, np.arange(count) * TEAM),
        "search.vertex": joined(
            own, (np.arange(len(vertex) // TEAM) // WALKERS, np.arange(len(vertex) // TEAM) * TEAM)
        ),
        "search.edges": (edges // WALKERS, edge[edges * TEAM]),
        "search.item": (blocks, first),
        "search.leaves": (blocks, item),
        "search.edge_tree.first": _once(edges // WALKERS),
        "search.triangle_tree.first": _once((count + vertices) // WALKERS),
        "cloth.position": (own[0], corner),
        "contact.skin": (own[0], corner),
    }


def crossing_walks_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """The same of ``meet_crossing``: groups of edges, triangles and vertices walk if any of theirs is tangled."""
    edge, triangle, vertex = (
        integers(arrays[f"search.{leaf}"]) for leaf in ("edge_tree.leaf", "triangle_tree.leaf", "vertex")
    )
    trees = [len(leaf) // TEAM for leaf in (edge, triangle)]
    edges, triangles, vertices = (np.flatnonzero(leaf[::TEAM] >= 0) for leaf in (edge, triangle, vertex))
    vertices = vertices[: threads // TEAM - sum(trees)] if threads // TEAM > sum(trees) else vertices[:0]
    kind, group, met = listed_groups(arrays).T
    by_triangle, by_vertex = kind == int(BY_TRIANGLE), kind == int(ON_TRIANGLE)
    team = group + trees[0] * (by_triangle | by_vertex) + trees[1] * by_vertex
    first = [integers(arrays[f"search.{tree}_tree.first"]) for tree in ("edge", "triangle")]
    ends, corners = _leaves(edges // WALKERS, edges), _leaves((trees[0] + triangles) // WALKERS, triangles)
    own = _leaves((sum(trees) + vertices) // WALKERS, vertices)
    walking = np.unique(group[by_vertex])
    walked = _leaves((sum(trees) + walking) // WALKERS, walking)
    tangled = [
        (np.repeat(block, columns), integers(arrays[f"search.{name}"])[leaf].ravel())
        for (block, leaf), name, columns in ((ends, "ends", 2), (corners, "corners", 3))
    ]
    return {
        **_put_groups(team, met),
        "search.edge_tree.leaf": (np.arange(trees[0]) // WALKERS, np.arange(trees[0]) * TEAM),
        "search.triangle_tree.leaf": ((trees[0] + np.arange(trees[1])) // WALKERS, np.arange(trees[1]) * TEAM),
        "search.edge_tree.bound": _walked(first[0], np.unique(team[by_triangle]), team[by_triangle], met[by_triangle]),
        "search.triangle_tree.bound": _walked(
            first[1], np.unique(team[~by_triangle]), team[~by_triangle], met[~by_triangle]
        ),
        "search.ends": ends,
        "search.corners": corners,
        "search.tangled": joined(*tangled, (own[0], np.maximum(vertex[own[1]], 0))),
        "search.vertex": own,
        "cloth.position": (walked[0], np.maximum(vertex[walked[1]], 0)),
        "contact.skin": (walked[0], np.maximum(vertex[walked[1]], 0)),
    }


def groups_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """What ``find_near_leaves`` asks for of each array, a team for each listed pair of groups; and what it lists.

    Of that blocks are instructions: a thread lists its leaves one after another, a team's threads side by side.
    """
    kind, group, met = listed_groups(arrays).T
    block = np.arange(len(kind)) % max(threads // TEAM, 1) // TEAMS
    on_edge = kind == int(ON_EDGE)
    edges, others = block[on_edge], block[~on_edge]
    vertices = _leaves(others, group[~on_edge])
    vertex = np.maximum(integers(arrays["search.vertex"])[vertices[1]], 0)
    of_edges = np.tile(edges, 2), np.concatenate([group[on_edge], met[on_edge]])
    edge_first, triangle_first = (integers(arrays[f"search.{tree}_tree.first"]) for tree in ("edge", "triangle"))
    return {
        "meetings.count": _first_of_blocks(threads),
        "meetings.group": (block, np.arange(len(kind))),
        **_put_leaves(arrays),
        "search.edge_tree.first": _once(edges),
        "search.triangle_tree.first": _once(others),
        "search.edge_tree.bound": joined(_boxes(*of_edges), _box(edges, met[on_edge], edge_first)),
        "search.ends": _leaves(*of_edges),
        "search.triangle_tree.bound": joined(
            _boxes(others, met[~on_edge]), _box(others, met[~on_edge], triangle_first)
        ),
        "search.corners": _leaves(others, met[~on_edge]),
        "search.vertex": vertices,
        "cloth.position": (vertices[0], vertex),
        "contact.skin": (vertices[0], vertex),
    }


def crossing_groups_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """The same of ``find_crossing_leaves``: of edges, or vertices, and triangles, whichever of them asked."""
    kind, group, met = listed_groups(arrays).T
    block = np.arange(len(kind)) % max(threads // TEAM, 1) // TEAMS
    by_triangle, on_edge = kind == int(BY_TRIANGLE), kind != int(ON_TRIANGLE)
    asking, triangles = np.where(by_triangle, met, group), np.where(by_triangle, group, met)
    looked, ends = _leaves(block[by_triangle], asking[by_triangle]), integers(arrays["search.ends"])
    goes_on = groups_that_go_on(arrays)
    edges, on = on_edge & goes_on, block[goes_on]
    vertices = _leaves(block[~on_edge], group[~on_edge])
    first = integers(arrays["search.triangle_tree.first"])
    return {
        "meetings.count": _first_of_blocks(threads),
        "meetings.group": (block, np.arange(len(kind))),
        **_put_leaves(arrays),
        "search.triangle_tree.first": _once(on),
        "search.triangle_tree.bound": joined(_boxes(on, triangles[goes_on]), _box(on, triangles[goes_on], first)),
        "search.corners": _leaves(on, triangles[goes_on]),
        "search.edge_tree.bound": _boxes(block[edges], asking[edges]),
        "search.ends": joined(looked, _leaves(block[edges], asking[edges])),
        "search.tangled": (np.repeat(looked[0], 2), ends[looked[1]].ravel()),
        "search.vertex": vertices,
        "cloth.position": (vertices[0], np.maximum(integers(arrays["search.vertex"])[vertices[1]], 0)),
    }


def groups_that_go_on(arrays: Arrays) -> NDArray[np.bool_]:
    """Of each listed pair of groups, whether its leaves are looked at: edges that are tangled ask by themselves."""
    kind, _, met = listed_groups(arrays).T
    goes_on = np.ones(len(kind), dtype=bool)
    by_triangle = kind == int(BY_TRIANGLE)
    ends = integers(arrays["search.ends"])[_leaves(met[by_triangle], met[by_triangle])[1]]
    goes_on[by_triangle] = ~integers(arrays["search.tangled"])[ends].reshape(-1, 2 * TEAM).any(axis=1)
    return goes_on


def leaves_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """What ``find_pairs`` asks for of each array, a thread for each listed pair of leaves; and the pairs that it keeps.

    Of these blocks are instructions, as of ``groups_work``.
    """
    part, row, asking, met = listed_leaves(arrays)
    block, instruction = _threads_of_leaves(part, row, threads)
    corners, on_edge = leaf_corners(arrays, asking, met)
    pair = kept_pairs(arrays, corners, on_edge)
    kept = pair >= 0
    leaning = kept.copy()
    leaning[kept] = arrays["contact.lean"].numpy()[pair[kept]].any(axis=1)
    fours = np.repeat(block, 4), corners.ravel()
    edges = np.tile(block[on_edge], 2), np.concatenate([asking[on_edge], met[on_edge]])
    together = 2 * instruction[kept] + on_edge[kept]
    slot = np.empty(len(together), dtype=np.int64)
    slot[np.argsort(together, kind="stable")] = np.arange(len(together))
    asked = joined((block[kept], corners[kept, 0]), (block[kept & on_edge], corners[kept & on_edge, 1]))
    places = len(arrays["memory.place"]) - 1
    remembered = block[leaning], pair[leaning]
    return {
        "meetings.count": _counts_of_parts(threads),
        "meetings.leaf": (block, part * (len(arrays["meetings.leaf"]) // int(PARTS)) + row),
        "search.corners": (block[~on_edge], met[~on_edge]),
        "search.ends": edges,
        "search.edge_tree.leaf": edges,
        "cloth.position": fours,
        "contact.skin": fours,
        "contact.thickness": (np.repeat(block[kept], 2), corners[kept][:, [0, 3]].ravel()),
        "search.near_start": (np.tile(asked[0], 2), np.concatenate([asked[1], asked[1] + 1])),
        "search.near": _near(arrays, *asked),
        **dict.fromkeys(("contact.way", "contact.stride", "contact.turn"), _once(block[kept])),
        "memory.search": _once(block[leaning]),
        "memory.place": (block[leaning], pair_numbers(corners[leaning], on_edge[leaning]).astype(np.int64) & places),
        **dict.fromkeys(("memory.corners", "memory.kind", "memory.lean"), remembered),
        STORED + "contact.count": _once(np.unique(together)),
        **dict.fromkeys(("contact.corners", "contact.kind", "contact.lean", "contact.due"), (together, slot)),
    }


def crossing_leaves_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """What ``part_crossings`` asks for of each array, a thread for each listed pair.

    Of those that cross only the number is known; each shifts five vertices, number by number.
    """
    part, row, asking, met = listed_leaves(arrays)
    block, _ = _threads_of_leaves(part, row, threads)
    on_edge = asking >= 0
    edge = integers(arrays["search.edge_tree.leaf"])[asking[on_edge]]
    triangle = integers(arrays["search.triangle_tree.leaf"])[met]
    corners = integers(arrays["search.triangles"])[triangle]
    vertex = -1 - asking[~on_edge]
    asked = joined(
        (np.repeat(block, 3), corners.ravel()),
        (np.repeat(block[on_edge], 2), integers(arrays["search.edges"])[edge].ravel()),
        (block[~on_edge], vertex),
    )
    shifted = np.arange(5 * int(arrays["untangling.count"].numpy()[0])) % len(arrays["search.tangled"])
    return {
        "meetings.count": _counts_of_parts(threads),
        "meetings.leaf": (block, part * (len(arrays["meetings.leaf"]) // int(PARTS)) + row),
        "search.edge_tree.leaf": (block[on_edge], asking[on_edge]),
        "search.triangle_tree.leaf": (block, met),
        "search.edges": (block[on_edge], edge),
        "search.triangles": (block[on_edge], triangle[on_edge]),
        "search.corners": (block[~on_edge], met[~on_edge]),
        "cloth.position": asked,
        "untangling.beyond": (np.arange(len(vertex)), vertex),
        "untangling.sum": (np.arange(4 * len(shifted)), np.repeat(shifted, 4)),
        "untangling.crosses": (np.arange(len(shifted)), shifted),
    }


def listed_groups(arrays: Arrays) -> Numbers:
    """What is asked for, the group that asks and the one that it meets, of each listed pair of groups, shape [N, 3]."""
    groups = arrays["meetings.group"]
    return integers(groups)[: int(arrays["meetings.count"].numpy()[int(GROUPS)])]


def listed_leaves(arrays: Arrays) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Of each listed pair of leaves the part of the list, the row there, what asks, and what it meets."""
    room = len(arrays["meetings.leaf"]) // int(PARTS)
    leaves = integers(arrays["meetings.leaf"])[: room * int(PARTS)].reshape(int(PARTS), room, 2)
    counts = arrays["meetings.count"].numpy()[int(LEAVES_MET) * int(APART) :: int(APART)]
    here = np.arange(room) < counts[:, None]
    part, row = np.nonzero(here)
    return part, row, leaves[here][:, 0], leaves[here][:, 1]


def leaf_corners(arrays: Arrays, asking: Numbers, met: Numbers) -> tuple[Numbers, NDArray[np.bool_]]:
    """The four vertices of each pair of leaves, shape [N, 4], as a pair of cloth has them; whether it is of edges."""
    on_edge = asking >= 0
    corners = np.empty((len(asking), 4), dtype=np.int64)
    corners[~on_edge, 0] = -1 - asking[~on_edge]
    corners[~on_edge, 1:] = integers(arrays["search.corners"])[met[~on_edge]]
    leaf, ends = integers(arrays["search.edge_tree.leaf"]), integers(arrays["search.ends"])
    one, two = asking[on_edge], met[on_edge]
    before = leaf[one] < leaf[two]
    corners[on_edge, :2] = ends[np.where(before, one, two)]
    corners[on_edge, 2:] = ends[np.where(before, two, one)]
    return corners, on_edge


def kept_pairs(arrays: Arrays, corners: Numbers, on_edge: NDArray[np.bool_]) -> Numbers:
    """Which of the pairs of cloth each pair of leaves became; -1: none."""
    count = min(int(arrays["contact.count"].numpy()[0]), len(arrays["contact.corners"]))
    if not count:
        return np.full(len(corners), -1)
    kinds = arrays["contact.kind"].numpy()[:count] & 1
    numbers = pair_numbers(integers(arrays["contact.corners"])[:count], kinds == int(ON_EDGE))
    order = np.argsort(numbers)
    wanted = pair_numbers(corners, on_edge)
    found = order[np.minimum(np.searchsorted(numbers, wanted, sorter=order), count - 1)]
    return np.where(numbers[found] == wanted, found, -1)


def pair_numbers(corners: Numbers, on_edge: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """A number of each pair's own, whatever its vertices."""
    numbers = np.zeros(len(corners), dtype=np.uint64)
    for column, odd in zip((*corners.T, on_edge), SPREAD, strict=True):
        numbers = (numbers ^ (numbers >> np.uint64(29)) ^ column.astype(np.uint64)) * (odd * odd)
    return numbers ^ (numbers >> np.uint64(32))


def _threads_of_leaves(part: Numbers, row: Numbers, threads: int) -> Part:
    """The blocks that go through listed leaves, and a number for those that the threads of a team take at once."""
    turn = row // TEAM  # of a part's teams one after another
    block = (turn % max(threads // (TEAM * int(PARTS)), 1) * int(PARTS) + part) // TEAMS
    return block, turn * int(PARTS) + part


def _put_groups(team: Numbers, met: Numbers) -> dict[str, Part]:
    """The instructions that counted and listed pairs of groups, and the places of the count and in the list.

    A thread of a team lists what it has found on a step of its walk, one after another.
    """
    step, place = team * (1 + met.max(initial=0) // TEAM) + met // TEAM, np.arange(len(team))
    turn = place - np.maximum.accumulate(np.where(np.diff(step, prepend=-1) != 0, place, 0))
    return {STORED + "meetings.count": _once(np.unique(team)), "meetings.group": (team * TEAM + turn, place)}


def _put_leaves(arrays: Arrays) -> dict[str, Part]:
    """The same of leaves, each part of which has its count."""
    part, row, asking, met = listed_leaves(arrays)
    room = len(arrays["meetings.leaf"]) // int(PARTS)
    group = np.where(asking < 0, -1, asking // TEAM)  # of vertices any: a team's leaves follow each other
    new = np.ones(len(part), dtype=bool)
    new[1:] = np.diff(asking) != 0
    first = np.maximum.accumulate(np.where(new | (row == 0), np.arange(len(part)), 0))  # of what a thread lists
    team = np.cumsum((np.diff(group, prepend=-2) != 0) | (np.diff(met // TEAM, prepend=-1) != 0) | (row == 0))
    counted = team, (int(LEAVES_MET) + part) * int(APART)
    return {
        STORED + "meetings.count": counted,
        "meetings.leaf": (team * TEAM + np.arange(len(part)) - first, part * room + row),
    }


def _near(arrays: Arrays, block: Numbers, vertex: Numbers) -> Part:
    """The rows of those near vertices in the rest shape."""
    start = integers(arrays["search.near_start"])
    which, rows = ranges(start[vertex], start[vertex + 1] - start[vertex])
    return block[which], rows


def _leaves(block: Numbers, group: Numbers) -> Part:
    """Blocks, and the leaves of groups."""
    return np.repeat(block, TEAM), (group[:, None] * TEAM + np.arange(TEAM)).ravel()


def _boxes(block: Numbers, group: Numbers) -> Part:
    """Blocks, and the numbers in a tree's bounds that groups' boxes begin with, every so many."""
    step = np.arange(0, BOUND, MOVED)
    return np.repeat(block, len(step)), (group[:, None] * BOUND + step).ravel()


def _walked(first: Numbers, teams: Numbers, team: Numbers, met: Numbers) -> Part:
    """Of teams that walk a tree blocks, and the boxes that they look at, given what groups they met."""
    top = len(first) - 2
    highest = first[top] + np.arange(first[top + 1] - first[top])
    parts = [_boxes(np.repeat(teams // WALKERS, len(highest)), np.tile(highest, len(teams)))]
    parts += [_boxes(team // WALKERS, first[level] + (met >> (5 * level))) for level in range(1, top)]
    return joined(*parts)


def _box(block: Numbers, group: Numbers, first: Numbers) -> Part:
    """Blocks, and the numbers of the boxes round groups."""
    at = BOUND * (first[1] + group // TEAM) + group % TEAM
    return np.repeat(block, 6), (at[:, None] + TEAM * np.arange(6)).ravel()


def _first_of_blocks(threads: int) -> Part:
    blocks = np.arange(-(-threads // LISTING[0]))
    return blocks, np.full(len(blocks), int(GROUPS))


def _counts_of_parts(threads: int) -> Part:
    team = np.arange(-(-threads // TEAM))
    return team // TEAMS, (int(LEAVES_MET) + team % int(PARTS)) * int(APART)


def _once(block: Numbers) -> Part:
    """Blocks, each of which asks for the start of an array."""
    return block, np.zeros(len(block), dtype=np.int64)
