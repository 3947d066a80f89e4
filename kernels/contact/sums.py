"""Contact sums: what pairs add at each vertex, as integers, and what a move takes of these and resets."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element, permuted
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    FORCE_UNIT,
    LENGTH_UNIT,
    NO_LIMIT,
    STIFFNESS_UNIT,
    ContactData,
    VertexContact,
)

# No result is used: with an atomic that returns the old value a GPU would wait for the memory.
_ADD_UNITS = """
    const wp::int64 units[4] = {x, y, z, extra};
    wp::int64* const to = load.data + 4 * vertex;
#pragma unroll
    for (int k = 0; k < 4; ++k)
#if defined(__CUDA_ARCH__)
        asm volatile("red.relaxed.gpu.global.add.u64 [%0], %1;" :: "l"(to + k), "l"(units[k]) : "memory");
#else
        to[k] += units[k];
#endif
"""

_LOWER_LIMIT = """
#if defined(__CUDA_ARCH__)
    asm volatile("red.relaxed.gpu.global.min.s32 [%0], %1;" :: "l"(limits.data + vertex), "r"(limit) : "memory");
#else
    if (limit < limits.data[vertex])
        limits.data[vertex] = limit;
#endif
"""


@wp.func_native(_ADD_UNITS)
def add_load_units(
    load: wp.array2d(dtype=wp.int64), vertex: int, x: wp.int64, y: wp.int64, z: wp.int64, extra: wp.int64
):
    """Adds integers to a vertex's load."""
    wp.atomic_add(load, vertex, 0, x)


@wp.func_native(_LOWER_LIMIT)
def lower_step_limit(limits: wp.array(dtype=wp.int32), vertex: int, limit: int):
    """Lowers a vertex's step limit to this one, where that is lower."""
    wp.atomic_min(limits, vertex, limit)


@functools.cache
def add_functions(real: type) -> SimpleNamespace:
    """Functions ``add_pair`` and ``add_couples``, which distribute forces of a precision to vertices' loads."""
    vec3, vec4 = wp.types.vector(3, real), wp.types.vector(4, real)
    by_force, by_stiffness = wp.constant(real(1.0 / float(FORCE_UNIT))), wp.constant(real(1.0 / float(STIFFNESS_UNIT)))

    @wp.func
    def add_vertex_load(load: wp.array2d(dtype=wp.int64), vertex: int, force: vec3, extra: real):
        """Adds a force [N] and a fourth component to a vertex's load."""
        units = force * by_force
        add_load_units(
            load, vertex, wp.int64(units[0]), wp.int64(units[1]), wp.int64(units[2]), wp.int64(extra * by_stiffness)
        )

    @wp.func
    def add_pair(load: wp.array2d(dtype=wp.int64), corners: wp.vec4i, weights: vec4, force: vec3, extra: real):
        """Adds w_i times the force on a pair's first [N], and |w_i| times a fourth component, w_i the weights."""
        for corner in range(4):
            add_vertex_load(load, corners[corner], weights[corner] * force, wp.abs(weights[corner]) * extra)

    @wp.func
    def add_couples(load: wp.array2d(dtype=wp.int64), corners: wp.vec4i, couple_0: vec3, couple_1: vec3, extra: real):
        """Adds a couple, opposite forces on the ends [N], to each of two edges, and a fourth component to all ends."""
        add_vertex_load(load, corners[0], couple_0, extra)
        add_vertex_load(load, corners[1], -couple_0, extra)
        add_vertex_load(load, corners[2], couple_1, extra)
        add_vertex_load(load, corners[3], -couple_1, extra)

    return SimpleNamespace(add_pair=add_pair, add_couples=add_couples)


_ROW = """
    const wp::vec_t<2, wp::int64>* row = reinterpret_cast<const wp::vec_t<2, wp::int64>*>(
        __builtin_assume_aligned(load.data + 4 * vertex, 16));
    const wp::vec_t<2, wp::int64> one = row[0], two = row[1];
    return wp::vec_t<4, wp::int64>(one[0], one[1], two[0], two[1]);
"""
Row = wp.types.vector(length=4, dtype=wp.int64)


@wp.func_native(_ROW)
def load_row(load: wp.array2d(dtype=wp.int64), vertex: int) -> Row:
    """A vertex's sums, by two 16-byte loads."""
    return Row(load[vertex, 0], load[vertex, 1], load[vertex, 2], load[vertex, 3])


@wp.func
def clear_row(load: wp.array2d(dtype=wp.int64), vertex: int, row: Row):
    """Resets a vertex's sums to zero."""
    if (row[0] | row[1] | row[2] | row[3]) != wp.int64(0):
        for column in range(4):
            load[vertex, column] = wp.int64(0)


@functools.cache
def conversion_function(precision: str) -> wp.Function:
    """Function ``in_newtons``."""
    types = cloth_types(precision)
    real, vec4 = types.real, types.vec4
    force, stiffness = wp.constant(real(float(FORCE_UNIT))), wp.constant(real(float(STIFFNESS_UNIT)))

    @wp.func
    def in_newtons(row: Row):
        """Force [N] and fourth component of a vertex's sums."""
        return vec4(real(row[0]) * force, real(row[1]) * force, real(row[2]) * force, real(row[3]) * stiffness)

    return in_newtons


@functools.cache
def take_load_function(precision: str) -> wp.Function:
    """Function ``take_contact_load``."""
    in_newtons = conversion_function(precision)

    @wp.func
    def take_contact_load(contact: ContactData, vertex: int, known: VertexContact):
        """Contact's force [N] and fourth component at a vertex, and the vertex's step limit [m]. Resets both sums.

        Within the limit it cannot reach anything, listed or not.
        """
        row = load_row(contact.sums.load, vertex)  # all loads come before any store
        limit = element(contact.sums.step_limit, vertex)
        clear_row(contact.sums.load, vertex, row)
        longest = known.step_limit
        if limit != NO_LIMIT:
            contact.sums.step_limit[vertex] = NO_LIMIT
            longest = wp.min(float(limit) * float(LENGTH_UNIT), known.step_limit)
        return in_newtons(row), longest

    return take_contact_load


@functools.cache
def add_load_kernel(precision: str) -> wp.Kernel:
    """Kernel ``add_contact_load``."""
    types = cloth_types(precision)
    vec4, in_newtons = types.vec4, conversion_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_contact_load(
        contact: ContactData,
        order: wp.array(dtype=wp.int32),  # each vertex's number in ``load``, shape [V]; empty: the same numbers
        load: wp.array(dtype=vec4),  # force [N] and fourth component, shape [V]
    ):
        """Adds a vertex's sums to its load, and resets them."""
        place = wp.tid()
        vertex = permuted(order, place)
        row = load_row(contact.sums.load, place)
        clear_row(contact.sums.load, place, row)
        load[vertex] = load[vertex] + in_newtons(row)

    return add_contact_load
