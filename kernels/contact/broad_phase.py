"""Broad phase in three steps that balance the load: pairs of groups of leaves, pairs of leaves, then the exact test.

How much is near a group differs tenfold, and a GPU waits for the slowest. So a team traverses the tree for a whole
group and lists the groups that overlap it; then a team for each such pair lists the leaves whose boxes overlap; then a
thread for each of these runs the exact test. Whatever does not fit a list is worked on at once: with lists of no
capacity, as on the CPU, the first step does everything.

The factories take the types of the kernels' arguments (state, search, contact and one more, ``extra``) and the function
that works on a candidate.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.box_tree import (
    MOST_THREADS,
    WIDTH,
    BoxTree,
    BoxWalk,
    advance_walk,
    bit_count,
    lowest_bit,
    team_lane,
    team_max,
    team_threads,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Launch bounds of kernels that list leaves: threads in a block, and blocks that must fit a core's registers. A core
# hides more latency with more threads, if what only a full list needs is spilled.
LIST_LAUNCH = (MOST_THREADS, 4)

GROUP_COUNT = wp.constant(wp.int32(0))  # number of the counter of pairs of groups
LEAF_COUNTS = wp.constant(wp.int32(1))  # and of the first counter of pairs of leaves, one for each part of their list
LIST_PARTS = wp.constant(wp.int32(32))  # with a single counter teams would wait for each other
COUNTER_STRIDE = wp.constant(wp.int32(32))  # elements between counters: neighbours would share a cache line


@wp.struct
class Candidates:
    """Lists of candidate pairs; counts go on beyond the lists' capacity."""

    count: wp.array(dtype=wp.int32)  # of groups, and of each part of leaves, shape [(1 + LIST_PARTS) COUNTER_STRIDE]
    group: wp.array(dtype=wp.vec3i)  # kind of query, the querying group, the group of leaves that it overlaps
    leaf: wp.array(dtype=wp.vec2i)  # querying edge's place in its tree, or -1 - vertex, and the leaf that it overlaps


@wp.struct
class Query:
    """What a group searches for."""

    kind: int
    group: int


@wp.func
def clear_candidates(candidates: Candidates, thread: int):
    """Empties the lists, by the first thread."""
    if thread == 0:
        for part in range(LEAF_COUNTS + LIST_PARTS):
            candidates.count[part * COUNTER_STRIDE] = 0


_TEAM_SLOT = """
#if defined(__CUDA_ARCH__)
    const int lane = threadIdx.x & 31;
    int through = more;
    for (int k = 1; k < 32; k <<= 1) {
        const int below = __shfl_up_sync(0xffffffffu, through, k);
        if (lane >= k)
            through += below;
    }
    int base = 0;
    if (lane == 31 && through > 0)
        base = atomicAdd(count.data + which, through);
    return __shfl_sync(0xffffffffu, base, 31) + through - more;
#else
    return wp::atomic_add(count, which, more);
#endif
"""

_TEAM_VALUE = """
#if defined(__CUDA_ARCH__)
    return __shfl_sync(0xffffffffu, value, lane);
#else
    return value;
#endif
"""

_TEAM_NUMBER = """
#if defined(__CUDA_ARCH__)
    return (int)((blockIdx.x * blockDim.x + threadIdx.x) >> 5);
#else
    return 0;
#endif
"""


@wp.func_native(_TEAM_VALUE)
def team_value(value: int, lane: int) -> int:
    """The value of one of a team's threads."""
    ...


@wp.func_native(_TEAM_NUMBER)
def team_number() -> int:
    """A team's number in its launch; 0 on the CPU."""
    ...


@wp.func_native(_TEAM_SLOT)
def team_slot(count: wp.array(dtype=wp.int32), which: int, more: int) -> int:
    """Reserves ``more`` list entries for each of a team's threads; returns the thread's first, capacity or not."""
    ...


@functools.cache
def list_groups_function(work: wp.Function, State: Any, Search: Any, Extra: Any) -> wp.Function:
    """Function ``list_groups``; arguments as in ``walk_groups_function``."""

    @wp.func
    def list_groups(
        state: State,
        search: Search,
        contact: ContactData,
        extra: Extra,
        candidates: Candidates,
        query: Query,
        first: int,
        mask: wp.uint32,
    ):
        """Lists the groups first + k, k the bits of a mask, or works on them where the list is full.

        Each of a team's threads has a first group and a mask of its own.
        """
        capacity = candidates.group.shape[0]
        count = bit_count(mask)
        base = team_slot(candidates.count, GROUP_COUNT, count)
        left = wp.uint32(mask)
        slot = int(base)
        while left != wp.uint32(0) and slot < capacity:
            candidates.group[slot] = wp.vec3i(query.kind, query.group, first + lowest_bit(left))
            left = left & (left - wp.uint32(1))
            slot += 1
        if team_max(base + count) > capacity:  # the whole team works on each thread's remaining groups in turn
            for lane in range(team_threads()):
                others = wp.uint32(team_value(wp.int32(left), lane))
                place = team_value(first, lane)
                while others != wp.uint32(0):
                    work(state, search, contact, extra, candidates, query, place + lowest_bit(others))
                    others = others & (others - wp.uint32(1))

    return list_groups


@functools.cache
def walk_groups_function(work: wp.Function, State: Any, Search: Any, Extra: Any) -> wp.Function:
    """Function ``walk_groups``.

    ``work`` works on a pair of groups: (state, search, contact, extra, candidates, query, group of leaves), a whole
    team at once.
    """
    list_groups = list_groups_function(work, State, Search, Extra)

    @wp.func
    def walk_groups(
        state: State,
        search: Search,
        contact: ContactData,
        extra: Extra,
        candidates: Candidates,
        tree: BoxTree,
        start: BoxWalk,
        query: Query,
    ):
        """Lists the groups of leaves that a traversal visits for a query, or works on them where the list is full.

        A team lists the results of as many steps at once as it has threads: each time it waits for the list's counter.
        """
        first = int(0)
        mask = wp.uint32(0)
        steps = int(0)
        walk = advance_walk(tree, start)
        while walk.group >= 0:
            if team_lane() == steps:
                first = WIDTH * walk.group
                mask = walk.mask_1
            steps += 1
            walk = advance_walk(tree, walk)
            if walk.group < 0 or steps == team_threads():
                list_groups(state, search, contact, extra, candidates, query, first, mask)
                mask = wp.uint32(0)
                steps = 0

    return walk_groups


@functools.cache
def process_groups_function(work: wp.Function, State: Any, Search: Any, Extra: Any) -> wp.Function:
    """Function ``process_groups``; arguments as in ``walk_groups_function``."""

    @wp.func
    def process_groups(
        state: State,
        search: Search,
        contact: ContactData,
        extra: Extra,
        candidates: Candidates,
        thread: int,
        threads: int,
    ):
        """Works on a thread's share of the listed pairs of groups, a team on each."""
        row = thread // team_threads()
        count = wp.min(candidates.count[GROUP_COUNT], candidates.group.shape[0])
        while row < count:
            pair = candidates.group[row]
            query = Query()
            query.kind = pair[0]
            query.group = pair[1]
            work(state, search, contact, extra, candidates, query, pair[2])
            row += threads // team_threads()

    return process_groups


@functools.cache
def list_leaves_function(work: wp.Function, State: Any, Search: Any, Extra: Any) -> wp.Function:
    """Function ``list_leaves``.

    ``work`` works on a pair of leaves: (state, search, contact, extra, querying, leaf), a thread on each; ``querying``
    and ``leaf`` as in Candidates.leaf.
    """

    @wp.func
    def list_leaves(
        state: State,
        search: Search,
        contact: ContactData,
        extra: Extra,
        candidates: Candidates,
        querying: int,
        group: int,
        mask: wp.uint32,
    ):
        """Lists the leaves of a group that a mask names, or works on them where the list is full."""
        part = team_number() & (LIST_PARTS - 1)
        capacity = candidates.leaf.shape[0] // LIST_PARTS
        slot = team_slot(candidates.count, (LEAF_COUNTS + part) * COUNTER_STRIDE, bit_count(mask))
        left = wp.uint32(mask)
        while left != wp.uint32(0):
            leaf = WIDTH * group + lowest_bit(left)
            left = left & (left - wp.uint32(1))
            if slot < capacity:
                candidates.leaf[part * capacity + slot] = wp.vec2i(querying, leaf)
            else:
                work(state, search, contact, extra, querying, leaf)
            slot += 1

    return list_leaves


@functools.cache
def process_leaves_function(work: wp.Function, State: Any, Search: Any, Extra: Any) -> wp.Function:
    """Function ``process_leaves``; arguments as in ``list_leaves_function``."""

    @wp.func
    def process_leaves(
        state: State,
        search: Search,
        contact: ContactData,
        extra: Extra,
        candidates: Candidates,
        thread: int,
        threads: int,
    ):
        """Works on a thread's share of the listed pairs of leaves; a team takes pairs of one part of the list.

        Every part has as many teams.
        """
        part = (thread // WIDTH) & (LIST_PARTS - 1)
        row = thread // (WIDTH * LIST_PARTS) * WIDTH + (thread & (WIDTH - 1))
        capacity = candidates.leaf.shape[0] // LIST_PARTS
        count = wp.min(candidates.count[(LEAF_COUNTS + part) * COUNTER_STRIDE], capacity)
        while row < count:
            pair = candidates.leaf[part * capacity + row]
            work(state, search, contact, extra, pair[0], pair[1])
            row += threads // LIST_PARTS

    return process_leaves
