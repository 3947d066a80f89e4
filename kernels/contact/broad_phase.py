"""Which cloth may meet, found in steps that share the work out evenly: groups of leaves, leaves, then what they hold.

How much is near a group differs tenfold, and a GPU waits for the slowest. So a team walks the tree for a whole group
and lists the groups that it meets; then a team for each such pair lists the leaves whose boxes meet; then a thread for
each of these looks closely. What a list has no room for is worked on at once: with lists of no room at all, as on the
CPU, the first step does everything.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.contact.box_tree import (
    MOST_THREADS,
    WIDTH,
    BoxTree,
    BoxWalk,
    bit_count,
    lowest_bit,
    step_on,
    team_lane,
    team_last,
    team_threads,
)

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Threads in a block, and blocks that a core is to have registers for, of what lists leaves: a core keeps more threads
# waiting for memory if what a full list asks for does not lie in registers.
LISTING = (MOST_THREADS, 4)

GROUPS = wp.constant(wp.int32(0))  # where ``Meetings.count`` counts pairs of groups,
LEAVES_MET = wp.constant(wp.int32(1))  # and from where on pairs of leaves, in each part of their list
PARTS = wp.constant(wp.int32(32))  # of that list: counted all together, teams would wait for each other
APART = wp.constant(wp.int32(32))  # numbers from one count to the next: neighbours would wait for each other, too


@wp.struct
class Meetings:
    """Lists of what meets, each counted also beyond its room."""

    count: wp.array(dtype=wp.int32)  # of the first, and of each part of the second, shape [(1 + PARTS) APART]
    group: wp.array(dtype=wp.vec3i)  # what is asked for, the group that asks, the group of leaves that it meets
    leaf: wp.array(dtype=wp.vec2i)  # an edge's place in its tree, or -1 - a vertex, and what it meets in the tree


@wp.func
def forget_meetings(meetings: Meetings, thread: int):
    """Empties the lists, by the first thread."""
    if thread == 0:
        for part in range(LEAVES_MET + PARTS):
            meetings.count[part * APART] = 0


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

_OF_TEAM = """
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


@wp.func_native(_OF_TEAM)
def of_team(value: int, lane: int) -> int:
    """What one of a team's threads has."""
    ...


@wp.func_native(_TEAM_NUMBER)
def team_number() -> int:
    """A team's number among all of a launch; 0 on the CPU."""
    ...


@wp.func_native(_TEAM_SLOT)
def team_slot(count: wp.array(dtype=wp.int32), which: int, more: int) -> int:
    """Adds numbers of a team's threads, each its own, to a list's count: where what a thread has begins."""
    ...


@functools.cache
def meet_function(work: wp.Function, State: Any, Search: Any, First: Any, Second: Any) -> wp.Function:
    """The function that lists which groups a group meets.

    ``work`` works on such a pair: (state, search, first, second, meetings, kind, group, met), a whole team at once.
    """

    @wp.func
    def list_groups(
        state: State,
        search: Search,
        first: First,
        second: Second,
        meetings: Meetings,
        kind: int,
        group: int,
        met: int,
        mask: wp.uint32,
    ):
        """Lists those of the groups from ``met`` on that a mask tells of, or works on them where the list is full.

        Each of a team's threads has groups and a mask of its own.
        """
        room = meetings.group.shape[0]
        count = bit_count(mask)
        base = team_slot(meetings.count, GROUPS, count)
        left = wp.uint32(mask)
        slot = int(base)
        while left != wp.uint32(0) and slot < room:
            meetings.group[slot] = wp.vec3i(kind, group, met + lowest_bit(left))
            left = left & (left - wp.uint32(1))
            slot += 1
        if team_last(base + count) > room:  # all work on what one after another found no room for
            for lane in range(team_threads()):
                theirs = wp.uint32(of_team(wp.int32(left), lane))
                place = of_team(met, lane)
                while theirs != wp.uint32(0):
                    work(state, search, first, second, meetings, kind, group, place + lowest_bit(theirs))
                    theirs = theirs & (theirs - wp.uint32(1))

    @wp.func
    def meet_groups(
        state: State,
        search: Search,
        first: First,
        second: Second,
        meetings: Meetings,
        tree: BoxTree,
        start: BoxWalk,
        kind: int,
        group: int,
    ):
        """Lists the groups of leaves that a walk finds for a group, or works on them where the list is full.

        A team lists what it has found on as many steps as it has threads: each time it waits for the list's count.
        """
        met = int(0)
        mask = wp.uint32(0)
        steps = int(0)
        walk = step_on(tree, start)
        while walk.group >= 0:
            if team_lane() == steps:
                met = WIDTH * walk.group
                mask = walk.mask_1
            steps += 1
            walk = step_on(tree, walk)
            if walk.group < 0 or steps == team_threads():
                list_groups(state, search, first, second, meetings, kind, group, met, mask)
                mask = wp.uint32(0)
                steps = 0

    return meet_groups


@functools.cache
def listed_groups_function(work: wp.Function, State: Any, Search: Any, First: Any, Second: Any) -> wp.Function:
    """The function that works, as of ``meet_function``, on the pairs of groups that are listed: so many threads do."""

    @wp.func
    def go_through_groups(
        state: State, search: Search, first: First, second: Second, meetings: Meetings, thread: int, threads: int
    ):
        """Works on every so many of the listed pairs of groups, a team on each."""
        row = thread // team_threads()
        count = wp.min(meetings.count[GROUPS], meetings.group.shape[0])
        while row < count:
            pair = meetings.group[row]
            work(state, search, first, second, meetings, pair[0], pair[1], pair[2])
            row += threads // team_threads()

    return go_through_groups


@functools.cache
def list_leaves_function(work: wp.Function, State: Any, Search: Any, First: Any, Second: Any) -> wp.Function:
    """The function that lists which leaves meet.

    ``work`` works on such a pair: (state, search, first, second, asking, met), a thread on each.
    """

    @wp.func
    def list_leaves(
        state: State,
        search: Search,
        first: First,
        second: Second,
        meetings: Meetings,
        asking: int,
        group: int,
        mask: wp.uint32,
    ):
        """Lists those leaves of a group that a mask tells of, or works on them where the list is full."""
        part = team_number() & (PARTS - 1)
        room = meetings.leaf.shape[0] // PARTS
        slot = team_slot(meetings.count, (LEAVES_MET + part) * APART, bit_count(mask))
        left = wp.uint32(mask)
        while left != wp.uint32(0):
            met = WIDTH * group + lowest_bit(left)
            left = left & (left - wp.uint32(1))
            if slot < room:
                meetings.leaf[part * room + slot] = wp.vec2i(asking, met)
            else:
                work(state, search, first, second, asking, met)
            slot += 1

    return list_leaves


@functools.cache
def listed_leaves_function(work: wp.Function, State: Any, Search: Any, First: Any, Second: Any) -> wp.Function:
    """The function that works, as of ``list_leaves_function``, on the pairs of leaves that are listed."""

    @wp.func
    def go_through_leaves(
        state: State, search: Search, first: First, second: Second, meetings: Meetings, thread: int, threads: int
    ):
        """Works on every so many of the listed pairs of leaves, a team on those of a part.

        There are as many teams for every part.
        """
        part = (thread // WIDTH) & (PARTS - 1)
        row = thread // (WIDTH * PARTS) * WIDTH + (thread & (WIDTH - 1))
        room = meetings.leaf.shape[0] // PARTS
        count = wp.min(meetings.count[(LEAVES_MET + part) * APART], room)
        while row < count:
            pair = meetings.leaf[part * room + row]
            work(state, search, first, second, pair[0], pair[1])
            row += threads // PARTS

    return go_through_leaves
