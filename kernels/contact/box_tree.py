"""A bounding volume hierarchy (BVH) of boxes, 32 to a node: its topology stays, its boxes are refitted to the cloth.

On a GPU a warp is a team: its threads test a node's boxes together, one each. On the CPU a thread is a team.

Why not ``wp.Bvh``: both list the same pairs, and it takes longer. Time of one search by ``wp.Bvh`` (refit, a thread for
each query) over that by this tree, by tests/benchmarks/broad_phase.py of commit 3ba508b:

    one core of a CPU   3.3 (one T-shirt that hangs front on back), 2.4 (two layers), at 4,000 vertices
    NVIDIA H200         6.8, 4.8, 3.6 (one T-shirt), 7.7, 6.1, 4.2 (two layers), at 4,000, 16,000 and 65,000
"""

import warp as wp

from warp_cloth.kernels.base.block import block_threads, wait_for_block, warp_size

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

WIDTH = wp.constant(wp.int32(32))  # boxes in a group, and threads in a team
LEAVES = wp.constant(wp.int32(1024))  # that a thread block refits, with the two levels above them
MOST_THREADS = 256  # of a block that calls leaf_overlaps
EMPTY_BOUND = wp.constant(wp.float32(3.0e38))  # lower bound of an empty box; its upper bound is the negative


@wp.struct
class BoxTree:
    """N leaves in spatial order; each group of 32 boxes of a level is one box of the next.

    Layout of a group's boxes: the least x of all 32, then y and z, then the greatest.
    """

    leaf: wp.array(dtype=wp.int32)  # edge or triangle of each leaf, -1: none, shape [N], N a multiple of LEAVES
    first: wp.array(dtype=wp.int32)  # first group of each level, and the group count, shape [levels + 1]
    levels: int  # three or four; the highest may have several groups
    bound: wp.array(dtype=wp.float32)  # [m], shape [6 * 32 groups]


@wp.struct
class BoxWalk:
    """State of a team's traversal: the groups of leaves that overlap a box, 32 groups at a time."""

    lower: wp.vec3f  # of the team's box [m]
    upper: wp.vec3f
    begin: int  # leaves from here
    end: int  # to before here are visited
    level: int
    group: int  # current one, in that level; its boxes are 32 groups of leaves; -1: at the end
    mask_1: wp.uint32  # which of those overlap the box
    # boxes of the groups above it that are yet to be visited
    mask_2: wp.uint32
    mask_3: wp.uint32


_TEAM_MIN = """
#if defined(__CUDA_ARCH__)
    for (int k = 1; k < 32; k <<= 1)
        for (int axis = 0; axis < 3; ++axis)
            value[axis] = fminf(value[axis], __shfl_xor_sync(0xffffffffu, value[axis], k));
#endif
    return value;
"""

_TEAM_MAX = """
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

_BOX_OVERLAPS = """
    unsigned int mask = 0;
    const float* box = bound.data + 192 * group;
    for (int k = 0; k < 32; ++k) {
        const bool overlaps = (box[k] <= upper[0]) & (box[32 + k] <= upper[1]) & (box[64 + k] <= upper[2])
            & (box[96 + k] >= lower[0]) & (box[128 + k] >= lower[1]) & (box[160 + k] >= lower[2]);
        mask |= (unsigned int)overlaps << k;
    }
"""

_TEAM_OVERLAPS = (
    """
#if defined(__CUDA_ARCH__)
    const float* box = bound.data + 192 * group + (threadIdx.x & 31);
    return __ballot_sync(0xffffffffu, (box[0] <= upper[0]) & (box[32] <= upper[1]) & (box[64] <= upper[2])
        & (box[96] >= lower[0]) & (box[128] >= lower[1]) & (box[160] >= lower[2]));
#else
"""
    + _BOX_OVERLAPS
    + """
    return mask;
#endif
"""
)

_LEAF_OVERLAPS = (
    """
#if defined(__CUDA_ARCH__)
    // query boxes pass through shared memory, which is faster than six shuffles for each
    __shared__ float4 queries[2 * MOST_THREADS];
    const int lane = threadIdx.x & 31;
    float4* const query = queries + 2 * (threadIdx.x - lane);
    const float* box = bound.data + 192 * group + lane;
    const float x0 = box[0], y0 = box[32], z0 = box[64], x1 = box[96], y1 = box[128], z1 = box[160];
    const auto own = vertices.data[32 * group + lane];
    const unsigned int all = __ballot_sync(0xffffffffu, may != 0);
    const int count = __popc(all), rank = may != 0 ? __popc(all & ((1u << lane) - 1u)) : -1;
    if (may != 0) {
        query[2 * rank] = make_float4(upper[0], upper[1], upper[2], lower[0]);
        query[2 * rank + 1] = make_float4(lower[1], lower[2], __int_as_float(first), __int_as_float(second));
    }
    __syncwarp();
    unsigned int found = 0;
#pragma unroll 2
    for (int k = 0; k < count; ++k) {  // one query after another, against a box of each thread
        const float4 high = query[2 * k], low = query[2 * k + 1];
        bool overlaps = (x0 <= high.x) & (y0 <= high.y) & (z0 <= high.z)
            & (x1 >= high.w) & (y1 >= low.x) & (z1 >= low.y);
        if (__ballot_sync(0xffffffffu, overlaps) == 0)
            continue;
        const int p = __float_as_int(low.z), q = __float_as_int(low.w);
#pragma unroll
        for (int c = 0; c < CORNERS; ++c)
            overlaps = overlaps & (own[c] != p) & (own[c] != q);
        const unsigned int mask = __ballot_sync(0xffffffffu, overlaps);
        if (rank == k)
            found = mask;
    }
    __syncwarp();
    return found;
#else
    if (may == 0)
        return 0;
"""
    + _BOX_OVERLAPS
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

_GROUP_BOUND = """
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


@wp.func_native(_TEAM_MIN)
def team_min(value: wp.vec3f) -> wp.vec3f:
    """Componentwise minimum over a team."""
    ...


@wp.func_native(_TEAM_MAX)
def team_max(value: int) -> int:
    """Maximum over a team."""
    ...


@wp.func_native(_TEAM_OVERLAPS)
def team_overlaps(bound: wp.array(dtype=wp.float32), group: int, lower: wp.vec3f, upper: wp.vec3f) -> wp.uint32:
    """Which boxes of a group overlap a team's box: a bit for each."""
    ...


@wp.func_native(_TEAM_LANE)
def team_lane() -> int:
    """A thread's number in its team."""
    ...


@wp.func_native(_BIT_COUNT)
def bit_count(mask: wp.uint32) -> int:
    """Number of set bits."""
    ...


for _corners, _dtype in ((2, wp.vec2i), (3, wp.vec3i)):

    @wp.func_native(_LEAF_OVERLAPS.replace("CORNERS", str(_corners)).replace("MOST_THREADS", str(MOST_THREADS)))
    def leaf_overlaps(
        bound: wp.array(dtype=wp.float32),
        vertices: wp.array(dtype=_dtype),
        group: int,
        lower: wp.vec3f,
        upper: wp.vec3f,
        first: int,
        second: int,
        may: int,
    ) -> wp.uint32:
        """Which leaves of a group overlap a thread's own box and have neither of two vertices: a bit for each.

        ``vertices`` are the leaves'. All threads of a team call together; ``may``: 0 where none can overlap.
        """
        ...


@wp.func_native(_LOWEST_BIT)
def lowest_bit(mask: wp.uint32) -> int:
    """Index of the lowest set bit."""
    ...


@wp.func_native(_GROUP_BOUND)
def group_bound(bound: wp.array(dtype=wp.float32), group: int, upper: int, sign: float) -> wp.vec3f:
    """Least (sign 1) or greatest (sign -1) of the lower (``upper`` 0) or upper (1) bounds of a group's boxes."""
    ...


@wp.func
def low_bits(count: int):
    """A mask of the lowest bits, 0 to 32 of them."""
    some = (wp.uint32(1) << wp.uint32(count & 31)) - wp.uint32(1)
    return wp.where(count <= 0, wp.uint32(0), wp.where(count >= WIDTH, ~wp.uint32(0), some))


@wp.func
def boxes_in_range(begin: int, end: int, level: int, group: int):
    """Which boxes of a group hold any leaf from ``begin`` to before ``end``: a bit for each."""
    first = (begin >> (5 * level)) - WIDTH * group
    last = ((end - 1) >> (5 * level)) - WIDTH * group + 1
    return low_bits(last) & ~low_bits(first)


@wp.func
def start_walk(tree: BoxTree, lower: wp.vec3f, upper: wp.vec3f, begin: int, end: int):
    """A team's traversal over the groups of leaves that overlap the union of its threads' boxes; before the first."""
    walk = BoxWalk()
    walk.lower = team_min(lower)
    walk.upper = -team_min(-upper)
    walk.begin = -team_max(-begin)
    walk.end = team_max(end)
    walk.level = tree.levels - 1
    walk.group = (walk.begin >> (5 * tree.levels)) - 1
    return walk


@wp.func
def advance_walk(tree: BoxTree, walk: BoxWalk):
    """The traversal at its next 32 groups of leaves of which some overlap its box; ``mask_1`` has which."""
    level = int(walk.level)
    group = int(walk.group)
    mask_1 = wp.uint32(0)
    mask_2 = wp.uint32(walk.mask_2)
    mask_3 = wp.uint32(walk.mask_3)
    if level == 1:  # continue above it
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
                mask = team_overlaps(tree.bound, tree.first[level] + group, walk.lower, walk.upper)
                mask = mask & boxes_in_range(walk.begin, walk.end, level, group)
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
def store_box(tree: BoxTree, level: int, box: int, lower: wp.vec3f, upper: wp.vec3f):
    """Stores a box of a level [m]."""
    at = 192 * (tree.first[level] + (box >> 5)) + (box & 31)
    for axis in range(3):
        tree.bound[at + 32 * axis] = lower[axis]
        tree.bound[at + 96 + 32 * axis] = upper[axis]


@wp.func
def refit_groups(tree: BoxTree, level: int, begin: int, count: int, lane: int):
    """Refits boxes of the next level to ``count`` groups of a level, by a block's teams."""
    local = lane // warp_size()
    while local < count:
        group = begin + local
        lower = group_bound(tree.bound, tree.first[level] + group, 0, 1.0)
        upper = group_bound(tree.bound, tree.first[level] + group, 1, -1.0)
        if lane % warp_size() == 0:
            store_box(tree, level + 1, group, lower, upper)
        local += wp.max(block_threads() // warp_size(), 1)


@wp.func
def refit_above(tree: BoxTree, block: int, lane: int):
    """Refits both levels above a block's leaves, once their boxes are stored."""
    wait_for_block()
    refit_groups(tree, 0, block * (LEAVES // WIDTH), LEAVES // WIDTH, lane)
    wait_for_block()
    refit_groups(tree, 1, block, 1, lane)


@wp.func
def load_box(tree: BoxTree, level: int, box: int):
    """Lower and upper corner of a box of a level [m]."""
    at = 192 * (tree.first[level] + (box >> 5)) + (box & 31)
    lower = wp.vec3f(tree.bound[at], tree.bound[at + 32], tree.bound[at + 64])
    return lower, wp.vec3f(tree.bound[at + 96], tree.bound[at + 128], tree.bound[at + 160])


@wp.func
def may_overlap(tree: BoxTree, group: int, lower: wp.vec3f, upper: wp.vec3f):
    """Whether a box may overlap any leaf of a group: 1 or 0."""
    low, high = load_box(tree, 1, group)
    return wp.where(wp.max(low - upper) > 0.0 or wp.max(lower - high) > 0.0, 0, 1)
