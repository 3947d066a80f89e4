"""Broad phase in three steps that balance the load: pairs of groups of leaves, pairs of leaves, then the exact test.

How much is near a group differs tenfold, and a GPU waits for the slowest. So a team traverses the tree for a whole
group and lists the groups that overlap it; then a team for each such pair lists the leaves whose boxes overlap; then a
thread for each of these runs the exact test. Whatever does not fit a list is processed at once: with lists of no
capacity, as on the CPU, the first step does everything.

Every step passes on what the exact test needs, as a ``context``: see ``search_context_type``.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.block import warp_size
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
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
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Launch bounds of kernels that list leaves: threads in a block, and blocks that must fit a multiprocessor's registers.
# With more threads it hides more latency, if what only a full list needs is spilled.
LIST_LAUNCH = (MOST_THREADS, 4)

LEAF_LISTS = wp.constant(wp.int32(32))  # of equal capacity: with a single counter teams would wait for each other
GROUP_COUNT = wp.constant(wp.int32(0))  # number of the counter of pairs of groups
LEAF_COUNTS = wp.constant(wp.int32(1))  # and of the first counter of pairs of leaves, one for each of their lists
COUNTER_STRIDE = wp.constant(wp.int32(32))  # elements between counters: neighbours would share a cache line


@wp.struct
class Candidates:
    """Lists of candidate pairs; counts go on beyond the lists' capacity."""

    count: wp.array(dtype=wp.int32)  # of groups, and of each list of leaves, shape [(1 + LEAF_LISTS) COUNTER_STRIDE]
    group: wp.array(dtype=wp.vec3i)  # kind of query, the querying group, the group of leaves that it overlaps
    leaf: wp.array(dtype=wp.vec2i)  # querying edge's place in its tree, or -1 - vertex, and the leaf that it overlaps


@wp.struct
class Query:
    """What a group searches for."""

    kind: int
    group: int


@wp.func
def query_of(kind: int, group: int):
    """The query of a group."""
    query = Query()
    query.kind = kind
    query.group = group
    return query


@wp.func
def clear_candidates(candidates: Candidates, thread: int):
    """Empties the lists, by the first thread."""
    if thread == 0:
        for counter in range(LEAF_COUNTS + LEAF_LISTS):
            candidates.count[counter * COUNTER_STRIDE] = 0


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
def search_context_type(precision: str, Search: Any, Extra: Any) -> type:
    """The struct of what a search reads and writes; ``Search`` is search.ContactSearch."""

    @wp.struct
    class SearchContext:
        """The cloth, what is searched, and where what is found is stored."""

        state: cloth_types(precision).State
        search: Search
        contact: ContactData
        extra: Extra  # StickMemory where pairs are listed, Untangling where crossings are separated
        candidates: Candidates

    return SearchContext


@functools.cache
def search_context_function(precision: str, Search: Any, Extra: Any) -> wp.Function:
    """Function ``search_context``, by which kernels begin."""
    State, SearchContext = cloth_types(precision).State, search_context_type(precision, Search, Extra)

    @wp.func
    def search_context(state: State, search: Search, contact: ContactData, extra: Extra, candidates: Candidates):
        """A search's arguments in one."""
        context = SearchContext()
        context.state = state
        context.search = search
        context.contact = contact
        context.extra = extra
        context.candidates = candidates
        return context

    return search_context


@functools.cache
def walk_groups_function(find_leaves: wp.Function) -> wp.Function:
    """Function ``walk_groups``.

    ``find_leaves`` searches a pair of groups: (context, query, group of leaves), a whole team at once.
    """

    @wp.func
    def list_groups(context: Any, query: Query, first: int, mask: wp.uint32):
        """Lists the groups first + k, k the bits of a mask, or searches them where the list is full.

        Each of a team's threads has a first group and a mask of its own.
        """
        candidates = context.candidates
        capacity = candidates.group.shape[0]
        count = bit_count(mask)
        base = team_slot(candidates.count, GROUP_COUNT, count)
        left = wp.uint32(mask)
        slot = int(base)
        while left != wp.uint32(0) and slot < capacity:
            candidates.group[slot] = wp.vec3i(query.kind, query.group, first + lowest_bit(left))
            left = left & (left - wp.uint32(1))
            slot += 1
        if team_max(base + count) > capacity:  # the team searches each thread's remaining groups together
            for lane in range(warp_size()):
                others = wp.uint32(team_value(wp.int32(left), lane))
                place = team_value(first, lane)
                while others != wp.uint32(0):
                    find_leaves(context, query, place + lowest_bit(others))
                    others = others & (others - wp.uint32(1))

    @wp.func
    def walk_groups(context: Any, tree: BoxTree, start: BoxWalk, query: Query):
        """Lists the groups of leaves that a traversal visits for a query, or searches them where the list is full.

        A team lists the results of as many steps at once as it has threads: each time it waits for the list's counter.
        """
        first = int(0)
        mask = wp.uint32(0)
        steps = int(0)
        walk = start
        going = bool(True)
        while going:
            walk = advance_walk(tree, walk)  # at one place: compilers insert all that is called wherever it is
            going = walk.group >= 0
            if steps > 0 and (steps == warp_size() or not going):
                list_groups(context, query, first, mask)
                mask = wp.uint32(0)
                steps = 0
            if going:
                if team_lane() == steps:
                    first = WIDTH * walk.group
                    mask = walk.mask_1
                steps += 1

    return walk_groups


@functools.cache
def list_leaves_function(test: wp.Function) -> wp.Function:
    """Function ``list_leaves``.

    ``test`` is the exact test of a pair of leaves: (context, querying, leaf), a thread for each; ``querying`` and
    ``leaf`` as in Candidates.leaf.
    """

    @wp.func
    def list_leaves(context: Any, querying: int, group: int, mask: wp.uint32):
        """Lists the leaves of a group that a mask names, or tests them where the list is full."""
        candidates = context.candidates
        number = team_number() & (LEAF_LISTS - 1)
        capacity = candidates.leaf.shape[0] // LEAF_LISTS
        slot = team_slot(candidates.count, (LEAF_COUNTS + number) * COUNTER_STRIDE, bit_count(mask))
        left = wp.uint32(mask)
        while left != wp.uint32(0):
            leaf = WIDTH * group + lowest_bit(left)
            left = left & (left - wp.uint32(1))
            if slot < capacity:
                candidates.leaf[number * capacity + slot] = wp.vec2i(querying, leaf)
            else:
                test(context, querying, leaf)
            slot += 1

    return list_leaves


@functools.cache
def groups_kernel(precision: str, find_leaves: wp.Function, Search: Any, Extra: Any) -> wp.Kernel:
    """Kernel ``process_groups``; ``find_leaves`` of ``walk_groups_function``, types of ``search_context_type``."""
    State, search_context = cloth_types(precision).State, search_context_function(precision, Search, Extra)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=LIST_LAUNCH)
    def process_groups(
        state: State, search: Search, contact: ContactData, extra: Extra, candidates: Candidates, threads: int
    ):
        """Lists the leaves that overlap in the listed pairs of groups, a team for each pair."""
        context = search_context(state, search, contact, extra, candidates)
        row = wp.tid() // warp_size()
        count = wp.min(candidates.count[GROUP_COUNT], candidates.group.shape[0])
        while row < count:
            pair = candidates.group[row]
            find_leaves(context, query_of(pair[0], pair[1]), pair[2])
            row += threads // warp_size()

    return process_groups


@functools.cache
def leaves_kernel(precision: str, test: wp.Function, Search: Any, Extra: Any) -> wp.Kernel:
    """Kernel ``process_leaves``; ``test`` of ``list_leaves_function``, types of ``search_context_type``."""
    State, search_context = cloth_types(precision).State, search_context_function(precision, Search, Extra)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def process_leaves(
        state: State, search: Search, contact: ContactData, extra: Extra, candidates: Candidates, threads: int
    ):
        """Runs the exact test of the listed pairs of leaves. A team takes pairs of one list; all have as many teams."""
        context = search_context(state, search, contact, extra, candidates)
        thread = wp.tid()
        number = (thread // WIDTH) & (LEAF_LISTS - 1)
        row = thread // (WIDTH * LEAF_LISTS) * WIDTH + (thread & (WIDTH - 1))
        capacity = candidates.leaf.shape[0] // LEAF_LISTS
        count = wp.min(candidates.count[(LEAF_COUNTS + number) * COUNTER_STRIDE], capacity)
        while row < count:
            pair = candidates.leaf[number * capacity + row]
            test(context, pair[0], pair[1])
            row += threads // LEAF_LISTS

    return process_leaves
