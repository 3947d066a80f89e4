"""How the forces change with the positions: for each pair of vertices that share an element, a 3x3 coupling [N/m].

Moved by d, the forces change by minus the sum over pairs of S_ij (d_i - d_j): rigid shifts cost nothing, exactly. Only
what resists is kept (tension across an edge, not the buckling of a compressed one), so that the whole is never
negative and a solution with it always goes downhill.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, difference_function, hinge_sides_function
from warp_cloth.kernels.laws.bending import THINNEST, hinge_fold, turned_back
from warp_cloth.kernels.laws.tension import tension_force, tension_stiffness
from warp_cloth.kernels.laws.yarn import warp_vector, weft_vector
from warp_cloth.kernels.math.packet import alike, dot, part, products, six, three
from warp_cloth.kernels.math.real import quotient, shaped


@functools.cache
def stiffness_types(precision: str) -> SimpleNamespace:
    """Struct ``Pairs`` and the types ``mat3`` and ``vec6`` (xx, yy, zz, xy, xz, yz of a symmetric matrix)."""
    types = cloth_types(precision)
    real, vec6 = types.real, types.vec6
    mat3 = wp.types.matrix(shape=(3, 3), dtype=real)

    @wp.struct
    class Pairs:
        """N pairs of vertices i < j that share an edge, a hinge or a woven triangle, and what couples each."""

        edge: wp.array(dtype=wp.int32)  # the edge that pulls between them, or -1, shape [N]
        hinge_start: wp.array(dtype=wp.int32)  # rows of ``hinge``, shape [N + 1]
        hinge: wp.array(dtype=wp.int32)  # 16 hinge + 4 corner of i + corner of j
        weave_start: wp.array(dtype=wp.int32)  # rows of ``weave``, shape [N + 1]
        weave: wp.array(dtype=wp.int32)  # 3 triangle + side
        slot: wp.array(dtype=wp.vec2i)  # where row i and row j keep the coupling, shape [N]

    return SimpleNamespace(mat3=mat3, vec6=vec6, Pairs=Pairs)


@wp.func
def symmetric_times(m: Any, v: Any):
    """m v, m a symmetric matrix as vec6; of one or of eight (kernels.math.packet)."""
    row_0 = three(part(m, 0), part(m, 3), part(m, 4))
    row_1 = three(part(m, 3), part(m, 1), part(m, 5))
    row_2 = three(part(m, 4), part(m, 5), part(m, 2))
    return three(dot(row_0, v), dot(row_1, v), dot(row_2, v))


@functools.cache
def matrix_functions(precision: str, eight: bool = False) -> SimpleNamespace:
    """Functions ``along`` and ``even``, which make symmetric matrices as vec6; of one or of ``eight`` at a time."""
    real = cloth_types(precision).real
    one, vec3 = shaped(real, eight).real, shaped(real, eight).vec3

    @wp.func
    def along(size: one, u: vec3):
        """size u u^T."""
        x, y, z = part(u, 0), part(u, 1), part(u, 2)
        size_x, size_y = products(size, x), products(size, y)
        return six(
            products(size_x, x), products(size_y, y), products(products(size, z), z),
            products(size_x, y), products(size_x, z), products(size_y, z),
        )  # fmt: skip

    @wp.func
    def even(size: one):
        """size times the unit matrix."""
        none = alike(size, real(0.0))
        return six(size, size, size, none, none, none)

    return SimpleNamespace(along=along, even=even)


@wp.func
def divided(a: Any, b: Any):
    """a / b, whatever they are."""
    return a / b


@functools.cache
def inverse_function(precision: str, over: wp.Function) -> wp.Function:
    """The function that inverts a symmetric matrix; ``over``: ``divided``, or arithmetic.quotient in its bounds."""
    real, vec6 = cloth_types(precision).real, stiffness_types(precision).vec6
    # of a block's mean stiffness; keeps a block with a direction that nothing resists solvable
    least = wp.constant(real(1.0e-6))

    @wp.func
    def inverse(m: vec6):
        """m^-1, by cofactors of what is left when its size is taken out; zero where m is."""
        one = real(1.0)
        mean = (m[0] + m[1] + m[2]) / real(3.0)
        result = vec6()
        if mean > real(0.0):
            n = vec6(
                over(m[0], mean), over(m[1], mean), over(m[2], mean),
                over(m[3], mean), over(m[4], mean), over(m[5], mean),
            )  # fmt: skip
            xx = n[0] + least
            yy = n[1] + least
            zz = n[2] + least
            c00 = yy * zz - n[5] * n[5]
            c01 = n[4] * n[5] - n[3] * zz
            c02 = n[3] * n[5] - n[4] * yy
            c11 = xx * zz - n[4] * n[4]
            c12 = n[3] * n[4] - xx * n[5]
            c22 = xx * yy - n[3] * n[3]
            determinant = xx * c00 + n[3] * c01 + n[4] * c02
            if determinant > real(0.0):
                result = vec6(c00, c11, c22, c01, c02, c12) * over(one, determinant * mean)
        return result

    return inverse


@functools.cache
def symmetric_functions(precision: str) -> SimpleNamespace:
    """Functions on symmetric matrices as vec6: ``along``, ``even``, ``times``, ``inverse``.

    And ``leeway_inverse``, as quick as a GPU can be, of what is neither as small nor as large as stiffnesses may be.
    """
    matrices = matrix_functions(precision)
    return SimpleNamespace(
        along=matrices.along, even=matrices.even, times=symmetric_times,
        inverse=inverse_function(precision, divided), leeway_inverse=inverse_function(precision, quotient),
    )  # fmt: skip


@functools.cache
def spring_function(precision: str) -> wp.Function:
    """The function ``spring``: how a thread or an edge resists its ends' moving apart, along and across it."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    symmetric = symmetric_functions(precision)
    along, even = symmetric.along, symmetric.even

    @wp.func
    def spring(d: vec3, change: vec3, rest: real, pull: real, push: real, share: real):
        """Stiffness of a spring at d: f' along it, f / r across it where it pulls, at most where its change ends."""
        length = wp.max(wp.length(d), real(1.0e-9))
        reach = share * wp.abs(wp.length(d + change) - length)
        across = wp.max(tension_force(length + reach, rest, pull, push), real(0.0)) / length
        stiff = tension_stiffness(length, rest, pull, push, reach)
        across = wp.min(across, stiff)
        return along(stiff - across, d / length) + even(across)

    return spring


@functools.cache
def linearise_hinges_kernel(precision: str, angles: bool) -> wp.Kernel:
    """Kernel ``linearise_hinges``, of hinges with rest angles or flat ones."""
    types = cloth_types(precision)
    real, vec3, State, Hinges = types.real, types.vec3, types.State, types.Hinges
    hinge_sides = hinge_sides_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def linearise_hinges(
        state: State,
        hinges: Hinges,
        gradient_out: wp.array2d(dtype=vec3),  # sqrt(C sin theta) times the angle's gradient, shape [4, H]
    ):
        """C sin(theta) grad(theta) grad(theta)^T is a hinge's stiffness; stores a root of it for each corner."""
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        axis, wing_0, wing_1 = hinge_sides(state.position, corners)
        normal_0, normal_1, area_0, area_1 = hinge_fold(axis, wing_0, wing_1)
        length = wp.length(axis)
        least = real(THINNEST) * length * length + real(1.0e-30)
        # as kernels.laws.bending.hinge_turn: the torque of a collapsing triangle fades
        faded = wp.min(area_0 / least, real(1.0)) * wp.min(area_1 / least, real(1.0))
        against = normal_1
        if wp.static(angles):
            against = turned_back(normal_1, axis, hinges.rest[hinge])
        bent = wp.length(wp.cross(normal_0, against)) * faded
        root = wp.sqrt(hinges.stiffness[hinge] * bent)
        g2 = normal_0 * (root * length / wp.max(area_0, least))
        g3 = normal_1 * (root * length / wp.max(area_1, least))
        scale = real(1.0) / (length * length + real(1.0e-30))
        g1 = -(g2 * (wp.dot(wing_0, axis) * scale) + g3 * (wp.dot(wing_1, axis) * scale))
        gradient_out[0, hinge] = -(g1 + g2 + g3)
        gradient_out[1, hinge] = g1
        gradient_out[2, hinge] = g2
        gradient_out[3, hinge] = g3

    return linearise_hinges


@functools.cache
def linearise_weave_kernel(precision: str) -> wp.Kernel:
    """Kernel ``linearise_weave``."""
    types = cloth_types(precision)
    real, State, Weave = types.real, types.State, types.Weave
    vec6 = stiffness_types(precision).vec6
    spring = spring_function(precision)
    difference = difference_function(precision)
    half = wp.constant(real(0.5**0.5))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def linearise_weave(
        state: State,
        weave: Weave,
        share: real,  # of the last change of a length that is allowed for
        side_out: wp.array2d(dtype=vec6),  # coupling of the corners (0,1), (1,2), (2,0) [N/m], shape [3, T]
    ):
        """Couplings of a woven triangle's corners by its four threads: minus b_i b_j times the thread's stiffness."""
        triangle = wp.tid()
        corners = weave.corners[triangle]
        slope = weave.slope[triangle]
        law = weave.law[triangle]
        push = law * law[3]
        origin = state.position[corners[0]]
        side_1 = difference(state.position[corners[1]], origin)
        side_2 = difference(state.position[corners[2]], origin)
        along_u = weft_vector(slope, side_1, side_2)
        along_v = warp_vector(slope, side_1, side_2)
        move = state.displacement[corners[0]]
        change_u = weft_vector(slope, state.displacement[corners[1]] - move, state.displacement[corners[2]] - move)
        change_v = warp_vector(slope, state.displacement[corners[1]] - move, state.displacement[corners[2]] - move)
        one = real(1.0)
        first = vec6()
        second = vec6()
        third = vec6()
        for thread in range(4):
            t = along_u
            change = change_u
            b1 = slope[0]
            b2 = slope[1]
            pull = law[0]
            low = push[0]
            if thread == 1:
                t = along_v
                change = change_v
                b1 = slope[2]
                b2 = slope[3]
                pull = law[1]
                low = push[1]
            if thread > 1:
                sign = wp.where(thread == 2, half, -half)
                t = along_u * half + along_v * sign
                change = change_u * half + change_v * sign
                b1 = slope[0] * half + slope[2] * sign
                b2 = slope[1] * half + slope[3] * sign
                pull = law[2]
                low = push[2]
            stiff = spring(t, change, one, pull, low, share)
            b0 = -(b1 + b2)
            first -= stiff * (b0 * b1)
            second -= stiff * (b1 * b2)
            third -= stiff * (b2 * b0)
        side_out[0, triangle] = first
        side_out[1, triangle] = second
        side_out[2, triangle] = third

    return linearise_weave


@functools.cache
def couple_pairs_kernel(precision: str) -> wp.Kernel:
    """Kernel ``couple_pairs``."""
    types, own = cloth_types(precision), stiffness_types(precision)
    real, vec3, State, Edges = types.real, types.vec3, types.State, types.Edges
    mat3, vec6, Pairs = own.mat3, own.vec6, own.Pairs
    spring = spring_function(precision)
    difference = difference_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def couple_pairs(
        state: State,
        edges: Edges,
        pairs: Pairs,
        share: real,  # as of linearise_weave
        gradient: wp.array2d(dtype=vec3),  # from linearise_hinges
        side: wp.array2d(dtype=vec6),  # from linearise_weave
        coupling_out: wp.array(dtype=mat3),  # S_ij in row i and its transpose in row j [N/m], shape [2 N]
        pair_out: wp.array(dtype=vec6),  # symmetric part of S_ij, shape [N]
    ):
        """Sums what couples the two vertices of a pair."""
        pair = wp.tid()
        s = vec6()
        edge = pairs.edge[pair]
        if edge >= 0:
            ends = edges.ends[edge]
            law = edges.law[edge]
            d = difference(state.position[ends[1]], state.position[ends[0]])
            change = state.displacement[ends[1]] - state.displacement[ends[0]]
            s = spring(d, change, law[0], law[1], law[2], share)
        for row in range(pairs.weave_start[pair], pairs.weave_start[pair + 1]):
            code = pairs.weave[row]
            s += side[code % 3, code // 3]
        full = mat3(s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2])
        for row in range(pairs.hinge_start[pair], pairs.hinge_start[pair + 1]):
            code = pairs.hinge[row]
            hinge = code // 16
            full -= wp.outer(gradient[(code // 4) % 4, hinge], gradient[code % 4, hinge])
        slot = pairs.slot[pair]
        coupling_out[slot[0]] = full
        coupling_out[slot[1]] = wp.transpose(full)
        mean = real(0.5)
        pair_out[pair] = vec6(
            full[0, 0], full[1, 1], full[2, 2],
            (full[0, 1] + full[1, 0]) * mean, (full[0, 2] + full[2, 0]) * mean, (full[1, 2] + full[2, 1]) * mean,
        )  # fmt: skip

    return couple_pairs


@functools.cache
def stiffness_kernels(precision: str, angles: bool) -> SimpleNamespace:
    """The three kernels, in the order of their launches; ``angles``: whether hinges have rest angles."""
    return SimpleNamespace(
        linearise_hinges=linearise_hinges_kernel(precision, angles),
        linearise_weave=linearise_weave_kernel(precision),
        couple_pairs=couple_pairs_kernel(precision),
    )
