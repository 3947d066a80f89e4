"""Force, cap, displacement: what one iteration makes of a vertex (the paper, section 4), then contact (section 5)."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.avatar.field import field_contact
from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.options import Accumulate, KernelOptions
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.contact.arrays import ContactData, VertexContact, load_vertex_contact
from warp_cloth.kernels.contact.sums import take_load_function
from warp_cloth.kernels.laws.direct_step import direct_displacement
from warp_cloth.kernels.laws.step import accelerated_displacement, capped, step_stiffness
from warp_cloth.kernels.math.lanes import lane_types
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import broadcast, component, minimum, vector3
from warp_cloth.kernels.math.real import root, scaled_sum
from warp_cloth.kernels.math.symmetric import bounded_inverse, each_times, multiple_of_unit, symmetric_times
from warp_cloth.kernels.passes.avatar_contact import avatar_function
from warp_cloth.kernels.patches.packing import order_functions

AHEAD = wp.constant(16)  # vertices by which the CPU prefetches the avatar's field


@wp.struct
class NoCollider:
    """A scene without avatar has none."""


def colliders_type(avatar_contact: wp.Function | None, collider_type: type) -> Any:
    """What kernels take for the items' avatars: an array of their structs, or nothing where there are none."""
    return NoCollider if avatar_contact is None else wp.array(dtype=collider_type)


@wp.struct
class NoClothContact:
    """Cloth that passes through cloth reads nothing."""


def cloth_contact_type(cloth_contact: bool) -> type:
    """The struct of cloth on cloth, where it meets at all."""
    return ContactData if cloth_contact else NoClothContact


@functools.cache
def prefetched_type(options: KernelOptions) -> type:
    """The struct of what is loaded for a vertex before its forces are known.

    A GPU waits for memory far longer than it computes: it loads all that while forces are still computed, or while
    other blocks compute contact forces.
    """
    vec6 = cloth_types(options.precision).vec6

    @wp.struct
    class Prefetched:
        """What is known of a vertex that may meet cloth."""

        contact: VertexContact
        anisotropic: bool  # whether its step is
        inverse_compliance: vec6  # of one whose step is
        collider: options.collider or NoCollider  # of its item

    @wp.struct
    class WornPrefetched:
        """What is known of a vertex that may meet an avatar alone."""

        anisotropic: bool
        compliance: vec6  # of one whose step is anisotropic
        clearance: float  # as of State [m]

    if options.cloth_contact:
        return Prefetched
    return NoClothContact if options.avatar_contact is None else WornPrefetched


@functools.cache
def prefetch_function(options: KernelOptions) -> wp.Function:
    """The function that loads ``prefetched_type``."""
    types, cloth_contact, anisotropic = cloth_types(options.precision), options.cloth_contact, options.anisotropic
    real, State, Item = types.real, types.State, types.Item
    Colliders = colliders_type(options.avatar_contact, options.collider)
    Contact, Prefetched = cloth_contact_type(cloth_contact), prefetched_type(options)
    compliance_at = order_functions(options.precision, options.packed).compliance_at

    @wp.func
    def prefetch(
        state: State,
        colliders: Colliders,
        contact: Contact,
        vertex: int,
        position: wp.vec3d,
        item_index: int,
        item: Item,
    ):
        """What is known of a vertex at this position, of an item."""
        known = Prefetched()
        if wp.static(cloth_contact):
            known.contact = load_vertex_contact(contact, vertex, position)
            if wp.static(options.avatar_contact is not None):
                known.collider = colliders[item_index]
        if wp.static(saves_queries(options)):
            known.clearance = element(state.clearance, vertex)
        if wp.static(anisotropic):
            if item.anisotropy_limit > real(0.0):
                compliance = compliance_at(state, vertex)
                known.anisotropic = state.in_contact[vertex] == wp.uint8(0)
                if wp.static(cloth_contact):
                    if known.anisotropic:
                        known.inverse_compliance = bounded_inverse(compliance)
                else:
                    known.compliance = compliance
        return known

    return prefetch


def saves_queries(options: KernelOptions) -> bool:
    """Whether the avatar is queried only for vertices that may have come near: where that is known, and saves time.

    Where patches are few each takes as long as its vertices that are near. Where cloth meets cloth patches mostly are.
    """
    return options.avatar_contact is field_contact and (options.packets or not (options.cloth_contact or options.few))


@wp.func
def compliant_descent(stiff: Any, force: Any, own: Any, stiffness: Any):
    """Displacement (k L^-1 + (s - k) I)^-1 f: L is the compliance of the cloth's ``own`` part k of the stiffness s.

    ``stiff`` is L^-1. What presses, and what was stiff before, is so in all directions: a vertex pressed hard has
    no compliance.
    """
    share = minimum(own, stiffness)
    return symmetric_times(bounded_inverse(each_times(stiff, share) + multiple_of_unit(stiffness - share)), force)


def swings_evenly(options: KernelOptions) -> bool:
    """Whether cloth's swing changes once forces have balanced; what meets itself swings by one rule throughout."""
    return options.accelerated and options.avatar_contact is not None and not options.cloth_contact


@functools.cache
def descent_function(precision: str, steady: bool, lanes: int = 1) -> wp.Function:
    """The function ``force_descent`` of the accelerated step, of a vertex or a packet; ``steady``: of swings_evenly."""
    types, shapes = cloth_types(precision), lane_types(cloth_types(precision).real, lanes)
    real, Step, Item = types.real, types.Step, types.Item
    one, vec4 = shapes.real, shapes.vec4

    @wp.func
    def force_descent(step: Step, load: vec4, weight: one, last: one, item: Item):
        """Force [N], that over the stiffness [m], this [N/m], and the share of momentum that its growth leaves.

        ``last``: the stiffness that the last step went by.
        """
        cloth_force = vector3(component(load, 0), component(load, 1), component(load, 2))
        force = scaled_sum(broadcast(weight, step.gravity), weight, cloth_force)
        memory = step.memory
        if wp.static(steady):
            memory = wp.where(item.anisotropy_limit > real(0.0), memory, step.memory_falling)
        stiffness, momentum_ratio = step_stiffness(component(load, 3), weight, last, item.cap, memory)
        if wp.static(steady):
            momentum_ratio = root(momentum_ratio)
        return force, force * (one(real(1.0)) / stiffness), stiffness, momentum_ratio

    return force_descent


@functools.cache
def momentum_function(precision: str, steady: bool) -> wp.Function:
    """The function ``with_momentum``, of a vertex or a packet of an item; ``steady``: of swings_evenly.

    At any moment some fold's trembling has half of all displacements fight their forces: a fold that slides slowly
    would be damped by others' trembling, in every iteration. Loose cloth is damped evenly, so that all that is soft
    comes to rest at one pace.
    """
    types = cloth_types(precision)
    real, Step, Item = types.real, types.Step, types.Item

    @wp.func
    def with_momentum(step: Step, item: Item, force: Any, descent: Any, last: Any, momentum_ratio: Any):
        """Displacement [m]: ``descent`` and what is kept of the ``last`` one; others of ``force_descent``."""
        momentum, damping = real(step.momentum), real(step.damping)
        if wp.static(steady):
            momentum = wp.where(item.anisotropy_limit > real(0.0), step.momentum_loose, step.momentum)
            damping = wp.where(item.anisotropy_limit > real(0.0), real(1.0), step.damping)
        return accelerated_displacement(force, descent, last, momentum_ratio * momentum, damping, item.cap)

    return with_momentum


@functools.cache
def free_displacement_function(options: KernelOptions) -> wp.Function:
    """The function that turns a load into a displacement where nothing is met."""
    types = cloth_types(options.precision)
    real, vec3, vec4, Vertex, Step = types.real, types.vec3, types.vec4, types.Vertex, types.Step
    steady = swings_evenly(options)
    Prefetched = prefetched_type(options)
    force_descent = descent_function(options.precision, steady)
    with_momentum = momentum_function(options.precision, steady)

    @wp.func
    def free_displacement(step: Step, known: Prefetched, load: vec4, pressed: real, vertex: Vertex):
        """Displacement of a vertex by its forces, and the stiffness of its step; ``pressed``: what of it is cloth's."""
        weight = vertex.weight
        move = vec3()
        stiffness = real(0.0)
        if wp.static(options.accelerated):
            force, descent, stiffness, momentum_ratio = force_descent(step, load, weight, vertex.stiffness, vertex.item)
            if wp.static(options.anisotropic):
                # what contact and friction hold is held alike in all directions
                if wp.static(options.cloth_contact):
                    if known.anisotropic:
                        own = load[3] - pressed + weight / vertex.item.cap
                        descent = compliant_descent(known.inverse_compliance, force, own, stiffness)
                else:
                    if known.anisotropic:
                        descent = symmetric_times(known.compliance, descent)
            move = with_momentum(step, vertex.item, force, descent, vertex.displacement, momentum_ratio)
        else:
            force = scaled_sum(step.gravity, weight, vec3(load[0], load[1], load[2]))
            move = direct_displacement(force, weight, vertex.item.cap)
        return move, stiffness

    return free_displacement


@functools.cache
def displacement_function(options: KernelOptions) -> wp.Function:
    """The function that turns a free vertex's load into its displacement [m], contact and friction included."""
    types, cloth_contact = cloth_types(options.precision), options.cloth_contact
    real, vec3, vec4, State, Vertex, Step = (
        types.real, types.vec3, types.vec4, types.State, types.Vertex, types.Step,
    )  # fmt: skip
    Colliders = colliders_type(options.avatar_contact, options.collider)
    Contact, Prefetched = cloth_contact_type(cloth_contact), prefetched_type(options)
    free_displacement, take_contact_load = free_displacement_function(options), take_load_function(options.precision)
    meets_avatar = options.avatar_contact is not None
    meet_avatar = avatar_function(options, Prefetched, saves_queries(options)) if meets_avatar else None

    @wp.func
    def vertex_displacement(
        state: State,
        step: Step,
        colliders: Colliders,
        contact: Contact,
        known: Prefetched,
        load: vec4,
        vertex: Vertex,
    ):
        """Displacement of a vertex, the part of it that has momentum, and the stiffness of its step."""
        shift = vec3()
        lift = float(0.0)
        limit, pressed = real(0.0), real(0.0)
        if wp.static(cloth_contact):  # loaded at once: a GPU waits for memory far longer than it computes
            contact_load, longest = take_contact_load(contact, vertex.index, known.contact)
            load += contact_load
            pressed = contact_load[3]
            limit = real(longest)
            shift, lift = vec3(known.contact.shift), float(known.contact.lift)
        move, stiffness = free_displacement(step, known, load, pressed, vertex)
        if wp.static(cloth_contact):
            move += shift
        inertial = move
        if wp.static(meets_avatar):
            if wp.static(cloth_contact):
                move, inertial = meet_avatar(state, known.collider, known, lift, vertex, move)
            else:
                move, inertial = meet_avatar(state, colliders[vertex.item_index], known, lift, vertex, move)
        if wp.static(cloth_contact):
            move, inertial = capped(move, limit), capped(inertial, limit) - shift
        return move, inertial, stiffness

    return vertex_displacement


def accumulated(options: KernelOptions) -> Accumulate:
    """What an iteration accumulates besides forces."""
    if not options.accelerated:
        return Accumulate.NONE
    return Accumulate.ANISOTROPIC_STIFFNESS if options.anisotropic else Accumulate.STIFFNESS
