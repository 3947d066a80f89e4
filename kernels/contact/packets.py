"""Cloth contact of eight vertices at a time, for the CPU's iterations: what a move reads of it, and what it records."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element, permuted
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.contact.arrays import ContactData, VertexContact, load_vertex_contact
from warp_cloth.kernels.contact.search_trigger import load_bounds, note_displacement
from warp_cloth.kernels.contact.sums import take_load_function
from warp_cloth.kernels.math.lanes import WIDTH as EIGHT
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.packet_memory import first_lane

WIDTH = wp.constant(EIGHT)


@functools.cache
def packet_contact_functions(precision: str) -> SimpleNamespace:
    """Functions ``take_contact`` and ``note_moves``."""
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, EIGHT)
    real, State = types.real, types.State
    take_contact_load = take_load_function(precision)

    @wp.func
    def take_contact(
        state: State, contact: ContactData, order: wp.array(dtype=wp.int32), first: int, lanes: int, free: int
    ):
        """Contact's loads, step limits and shifts, and distances moved since the last search, of eight vertices.

        Distances are those of ``lanes``; the rest that of ``free`` ones among these, whose sums are reset. ``order``:
        the number that contact has for each vertex; empty: the same.
        """
        loads = packets.vec4()
        limits = packets.real()
        shifts = packets.vec3()
        moved = packets.real()
        left = lanes
        while left != 0:  # not unrolled: what is called at one place is inlined, and its structs are not copied
            lane = first_lane(left)
            position = wp.vec3d(element(state.position, first + lane))
            vertex = permuted(order, first + lane)
            known = load_vertex_contact(contact, vertex, position)
            moved[lane] = real(known.moved)
            if (free >> lane) & 1 != 0:
                load, longest = take_contact_load(contact, vertex, known)
                limits[lane] = real(longest)
                for row in range(4):
                    loads[WIDTH * row + lane] = load[row]
                for axis in range(3):
                    shifts[WIDTH * axis + lane] = real(known.shift[axis])
            left &= left - 1
        return loads, limits, shifts, moved

    @wp.func
    def note_moves(
        contact: ContactData,
        order: wp.array(dtype=wp.int32),
        first: int,
        lanes: int,
        moved: packets.real,
        lengths: packets.real,
    ):
        """``note_displacement`` of those of eight vertices; ``moved`` is of ``take_contact``."""
        left = lanes
        while left != 0:
            lane = first_lane(left)
            vertex = permuted(order, first + lane)
            known = VertexContact()
            known.moved = float(moved[lane])
            known.skin = element(contact.trigger.skin, vertex)
            known.region = element(contact.bounds.region, vertex)
            iteration, path = load_bounds(contact, vertex)
            note_displacement(contact, vertex, known, float(lengths[lane]), iteration, path)
            left &= left - 1

    return SimpleNamespace(take_contact=take_contact, note_moves=note_moves)
