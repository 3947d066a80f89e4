"""Vertices in the order in which patches own them, so that what a patch reads and writes lies together."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, rest_function


@functools.cache
def packing_kernels(precision: str, accelerated: bool) -> SimpleNamespace:
    """Kernels ``pack_vertices``, ``pack_leeway``, ``unpack_vertices``; ``accelerated``: vertices have a stiffness.

    Items that no longer iterate are left out. An item's vertices lie at the same places in both orders.
    """
    types = cloth_types(precision)
    point, real, vec3, Cloth = types.point, types.real, types.vec3, types.Cloth
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def pack_vertices(
        order: wp.array(dtype=wp.int32),  # vertices as patches own them, shape [V]
        cloth: Cloth,
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=vec3),  # [m], shape [V]
        beside_position_out: wp.array(dtype=point),  # the same, for iterations that write beside what they read
        beside_move_out: wp.array(dtype=vec3),
        stiffness_out: wp.array(dtype=real),  # [N/m], shape [V]
    ):
        """Puts what iterations change in the patches' order."""
        place = wp.tid()
        if rests(cloth, place):
            return
        vertex = element(order, place)
        position, move = element(cloth.position, vertex), element(cloth.move, vertex)
        position_out[place] = position
        move_out[place] = move
        beside_position_out[place] = position
        beside_move_out[place] = move
        if wp.static(accelerated):
            stiffness_out[place] = element(cloth.stiffness, vertex)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def pack_leeway(
        order: wp.array(dtype=wp.int32),  # vertices as patches own them, shape [V]
        cloth: Cloth,
        leeway_out: wp.array(dtype=types.vec6),  # shape [V]
    ):
        """Puts the vertices' leeway, which iterations only read, in the patches' order."""
        place = wp.tid()
        if rests(cloth, place):
            return
        leeway_out[place] = cloth.leeway[element(order, place)]

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def unpack_vertices(
        order: wp.array(dtype=wp.int32),  # vertices as patches own them, shape [V]
        packed: Cloth,
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=vec3),  # [m], shape [V]
        stiffness_out: wp.array(dtype=real),  # [N/m], shape [V]
    ):
        """Puts it back in the garments' order."""
        place = wp.tid()
        if rests(packed, place):
            return
        vertex = element(order, place)
        position_out[vertex] = element(packed.position, place)
        move_out[vertex] = element(packed.move, place)
        if wp.static(accelerated):
            stiffness_out[vertex] = element(packed.stiffness, place)

    return SimpleNamespace(pack_vertices=pack_vertices, pack_leeway=pack_leeway, unpack_vertices=unpack_vertices)
