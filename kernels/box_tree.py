"""A tree of boxes, eight to a node: its shape stays, and its boxes are brought up to where their cloth is."""

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.block import block_threads, wait_for_block

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

LEAVES = wp.constant(wp.int32(512))  # that a thread block boxes, with the three levels above them
FAR_OFF = wp.constant(wp.float32(3.0e38))  # lowest of nothing


@wp.struct
class BoxTree:
    """N leaves, in an order that keeps near what is near; level by level each group of eight is one box of the next.

    Of a group's boxes the memory holds the lowest x of all eight, then y and z, then the highest: a group is read
    together, and compared without waiting box after box.
    """

    leaf: wp.array(dtype=wp.int32)  # what a leaf holds; -1: nothing, shape [N], a multiple of LEAVES
    first: wp.array(dtype=wp.int32)  # group with which each level begins, and how many there are, shape [levels + 1]
    levels: int  # two to eight
    bound: wp.array(dtype=wp.float32)  # [m], shape [48 groups]
    four: wp.array(dtype=wp.vec4f)  # the same, in fours


@wp.struct
class BoxWalk:
    """How far a walk over the groups of leaves that meet a box has come. The eight threads of a team walk together."""

    lower: wp.vec3f  # of the team's box [m]
    upper: wp.vec3f
    begin: int  # only leaves from here
    end: int  # to before here are looked at
    level: int
    group: int  # in that level; where the walk stands, a group of leaves; -1: at its end
    masks: wp.uint64  # boxes of that group, and of those above it, that are still to be looked at; a byte a level


_LEAST = """
#if defined(__CUDA_ARCH__)
    const unsigned int team = 255u << (threadIdx.x & 24);
    for (int k = 1; k < 8; k <<= 1)
        for (int axis = 0; axis < 3; ++axis)
            value[axis] = fminf(value[axis], __shfl_xor_sync(team, value[axis], k));
#endif
    return value;
"""

_LAST = """
#if defined(__CUDA_ARCH__)
    const unsigned int team = 255u << (threadIdx.x & 24);
    for (int k = 1; k < 8; k <<= 1)
        value = max(value, __shfl_xor_sync(team, value, k));
#endif
    return value;
"""

_TEAM_MEETING = """
#if defined(__CUDA_ARCH__)
    const float* box = bound.data + 48 * group + (threadIdx.x & 7);
    const bool meets = (box[0] <= upper[0]) & (box[8] <= upper[1]) & (box[16] <= upper[2]) & (box[24] >= lower[0])
        & (box[32] >= lower[1]) & (box[40] >= lower[2]);
    const int lane = threadIdx.x & 24;
    return (int)((__ballot_sync(255u << lane, meets) >> lane) & 255u);
#else
    int mask = 0;
    for (int k = 0; k < 8; ++k) {
        const float* box = bound.data + 48 * group + k;
        const bool meets = (box[0] <= upper[0]) & (box[8] <= upper[1]) & (box[16] <= upper[2]) & (box[24] >= lower[0])
            & (box[32] >= lower[1]) & (box[40] >= lower[2]);
        mask |= (int)meets << k;
    }
    return mask;
#endif
"""

_LOWEST_BIT = """
#if defined(__CUDA_ARCH__)
    return __ffs(mask) - 1;
#else
    return __builtin_ctz((unsigned int)mask);
#endif
"""


@wp.func_native(_LEAST)
def team_least(value: wp.vec3f) -> wp.vec3f:
    """The least that any thread of a team has of each component; on the CPU a thread is a team by itself."""
    ...


@wp.func_native(_LAST)
def team_last(value: int) -> int:
    """The highest number that any thread of a team has."""
    ...


@wp.func_native(_TEAM_MEETING)
def team_meeting(bound: wp.array(dtype=wp.float32), group: int, lower: wp.vec3f, upper: wp.vec3f) -> int:
    """Which boxes of a group meet a team's box: a bit for each, and each looked at by one thread."""
    ...


@wp.func_native(_LOWEST_BIT)
def lowest_bit(mask: int) -> int:
    """Number of the lowest bit that is set."""
    ...


@wp.func
def within(begin: int, end: int, level: int, group: int):
    """Which boxes of a group hold any of some leaves: a bit for each."""
    first = wp.clamp((begin >> (3 * level)) - 8 * group, 0, 8)
    last = wp.clamp(((end - 1) >> (3 * level)) - 8 * group + 1, 0, 8)
    return ((1 << last) - 1) & ~((1 << first) - 1)


@wp.func
def meeting(tree: BoxTree, group: int, lower: wp.vec3f, upper: wp.vec3f, begin: int, end: int):
    """Which of some leaves in a group meet a thread's own box: a bit for each."""
    mask = int(0)
    for half in range(2):
        at = 12 * group + half
        low_x = element(tree.four, at)
        low_y = element(tree.four, at + 2)
        low_z = element(tree.four, at + 4)
        high_x = element(tree.four, at + 6)
        high_y = element(tree.four, at + 8)
        high_z = element(tree.four, at + 10)
        for k in range(4):
            gap = wp.max(low_x[k] - upper[0], lower[0] - high_x[k])
            gap = wp.max(gap, wp.max(low_y[k] - upper[1], lower[1] - high_y[k]))
            gap = wp.max(gap, wp.max(low_z[k] - upper[2], lower[2] - high_z[k]))
            mask = mask | wp.where(gap <= 0.0, 1 << (4 * half + k), 0)
    return mask & within(begin, end, 0, group)


@wp.func
def walk_from(tree: BoxTree, lower: wp.vec3f, upper: wp.vec3f, begin: int, end: int):
    """A team's walk over the groups of leaves that meet any of its threads' boxes; it stands before the first."""
    walk = BoxWalk()
    walk.lower = team_least(lower)
    walk.upper = -team_least(-upper)
    walk.begin = -team_last(-begin)
    walk.end = team_last(end)
    walk.level = tree.levels - 1
    walk.group = (walk.begin >> (3 * tree.levels)) - 1
    walk.masks = wp.uint64(0)
    return walk


@wp.func
def step_on(tree: BoxTree, walk: BoxWalk):
    """The walk at its next group of leaves."""
    level = int(walk.level)
    group = int(walk.group)
    masks = wp.uint64(walk.masks)
    going = bool(True)
    while going:
        if level == 0 and tree.levels > 1:  # on from a group of leaves
            level = 1
            group = group >> 3
        mask = int((masks >> wp.uint64(8 * level)) & wp.uint64(255))
        opened = bool(True)
        if mask == 0:
            if level < tree.levels - 1:
                level += 1
                group = group >> 3
                opened = False
            else:  # the highest level may have several groups
                group += 1
                if group >= tree.first[level + 1] - tree.first[level] or (group << (3 * level + 3)) >= walk.end:
                    group = -1
                    going = False
                    opened = False
        else:
            bit = lowest_bit(mask)
            masks = masks ^ (wp.uint64(1) << wp.uint64(8 * level + bit))
            level -= 1
            group = 8 * group + bit
        if opened:
            if level == 0:
                going = False
            else:
                mask = team_meeting(tree.bound, tree.first[level] + group, walk.lower, walk.upper)
                mask = mask & within(walk.begin, walk.end, level, group)
                masks = masks | (wp.uint64(mask) << wp.uint64(8 * level))
    walk.level = level
    walk.group = group
    walk.masks = masks
    return walk


@wp.func
def put_box(tree: BoxTree, level: int, box: int, lower: wp.vec3f, upper: wp.vec3f):
    """Puts a box where its level has it."""
    at = 48 * (tree.first[level] + (box >> 3)) + (box & 7)
    for axis in range(3):
        tree.bound[at + 8 * axis] = lower[axis]
        tree.bound[at + 24 + 8 * axis] = upper[axis]


@wp.func
def put_group(tree: BoxTree, level: int, group: int):
    """Boxes all of a group as one of the next level."""
    at = 12 * (tree.first[level] + group)
    lower = wp.vec3f()
    upper = wp.vec3f()
    for axis in range(3):
        low = wp.min(element(tree.four, at + 2 * axis), element(tree.four, at + 2 * axis + 1))
        high = wp.max(element(tree.four, at + 6 + 2 * axis), element(tree.four, at + 7 + 2 * axis))
        lower[axis] = wp.min(low)
        upper[axis] = wp.max(high)
    put_box(tree, level + 1, group, lower, upper)


@wp.func
def box_up(tree: BoxTree, block: int, lane: int):
    """Boxes the three levels above a block's leaves, once these are boxed."""
    count = int(LEAVES)
    for level in range(3):
        count = count // 8
        wait_for_block()
        if level + 1 < tree.levels:
            local = int(lane)
            while local < count:
                put_group(tree, level, block * count + local)
                local += block_threads()


@wp.func
def box_top(tree: BoxTree, lane: int):
    """Boxes all levels above those, by one block."""
    for level in range(3, tree.levels - 1):
        group = int(lane)
        while group < tree.first[level + 1] - tree.first[level]:
            put_group(tree, level, group)
            group += block_threads()
        wait_for_block()
