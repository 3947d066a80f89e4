"""The kernel that moves a packet of vertices at a time where they lie; for the CPU's iterations.

The step itself is that of one vertex (``passes.step``, with its lanes) and so is a meeting with the avatar
(``passes.avatar_contact``). Here is what a packet has besides: which of its lanes move, which are near the avatar.
"""

import functools

import warp as wp

from warp_cloth.kernels.avatar.field import fetch_field, field_contact
from warp_cloth.kernels.base.access import element, permuted
from warp_cloth.kernels.base.options import KernelOptions
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.packets import packet_contact_functions
from warp_cloth.kernels.laws.step import capped
from warp_cloth.kernels.math.lanes import WIDTH as PACKET_WIDTH
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import component, where_greater
from warp_cloth.kernels.math.packet_memory import (
    first_lane,
    first_of_packet,
    load_packet,
    move_packet,
    store_lanes,
    store_zeros,
)
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.math.symmetric import bounded_inverse, symmetric_times
from warp_cloth.kernels.passes.avatar_contact import LONGER, STEP, query_function
from warp_cloth.kernels.passes.step import (
    AHEAD,
    cloth_contact_type,
    colliders_type,
    compliant_descent,
    descent_function,
    momentum_function,
    saves_queries,
    swings_evenly,
)

WIDTH = wp.constant(PACKET_WIDTH)

_OF_ITEM = """
    int lanes = 0;
    for (int lane = 0; lane < 8; ++lane)
        lanes |= (array.data[first + lane] == number) << lane;
    return lanes;
"""
_UNPINNED = """
    int lanes = 0;
    for (int lane = 0; lane < 8; ++lane)
        lanes |= (array.data[first + lane] == 0) << lane;
    return lanes;
"""
_LOOSE = """
    wp::vec_t<8, %s> loose;
    for (int lane = 0; lane < 8; ++lane)
        loose.c[lane] = in_contact.data[first + lane] == 0;
    return loose;
"""
_FAR = """
    int lanes = 0;
    float left[8];
    for (int lane = 0; lane < 8; ++lane)
        left[lane] = clear.data[first + lane] - (longer * (wp::float32)displacement.c[lane] + step);
    for (int lane = 0; lane < 8; ++lane)
        lanes |= (left[lane] > 0.0f) << lane;
    lanes &= which;
    for (int lane = 0; lane < 8; ++lane)
        clear.data[first + lane] = lanes >> lane & 1 ? left[lane] : clear.data[first + lane];
    return lanes;
"""
_CLEAR_FLAGS = """
    for (int lane = 0; lane < 8; ++lane)
        array.data[first + lane] = lanes >> lane & 1 ? 0 : array.data[first + lane];
"""


@wp.func_native(_OF_ITEM)
def lanes_of(array: wp.array(dtype=wp.int32), first: int, number: int) -> int:
    """Bits of those of eight that are this number."""
    return array[first]


@wp.func_native(_UNPINNED)
def lanes_free(array: wp.array(dtype=wp.uint8), first: int) -> int:
    """Bits of those of eight that are 0."""
    return array[first]


@wp.func_native(_CLEAR_FLAGS)
def put_none(array: wp.array(dtype=wp.uint8), first: int, lanes: int):
    """Writes 0 to those of eight."""
    array[first] = wp.uint8(0)


for _real, _name in ((wp.float32, "float"), (wp.float64, "double")):
    _one = lane_types(_real, PACKET_WIDTH).real

    @wp.func_native(_LOOSE % _name)
    def loose_lanes(like: _one, in_contact: wp.array(dtype=wp.uint8), first: int) -> _one:
        """1 for those of eight vertices that nothing holds, else 0."""
        return in_contact[first]

    @wp.func_native(_FAR)
    def far_lanes(
        clear: wp.array(dtype=wp.float32),
        first: int,
        which: int,
        displacement: _one,
        longer: wp.float32,
        step: wp.float32,
    ) -> int:
        """Bits of those ``which`` of eight vertices that surely meet nothing on their way [m], and are less clear."""
        clear[first] = clear[first]
        return which


@functools.cache
def own_moves_function(options: KernelOptions) -> wp.Function:
    """The function ``own_moves``: the step of eight vertices where they meet nothing."""
    precision, steady = options.precision, swings_evenly(options)
    types, packets = cloth_types(precision), lane_types(cloth_types(precision).real, PACKET_WIDTH)
    real, Model, State, Step, Item = types.real, types.Model, types.State, types.Step, types.Item
    force_descent = descent_function(precision, steady, lanes=PACKET_WIDTH)
    with_momentum = momentum_function(precision, steady)

    @wp.func
    def own_moves(
        model: Model, state: State, step: Step, load: packets.vec4, pressed: packets.real, first: int, item: Item
    ):
        """Displacements of eight vertices by their forces, and the stiffness that they go by.

        ``pressed``: what of the stiffness bound is not the cloth's own but of cloth that presses.
        """
        weight = load_packet(model.weight, first)
        force, descent, stiffness, momentum_ratio = force_descent(
            step, load, weight, load_packet(state.stiffness, first), item
        )
        if wp.static(options.anisotropic):
            if item.anisotropy_limit > real(0.0):
                loose = loose_lanes(momentum_ratio, state.in_contact, first)
                compliance = load_packet(state.compliance, first)
                if wp.static(options.cloth_contact):  # what contact and friction hold is held alike in all directions
                    own = component(load, 3) - pressed + weight / packets.real(item.cap)
                    further = compliant_descent(bounded_inverse(compliance), force, own, stiffness)
                else:
                    further = symmetric_times(compliance, descent)
                descent = where_greater(loose, packets.real(real(0.0)), further, descent)
        last = load_packet(state.displacement, first)
        return with_momentum(step, item, force, descent, last, momentum_ratio), stiffness

    return own_moves


@functools.cache
def met_moves_function(options: KernelOptions) -> wp.Function:
    """The function ``met_moves``: what the avatar leaves of eight vertices' displacements."""
    types, packets = cloth_types(options.precision), lane_types(cloth_types(options.precision).real, PACKET_WIDTH)
    vec3, vec6, State, Item, Vertex = types.vec3, types.vec6, types.State, types.Item, types.Vertex
    spares, collider_type = saves_queries(options), options.collider
    Contact = cloth_contact_type(options.cloth_contact)
    query_avatar = query_function(options, spares, prefetched=False)

    @wp.func
    def met_moves(
        state: State,
        collider: collider_type,
        contact: Contact,
        order: wp.array(dtype=wp.int32),
        first: int,
        lanes: int,
        moves: packets.vec3,
        item: Item,
    ):
        """Their displacements after contact and friction, and what of them has momentum; those of ``lanes`` only."""
        met = moves
        momentum = moves
        near = lanes
        if wp.static(spares):
            far = far_lanes(state.clearance, first, lanes, root(inner(moves, moves)), LONGER, STEP)
            near = lanes & ~far
            if wp.static(options.anisotropic):
                put_none(state.in_contact, first, far)
        while near != 0:
            lane = first_lane(near)
            vertex = first + lane
            move = vec3(moves[lane], moves[WIDTH + lane], moves[2 * WIDTH + lane])
            near_one = Vertex()
            near_one.index = vertex
            near_one.item = item
            near_one.position = element(state.position, vertex)
            lift = float(0.0)
            if wp.static(options.cloth_contact):
                lift = element(contact.model.lift, permuted(order, vertex))
            move, inertial = query_avatar(state, collider, False, vec6(), lift, near_one, move)
            for axis in range(3):
                met[WIDTH * axis + lane] = move[axis]
                momentum[WIDTH * axis + lane] = inertial[axis]
            near &= near - 1
        return met, momentum

    return met_moves


@functools.cache
def displace_lanes_function(options: KernelOptions) -> wp.Function:
    """The function ``displace_lanes``."""
    types, packets = cloth_types(options.precision), lane_types(cloth_types(options.precision).real, PACKET_WIDTH)
    Model, State, Step, Item = types.Model, types.State, types.Step, types.Item
    avatar_contact, cloth_contact = options.avatar_contact, options.cloth_contact
    Colliders, Contact = colliders_type(avatar_contact, options.collider), cloth_contact_type(cloth_contact)
    own_moves = own_moves_function(options)
    met_moves = None if avatar_contact is None else met_moves_function(options)
    meets_cloth = packet_contact_functions(options.precision)

    @wp.func
    def displace_lanes(  # eleven arguments: the kernel's own, and which of eight vertices of which item
        model: Model,
        state: State,
        step: Step,
        colliders: Colliders,
        contact: Contact,
        order: wp.array(dtype=wp.int32),
        loads: packets.vec4,
        first: int,
        lanes: int,
        number: int,
        item: Item,
    ):
        """Moves those of eight vertices, all of an item: ``lanes`` but for what is pinned."""
        free = lanes
        if wp.static(options.terms.pins):
            free = lanes & lanes_free(model.pinned, first)
        pressed = packets.real()
        if wp.static(cloth_contact):
            contact_loads, limits, shifts, moved = meets_cloth.take_contact(state, contact, order, first, lanes, free)
            pressed = component(contact_loads, 3)
            loads = loads + contact_loads
        moves, stiffness = own_moves(model, state, step, loads, pressed, first, item)
        if wp.static(cloth_contact):
            moves = moves + shifts
        momentum = moves
        if wp.static(avatar_contact is not None):
            moves, momentum = met_moves(state, colliders[number], contact, order, first, free, moves, item)
        if wp.static(cloth_contact):
            moves, momentum = capped(moves, limits), capped(momentum, limits) - shifts
            meets_cloth.note_moves(contact, order, first, lanes, moved, root(inner(moves, moves)))
        move_packet(state.position, state.displacement, first, free, moves, momentum)
        store_lanes(state.stiffness, first, free, stiffness)

    return displace_lanes


@functools.cache
def packet_displace_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``displace_vertices`` of the accelerated step."""
    types, avatar_contact = cloth_types(options.precision), options.avatar_contact
    vec4, Model, State, Step = types.vec4, types.Model, types.State, types.Step
    Colliders = colliders_type(avatar_contact, options.collider)
    displace_lanes = displace_lanes_function(options)

    @wp.func
    def fetch_ahead(model: Model, state: State, colliders: Colliders, first: int):
        """Prefetches what vertices need of the avatar's field that are moved soon."""
        if first + AHEAD + WIDTH <= model.weight.shape[0]:
            for lane in range(WIDTH):
                vertex = first + AHEAD + lane
                if element(state.clearance, vertex) == 0.0:
                    fetch_field(colliders[element(model.item, vertex)], wp.vec3d(element(state.position, vertex)))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_vertices(
        model: Model,
        state: State,
        step: Step,
        colliders: Colliders,
        contact: cloth_contact_type(options.cloth_contact),
        order: wp.array(dtype=wp.int32),  # number that contact has for each vertex, shape [V]; empty: the same
        load_out: wp.array(dtype=vec4),  # the cloth's forces [N] and stiffness bounds [N/m], shape [V]; left at zero
    ):
        """Moves those of eight vertices that are free and of items that are not at rest."""
        first = first_of_packet(wp.tid(), model.weight.shape[0])
        lanes = 256 - (1 << (WIDTH * wp.tid() - first))  # the others are moved already
        loads = load_packet(load_out, first)
        store_zeros(load_out, first)
        if wp.static(avatar_contact is field_contact):
            fetch_ahead(model, state, colliders, first)
        for number in range(element(model.item, first), element(model.item, first + WIDTH - 1) + 1):
            item = model.items[number]
            own = lanes & lanes_of(model.item, first, number)
            if item.active != 0 and own != 0:
                displace_lanes(model, state, step, colliders, contact, order, loads, first, own, number, item)

    return displace_vertices
