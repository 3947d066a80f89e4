"""The anisotropic step of woven cloth on the CPU: bounds are scattered from packets of triangles; same bits.

``anisotropic_step`` gathers at each vertex, which would measure every triangle three times here. Both compute
a triangle's bounds at its corners by the same functions.

A vertex's sum is kept in two arrays: xx, yy, zz of the matrix and its size; xy, xz, yz and zero.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import Terms
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rests
from warp_cloth.kernels.math.lanes import WIDTH, lane_types
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  what + - * below call for packets
from warp_cloth.kernels.math.packet import component, vector4
from warp_cloth.kernels.math.packet_memory import (
    active_lanes,
    add_packet_pairs,
    add_packets,
    first_of_packet,
    load_packet,
    load_packet_signed,
    load_sides,
)
from warp_cloth.kernels.passes.anisotropic_step import compliance_of, folds_bound, yarn_bounds, yarns_matrix


def _begin_kernel(precision: str) -> wp.Kernel:
    types = cloth_types(precision)
    vec4, Model = types.vec4, types.Model

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def begin_bounds(
        model: Model,
        diagonal_out: wp.array(dtype=vec4),  # shape [V]
        off_diagonal_out: wp.array(dtype=vec4),
    ):
        """Starts each vertex's sum with the bound of its free fall, weight over cap."""
        vertex = wp.tid()
        own = model.weight[vertex] / model.items[model.item[vertex]].cap
        diagonal_out[vertex] = vec4(own, own, own, own)
        off_diagonal_out[vertex] = vec4()

    return begin_bounds


@wp.func
def diagonal_of(matrix: Any, size: Any):
    """What is added to the first array."""
    return vector4(component(matrix, 0), component(matrix, 1), component(matrix, 2), size)


@wp.func
def off_diagonal_of(matrix: Any):
    """What is added to the second."""
    xy = component(matrix, 3)
    return vector4(xy, component(matrix, 4), component(matrix, 5), type(xy)(0.0))


def _sum_kernel(precision: str, terms: Terms) -> wp.Kernel:
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, WIDTH)
    real, vec4, Step, Triangles = types.real, types.vec4, types.Step, types.Triangles
    Model, State = types.Model, types.State
    like = wp.constant(real(0.0))

    @wp.func
    def folds_bounds(fold: wp.array(dtype=vec4), edges: wp.array(dtype=wp.vec3i), start: int):
        """What the hinges of eight triangles bound at their corners."""
        bound_0 = component(load_packet_signed(fold, edges, start, 0), 1)
        bound_1 = component(load_packet_signed(fold, edges, start, 1), 1)
        bound_2 = component(load_packet_signed(fold, edges, start, 2), 1)
        first, second = folds_bound(bound_0, bound_1, bound_2, 0), folds_bound(bound_0, bound_1, bound_2, 1)
        third = folds_bound(bound_0, bound_1, bound_2, 2)
        return (
            vector4(first, first, first, first),
            vector4(second, second, second, second),
            vector4(third, third, third, third),
        )

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def sum_bounds(
        model: Model,
        state: State,
        triangles: Triangles,
        fold: wp.array(dtype=vec4),  # of scatter.add_edges, of packets, shape [E]
        step: Step,
        diagonal_out: wp.array(dtype=vec4),  # shape [V]
        off_diagonal_out: wp.array(dtype=vec4),
    ):
        """Adds the bounds of eight triangles' hinges and yarns to their corners."""
        number = wp.tid()
        lanes = active_lanes(model, triangles.corners, number)
        if lanes == 0:
            return
        start = first_of_packet(number, triangles.corners.shape[0])
        folds_0, folds_1, folds_2 = packets.vec4(), packets.vec4(), packets.vec4()
        if wp.static(terms.folds):
            folds_0, folds_1, folds_2 = folds_bounds(fold, triangles.edges, start)
        side_1 = load_sides(like, state.position, triangles.corners, start, 0, 1)
        side_2 = load_sides(like, state.position, triangles.corners, start, 0, 2)
        change_1 = load_sides(like, state.displacement, triangles.corners, start, 0, 1)
        change_2 = load_sides(like, state.displacement, triangles.corners, start, 0, 2)
        slope, yarns = load_packet(triangles.slope, start), load_packet(triangles.yarns, start)
        weft, warp, bounds, fraction, inverse_length = yarn_bounds(
            side_1, side_2, change_1, change_2, slope, yarns, step
        )
        first, size_0 = yarns_matrix(weft, warp, bounds, fraction, inverse_length, slope, 0)
        second, size_1 = yarns_matrix(weft, warp, bounds, fraction, inverse_length, slope, 1)
        third, size_2 = yarns_matrix(weft, warp, bounds, fraction, inverse_length, slope, 2)
        add_packet_pairs(
            diagonal_out, triangles.corners, start, lanes,
            folds_0, folds_1, folds_2,
            diagonal_of(first, size_0), diagonal_of(second, size_1), diagonal_of(third, size_2),
        )  # fmt: skip
        add_packets(
            off_diagonal_out, triangles.corners, start, lanes,
            off_diagonal_of(first), off_diagonal_of(second), off_diagonal_of(third),
        )  # fmt: skip

    return sum_bounds


def _end_kernel(precision: str) -> wp.Kernel:
    types = cloth_types(precision)
    real, vec4, vec6, Model, State = types.real, types.vec4, types.vec6, types.Model, types.State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def take_bounds(
        model: Model,
        state: State,
        diagonal: wp.array(dtype=vec4),  # of sum_bounds, shape [V]
        off_diagonal: wp.array(dtype=vec4),
    ):
        """Sets the compliance of every vertex whose item takes anisotropic steps."""
        vertex = wp.tid()
        if rests(model, vertex):
            return
        limit = model.items[model.item[vertex]].anisotropy_limit
        if limit == real(0.0):
            return
        a, b = diagonal[vertex], off_diagonal[vertex]
        state.compliance[vertex] = compliance_of(vec6(a[0], a[1], a[2], b[0], b[1], b[2]), a[3], limit)

    return take_bounds


@functools.cache
def packet_compliance_kernels(precision: str, terms: Terms) -> SimpleNamespace:
    """Kernels ``begin_bounds``, ``sum_bounds`` and ``take_bounds``."""
    return SimpleNamespace(
        begin_bounds=_begin_kernel(precision),
        sum_bounds=_sum_kernel(precision, terms),
        take_bounds=_end_kernel(precision),
    )
