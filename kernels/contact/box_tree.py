"""A bounding volume hierarchy (BVH) of boxes, 32 to a node: its topology stays, its boxes are refitted to the cloth.

On a GPU a warp is a team: its threads test a node's boxes together, one each. On the CPU a thread is a team.

Why not ``wp.Bvh``: tests/benchmarks/broad_phase.py runs both over the same garments. Times of one search, ``wp.Bvh``
(refit, a thread for each query) over this tree, which lists the same pairs:

    one core of a CPU, 4,000 vertices   one T-shirt 3.1, two layers 2.3
"""

import warp as wp

from warp_cloth.kernels.base.block import block_threads, wait_for_block

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

WIDTH = wp.constant(wp.int32(32))  # boxes to a group, and threads to a team
LEAVES = wp.constant(wp.int32(1024))  # that a thread block boxes, with both levels above them
MOST_THREADS = 256  # of a block whose teams ask which leaves meet
FAR_OFF = wp.constant(wp.float32(3.0e38))  # lowest of nothing


@wp.struct
class BoxTree:
    """N leaves, in an order that keeps near what is near; level by level each group of 32 is one box of the next.

    Of a group's boxes the memory holds the lowest x of all, then y and z, then the highest.
    """

    leaf: wp.array(dtype=wp.int32)  # what a leaf holds; -1: nothing, shape [N], a multiple of LEAVES
    first: wp.array(dtype=wp.int32)  # group with which each level begins, and how many there are, shape [levels + 1]
    levels: int  # three or four; the highest may have several groups
    bound: wp.array(dtype=wp.float32)  # [m], shape [6 * 32 groups]


@wp.struct
class BoxWalk:
    """How far a team's walk over the groups of leaves that meet a box has come: 32 of them at a time."""

    lower: wp.vec3f  # of the team's box [m]
    upper: wp.vec3f
    begin: int  # only leaves from here
    end: int  # to before here are looked at
    level: int
    group: int  # in that level; where the walk stands, of 32 groups of leaves; -1: at its end
    mask_1: wp.uint32  # which of those meet the box
    # boxes of the groups above it that are still to be looked at
    mask_2: wp.uint32
    mask_3: wp.uint32


_TEAM_THREADS = """
#if defined(__CUDA_ARCH__)
    return 32;
#else
    return 1;
#endif
"""

_TEAM_LEAST = """
#if defined(__CUDA_ARCH__)
    for (int k = 1; k < 32; k <<= 1)
        for (int axis = 0; axis < 3; ++axis)
            value[axis] = fminf(value[axis], __shfl_xor_sync(0xffffffffu, value[axis], k));
#endif
    return value;
"""

_TEAM_LAST = """
#if defined(__CUDA_ARCH__)
    return __reduce_max_sync(0xffffffffu, value);
#else
    return value;
#endif
"""

_TEAM_LANE = """
#if defined(__CUDA_ARCH__)
    return threadIdx.x & 31;
#else
    return 0;
#endif
"""

_BOXES_MEETING = """
    unsigned int mask = 0;
    const float* box = bound.data + 192 * group;
    for (int k = 0; k < 32; ++k) {
        const bool meets = (box[k] <= upper[0]) & (box[32 + k] <= upper[1]) & (box[64 + k] <= upper[2])
            & (box[96 + k] >= lower[0]) & (box[128 + k] >= lower[1]) & (box[160 + k] >= lower[2]);
        mask |= (unsigned int)meets << k;
    }
"""

_TEAM_MEETING = (
    """
#if defined(__CUDA_ARCH__)
    const float* box = bound.data + 192 * group + (threadIdx.x & 31);
    return __ballot_sync(0xffffffffu, (box[0] <= upper[0]) & (box[32] <= upper[1]) & (box[64] <= upper[2])
        & (box[96] >= lower[0]) & (box[128] >= lower[1]) & (box[160] >= lower[2]));
#else
"""
    + _BOXES_MEETING
    + """
    return mask;
#endif
"""
)

_LEAVES_MEETING = (
    """
#if defined(__CUDA_ARCH__)
    // boxes that ask go through the block's own memory, which takes less than handing six numbers round for each
    __shared__ float4 asked[2 * MOST_THREADS];
    const int lane = threadIdx.x & 31;
    float4* const ask = asked + 2 * (threadIdx.x - lane);
    const float* box = bound.data + 192 * group + lane;
    const float x0 = box[0], y0 = box[32], z0 = box[64], x1 = box[96], y1 = box[128], z1 = box[160];
    const auto own = vertices.data[32 * group + lane];
    const unsigned int all = __ballot_sync(0xffffffffu, may != 0);
    const int count = __popc(all), rank = may != 0 ? __popc(all & ((1u << lane) - 1u)) : -1;
    if (may != 0) {
        ask[2 * rank] = make_float4(upper[0], upper[1], upper[2], lower[0]);
        ask[2 * rank + 1] = make_float4(lower[1], lower[2], __int_as_float(first), __int_as_float(second));
    }
    __syncwarp();
    unsigned int found = 0;
#pragma unroll 2
    for (int k = 0; k < count; ++k) {  // one of those that may after another, its box against a box of each thread
        const float4 high = ask[2 * k], low = ask[2 * k + 1];
        bool meets = (x0 <= high.x) & (y0 <= high.y) & (z0 <= high.z) & (x1 >= high.w) & (y1 >= low.x) & (z1 >= low.y);
        if (__ballot_sync(0xffffffffu, meets) == 0)
            continue;
        const int p = __float_as_int(low.z), q = __float_as_int(low.w);
#pragma unroll
        for (int c = 0; c < CORNERS; ++c)
            meets = meets & (own[c] != p) & (own[c] != q);
        const unsigned int mask = __ballot_sync(0xffffffffu, meets);
        if (rank == k)
            found = mask;
    }
    __syncwarp();
    return found;
#else
    if (may == 0)
        return 0;
"""
    + _BOXES_MEETING
    + """
    unsigned int found = mask;
    for (unsigned int left = mask; left != 0; left &= left - 1) {
        const int at = __builtin_ctz(left);
        const auto own = vertices.data[32 * group + at];
        for (int k = 0; k < CORNERS; ++k)
            if (own[k] == first || own[k] == second)
                found &= ~(1u << at);
    }
    return found;
#endif
"""
)

_BIT_COUNT = """
#if defined(__CUDA_ARCH__)
    return __popc(mask);
#else
    return __builtin_popcount(mask);
#endif
"""

_LOWEST_BIT = """
#if defined(__CUDA_ARCH__)
    return __ffs(mask) - 1;
#else
    return __builtin_ctz(mask);
#endif
"""

_GROUP_LEAST = """
    const float* box = bound.data + 192 * group + 96 * upper;
    wp::vec3 least;
    for (int axis = 0; axis < 3; ++axis) {
#if defined(__CUDA_ARCH__)
        float value = sign * box[32 * axis + (threadIdx.x & 31)];
        for (int k = 1; k < 32; k <<= 1)
            value = fminf(value, __shfl_xor_sync(0xffffffffu, value, k));
#else
        float value = sign * box[32 * axis];
        for (int k = 1; k < 32; ++k)
            value = sign * box[32 * axis + k] < value ? sign * box[32 * axis + k] : value;
#endif
        least[axis] = sign * value;
    }
    return least;
"""


@wp.func_native(_TEAM_THREADS)
def team_threads() -> int:
    """How many threads a team has."""
    ...


@wp.func_native(_TEAM_LEAST)
def team_least(value: wp.vec3f) -> wp.vec3f:
    """The least that any thread of a team has of each component."""
    ...


@wp.func_native(_TEAM_LAST)
def team_last(value: int) -> int:
    """The highest number that any thread of a team has."""
    ...


@wp.func_native(_TEAM_MEETING)
def team_meeting(bound: wp.array(dtype=wp.float32), group: int, lower: wp.vec3f, upper: wp.vec3f) -> wp.uint32:
    """Which boxes of a group meet a team's box: a bit for each."""
    ...


@wp.func_native(_TEAM_LANE)
def team_lane() -> int:
    """A thread's number in its team."""
    ...


@wp.func_native(_BIT_COUNT)
def bit_count(mask: wp.uint32) -> int:
    """How many bits are set."""
    ...


for _corners, _dtype in ((2, wp.vec2i), (3, wp.vec3i)):

    @wp.func_native(_LEAVES_MEETING.replace("CORNERS", str(_corners)).replace("MOST_THREADS", str(MOST_THREADS)))
    def boxes_meeting(
        bound: wp.array(dtype=wp.float32),
        vertices: wp.array(dtype=_dtype),
        group: int,
        lower: wp.vec3f,
        upper: wp.vec3f,
        first: int,
        second: int,
        may: int,
    ) -> wp.uint32:
        """Which leaves of a group meet a thread's own box and have neither of two vertices: a bit for each.

        ``vertices`` are the leaves'. A whole team asks at once; ``may``: whether there may be any.
        """
        ...


@wp.func_native(_LOWEST_BIT)
def lowest_bit(mask: wp.uint32) -> int:
    """Number of the lowest bit that is set."""
    ...


@wp.func_native(_GROUP_LEAST)
def group_bound(bound: wp.array(dtype=wp.float32), group: int, upper: int, sign: float) -> wp.vec3f:
    """The least, or for a sign of -1 the most, of the lower bounds of a group's boxes, or where that is 1 the upper."""
    ...


@wp.func
def below(count: int):
    """As many of the lowest bits as counted, none to 32."""
    some = (wp.uint32(1) << wp.uint32(count & 31)) - wp.uint32(1)
    return wp.where(count <= 0, wp.uint32(0), wp.where(count >= WIDTH, ~wp.uint32(0), some))


@wp.func
def within(begin: int, end: int, level: int, group: int):
    """Which boxes of a group hold any of some leaves: a bit for each."""
    first = (begin >> (5 * level)) - WIDTH * group
    last = ((end - 1) >> (5 * level)) - WIDTH * group + 1
    return below(last) & ~below(first)


@wp.func
def walk_from(tree: BoxTree, lower: wp.vec3f, upper: wp.vec3f, begin: int, end: int):
    """A team's walk over the groups of leaves that meet any of its threads' boxes; it stands before the first."""
    walk = BoxWalk()
    walk.lower = team_least(lower)
    walk.upper = -team_least(-upper)
    walk.begin = -team_last(-begin)
    walk.end = team_last(end)
    walk.level = tree.levels - 1
    walk.group = (walk.begin >> (5 * tree.levels)) - 1
    return walk


@wp.func
def step_on(tree: BoxTree, walk: BoxWalk):
    """The walk at its next 32 groups of leaves of which some meet its box; ``mask_1`` tells which."""
    level = int(walk.level)
    group = int(walk.group)
    mask_1 = wp.uint32(0)
    mask_2 = wp.uint32(walk.mask_2)
    mask_3 = wp.uint32(walk.mask_3)
    if level == 1:  # on from there
        level = 2
        group = group >> 5
    going = bool(True)
    while going:
        mask = wp.where(level == 2, mask_2, mask_3)
        if mask == wp.uint32(0) and level < tree.levels - 1:
            level += 1
            group = group >> 5
        else:
            if mask == wp.uint32(0):  # the highest level may have several groups
                group += 1
                going = group < tree.first[level + 1] - tree.first[level] and (group << (5 * level + 5)) < walk.end
                group = wp.where(going, group, -1)
            else:
                mask_2 = wp.where(level == 2, mask & (mask - wp.uint32(1)), mask_2)
                mask_3 = wp.where(level == 3, mask & (mask - wp.uint32(1)), mask_3)
                group = WIDTH * group + lowest_bit(mask)
                level -= 1
            if going:
                mask = team_meeting(tree.bound, tree.first[level] + group, walk.lower, walk.upper)
                mask = mask & within(walk.begin, walk.end, level, group)
                mask_2 = wp.where(level == 2, mask, mask_2)
                mask_3 = wp.where(level == 3, mask, mask_3)
                if level == 1:
                    mask_1 = wp.uint32(mask)
                    going = mask == wp.uint32(0)
                    if going:
                        level = 2
                        group = group >> 5
    walk.level = level
    walk.group = group
    walk.mask_1 = mask_1
    walk.mask_2 = mask_2
    walk.mask_3 = mask_3
    return walk


@wp.func
def put_box(tree: BoxTree, level: int, box: int, lower: wp.vec3f, upper: wp.vec3f):
    """Puts a box where its level has it."""
    at = 192 * (tree.first[level] + (box >> 5)) + (box & 31)
    for axis in range(3):
        tree.bound[at + 32 * axis] = lower[axis]
        tree.bound[at + 96 + 32 * axis] = upper[axis]


@wp.func
def box_groups(tree: BoxTree, level: int, begin: int, count: int, lane: int):
    """Boxes some groups of a level, each as one of the next, by a block's teams."""
    local = lane // team_threads()
    while local < count:
        group = begin + local
        lower = group_bound(tree.bound, tree.first[level] + group, 0, 1.0)
        upper = group_bound(tree.bound, tree.first[level] + group, 1, -1.0)
        if lane % team_threads() == 0:
            put_box(tree, level + 1, group, lower, upper)
        local += wp.max(block_threads() // team_threads(), 1)


@wp.func
def box_up(tree: BoxTree, block: int, lane: int):
    """Boxes both levels above a block's leaves, once these are boxed."""
    wait_for_block()
    box_groups(tree, 0, block * (LEAVES // WIDTH), LEAVES // WIDTH, lane)
    wait_for_block()
    box_groups(tree, 1, block, 1, lane)


@wp.func
def box_of(tree: BoxTree, level: int, box: int):
    """A box of a level [m]."""
    at = 192 * (tree.first[level] + (box >> 5)) + (box & 31)
    lower = wp.vec3f(tree.bound[at], tree.bound[at + 32], tree.bound[at + 64])
    return lower, wp.vec3f(tree.bound[at + 96], tree.bound[at + 128], tree.bound[at + 160])


@wp.func
def may_meet(tree: BoxTree, group: int, lower: wp.vec3f, upper: wp.vec3f):
    """Whether a box may meet any leaf of a group: 1 or 0."""
    low, high = box_of(tree, 1, group)
    return wp.where(wp.max(low - upper) > 0.0 or wp.max(lower - high) > 0.0, 0, 1)
