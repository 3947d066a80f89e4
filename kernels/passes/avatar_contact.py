"""How a displaced vertex meets its item's avatar: pushed out, held by friction, and looked up only where need be."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.field import field_clearance
from warp_cloth.kernels.base.options import KernelOptions
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.math.real import inner, root, scaled_sum
from warp_cloth.kernels.math.symmetric import multiple_of_unit
from warp_cloth.kernels.passes.anisotropic_step import transferred

LONGER, STEP = wp.constant(1.0001), wp.constant(1.0e-9)  # more than rounding adds to a way, as a share and [m]


@functools.cache
def query_function(options: KernelOptions, saves_queries: bool, prefetched: bool = True) -> wp.Function:
    """The function that queries where a displaced vertex meets its item's avatar.

    ``saves_queries``: whether its clearance is noted; ``prefetched``: whether it is known if its step is anisotropic
    and, unless cloth meets cloth, its compliance; what is not is read here.
    """
    types, collider_type = cloth_types(options.precision), options.collider
    real, vec3, vec6, State, Item, Vertex = (
        types.real, types.vec3, types.vec6, types.State, types.Item, types.Vertex,
    )  # fmt: skip
    avatar_contact = options.avatar_contact

    @wp.func
    def pushed_move(at: wp.vec4f, depth: float, move: vec3, item: Item):
        """A displacement [m] that contact pushes out along the normal, at most by the cap, and friction shortens."""
        normal = vec3(real(at[0]), real(at[1]), real(at[2]))
        pushed = scaled_sum(normal, wp.min(real(depth), item.cap), move)
        return friction_slide(pushed, normal, real(depth), real(item.avatar_friction))

    @wp.func
    def query_avatar(
        state: State,
        collider: collider_type,
        anisotropic: bool,
        compliance: vec6,
        lift: float,
        vertex: Vertex,
        move: vec3,
    ):
        """A vertex' displacement after contact and friction, and what of it has momentum.

        ``lift`` is how much farther off it is met [m]. What comes into contact goes on without a compliance of its
        own, as if it had become so much heavier; it is slowed as much, or contact that comes and goes would feed a
        swing.
        """
        place = wp.vec3d(vertex.position) + wp.vec3d(move)
        at = avatar_contact(collider, place)
        depth = vertex.item.offset - at[3] + lift
        if wp.static(saves_queries):
            state.clearance[vertex.index] = field_clearance(collider, place, at[3], vertex.item.offset + lift)
        inertial = move
        if depth > 0.0:
            move = pushed_move(at, depth, move, vertex.item)
            inertial = move
            if wp.static(options.anisotropic):
                if wp.static(prefetched):
                    if anisotropic:
                        before = compliance
                        if wp.static(options.cloth_contact):
                            before = state.compliance[vertex.index]
                        inertial = transferred(before, multiple_of_unit(real(1.0)), move)
                else:
                    if vertex.item.anisotropy_limit > real(0.0) and state.in_contact[vertex.index] == wp.uint8(0):
                        inertial = transferred(state.compliance[vertex.index], multiple_of_unit(real(1.0)), move)
        if wp.static(options.anisotropic):
            state.in_contact[vertex.index] = wp.where(depth > 0.0, wp.uint8(1), wp.uint8(0))
        return move, inertial

    return query_avatar


@functools.cache
def avatar_function(options: KernelOptions, Prefetched: type, saves_queries: bool) -> wp.Function:
    """The function that has a displaced vertex meet its item's avatar; ``Prefetched``: passes.step.prefetched_type."""
    types, collider_type = cloth_types(options.precision), options.collider
    vec3, vec6, State, Vertex = types.vec3, types.vec6, types.State, types.Vertex
    query_avatar = query_function(options, saves_queries)

    @wp.func
    def meet_avatar(state: State, collider: collider_type, known: Prefetched, lift: float, vertex: Vertex, move: vec3):
        """``query_avatar`` of a vertex that may have come near; else it keeps what is left of its clearance [m]."""
        if wp.static(saves_queries):
            left = known.clearance - (LONGER * float(root(inner(move, move))) + STEP)
            if left > 0.0:
                state.clearance[vertex.index] = left
                if wp.static(options.anisotropic):
                    state.in_contact[vertex.index] = wp.uint8(0)
                return move, move
        compliance = vec6()
        if wp.static(not options.cloth_contact):
            compliance = known.compliance
        return query_avatar(state, collider, known.anisotropic, compliance, lift, vertex, move)

    return meet_avatar
