"""Force, cap, displacement: what one iteration makes of a vertex (the paper, section 4), then contact (section 5)."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.avatar.field import field_contact
from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.contact.arrays import ContactBefore, ContactData, contact_before
from warp_cloth.kernels.contact.sums import taken_function
from warp_cloth.kernels.laws.step import accelerated_displacement, capped, direct_displacement, step_stiffness
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import broadcast, component, vector3
from warp_cloth.kernels.math.real import root, scaled_sum
from warp_cloth.kernels.math.symmetric import bounded_inverse, multiple_of_unit, symmetric_times
from warp_cloth.kernels.passes.avatar_contact import meeting
from warp_cloth.kernels.patches.packing import order_functions

AHEAD = wp.constant(16)  # vertices for which the CPU's memory is asked before it is needed


@wp.struct
class NoCollider:
    """A scene without avatar asks nothing."""


def colliders_type(avatar_contact: wp.Function | None, collider_type: type) -> Any:
    """What kernels take for the items' avatars: an array of their structs, or nothing where there are none."""
    return NoCollider if avatar_contact is None else wp.array(dtype=collider_type)


@wp.struct
class NoClothContact:
    """Cloth that passes through cloth asks nothing."""


def contact_type(cloth_contact: bool) -> type:
    """The struct that tells of cloth on cloth, where it is told at all."""
    return ContactData if cloth_contact else NoClothContact


@functools.cache
def before_type(precision: str, avatar_contact: wp.Function | None, collider_type: type, cloth_contact: bool) -> type:
    """The struct of what is known of a vertex before its forces are; arguments as of ``displacement``.

    A GPU waits for memory far longer than it works: it asks for all that while forces are still worked out, or while
    others press pairs of cloth.
    """
    vec6 = cloth_types(precision).vec6

    @wp.struct
    class Before:
        """What is known of a vertex that may meet cloth."""

        contact: ContactBefore
        loose: bool  # whether it has leeway
        stiff: vec6  # inverse of the leeway of one that is loose
        collider: collider_type  # of its item

    @wp.struct
    class WornBefore:
        """What is known of a vertex that may meet an avatar alone."""

        loose: bool
        leeway: vec6  # of one that is loose
        clear: float  # as of State [m]

    if cloth_contact:
        return Before
    return NoClothContact if avatar_contact is None else WornBefore


@functools.cache
def before_function(
    precision: str,
    accelerated: bool,
    avatar_contact: wp.Function | None,
    collider_type: type,
    cloth_contact: bool,
    spares: bool,
    packed: bool = False,
) -> wp.Function:
    """The function that tells ``before_type``; ``packed`` as of packing.order_functions."""
    types = cloth_types(precision)
    real, State, Item = types.real, types.State, types.Item
    Colliders, Contact = colliders_type(avatar_contact, collider_type), contact_type(cloth_contact)
    Before = before_type(precision, avatar_contact, collider_type, cloth_contact)
    worn = wears(accelerated, avatar_contact, cloth_contact)
    leeway_at = order_functions(precision, packed).leeway_at

    @wp.func
    def told_before(
        contact: Contact, state: State, colliders: Colliders, vertex: int, position: wp.vec3d, number: int, item: Item
    ):
        """What is known of a vertex of an item of that number."""
        before = Before()
        if wp.static(cloth_contact):
            before.contact = contact_before(contact, vertex, position)
            if wp.static(avatar_contact is not None):
                before.collider = colliders[number]
        if wp.static(spares):
            before.clear = element(state.clearance, vertex)
        if wp.static(worn):
            if item.anisotropy_limit > real(0.0):
                leeway = leeway_at(state, vertex)
                before.loose = state.in_contact[vertex] == wp.uint8(0)
                if wp.static(cloth_contact):
                    if before.loose:
                        before.stiff = bounded_inverse(leeway)
                else:
                    before.leeway = leeway
        return before

    return told_before


def wears(accelerated: bool, avatar_contact: wp.Function | None, cloth_contact: bool = False) -> bool:
    """Whether a scene's cloth may be loose (passes.anisotropic_step): it is worn by an avatar, or may lie on cloth.

    What just hangs is taut, and loses nothing by steps alike in all directions.
    """
    return accelerated and (avatar_contact is not None or cloth_contact)


def spares_looks(avatar_contact: wp.Function | None, cloth_contact: bool, few: bool = False) -> bool:
    """Whether only what may have come near the avatar is looked up: where that may be told, and saves time.

    Where cloth meets cloth it is lifted off the avatar here and there. Where patches are ``few`` (advance_kernel) each
    takes as long as its vertices that are near.
    """
    return avatar_contact is field_contact and not cloth_contact and not few


@functools.cache
def loose_way(precision: str) -> wp.Function:
    """The function that tells how far a force takes a vertex that has leeway."""
    types = cloth_types(precision)
    real, vec3, vec6 = types.real, types.vec3, types.vec6

    @wp.func
    def pressed_way(stiff: vec6, force: vec3, own: real, stiffness: real):
        """Displacement (k L^-1 + (s - k) I)^-1 f: leeway L is of the cloth's ``own`` part k of the stiffness s [N/m].

        ``stiff`` is L^-1. What presses, and what was stiff before, is so in all directions: a vertex pressed hard has
        no leeway.
        """
        share = wp.min(own, stiffness)
        return symmetric_times(bounded_inverse(stiff * share + multiple_of_unit(stiffness - share)), force)

    return pressed_way


def steady_swing(accelerated: bool, avatar_contact: wp.Function | None, cloth_contact: bool) -> bool:
    """Whether cloth swings otherwise once it is loose; what meets itself does so by the same rule, loose or not."""
    return wears(accelerated, avatar_contact) and not cloth_contact


@functools.cache
def way_function(precision: str, steady: bool, lanes: int = 1) -> wp.Function:
    """The function ``force_way`` of the accelerated step, of a vertex or a packet; ``steady``: of steady_swing."""
    types, shapes = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    real, Step, Item = types.real, types.Step, types.Item
    one, vec4 = shapes.real, shapes.vec4

    @wp.func
    def force_way(step: Step, load: vec4, weight: one, last: one, item: Item):
        """Force [N], its way over the stiffness [m], this [N/m], and the share of the last displacement to keep.

        ``last``: the stiffness that the last step went by.
        """
        cloth_force = vector3(component(load, 0), component(load, 1), component(load, 2))
        force = scaled_sum(broadcast(weight, step.gravity), weight, cloth_force)
        memory = step.memory
        if wp.static(steady):
            memory = wp.where(item.anisotropy_limit > real(0.0), memory, step.memory_falling)
        stiffness, kept = step_stiffness(component(load, 3), weight, last, item.cap, memory)
        if wp.static(steady):
            kept = root(kept)
        return force, force * (one(real(1.0)) / stiffness), stiffness, kept

    return force_way


@functools.cache
def momentum_function(precision: str, steady: bool) -> wp.Function:
    """The function that tells how much of a displacement an item's vertices keep; ``steady`` of steady_swing.

    At any moment some fold's trembling has half of all displacements fight their forces: a fold that slides slowly
    would be damped by others' trembling, in every iteration. Loose cloth is damped evenly, so that all that is soft
    comes to rest at one pace.
    """
    types = cloth_types(precision)
    real, Step, Item = types.real, types.Step, types.Item

    @wp.func
    def kept_share(step: Step, item: Item):
        """Share of a displacement that is kept, and its factor where it fights the force."""
        momentum, damping = real(step.momentum), real(step.damping)
        if wp.static(steady):
            momentum = wp.where(item.anisotropy_limit > real(0.0), step.momentum_loose, step.momentum)
            damping = wp.where(item.anisotropy_limit > real(0.0), real(1.0), step.damping)
        return momentum, damping

    return kept_share


@functools.cache
def free_move(
    precision: str, accelerated: bool, avatar_contact: wp.Function | None, collider_type: type, cloth_contact: bool
) -> wp.Function:
    """The function that turns a load into a displacement where nothing is met; arguments as of ``displacement``."""
    types = cloth_types(precision)
    real, vec3, vec4, Vertex = types.real, types.vec3, types.vec4, types.Vertex
    Step, Item = types.Step, types.Item
    worn, pressed_way = wears(accelerated, avatar_contact, cloth_contact), loose_way(precision)
    steady = steady_swing(accelerated, avatar_contact, cloth_contact)
    Before = before_type(precision, avatar_contact, collider_type, cloth_contact)
    force_way, kept_share = way_function(precision, steady), momentum_function(precision, steady)

    @wp.func
    def own_move(step: Step, before: Before, load: vec4, pressed: real, held: Vertex, vertex: int, item: Item):
        """Displacement of a vertex by its forces, and the stiffness that it goes by; ``pressed`` of it by cloth."""
        weight = held.weight
        move = vec3()
        stiffness = real(0.0)
        if wp.static(accelerated):
            force, way, stiffness, kept = force_way(step, load, weight, held.stiffness, item)
            if wp.static(worn):
                # what is held by contact and friction is held alike in all directions
                if wp.static(cloth_contact):
                    if before.loose:
                        own = load[3] - pressed + weight / item.cap
                        way = pressed_way(before.stiff, force, own, stiffness)
                else:
                    if before.loose:
                        way = symmetric_times(before.leeway, way)
            momentum, damping = kept_share(step, item)
            move = accelerated_displacement(force, way, held.move, momentum * kept, damping, item.cap)
        else:
            force = scaled_sum(step.gravity, weight, vec3(load[0], load[1], load[2]))
            move = direct_displacement(force, weight, item.cap)
        return move, stiffness

    return own_move


@functools.cache
def displacement(
    precision: str,
    accelerated: bool,
    avatar_contact: wp.Function | None,
    collider_type: type,
    cloth_contact: bool,
    spares: bool = False,
) -> wp.Function:
    """The function that turns a free vertex's load into its displacement [m], contact and friction included.

    Args:
        precision: of positions and forces.
        accelerated: each vertex by its own step and with momentum; otherwise by the paper's rule.
        contact: (collider, world position) -> (normal, distance [m]); None where the scene has no avatar.
        collider_type: the struct that it asks, one for each item; NoCollider without avatar.
        touches: whether cloth meets cloth.
        spares: whether a vertex that surely cannot have come near the avatar is not looked up; the same bits.
    """
    types = cloth_types(precision)
    real, vec3, vec4, vec6, Vertex, Step, Item = (
        types.real,
        types.vec3,
        types.vec4,
        types.vec6,
        types.Vertex,
        types.Step,
        types.Item,
    )
    State = types.State
    Colliders, Contact = colliders_type(avatar_contact, collider_type), contact_type(cloth_contact)
    own_move = free_move(precision, accelerated, avatar_contact, collider_type, cloth_contact)
    Before = before_type(precision, avatar_contact, collider_type, cloth_contact)
    contact_taken = taken_function(precision)
    worn = wears(accelerated, avatar_contact, cloth_contact)
    met_move = (
        None
        if avatar_contact is None
        else meeting(precision, avatar_contact, collider_type, worn, spares, cloth_contact)
    )

    @wp.func
    def vertex_displacement(
        state: State,
        step: Step,
        colliders: Colliders,
        contact: Contact,
        before: Before,
        load: vec4,
        held: Vertex,
        vertex: int,
        number: int,
        item: Item,
    ):
        """Displacement of a vertex, the part of it that has momentum, and the stiffness that it went by.

        ``before`` of ``before_function``; ``number`` is of the item that the vertex belongs to.
        """
        shift = vec3()
        lift = float(0.0)
        room, pressed = real(0.0), real(0.0)
        if wp.static(cloth_contact):  # asked for at once: a GPU waits for memory far longer than it works
            contact_load, limit = contact_taken(contact, vertex, before.contact)
            load += contact_load
            pressed = contact_load[3]
            room = real(limit)
            shift, lift = vec3(before.contact.shift), float(before.contact.lift)
        move, stiffness = own_move(step, before, load, pressed, held, vertex, item)
        if wp.static(cloth_contact):
            move += shift
        kept = move
        if wp.static(avatar_contact is not None):
            if wp.static(cloth_contact):
                move, kept = met_move(
                    state, before.collider, before.loose, vec6(), 0.0, lift, vertex, held.position, move, item
                )
            else:
                move, kept = met_move(
                    state, colliders[number], before.loose, before.leeway, before.clear, lift, vertex, held.position,
                    move, item,
                )  # fmt: skip
        if wp.static(cloth_contact):
            move, kept = capped(move, room), capped(kept, room) - shift
        return move, kept, stiffness

    return vertex_displacement


def step_bound(accelerated: bool, avatar_contact: wp.Function | None, cloth_contact: bool = False) -> Accumulate:
    """What an iteration accumulates beside forces; arguments as of ``displacement``."""
    if not accelerated:
        return Accumulate.NONE
    worn = wears(accelerated, avatar_contact, cloth_contact)
    return Accumulate.ANISOTROPIC_STIFFNESS if worn else Accumulate.STIFFNESS
