"""Stiffness matrix of the cloth: for each pair of vertices that share an element, a 3 x 3 coupling S_ij [N/m].

Displacements d change the forces by minus the sum over pairs of S_ij (d_i - d_j): rigid translations cost nothing,
exactly. Only what resists is kept (tension across an edge, not the buckling of a compressed one), so that the matrix is
positive semidefinite and every solution with it leads downhill.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import SliderField, SlopeField, Terms, Yarn
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, difference_function, hinge_sides_function
from warp_cloth.kernels.laws.bending import THINNEST
from warp_cloth.kernels.laws.hinge import hinge_normals, rotated_back
from warp_cloth.kernels.laws.hysteresis import slider_stiffness
from warp_cloth.kernels.laws.shear_hysteresis import shear_friction
from warp_cloth.kernels.laws.tension import spring_constants, tension_force, tension_stiffness
from warp_cloth.kernels.laws.yarn import DIAGONAL, warp_vector, weft_vector, yarn_of, yarn_stiffness
from warp_cloth.kernels.math.symmetric import full_matrix, matrix_type, multiple_of_unit, outer


@functools.cache
def stiffness_types(precision: str) -> SimpleNamespace:
    """Struct ``Pairs`` and the types ``mat3`` and ``vec6`` (xx, yy, zz, xy, xz, yz of a symmetric matrix)."""
    vec6, mat3 = cloth_types(precision).vec6, matrix_type(precision)

    @wp.struct
    class Pairs:
        """N pairs of vertices i < j that share an edge, a hinge or a woven triangle, and these elements."""

        edge: wp.array(dtype=wp.int32)  # the edge that pulls between them, or -1, shape [N]
        hinge_start: wp.array(dtype=wp.int32)  # rows of ``hinge``, shape [N + 1]
        hinge: wp.array(dtype=wp.int32)  # 16 hinge + 4 corner of i + corner of j
        weave_start: wp.array(dtype=wp.int32)  # rows of ``weave``, shape [N + 1]
        weave: wp.array(dtype=wp.int32)  # 3 triangle + side
        slot: wp.array(dtype=wp.vec2i)  # where row i and row j keep the coupling, shape [N]

    return SimpleNamespace(mat3=mat3, vec6=vec6, Pairs=Pairs)


@wp.func
def spring_stiffness(d: Any, change: Any, rest: Any, pull: Any, push: Any, allowance: Any):
    """Stiffness of a spring along d: f' along it, f / r across it where it pulls, each the largest within a range.

    The length r may change by ``allowance`` times as much as it did by the last displacements' ``change``.
    """
    length = wp.max(wp.length(d), type(rest)(1.0e-9))
    span = allowance * wp.abs(wp.length(d + change) - length)
    across = wp.max(tension_force(length + span - rest, pull, push), type(rest)(0.0)) / length
    along = tension_stiffness(length - rest, pull, push, span)
    across = wp.min(across, along)
    return outer(along - across, d / length) + multiple_of_unit(across)


@functools.cache
def linearise_hinges_kernel(precision: str, terms: Terms) -> wp.Kernel:
    """Kernel ``linearise_hinges``, of hinges with rest angles or flat ones, with friction or without."""
    types = cloth_types(precision)
    real, vec2, vec3, State, Hinges = types.real, types.vec2, types.vec3, types.State, types.Hinges
    hinge_sides = hinge_sides_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def linearise_hinges(
        state: State,
        hinges: Hinges,
        gradient_out: wp.array2d(dtype=vec3),  # sqrt(C sin theta) times the angle's gradient, shape [4, H]
    ):
        """Stores a root of a hinge's stiffness, C sin(theta) grad(theta) grad(theta)^T, for each corner.

        Friction adds that of ``slider_stiffness``.
        """
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        axis, wing_0, wing_1 = hinge_sides(state.position, corners)
        normal_0, normal_1, area_0, area_1 = hinge_normals(axis, wing_0, wing_1)
        length = wp.length(axis)
        least = real(THINNEST) * length * length + real(1.0e-30)
        # the torque of a collapsing triangle fades, as that of laws.bending.hinge_torque does
        faded = wp.min(area_0 / least, real(1.0)) * wp.min(area_1 / least, real(1.0))
        against = normal_1
        if wp.static(terms.angles):
            against = rotated_back(normal_1, axis, hinges.rest[hinge])
        bent = wp.length(wp.cross(normal_0, against)) * faded
        stiff = hinges.stiffness[hinge] * bent
        if wp.static(terms.hysteresis):
            slider = hinges.hysteresis[hinge]
            laid = rotated_back(normal_1, axis, vec2(slider[SliderField.COSINE], slider[SliderField.SINE]))
            fold = wp.length(normal_0 - laid)
            stiff += slider_stiffness(fold, slider[SliderField.MOMENT], slider[SliderField.STEEPNESS]) * faded
        root = wp.sqrt(stiff)
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
def linearise_weave_kernel(precision: str, terms: Terms) -> wp.Kernel:
    """Kernel ``linearise_weave``, of yarns with friction or without."""
    types = cloth_types(precision)
    real, State, Weave = types.real, types.State, types.Weave
    vec6 = stiffness_types(precision).vec6
    difference = difference_function(precision)
    diagonal = wp.constant(real(DIAGONAL))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def linearise_weave(
        state: State,
        weave: Weave,
        allowance: real,  # as in spring_stiffness
        side_out: wp.array2d(dtype=vec6),  # coupling of the corners (0,1), (1,2), (2,0) [N/m], shape [3, T]
    ):
        """Couplings of a triangle's corners by its four yarns t = sum b_i x_i: -b_i b_j times the yarn's stiffness."""
        triangle = wp.tid()
        corners = weave.corners[triangle]
        slope = weave.slope[triangle]
        origin = state.position[corners[0]]
        side_1 = difference(state.position[corners[1]], origin)
        side_2 = difference(state.position[corners[2]], origin)
        weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
        last = state.displacement[corners[0]]
        change_1, change_2 = state.displacement[corners[1]] - last, state.displacement[corners[2]] - last
        weft_change, warp_change = weft_vector(slope, change_1, change_2), warp_vector(slope, change_1, change_2)
        pull, push = yarn_stiffness(weave.yarns[triangle])
        first = vec6()
        second = vec6()
        third = vec6()
        friction, stiffer = real(0.0), real(0.0)
        if wp.static(terms.shear_hysteresis):
            friction, stiffer = shear_friction(weft, warp, weave.shear_hysteresis[triangle])
        for yarn in range(4):
            t, change = yarn_of(yarn, weft, warp, diagonal), yarn_of(yarn, weft_change, warp_change, diagonal)
            b1 = yarn_of(yarn, slope[SlopeField.WEFT_1], slope[SlopeField.WARP_1], diagonal)
            b2 = yarn_of(yarn, slope[SlopeField.WEFT_2], slope[SlopeField.WARP_2], diagonal)
            stiff = spring_stiffness(t, change, real(1.0), pull[yarn], push[yarn], allowance)
            if wp.static(terms.shear_hysteresis):
                # as in shear_friction_tension; what would buckle counts as nothing
                if yarn == Yarn.PLUS:
                    stiff += outer(real(2.0) * stiffer, t) + multiple_of_unit(wp.max(friction, real(0.0)))
                if yarn == Yarn.MINUS:
                    stiff += outer(real(2.0) * stiffer, t) + multiple_of_unit(wp.max(-friction, real(0.0)))
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
    types, own = cloth_types(precision), stiffness_types(precision)
    real, vec3, State, Edges = types.real, types.vec3, types.State, types.Edges
    mat3, vec6, Pairs = own.mat3, own.vec6, own.Pairs
    difference = difference_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def couple_pairs(
        state: State,
        edges: Edges,
        pairs: Pairs,
        allowance: real,  # as in spring_stiffness
        gradient: wp.array2d(dtype=vec3),  # from linearise_hinges
        side: wp.array2d(dtype=vec6),  # from linearise_weave
        coupling_out: wp.array(dtype=mat3),  # S_ij in row i and its transpose in row j [N/m], shape [2 N]
        pair_out: wp.array(dtype=vec6),  # symmetric part of S_ij, shape [N]
    ):
        """Sums the couplings of a pair's two vertices over its elements."""
        pair = wp.tid()
        s = vec6()
        edge = pairs.edge[pair]
        if edge >= 0:
            ends = edges.ends[edge]
            rest, pull, push = spring_constants(edges.spring[edge])
            d = difference(state.position[ends[1]], state.position[ends[0]])
            change = state.displacement[ends[1]] - state.displacement[ends[0]]
            s = spring_stiffness(d, change, rest, pull, push, allowance)
        for row in range(pairs.weave_start[pair], pairs.weave_start[pair + 1]):
            code = pairs.weave[row]
            s += side[code % 3, code // 3]
        full = full_matrix(s)
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
def stiffness_kernels(precision: str, terms: Terms) -> SimpleNamespace:
    """The three kernels, in the order of their launches."""
    return SimpleNamespace(
        linearise_hinges=linearise_hinges_kernel(precision, terms),
        linearise_weave=linearise_weave_kernel(precision, terms),
        couple_pairs=couple_pairs_kernel(precision),
    )
