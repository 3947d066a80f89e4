"""Both ends of an implicit step: what contact leaves of the forces, and the capped displacement (section 4 and 5)."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.block import block_of, block_threads, lane_of
from warp_cloth.kernels.base.reduction import Parts, sum_part, totals
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function, rest_function
from warp_cloth.kernels.elements.stiffness import stiffness_types, symmetric_functions
from warp_cloth.kernels.implicit.conjugate_gradient import FREE, SLIDES, STAYS, allowed_function, conjugate_types
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.passes.step import capped, colliders_type

# Up to this far above the contact offset a vertex that the force presses on to it counts as held by the avatar; one
# that contact has just borne on, up to WIDE: a field's distance and its slope agree no better.
NEAR = wp.constant(2.0e-5)  # [m]
WIDE = wp.constant(1.0e-3)  # [m]

# A vertex that moved by less in the last step stands [m].
STANDS = wp.constant(1.0e-7)

# A vertex whose force has turned against its last displacement went too far: it gets heavier, up to a share of the
# stiffness that it meets, and else lighter again. Without this wrinkles of stiff cloth tremble for ever.
HEAVIER, LIGHTER = wp.constant(1.05), wp.constant(0.97)
HEAVIEST = wp.constant(0.02)

# Where forces are seen ahead, it trembles where the force would take back more than such a share of the displacement
# against the stiffness that it meets. Near rest others' trembling turns forces to and fro, and all would get heavy:
# what still slides then hardly moves.
TREMBLES = wp.constant(0.3)

# While folds still snap and slide, what trembles is ``made_heavy`` at once, and light again as soon: a fold's tip that
# strikes the avatar trembles for ever else. Cloth that comes to rest is not: what is heavy would hold what has not
# arrived yet (66,000 vertices over a ball were certified 1.1 and 1.4 mm rms too early).
TREMBLES_EARLY = wp.constant(0.1)
HEAVIER_EARLY, LIGHTER_EARLY = wp.constant(1.5), wp.constant(0.8)
HEAVIEST_EARLY = wp.constant(0.5)


@functools.cache
def hold_function(precision: str) -> wp.Function:
    """The function ``hold_of``: what the avatar leaves of a vertex's freedom and of the force on it."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3

    @wp.func
    def hold_of(force: vec3, normal: vec3, friction: real, move: vec3):
        """What friction leaves free of a vertex on the avatar, the force that it leaves [N], and its drag [N/m].

        Where the force is beyond the cone, friction resists it with all it has. Within, what stands stays, and what
        slid by d in the last step is slowed down by friction * push / d times how far it slides now.
        """
        hold = int(FREE)
        left = force
        drag = real(0.0)
        push = -wp.dot(force, normal)
        if push > real(0.0):
            tangent = force + normal * push
            size = wp.length(tangent)
            over = size - friction * push
            last = wp.length(move - normal * wp.dot(move, normal))
            hold = int(STAYS)
            left = vec3()
            if over > real(0.0):
                hold = int(SLIDES)
                left = tangent * (over / size)
            elif last > real(STANDS):
                hold = int(SLIDES)
                left = tangent
                drag = friction * push / last
        return hold, left, drag

    return hold_of


@functools.cache
def meets_function(precision: str) -> wp.Function:
    """The function ``meets``: whether the force on a vertex takes it to the avatar's surface."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    vec6, times = stiffness_types(precision).vec6, symmetric_functions(precision).times

    @wp.func
    def meets(force: vec3, normal: vec3, gap: real, block: vec6):
        """Whether the push closes the gap against the vertex's own stiffness: push > gap n . block n.

        What is balanced a little above the surface is not held: that would draw it down and let it go, for ever.
        """
        return -wp.dot(force, normal) > wp.max(gap, real(0.0)) * wp.dot(normal, times(block, normal))

    return meets


@functools.cache
def face_forces_kernel(precision: str, contact: wp.Function | None, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``face_forces``, with the contact of ``kernels.passes.move.displacement``."""
    types = cloth_types(precision)
    real, vec3, vec4, Model, State, Step = types.real, types.vec3, types.vec4, types.Model, types.State, types.Step
    mat3, vec6 = stiffness_types(precision).mat3, stiffness_types(precision).vec6
    System = conjugate_types(precision).System
    symmetric = symmetric_functions(precision)
    along, even, times, inverse = symmetric.along, symmetric.even, symmetric.times, symmetric.inverse
    allowed, hold_of, free = allowed_function(precision), hold_function(precision), free_function(precision, pins)
    meets, rests = meets_function(precision), rest_function(precision)

    @wp.func
    def upper(s: mat3):
        """A symmetric matrix as vec6."""
        return vec6(s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[0, 2], s[1, 2])

    @wp.func
    def own_block(system: System, vertex: int):
        """Sum of the couplings at a vertex [N/m]."""
        block = vec6()
        start, last = system.start[vertex], system.start[vertex + 1]
        for row in range(start, last - 3, 4):
            for i in range(4):
                block += upper(system.coupling[row + i])
        for row in range(start + (last - start) // 4 * 4, last):
            block += upper(system.coupling[row])
        return block

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def face_forces(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(contact, collider_type),
        load: wp.array(dtype=vec4),  # forces of the cloth [N], shape [V]; left at zero
        system: System,
        anchor_out: wp.array(dtype=vec6),  # stiffness against the world [N/m], shape [V]
    ):
        """The right-hand side, what is held, and the share of the last displacement that is kept."""
        vertex = wp.tid()
        sum = load[vertex]
        load[vertex] = vec4()
        weight = model.weight[vertex]
        block = own_block(system, vertex)
        hold = int(FREE)
        left = vec3(sum[0], sum[1], sum[2]) + step.gravity * weight
        normal = vec3()
        drag = real(0.0)
        if wp.static(contact is not None):
            item = model.items[model.item[vertex]]
            at = contact(colliders[model.item[vertex]], wp.vec3d(state.position[vertex]))
            gap = real(at[3] - item.offset)
            system.gap[vertex] = gap
            if gap < real(NEAR) or (gap < real(WIDE) and system.pressed[vertex] != wp.uint8(0)):
                normal = vec3(real(at[0]), real(at[1]), real(at[2]))
                if meets(left, normal, gap, block):
                    hold, left, drag = hold_of(left, normal, real(item.avatar_friction), state.displacement[vertex])
        if not free(model, vertex) or rests(model, vertex):
            hold = int(STAYS)
            left = vec3()
        ahead = system.share > real(0.0)
        early = system.made_heavy
        move = state.displacement[vertex]
        trembles = wp.where(early, real(TREMBLES_EARLY), real(TREMBLES))
        bearable = wp.where(ahead, trembles * wp.dot(move, times(block, move)), real(0.0))
        turned = wp.dot(move, left) < -bearable
        heavier = wp.where(early, real(HEAVIER_EARLY), real(HEAVIER))
        lighter = wp.where(early, real(LIGHTER_EARLY), real(LIGHTER))
        inertia = system.inertia[vertex] * wp.where(turned, heavier, lighter)
        most = wp.where(early, real(HEAVIEST_EARLY), real(HEAVIEST)) * (block[0] + block[1] + block[2])
        inertia = wp.max(wp.min(inertia, most), weight / system.fall[system.garment[vertex]])
        anchor = even(inertia + drag)
        if hold == SLIDES:
            anchor += along(wp.dot(normal, times(block, normal)), normal)
        if hold == STAYS:
            anchor += block
        anchor_out[vertex] = anchor
        kept = allowed(move, normal, hold) * step.momentum
        if ahead:
            onward = allowed(system.onward[vertex], normal, hold)
            system.onward[vertex] = onward
            left -= onward * drag
            kept = vec3()
        system.hold[vertex] = hold
        system.drag[vertex] = drag
        system.normal[vertex] = normal
        system.inertia[vertex] = inertia
        system.divisor[vertex] = inverse(block + anchor)
        system.force[vertex] = left
        system.residual[vertex] = left
        system.displacement[vertex] = kept

    return face_forces


@functools.cache
def take_step_kernel(precision: str, contact: wp.Function | None, collider_type: type, pins: bool) -> wp.Kernel:
    """Kernel ``take_step``, with the contact of ``kernels.passes.move.displacement``."""
    types = cloth_types(precision)
    real, point, vec3, Model, State, Step = types.real, types.point, types.vec3, types.Model, types.State, types.Step
    System, free = conjugate_types(precision).System, free_function(precision, pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def take_step(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(contact, collider_type),
        system: System,
    ):
        """Moves each free vertex by its displacement, capped; a held one stays on the avatar's surface.

        Where forces are seen ahead it goes a share of it, and on to where momentum then leads. Where the avatar stops a
        vertex that was not on it, friction shortens the displacement's tangential part.
        """
        vertex = wp.tid()
        if free(model, vertex):
            move = system.displacement[vertex]
            solved = vec3()
            if system.share > real(0.0):
                solved = move * system.share
                move = solved + (solved + system.onward[vertex]) * system.momentum[system.garment[vertex]]
            normal = system.normal[vertex]
            met = wp.dot(normal, normal) > real(0.5)
            if met:
                beyond = wp.dot(move, normal) + system.gap[vertex]
                if system.hold[vertex] != FREE or beyond < real(0.0):
                    move = move - normal * beyond
            item = model.items[model.item[vertex]]
            move = capped(move, item.cap)
            if wp.static(contact is not None):
                at = contact(colliders[model.item[vertex]], wp.vec3d(state.position[vertex]) + wp.vec3d(move))
                push = item.offset - at[3]
                system.pressed[vertex] = wp.uint8(push > 0.0 or system.hold[vertex] != FREE)
                if push > 0.0:
                    out = vec3(real(at[0]), real(at[1]), real(at[2]))
                    move = move + out * wp.min(real(push), item.cap)
                    if not met:
                        move = friction_slide(move, out, real(push), real(item.avatar_friction))
            system.onward[vertex] = move - solved
            state.displacement[vertex] = move
            state.position[vertex] = state.position[vertex] + point(move)

    return take_step


@functools.cache
def ease_inertia_kernel(precision: str) -> wp.Kernel:
    """Kernel ``ease_inertia``."""
    real, System = cloth_types(precision).real, conjugate_types(precision).System

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def ease_inertia(
        growth: real,
        most: real,  # [m]
        system: System,
    ):
        """Lets every garment fall further in its next step."""
        garment = wp.tid()
        system.fall[garment] = wp.min(system.fall[garment] * growth, most)

    return ease_inertia


@functools.cache
def momentum_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``weigh_momentum`` and ``ease_momentum``."""
    real, System = cloth_types(precision).real, conjugate_types(precision).System

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def weigh_momentum(
        system: System,
        parts: Parts,
        taken_out: wp.array(dtype=wp.float64),  # force . onward of each part [J]
        given_out: wp.array(dtype=wp.float64),  # force . displacement [J]
    ):
        """The work that momentum took, and what the solution gives back."""
        thread = wp.tid()
        part, lane = block_of(thread), lane_of(thread)
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            parts.dot[vertex] = wp.float64(wp.dot(system.force[vertex], system.onward[vertex]))
        sum_part(parts, part, lane, taken_out)
        for vertex in range(parts.first[part] + lane, parts.first[part + 1], block_threads()):
            parts.dot[vertex] = wp.float64(wp.dot(system.force[vertex], system.displacement[vertex]))
        sum_part(parts, part, lane, given_out)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def ease_momentum(
        least: real,
        most: real,
        left: real,
        system: System,
        parts: Parts,
        taken: wp.array(dtype=wp.float64),
        given: wp.array(dtype=wp.float64),
    ):
        """Every garment keeps n / (n + 3) of its displacement after n steps; one that went too far leaves a share.

        So it is where the work that momentum took, b . onward, is more than what the solution gives back, b . x. By the
        former alone a single fold's trembling would stop the sliding of all others.
        """
        thread = wp.tid()
        garment = block_of(thread)
        both = totals(parts, taken, given, garment, False)
        if lane_of(thread) == 0:
            delay = real(3.0)
            kept = system.momentum[garment]
            steps = delay * kept / (real(1.0) - kept) + real(1.0)
            if both[0] + both[1] < wp.float64(0.0):
                steps = left * steps
            system.momentum[garment] = wp.clamp(steps / (steps + delay), least, most)

    return SimpleNamespace(weigh_momentum=weigh_momentum, ease_momentum=ease_momentum)


@functools.cache
def implicit_kernels(precision: str, contact: wp.Function | None, collider_type: type, pins: bool) -> SimpleNamespace:
    """The kernels of a step's two ends; those on momentum go between them."""
    return SimpleNamespace(
        face_forces=face_forces_kernel(precision, contact, collider_type, pins),
        take_step=take_step_kernel(precision, contact, collider_type, pins),
        ease_inertia=ease_inertia_kernel(precision),
        **vars(momentum_kernels(precision)),
    )
