"""How a displaced vertex meets its item's avatar: pushed out, held by friction, and looked up only where need be."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.field import field_clearance
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.laws.friction import friction_slide
from warp_cloth.kernels.math.real import inner, root, scaled_sum
from warp_cloth.kernels.math.symmetric import multiple_of_unit
from warp_cloth.kernels.passes.anisotropic_step import changed_leeway_function

LONGER, STEP = wp.constant(1.0001), wp.constant(1.0e-9)  # more than rounding adds to a way, as a share and [m]


@functools.cache
def looking(
    precision: str,
    avatar_contact: wp.Function,
    collider_type: type,
    worn: bool,
    spares: bool,
    cloth_contact: bool = False,
    told: bool = False,
) -> wp.Function:
    """The function that looks up where a displaced vertex meets its item's avatar.

    Arguments as of displacement.displacement; ``worn``: whether cloth may be loose; ``spares`` of spares_looks;
    ``told``: whether it is known if a vertex is loose and, unless cloth meets cloth, its leeway; what is not is read
    here.
    """
    types = cloth_types(precision)
    real, point, vec3, vec6, State, Item = types.real, types.point, types.vec3, types.vec6, types.State, types.Item
    changed_leeway = changed_leeway_function(precision)

    @wp.func
    def pushed_move(at: wp.vec4f, push: float, move: vec3, item: Item):
        """A displacement [m] that contact pushes out along the normal, at most by the cap, and friction shortens."""
        normal = vec3(real(at[0]), real(at[1]), real(at[2]))
        pushed = scaled_sum(normal, wp.min(real(push), item.cap), move)
        return friction_slide(pushed, normal, real(push), real(item.avatar_friction))

    @wp.func
    def looked_move(
        state: State,
        collider: collider_type,
        loose: bool,
        leeway: vec6,
        lift: float,
        vertex: int,
        position: point,
        move: vec3,
        item: Item,
    ):
        """A vertex' displacement after contact and friction, and what of it has momentum.

        ``loose``: whether it has leeway; ``lift`` is how much farther off it is met [m]. What comes to be held goes on
        without leeway, as if it had become so much heavier; it is slowed as much, or contact that comes and goes would
        feed a swing.
        """
        place = wp.vec3d(position) + wp.vec3d(move)
        at = avatar_contact(collider, place)
        push = item.offset - at[3] + lift
        if wp.static(spares):
            state.clearance[vertex] = field_clearance(collider, place, at[3], item.offset)
        kept = move
        if push > 0.0:
            move = pushed_move(at, push, move, item)
            kept = move
            if wp.static(worn):
                if wp.static(told):
                    if loose:
                        before = leeway
                        if wp.static(cloth_contact):
                            before = state.compliance[vertex]
                        kept = changed_leeway(before, multiple_of_unit(real(1.0)), move)
                else:
                    if item.anisotropy_limit > real(0.0) and state.in_contact[vertex] == wp.uint8(0):
                        kept = changed_leeway(state.compliance[vertex], multiple_of_unit(real(1.0)), move)
        if wp.static(worn):
            state.in_contact[vertex] = wp.where(push > 0.0, wp.uint8(1), wp.uint8(0))
        return move, kept

    return looked_move


@functools.cache
def meeting(
    precision: str, avatar_contact: wp.Function, collider_type: type, worn: bool, spares: bool, cloth_contact: bool
) -> wp.Function:
    """The function that has a displaced vertex meet its item's avatar; arguments as of ``looking``."""
    types = cloth_types(precision)
    point, vec3, vec6, State, Item = types.point, types.vec3, types.vec6, types.State, types.Item
    looked_move = looking(precision, avatar_contact, collider_type, worn, spares, cloth_contact, told=True)

    @wp.func
    def met_move(
        state: State,
        collider: collider_type,
        loose: bool,
        leeway: vec6,
        clear: float,
        lift: float,
        vertex: int,
        position: point,
        move: vec3,
        item: Item,
    ):
        """``looked_move`` of a vertex that may have come near; it is surely so ``clear`` of the avatar [m]."""
        if wp.static(spares):
            left = clear - (LONGER * float(root(inner(move, move))) + STEP)
            if left > 0.0:
                state.clearance[vertex] = left
                if wp.static(worn):
                    state.in_contact[vertex] = wp.uint8(0)
                return move, move
        return looked_move(state, collider, loose, leeway, lift, vertex, position, move, item)

    return met_move
