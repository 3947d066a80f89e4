"""What pressed pairs add up to at each vertex, as whole numbers: taken, and left at zero."""

import functools

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import (
    FORCE_UNIT,
    NO_LIMIT,
    ROOM_UNIT,
    STIFFNESS_UNIT,
    ContactBefore,
    ContactData,
)

_ROW = """
    const wp::vec_t<2, wp::int64>* row = reinterpret_cast<const wp::vec_t<2, wp::int64>*>(
        __builtin_assume_aligned(sum.data + 4 * vertex, 16));
    const wp::vec_t<2, wp::int64> one = row[0], two = row[1];
    return wp::vec_t<4, wp::int64>(one[0], one[1], two[0], two[1]);
"""
Row = wp.types.vector(length=4, dtype=wp.int64)


@wp.func_native(_ROW)
def sum_row(sum: wp.array2d(dtype=wp.int64), vertex: int) -> Row:
    """A vertex's sum."""
    return Row(sum[vertex, 0], sum[vertex, 1], sum[vertex, 2], sum[vertex, 3])


@wp.func
def leave_none(sum: wp.array2d(dtype=wp.int64), vertex: int, row: Row):
    """Leaves a vertex's sum at zero."""
    if (row[0] | row[1] | row[2] | row[3]) != wp.int64(0):
        for column in range(4):
            sum[vertex, column] = wp.int64(0)


@functools.cache
def row_function(precision: str) -> wp.Function:
    """The function that makes force [N] and bound or magnitude of a vertex's sum."""
    types = cloth_types(precision)
    real, vec4 = types.real, types.vec4
    force, stiffness = wp.constant(real(float(FORCE_UNIT))), wp.constant(real(float(STIFFNESS_UNIT)))

    @wp.func
    def load_of(row: Row):
        """Force [N] and bound or magnitude of a sum."""
        return vec4(real(row[0]) * force, real(row[1]) * force, real(row[2]) * force, real(row[3]) * stiffness)

    return load_of


@functools.cache
def taken_function(precision: str) -> wp.Function:
    """The function that takes what was pressed of a vertex."""
    load_of = row_function(precision)

    @wp.func
    def contact_taken(contact: ContactData, vertex: int, before: ContactBefore):
        """Force [N] and bound or magnitude that contact adds at a vertex, and how far this may move [m].

        That is before it could meet something, known or not. Leaves the sum at zero and the room open.
        """
        row = sum_row(contact.sum, vertex)  # asked for together, before anything is written
        nearest = element(contact.room, vertex)
        leave_none(contact.sum, vertex, row)
        room = before.room
        if nearest != NO_LIMIT:
            contact.room[vertex] = NO_LIMIT
            room = wp.min(float(nearest) * float(ROOM_UNIT), before.room)
        return load_of(row), room

    return contact_taken


@functools.cache
def sum_function(precision: str) -> wp.Function:
    """The function that reads a vertex's sum."""
    load_of = row_function(precision)

    @wp.func
    def contact_sum(contact: ContactData, vertex: int):
        """Force [N] and bound or magnitude that contact adds at a vertex; leaves the sum at zero."""
        row = sum_row(contact.sum, vertex)
        leave_none(contact.sum, vertex, row)
        return load_of(row)

    return contact_sum


@functools.cache
def add_kernel(precision: str) -> wp.Kernel:
    """Kernel ``add_contact``, which hands the sums on to what reads a load."""
    types = cloth_types(precision)
    vec4, contact_sum = types.vec4, sum_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def add_contact(
        contact: ContactData,
        order: wp.array(dtype=wp.int32),  # where contact has vertices in another order, theirs in the load's, shape [V]
        load: wp.array(dtype=vec4),  # force [N] and bound or magnitude, shape [V]
    ):
        """Adds a vertex's sum to its load, and leaves the sum at zero."""
        place = wp.tid()
        vertex = int(place)
        if order.shape[0] > 0:
            vertex = order[place]
        load[vertex] = load[vertex] + contact_sum(contact, place)

    return add_contact
