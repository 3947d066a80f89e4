"""Signed distances on a grid by Jacobi sweeps of the eikonal equation; active blocks, slope limit, spline prefilter."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})  # the same bits on CPU and CUDA

UNKNOWN = wp.constant(wp.float32(1.0e3))  # distance not measured yet [m]: farther than any other
BLOCK = wp.constant(4)  # nodes along a block's side; blocks without work are skipped
SHARPNESS = wp.constant(wp.float32(0.5))  # fraction of the spline's smoothing that its coefficients undo
STILL = wp.constant(wp.float32(0.02))  # spacings of change below which a block counts as unchanged


@wp.func
def node_position(spacing: float, offset: wp.vec3f, i: int, j: int, k: int) -> wp.vec3f:
    """Position of a node in the depth buffers' local frame [m]; offset is that of node (0, 0, 0)."""
    return offset + spacing * wp.vec3f(float(i), float(j), float(k))


@wp.func
def eikonal_distance(a: float, b: float, c: float, h: float) -> float:
    """Distance u with |grad u| = 1 upwind of the least neighbours a, b, c along the axes [m], spacing h [m].

    The largest root of sum_i max(u - a_i, 0)^2 = h^2 (Rouy and Tourin 1992).
    """
    low = wp.min(a, wp.min(b, c))
    high = wp.max(a, wp.max(b, c))
    mid = wp.max(wp.min(a, b), wp.min(wp.max(a, b), c))
    u = low + h
    if u > mid:
        u = 0.5 * (low + mid + wp.sqrt(2.0 * h * h - (low - mid) * (low - mid)))
        if u > high:
            s = low + mid + high
            u = (s + wp.sqrt(wp.max(s * s - 3.0 * (low * low + mid * mid + high * high - h * h), 0.0))) / 3.0
    return u


@wp.func
def neighbour(distance: wp.array3d(dtype=wp.float32), i: int, j: int, k: int, outside: float) -> float:
    """Value at a node, or ``outside`` beyond the grid's border."""
    if i < 0 or j < 0 or k < 0:
        return outside
    if i >= distance.shape[0] or j >= distance.shape[1] or k >= distance.shape[2]:
        return outside
    return distance[i, j, k]


@wp.kernel
def mark_blocks(
    distance: wp.array3d(dtype=wp.float32),  # signs of the nodes, shape [nx, ny, nz]
    inside_out: wp.array3d(dtype=wp.int32),  # 1 where a node is inside, shape [bx, by, bz]
    surface_out: wp.array3d(dtype=wp.int32),  # 1 where the surface passes in or next to the block, shape [bx, by, bz]
):
    """Finds the blocks of nodes that hold the inside and the surface."""
    bi, bj, bk = wp.tid()
    low = float(UNKNOWN)
    high = float(-UNKNOWN)
    for a in range(BLOCK + 1):
        for b in range(BLOCK + 1):
            for c in range(BLOCK + 1):
                i = wp.min(bi * BLOCK + a, distance.shape[0] - 1)
                j = wp.min(bj * BLOCK + b, distance.shape[1] - 1)
                k = wp.min(bk * BLOCK + c, distance.shape[2] - 1)
                low = wp.min(low, distance[i, j, k])
                high = wp.max(high, distance[i, j, k])
    inside_out[bi, bj, bk] = wp.where(low < 0.0, 1, 0)
    surface_out[bi, bj, bk] = wp.where(low * high < 0.0, 1, 0)


@wp.kernel
def spread_blocks(
    flag: wp.array3d(dtype=wp.int32),  # shape [bx, by, bz]
    radius: int,  # blocks
    also: wp.array3d(dtype=wp.int32),  # more flags, which do not spread, shape [bx, by, bz]
    flag_out: wp.array3d(dtype=wp.int32),  # 1 where a flag is within radius, or ``also`` is set, shape [bx, by, bz]
):
    """Dilates flags over blocks (largest coordinate difference)."""
    bi, bj, bk = wp.tid()
    found = also[bi, bj, bk]
    for i in range(wp.max(bi - radius, 0), wp.min(bi + radius, flag.shape[0] - 1) + 1):
        for j in range(wp.max(bj - radius, 0), wp.min(bj + radius, flag.shape[1] - 1) + 1):
            for k in range(wp.max(bk - radius, 0), wp.min(bk + radius, flag.shape[2] - 1) + 1):
                found = wp.max(found, flag[i, j, k])
    flag_out[bi, bj, bk] = found


@wp.kernel
def list_blocks(
    flag: wp.array3d(dtype=wp.int32),  # 1 where a block is active, shape [bx, by, bz]
    place: wp.array(dtype=wp.int32),  # inclusive prefix sum of flag, shape [bx by bz]
    corner_out: wp.array(dtype=wp.vec3i),  # first node of each active block, in ascending order
):
    """Lists the active blocks."""
    bi, bj, bk = wp.tid()
    if flag[bi, bj, bk] != 0:
        corner_out[place[(bi * flag.shape[1] + bj) * flag.shape[2] + bk] - 1] = BLOCK * wp.vec3i(bi, bj, bk)


@wp.func
def swept_distance(distance: wp.array3d(dtype=wp.float32), spacing: float, i: int, j: int, k: int) -> float:
    """Unsigned distance of a node by its six neighbours', where that is less than its own [m]."""
    here = wp.abs(distance[i, j, k])
    a0 = wp.abs(distance[wp.max(i - 1, 0), j, k])
    a1 = wp.abs(distance[wp.min(i + 1, distance.shape[0] - 1), j, k])
    b0 = wp.abs(distance[i, wp.max(j - 1, 0), k])
    b1 = wp.abs(distance[i, wp.min(j + 1, distance.shape[1] - 1), k])
    c0 = wp.abs(distance[i, j, wp.max(k - 1, 0)])
    c1 = wp.abs(distance[i, j, wp.min(k + 1, distance.shape[2] - 1)])
    a = wp.min(a0, a1)
    b = wp.min(b0, b1)
    c = wp.min(c0, c1)
    if wp.min(a, wp.min(b, c)) >= here:
        return here
    return wp.min(here, eikonal_distance(a, b, c, spacing))


@wp.func
def changed_nearby(changed: wp.array3d(dtype=wp.int32), bi: int, bj: int, bk: int) -> bool:
    """Whether a block or one of its six neighbours changed."""
    found = changed[bi, bj, bk]
    found += changed[wp.max(bi - 1, 0), bj, bk] + changed[wp.min(bi + 1, changed.shape[0] - 1), bj, bk]
    found += changed[bi, wp.max(bj - 1, 0), bk] + changed[bi, wp.min(bj + 1, changed.shape[1] - 1), bk]
    found += changed[bi, bj, wp.max(bk - 1, 0)] + changed[bi, bj, wp.min(bk + 1, changed.shape[2] - 1)]
    return found > 0


@wp.struct
class SweepDomain:
    """Where distances are swept, and from what; the same in every sweep."""

    spacing: float  # [m]
    limit_inside: float  # greatest depth that is needed [m]
    limit_outside: float  # greatest distance outside that is needed [m]
    corner: wp.array(dtype=wp.vec3i)  # first node of the active blocks, shape [N]
    fixed: wp.array3d(dtype=wp.float32)  # boundary values; +-UNKNOWN where swept [m], shape [nx, ny, nz]


@wp.kernel
def sweep_distance(
    domain: SweepDomain,
    distance: wp.array3d(dtype=wp.float32),  # signed distance so far [m], shape [nx, ny, nz]
    changed: wp.array3d(dtype=wp.int32),  # 1 where the sweep before changed a block, shape [bx, by, bz]
    distance_out: wp.array3d(dtype=wp.float32),  # after one sweep [m]; must hold the values of two sweeps ago
    changed_out: wp.array3d(dtype=wp.int32),  # 1 where this sweep changed a block; start it at 0
    any_changed_out: wp.array(dtype=wp.int32),  # set to 1 where anything changed, shape [1]
):
    """One Jacobi sweep of |grad d| = 1, on both sides at once, outward from the fixed nodes.

    Blocks around which nothing changed are skipped: both buffers hold the same there. Threads [N, BLOCK].
    """
    block, a = wp.tid()
    c = domain.corner[block]
    bi = c[0] / BLOCK
    bj = c[1] / BLOCK
    bk = c[2] / BLOCK
    i = c[0] + a
    if i >= domain.fixed.shape[0] or not changed_nearby(changed, bi, bj, bk):
        return
    change = float(0.0)
    for j in range(c[1], wp.min(c[1] + BLOCK, domain.fixed.shape[1])):
        for k in range(c[2], wp.min(c[2] + BLOCK, domain.fixed.shape[2])):
            fixed = domain.fixed[i, j, k]
            if wp.abs(fixed) < UNKNOWN:
                distance_out[i, j, k] = fixed
            else:
                u = swept_distance(distance, domain.spacing, i, j, k)
                if u > wp.where(fixed < 0.0, domain.limit_inside, domain.limit_outside):
                    u = UNKNOWN
                distance_out[i, j, k] = wp.sign(fixed) * u
                change = wp.max(change, wp.abs(distance[i, j, k]) - u)
    if change > STILL * domain.spacing:
        changed_out[bi, bj, bk] = 1
        any_changed_out[0] = 1


@wp.func
def smooth_gradient(distance: wp.array3d(dtype=wp.float32), i: int, j: int, k: int) -> wp.vec3f:
    """Central differences at an inner node, averaged over 3 x 3 lines with weights (1, 6, 1) / 8, per spacing."""
    gradient = wp.vec3f(0.0, 0.0, 0.0)
    for a in range(-1, 2):
        for b in range(-1, 2):
            weight = wp.where(a == 0, 0.75, 0.125) * wp.where(b == 0, 0.75, 0.125)
            gradient += (
                0.5
                * weight
                * wp.vec3f(
                    distance[i + 1, j + a, k + b] - distance[i - 1, j + a, k + b],
                    distance[i + a, j + 1, k + b] - distance[i + a, j - 1, k + b],
                    distance[i + a, j + b, k + 1] - distance[i + a, j + b, k - 1],
                )
            )
    return gradient


@wp.kernel
def limit_slopes(
    spacing: float,  # [m]
    corner: wp.array(dtype=wp.vec3i),  # first node of the active blocks, shape [N]
    distance: wp.array3d(dtype=wp.float32),  # signed distance near the surface, else +-UNKNOWN [m]
    distance_out: wp.array3d(dtype=wp.float32),  # no steeper than 1 away from the surface [m], shape [nx, ny, nz]
):
    """Cuts each distance to what its 26 neighbours allow: |d_i - d_j| <= |x_i - x_j|.

    In a crease the normal is a mean of the sides' normals, and the distance along it too long: a push out would
    overshoot. Threads [N, BLOCK, BLOCK].
    """
    block, a, b = wp.tid()
    i = corner[block][0] + a
    j = corner[block][1] + b
    if i >= distance.shape[0] or j >= distance.shape[1]:
        return
    for k in range(corner[block][2], wp.min(corner[block][2] + BLOCK, distance.shape[2])):
        here = distance[i, j, k]
        least = wp.abs(here)
        if least < UNKNOWN:
            for u in range(wp.max(i - 1, 0), wp.min(i + 2, distance.shape[0])):
                for v in range(wp.max(j - 1, 0), wp.min(j + 2, distance.shape[1])):
                    for w in range(wp.max(k - 1, 0), wp.min(k + 2, distance.shape[2])):
                        away = spacing * wp.length(wp.vec3f(float(u - i), float(v - j), float(w - k)))
                        least = wp.min(least, wp.sign(here) * distance[u, v, w] + away)
            distance_out[i, j, k] = wp.sign(here) * wp.max(least, 0.0)
        else:
            distance_out[i, j, k] = here


@wp.kernel
def prefilter_distance(
    limit: float,  # greatest distance outside; larger ones are cut to it [m]
    deep: float,  # depth beyond which the distance itself will do [m]
    distance: wp.array3d(dtype=wp.float32),  # signed distance [m], shape [nx, ny, nz]
    coefficient_out: wp.array3d(dtype=wp.float32),  # B-spline coefficients [m], shape [nx, ny, nz]
):
    """Spline coefficients c = d + a (d - S d), S = (1, 6, 1)^3 / 8^3, a = SHARPNESS.

    a = 1 reproduces the distances to second order but raises |grad d| above 1 in creases, where a push out would
    then overshoot; a = 1/2 costs 0.02 mm on limbs at 5 mm spacing and keeps |grad d| below 1.3.
    """
    i, j, k = wp.tid()
    here = wp.min(distance[i, j, k], limit)
    if here >= limit or here < -deep:
        coefficient_out[i, j, k] = here
        return
    smooth = float(0.0)
    for a in range(-1, 2):
        for b in range(-1, 2):
            weight = wp.where(a == 0, 0.75, 0.125) * wp.where(b == 0, 0.75, 0.125)
            low = wp.min(neighbour(distance, i + a, j + b, k - 1, here), limit)
            mid = wp.min(neighbour(distance, i + a, j + b, k, here), limit)
            high = wp.min(neighbour(distance, i + a, j + b, k + 1, here), limit)
            smooth += weight * (0.125 * low + 0.75 * mid + 0.125 * high)
    coefficient_out[i, j, k] = here + SHARPNESS * (here - smooth)
