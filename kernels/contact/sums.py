"""Contact sums: what pairs add up to at each vertex, as integers; they are read and reset."""

import functools

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    FORCE_UNIT,
    LENGTH_UNIT,
    NO_LIMIT,
    STIFFNESS_UNIT,
    ContactData,
    VertexContact,
)

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
        vertex = int(place)
        if order.shape[0] > 0:
            vertex = order[place]
        row = load_row(contact.sums.load, place)
        clear_row(contact.sums.load, place, row)
        load[vertex] = load[vertex] + in_newtons(row)

    return add_contact_load
