"""Elements in memory, one at a time or a packet of eight: the same functions for both, chosen by ``lanes``.

Elements follow one another in their arrays; their places are the indices that these hold. See ``packet_memory``.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import add_to, element
from warp_cloth.kernels.base.types import cloth_types, rests
from warp_cloth.kernels.math.packet_memory import (
    active_lanes,
    add_packets,
    first_of_packet,
    load_packet,
    load_packet_at,
    load_packet_signed,
    load_sides,
    load_signs,
    store_packet,
)


@wp.func
def first_element(number: int, count: int):
    """The first, and only, element of a thread."""
    return number


@wp.func
def load_element(array: Any, first: int):
    """An element."""
    return element(array, first)


@wp.func
def load_element_at(array: Any, places: Any, first: int, which: int):
    """What is at one of an element's places."""
    return element(array, element(places, first)[which])


@wp.func
def load_element_signed(array: Any, places: Any, first: int, which: int):
    """The same, where place p may be stored as -1 - p."""
    place = element(places, first)[which]
    return element(array, wp.where(place < 0, -1 - place, place))


@wp.func
def load_sign(like: Any, places: Any, first: int, which: int):
    """-1 where a place is stored as -1 - p, else 1."""
    one = type(like)(1.0)
    return wp.where(element(places, first)[which] < 0, -one, one)


@wp.func
def store_element(array: Any, first: int, value: Any):
    """Stores an element."""
    array[first] = value


@wp.func
def add_elements(array: Any, places: Any, first: int, lanes: int, a: Any, b: Any):
    """Adds a and b at an element's two places."""
    place = element(places, first)
    add_to(array, place[0], a)
    add_to(array, place[1], b)


@wp.func
def add_elements(array: Any, places: Any, first: int, lanes: int, a: Any, b: Any, c: Any):  # noqa: F811
    """Adds a, b and c at an element's three places."""
    place = element(places, first)
    add_to(array, place[0], a)
    add_to(array, place[1], b)
    add_to(array, place[2], c)


@functools.cache
def lane_memory(precision: str, lanes: int) -> SimpleNamespace:
    """Functions ``first``, ``active``, ``load``, ``load_at``, ``load_signed``, ``load_signs``, ``load_sides``.

    And ``add`` and ``store``; of one element (``lanes`` 1) or of a packet.
    """
    if lanes > 1:
        return SimpleNamespace(
            first=first_of_packet, active=active_lanes, load=load_packet, load_at=load_packet_at,
            load_signed=load_packet_signed, load_signs=load_signs, load_sides=load_sides,
            add=add_packets, store=store_packet,
        )  # fmt: skip
    types = cloth_types(precision)
    real, vec3, Model = types.real, types.vec3, types.Model

    @wp.func
    def active(model: Model, places: Any, number: int):
        """1 where the item of an element iterates, else 0."""
        return wp.where(rests(model, element(places, number)[0]), 0, 1)

    @wp.func
    def load_side(like: real, array: Any, places: Any, first: int, from_: int, to: int):
        """The difference from one of an element's places to another, subtracted in the array's precision."""
        place = element(places, first)
        side = element(array, place[to]) - element(array, place[from_])
        return vec3(real(side[0]), real(side[1]), real(side[2]))

    return SimpleNamespace(
        first=first_element, active=active, load=load_element, load_at=load_element_at,
        load_signed=load_element_signed, load_signs=load_sign, load_sides=load_side,
        add=add_elements, store=store_element,
    )  # fmt: skip
