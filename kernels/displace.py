"""Force, cap, displacement: one iteration's end for a vertex (the paper, section 4), then contact (section 5)."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.arithmetic import quotient, root
from warp_cloth.kernels.block import block_of, block_threads, lane_of
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Terms, cloth_types, free_function
from warp_cloth.kernels.cloth_contact import ClothContact, contact_room, contact_sum, contact_watch
from warp_cloth.kernels.friction import friction_slide
from warp_cloth.kernels.gather import patch_functions, patch_of


@wp.func
def capped(force: Any, limit: Any):
    """The force, or where it passes the limit one of that size in its direction (the paper, section 4)."""
    size = root(wp.dot(force, force))
    return force * wp.where(size > limit, quotient(limit, size), type(limit)(1.0))


@wp.func
def direct_move(force: Any, weight: Any, cap: Any):
    """Displacement [m] by the paper's rule: total force, capped slightly above gravity, added to the position.

    A force of 1.1 weights is "slightly larger than gravity" and moves the vertex by ``cap``.
    """
    limit = type(weight)(1.1) * weight
    return capped(force, limit) * (cap / limit)


@wp.func
def accelerated_move(force: Any, stiffness: Any, last: Any, momentum: Any, damping: Any, cap: Any):
    """Displacement [m]: force over the vertex's own stiffness, plus momentum, damped where it fights the force."""
    kept = wp.where(wp.dot(last, force) < type(cap)(0.0), momentum * damping, momentum)
    return capped(last * kept + force * quotient(type(cap)(1.0), stiffness), cap)


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
    real, vec3, vec4, Cloth, Step, Item = types.real, types.vec3, types.vec4, types.Cloth, types.Step, types.Item
    Colliders, Touch = colliders_type(contact, collider_type), touch_type(touches)

    @wp.func
    def vertex_displacement(
        cloth: Cloth, step: Step, colliders: Colliders, touch: Touch, load: vec4, vertex: int, number: int, item: Item
    ):
        """Displacement of a vertex and the part of it that has momentum; remembers the stiffness that it went by.

        ``number`` is of the item that the vertex belongs to.
        """
        if wp.static(touches):
            load += vec4(contact_sum(touch, vertex))
        weight = element(cloth.weight, vertex)
        force = vec3(load[0], load[1], load[2]) + step.gravity * weight
        move = vec3()
        if wp.static(accelerated):
            last = element(cloth.stiffness, vertex)
            stiffness = wp.max(load[3] + quotient(weight, item.cap), last * step.memory)
            momentum = step.momentum * wp.min(quotient(last, stiffness), real(1.0))
            cloth.stiffness[vertex] = stiffness
            move = accelerated_move(force, stiffness, element(cloth.move, vertex), momentum, step.damping, item.cap)
        else:
            move = direct_move(force, weight, item.cap)
        shift = vec3()
        if wp.static(touches):
            shift = vec3(touch.shift[vertex])
            move += shift
        if wp.static(contact is not None):
            at = contact(colliders[number], wp.vec3d(element(cloth.position, vertex)) + wp.vec3d(move))
            push = item.offset - at[3]
            if wp.static(touches):
                push += touch.lift[vertex]
            if push > 0.0:
                normal = vec3(real(at[0]), real(at[1]), real(at[2]))
                pushed = move + normal * wp.min(real(push), item.cap)
                move = friction_slide(pushed, normal, real(push), real(item.friction))
        if wp.static(touches):
            move = capped(move, real(contact_room(touch, vertex, wp.vec3d(cloth.position[vertex]))))
        return move, move - shift

    return vertex_displacement


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
        item = cloth.items[number]
        if item.active == 0:
            return
        move = vec3()
        if free(cloth, vertex):
            move, kept = vertex_displacement(cloth, step, colliders, touch, sum, vertex, number, item)
            cloth.move[vertex] = kept
            cloth.position[vertex] = cloth.position[vertex] + point(move)
        if wp.static(touches):
            contact_watch(touch, vertex, wp.vec3d(cloth.position[vertex]), wp.vec3d(move))

    return displace_vertices


@functools.cache
def advance_kernel(
    precision: str,
    accelerated: bool,
    terms: Terms,
    fits: bool,
    contact: wp.Function | None,
    collider_type: type,
    touches: bool,
) -> wp.Kernel:
    """Kernel ``advance_vertices``, which gathers a vertex's forces and moves it, from one set of arrays to another.

    ``terms``: what there is to gather, and pins; ``fits`` as of ``gather.patch_functions``, the rest as of
    ``displacement``.
    """
    types = cloth_types(precision)
    point, vec3, Cloth, Step, Patches = types.point, types.vec3, types.Cloth, types.Step, types.Patches
    vertex_displacement = displacement(precision, accelerated, contact, collider_type, touches)
    Touch = touch_type(touches)
    functions = patch_functions(precision, "stiffness" if accelerated else "none", terms, fits)
    work_patch, vertex_load = functions.work_patch, functions.vertex_load
    free = free_function(precision, terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=(256, 3))
    def advance_vertices(
        step: Step,
        colliders: colliders_type(contact, collider_type),
        touch: Touch,
        patches: Patches,
        beside: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        cloth: Cloth,
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=vec3),  # [m], shape [V]
    ):
        """Moves each free vertex of an item that is not at rest by the forces that meet there; pinned ones stay."""
        thread = wp.tid()
        lane = lane_of(thread)
        patch = patch_of(patches.patch, block_of(thread))
        item = cloth.items[patch.item]
        if item.active == 0:
            return
        memory = work_patch(cloth, patches, patch, beside, step, lane)
        local = int(lane)
        while local < patch.owned_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
            move = vec3()
            kept = vec3()
            if free(cloth, vertex):
                load = vertex_load(patches, patch, beside, memory, local)
                move, kept = vertex_displacement(cloth, step, colliders, touch, load, vertex, patch.item, item)
            move_out[vertex] = kept
            position = element(cloth.position, vertex) + point(move)
            position_out[vertex] = position
            if wp.static(touches):
                contact_watch(touch, vertex, wp.vec3d(position), wp.vec3d(move))
            local += block_threads()

    return advance_vertices
