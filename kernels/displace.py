"""Force, cap, displacement: one iteration's end for a vertex (the paper, section 4), then contact (section 5)."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.access import element, put
from warp_cloth.kernels.arithmetic import inner, quotient, root, scaled_sum
from warp_cloth.kernels.block import (
    BLOCK_THREADS,
    BLOCKS_PER_CORE,
    FEW_PER_CORE,
    ask_no_earlier,
    block_of,
    lane_of,
    patch_threads,
    wait_for_block,
)
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Terms, cloth_types, free_function
from warp_cloth.kernels.cloth_contact import ClothContact, contact_room, contact_sum, contact_watch
from warp_cloth.kernels.field import fetch_field, field_contact
from warp_cloth.kernels.friction import friction_slide
from warp_cloth.kernels.gather import patch_functions
from warp_cloth.kernels.packing import order_functions
from warp_cloth.kernels.patch_memory import leaves, patch_of
from warp_cloth.kernels.stiffness import symmetric_functions

AHEAD = wp.constant(8)  # vertices for which the CPU's memory is asked before it is needed


@wp.func
def capped(force: Any, limit: Any):
    """The force, or where it passes the limit one of that size in its direction (the paper, section 4)."""
    size = root(inner(force, force))
    return force * wp.where(size > limit, quotient(limit, size), type(limit)(1.0))


@wp.func
def direct_move(force: Any, weight: Any, cap: Any):
    """Displacement [m] by the paper's rule: total force, capped slightly above gravity, added to the position.

    A force of 1.1 weights is "slightly larger than gravity" and moves the vertex by ``cap``.
    """
    limit = type(weight)(1.1) * weight
    return capped(force, limit) * (cap / limit)


@wp.func
def accelerated_move(force: Any, way: Any, last: Any, momentum: Any, damping: Any, cap: Any):
    """Displacement [m]: the way of force over stiffness, plus momentum, damped where it fights the force."""
    kept = wp.where(inner(last, force) < type(cap)(0.0), momentum * damping, momentum)
    return capped(scaled_sum(last, kept, way), cap)


@wp.struct
class NoCollider:
    """A scene without avatar asks nothing."""


def colliders_type(contact: wp.Function | None, collider_type: type) -> Any:
    """What kernels take for the items' avatars: an array of their structs, or nothing where there are none."""
    return NoCollider if contact is None else wp.array(dtype=collider_type)


@wp.struct
class NoClothContact:
    """Cloth that passes through cloth asks nothing."""


def touch_type(touches: bool) -> type:
    """The struct that tells of cloth on cloth, where it is told at all."""
    return ClothContact if touches else NoClothContact


def wears(accelerated: bool, contact: wp.Function | None, touches: bool) -> bool:
    """Whether a scene's cloth may be loose (kernels.leeway): it is worn by an avatar, and does not meet itself.

    What hangs is taut, and loses nothing by steps alike in all directions; of what meets itself the pushes would have
    to be told from what resists.
    """
    return accelerated and contact is not None and not touches


@functools.cache
def held_function(precision: str, accelerated: bool, in_order: bool) -> wp.Function:
    """The function that reads a vertex; ``in_order``: vertices are packed."""
    types = cloth_types(precision)
    Cloth, Vertex = types.Cloth, types.Vertex
    order = order_functions(precision, in_order)
    position_at, move_at = order.position_at, order.move_at

    @wp.func
    def held_vertex(cloth: Cloth, vertex: int):
        """A vertex as it lies, what last moved it, its weight and the stiffness that it went by."""
        held = Vertex()
        held.position = position_at(cloth, vertex)
        held.weight = element(cloth.weight, vertex)
        if wp.static(accelerated):
            held.move = move_at(cloth, vertex)
            held.stiffness = element(cloth.stiffness, vertex)
        return held

    return held_vertex


@functools.cache
def displacement(
    precision: str, accelerated: bool, contact: wp.Function | None, collider_type: type, touches: bool
) -> wp.Function:
    """The function that turns a free vertex's load into its displacement [m], contact and friction included.

    Args:
        precision: of positions and forces.
        accelerated: each vertex by its own step and with momentum; otherwise by the paper's rule.
        contact: (collider, world position) -> (normal, distance [m]); None where the scene has no avatar.
        collider_type: the struct that it asks, one for each item; NoCollider without avatar.
        touches: whether cloth meets cloth.
    """
    types = cloth_types(precision)
    real, vec3, vec4, Vertex, Step, Item = types.real, types.vec3, types.vec4, types.Vertex, types.Step, types.Item
    Cloth = types.Cloth
    Colliders, Touch = colliders_type(contact, collider_type), touch_type(touches)
    worn = wears(accelerated, contact, touches)
    times = symmetric_functions(precision).times

    @wp.func
    def vertex_displacement(
        cloth: Cloth,
        step: Step,
        colliders: Colliders,
        touch: Touch,
        load: vec4,
        held: Vertex,
        vertex: int,
        number: int,
        item: Item,
    ):
        """Displacement of a vertex, the part of it that has momentum, and the stiffness that it went by.

        ``number`` is of the item that the vertex belongs to.
        """
        shift = vec3()
        lift = float(0.0)
        room = real(0.0)
        if wp.static(touches):  # asked for at once: a GPU waits for memory far longer than it works
            load += vec4(contact_sum(touch, vertex))
            room = real(contact_room(touch, vertex, wp.vec3d(held.position)))
            shift = vec3(touch.shift[vertex])
            lift = touch.lift[vertex]
        weight = held.weight
        force = scaled_sum(step.gravity, weight, vec3(load[0], load[1], load[2]))
        move = vec3()
        stiffness = real(0.0)
        if wp.static(accelerated):
            last = held.stiffness
            memory = step.memory
            if wp.static(worn):
                memory = wp.where(item.leeway > real(0.0), memory, step.memory_falling)
            stiffness = wp.max(load[3] + quotient(weight, item.cap), last * memory)
            kept = wp.min(quotient(last, stiffness), real(1.0))
            if wp.static(worn):
                kept = root(kept)
            way = force * quotient(real(1.0), stiffness)
            if wp.static(worn):
                # what is held by contact and friction is held alike in all directions
                if item.leeway > real(0.0) and cloth.held[vertex] == wp.uint8(0):
                    way = times(cloth.leeway[vertex], way)
            move = accelerated_move(force, way, held.move, step.momentum * kept, step.damping, item.cap)
        else:
            move = direct_move(force, weight, item.cap)
        if wp.static(touches):
            move += shift
        if wp.static(contact is not None):
            at = contact(colliders[number], wp.vec3d(held.position) + wp.vec3d(move))
            push = item.offset - at[3]
            if wp.static(touches):
                push += lift
            if wp.static(worn):
                cloth.held[vertex] = wp.where(push > 0.0, wp.uint8(1), wp.uint8(0))
            if push > 0.0:
                normal = vec3(real(at[0]), real(at[1]), real(at[2]))
                pushed = scaled_sum(normal, wp.min(real(push), item.cap), move)
                move = friction_slide(pushed, normal, real(push), real(item.friction))
        if wp.static(touches):
            move = capped(move, room)
        return move, move - shift, stiffness

    return vertex_displacement


def step_bound(accelerated: bool, contact: wp.Function | None, touches: bool) -> str:
    """Which of cloth.FOURTH_PARTS an iteration needs; arguments as of ``displacement``."""
    if not accelerated:
        return "none"
    return "leeway" if wears(accelerated, contact, touches) else "stiffness"


@functools.cache
def displace_kernel(
    precision: str, accelerated: bool, contact: wp.Function | None, collider_type: type, touches: bool, pins: bool
) -> wp.Kernel:
    """Kernel ``displace_vertices``, which moves the cloth where it lies; arguments as of ``displacement``.

    ``pins``: whether any vertex is pinned.
    """
    types = cloth_types(precision)
    point, vec3, vec4, Cloth, Step = types.point, types.vec3, types.vec4, types.Cloth, types.Step
    vertex_displacement = displacement(precision, accelerated, contact, collider_type, touches)
    Touch = touch_type(touches)
    held_vertex = held_function(precision, accelerated, in_order=False)
    free = free_function(precision, pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_vertices(
        step: Step,
        colliders: colliders_type(contact, collider_type),
        touch: Touch,
        load: wp.array(dtype=vec4),  # forces of the cloth [N] and stiffness bounds [N/m], shape [V]; left at zero
        cloth: Cloth,
    ):
        """Moves each free vertex of an item that is not at rest."""
        vertex = wp.tid()
        sum = element(load, vertex)
        load[vertex] = vec4()
        number = element(cloth.item, vertex)
        if wp.static(contact is field_contact):
            if vertex + AHEAD < cloth.weight.shape[0]:
                fetch_field(colliders[number], wp.vec3d(element(cloth.position, vertex + AHEAD)))
        item = cloth.items[number]
        if item.active == 0:
            return
        move = vec3()
        if free(cloth, vertex):
            held = held_vertex(cloth, vertex)
            move, kept, stiffness = vertex_displacement(cloth, step, colliders, touch, sum, held, vertex, number, item)
            cloth.move[vertex] = kept
            cloth.position[vertex] = held.position + point(move)
            if wp.static(accelerated):
                cloth.stiffness[vertex] = stiffness
        if wp.static(touches):
            contact_watch(touch, vertex, wp.vec3d(cloth.position[vertex]), wp.vec3d(move))

    return displace_vertices


@functools.cache
def end_function(
    precision: str, accelerated: bool, contact: wp.Function | None, collider_type: type, touches: bool
) -> wp.Function:
    """The function that ends a vertex' iteration, from one set of arrays to another; arguments of ``displacement``."""
    types = cloth_types(precision)
    point, vec3, Cloth, Vertex, Step, Item = (
        types.point, types.vec3, types.Cloth, types.Vertex, types.Step, types.Item,
    )  # fmt: skip
    vertex_displacement = displacement(precision, accelerated, contact, collider_type, touches)
    Colliders, Touch = colliders_type(contact, collider_type), touch_type(touches)
    order = order_functions(precision, in_order=not touches)
    put_position, put_move = order.put_position, order.put_move

    @wp.func
    def end_vertex(
        step: Step,
        colliders: Colliders,
        touch: Touch,
        cloth: Cloth,
        load: types.vec4,
        held: Vertex,
        vertex: int,
        moves: bool,
        number: int,
        item: Item,
        position_out: wp.array(dtype=point),
        move_out: wp.array(dtype=order.move),
    ):
        """Moves a vertex, if it ``moves``; ``number`` is of its item."""
        move, kept = vec3(), vec3()
        if moves:
            move, kept, stiffness = vertex_displacement(cloth, step, colliders, touch, load, held, vertex, number, item)
            if wp.static(accelerated):
                put(cloth.stiffness, vertex, stiffness)
        put_move(move_out, vertex, kept)
        position = held.position + point(move)
        put_position(position_out, vertex, position)
        if wp.static(touches):
            contact_watch(touch, vertex, wp.vec3d(position), wp.vec3d(move))

    return end_vertex


@functools.cache
def advance_kernel(
    precision: str,
    accelerated: bool,
    terms: Terms,
    fits: bool,
    contact: wp.Function | None,
    collider_type: type,
    touches: bool,
    few: bool,
) -> wp.Kernel:
    """Kernel ``advance_vertices``, which gathers a vertex's forces and moves it, from one set of arrays to another.

    ``terms``: what there is to gather, and pins; ``fits`` as of ``gather.patch_functions``, the rest as of
    ``displacement``, and ``few``: whether there are no more than block.FEW patches.
    """
    bounds = BLOCK_THREADS, FEW_PER_CORE if few else BLOCKS_PER_CORE
    types = cloth_types(precision)
    point, Cloth, Step = types.point, types.Cloth, types.Step
    end_vertex = end_function(precision, accelerated, contact, collider_type, touches)
    Touch = touch_type(touches)
    functions = patch_functions(precision, step_bound(accelerated, contact, touches), terms, fits, in_order=not touches)
    own_vertex, two_vertices = functions.own_vertex, functions.two_vertices
    work_patch, vertex_slots, vertex_load = functions.work_patch, functions.vertex_slots, functions.vertex_load
    held_vertex = held_function(precision, accelerated, in_order=not touches)
    free = free_function(precision, terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=bounds)
    def advance_vertices(
        step: Step,
        colliders: colliders_type(contact, collider_type),
        touch: Touch,
        patches: types.Patches,
        beside: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        cloth: Cloth,
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=order_functions(precision, not touches).move),  # [m], shape [V]
    ):
        """Moves each free vertex of an item that is not at rest by the forces that meet there; pinned ones stay."""
        thread = wp.tid()
        lane = lane_of(thread)
        patch = patch_of(patches.patch, block_of(thread))
        item = cloth.items[patch.item]
        first, second = two_vertices(patches, patch, lane)
        if leaves(item.active, patch, first, second):
            return
        memory, edges, triangles = work_patch(cloth, patches, patch, beside, step, lane, first, second)
        ask_no_earlier()
        local = int(lane)
        if wp.static(fits):  # a thread for each vertex, and no one waits for what is asked for before the block
            vertex = own_vertex(patches, patch, wp.min(local, patch.owned_count - 1))
            held, moves = held_vertex(cloth, vertex), free(cloth, vertex)
        wait_for_block()
        if wp.static(fits):
            if local < patch.owned_count:
                load = vertex_load(patches, patch, beside, memory, local, edges, triangles)
                end_vertex(
                    step, colliders, touch, cloth, load, held, vertex, moves, patch.item, item, position_out, move_out
                )
        else:
            while local < patch.owned_count:
                vertex = own_vertex(patches, patch, local)
                held, moves = held_vertex(cloth, vertex), free(cloth, vertex)
                load = vertex_load(patches, patch, beside, memory, local, edges, triangles)
                end_vertex(
                    step, colliders, touch, cloth, load, held, vertex, moves, patch.item, item, position_out, move_out
                )
                local += patch_threads()
                edges, triangles = vertex_slots(patches, patch, local)

    return advance_vertices
