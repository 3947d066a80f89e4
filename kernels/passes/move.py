"""Kernels that move the cloth by ``displacement``: where it lies, or from one set of arrays to another."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.field import fetch_field, field_contact
from warp_cloth.kernels.base.access import element, put
from warp_cloth.kernels.base.block import (
    FEW_PER_CORE,
    ask_no_earlier,
    await_blocks,
    block_of,
    block_threads,
    fetches,
    lane_of,
    leave_blocks,
    memory_functions,
    tell_blocks,
    wait_for_block,
)
from warp_cloth.kernels.base.options import WORN_THREADS, Accumulate, Terms, block_for
from warp_cloth.kernels.base.types import MODULE_OPTIONS, Patch, cloth_types, free_function
from warp_cloth.kernels.contact.force import press_function
from warp_cloth.kernels.contact.search_trigger import contact_turn, contact_watch
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.passes.gather import patch_functions
from warp_cloth.kernels.passes.step import (
    AHEAD,
    before_function,
    before_type,
    colliders_type,
    contact_type,
    displacement,
    spares_looks,
    step_bound,
)
from warp_cloth.kernels.patches.memory import NEXT_TURN, PatchMemory, leaves, next_functions, patch_of
from warp_cloth.kernels.patches.packing import order_functions, three_function
from warp_cloth.kernels.patches.steps import point_functions


@functools.cache
def held_function(precision: str, accelerated: bool, packed: bool, in_order: bool = True) -> wp.Function:
    """The function that reads a vertex; ``packed`` and ``in_order``: as of packing.order_functions."""
    types = cloth_types(precision)
    Model, State, Vertex = types.Model, types.State, types.Vertex
    order = order_functions(precision, packed, in_order)
    position_at, move_at = order.position_at, order.move_at

    @wp.func
    def held_vertex(model: Model, state: State, vertex: int):
        """A vertex as it lies, what last moved it, its weight and the stiffness that it went by."""
        held = Vertex()
        held.position = position_at(state, vertex)
        held.weight = element(model.weight, vertex)
        if wp.static(accelerated):
            held.move = move_at(state, vertex)
            held.stiffness = element(state.stiffness, vertex)
        return held

    return held_vertex


@functools.cache
def kept_function(precision: str, accelerated: bool) -> wp.Function:
    """The function that reads a vertex which the block's memory still has."""
    types = cloth_types(precision)
    Model, State, Vertex = types.Model, types.State, types.Vertex
    point_at, read_4 = point_functions(precision, True).point_at, memory_functions(precision, True).read_4
    first_three = three_function(precision)

    @wp.func
    def kept_vertex(
        model: Model, state: State, beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int, vertex: int
    ):
        """``held_vertex`` of one that is kept as ``local``."""
        held = Vertex()
        held.position = point_at(beside, memory, local)
        held.weight = element(model.weight, vertex)
        if wp.static(accelerated):
            held.move = first_three(read_4(beside, memory.move + wp.static(4 * types.real_size) * local))
            held.stiffness = element(state.stiffness, vertex)
        return held

    return kept_vertex


@functools.cache
def displace_kernel(
    precision: str,
    accelerated: bool,
    avatar_contact: wp.Function | None,
    collider_type: type,
    cloth_contact: bool,
    pins: bool,
) -> wp.Kernel:
    """Kernel ``displace_vertices``, which moves the cloth where it lies; arguments as of ``displacement``.

    ``pins``: whether any vertex is pinned.
    """
    types = cloth_types(precision)
    point, vec3, vec4, Model, State, Step = types.point, types.vec3, types.vec4, types.Model, types.State, types.Step
    spares = spares_looks(avatar_contact, cloth_contact)
    vertex_displacement = displacement(precision, accelerated, avatar_contact, collider_type, cloth_contact, spares)
    Contact = contact_type(cloth_contact)
    held_vertex = held_function(precision, accelerated, packed=False, in_order=False)
    free = free_function(precision, pins)
    told_before = before_function(precision, accelerated, avatar_contact, collider_type, cloth_contact, spares)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_vertices(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(avatar_contact, collider_type),
        contact: Contact,
        load: wp.array(dtype=vec4),  # forces of the cloth [N] and stiffness bounds [N/m], shape [V]; left at zero
    ):
        """Moves each free vertex of an item that is not at rest."""
        vertex = wp.tid()
        sum = element(load, vertex)
        load[vertex] = vec4()
        number = element(model.item, vertex)
        if wp.static(avatar_contact is field_contact):
            if vertex + AHEAD < model.weight.shape[0]:
                looks = True
                if wp.static(spares):
                    looks = element(state.clearance, vertex + AHEAD) == 0.0
                if looks:
                    fetch_field(colliders[number], wp.vec3d(element(state.position, vertex + AHEAD)))
        item = model.items[number]
        if item.active == 0:
            return
        move = vec3()
        turn, gone = int(0), wp.int64(0)
        if wp.static(cloth_contact):
            turn, gone = contact_turn(contact, vertex)
        before = told_before(contact, state, colliders, vertex, wp.vec3d(element(state.position, vertex)), number, item)
        if free(model, vertex):
            held = held_vertex(model, state, vertex)
            move, kept, stiffness = vertex_displacement(
                state, step, colliders, contact, before, sum, held, vertex, number, item
            )
            state.displacement[vertex] = kept
            state.position[vertex] = held.position + point(move)
            if wp.static(accelerated):
                state.stiffness[vertex] = stiffness
        if wp.static(cloth_contact):
            contact_watch(contact, vertex, before.contact, float(root(inner(move, move))), turn, gone)

    return displace_vertices


@functools.cache
def end_function(
    precision: str,
    accelerated: bool,
    avatar_contact: wp.Function | None,
    collider_type: type,
    cloth_contact: bool,
    spares: bool = False,
) -> wp.Function:
    """The function that ends a vertex' iteration, from one set of arrays to another; arguments of ``displacement``."""
    types = cloth_types(precision)
    point, vec3, State, Vertex, Step, Item = (
        types.point, types.vec3, types.State, types.Vertex, types.Step, types.Item,
    )  # fmt: skip
    vertex_displacement = displacement(precision, accelerated, avatar_contact, collider_type, cloth_contact, spares)
    Colliders, Contact = colliders_type(avatar_contact, collider_type), contact_type(cloth_contact)
    Before = before_type(precision, avatar_contact, collider_type, cloth_contact)
    order = order_functions(precision, packed=not cloth_contact)
    put_position, put_move = order.put_position, order.put_move

    @wp.func
    def end_vertex(
        step: Step,
        colliders: Colliders,
        contact: Contact,
        before: Before,
        state: State,
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
        turn, gone = int(0), wp.int64(0)
        if wp.static(cloth_contact):
            turn, gone = contact_turn(contact, vertex)
        if moves:
            move, kept, stiffness = vertex_displacement(
                state, step, colliders, contact, before, load, held, vertex, number, item
            )
            if wp.static(accelerated):
                put(state.stiffness, vertex, stiffness)
        put_move(move_out, vertex, kept)
        position = held.position + point(move)
        put_position(position_out, vertex, position)
        if wp.static(cloth_contact):
            contact_watch(contact, vertex, before.contact, float(root(inner(move, move))), turn, gone)

    return end_vertex


@functools.cache
def advance_kernel(
    precision: str,
    accelerated: bool,
    terms: Terms,
    fits: bool,
    avatar_contact: wp.Function | None,
    collider_type: type,
    cloth_contact: bool,
    few: bool,
    paired: bool = False,
) -> wp.Kernel:
    """Kernel ``advance_vertices``, which gathers a vertex's forces and moves it, from one set of arrays to another.

    ``terms``: what there is to gather, and pins; ``fits`` as of ``gather.patch_functions``, the rest as of
    ``displacement``, and ``few``: whether there are no more than block.FEW patches; ``paired`` as ``fits``. Where cloth
    meets cloth and patches are few the first blocks press its pairs, while the others work out what they own.
    """
    presses = cloth_contact and few and fits
    press_share = press_function(precision, Accumulate.STIFFNESS, in_order=True) if presses else None
    threads, _, many, _ = block_for(paired)
    if avatar_contact is not None and (cloth_contact or few or paired):
        many -= 1  # what an avatar is looked up by then finds more of the core's own memory
    elif avatar_contact is not None:
        threads = WORN_THREADS
    bounds = threads, FEW_PER_CORE if few else many
    types = cloth_types(precision)
    point, vec4, Model, State, Step = types.point, types.vec4, types.Model, types.State, types.Step
    spares = spares_looks(avatar_contact, cloth_contact, few)
    told_before = before_function(
        precision, accelerated, avatar_contact, collider_type, cloth_contact, spares, packed=not cloth_contact
    )
    end_vertex = end_function(precision, accelerated, avatar_contact, collider_type, cloth_contact, spares)
    Contact = contact_type(cloth_contact)
    bound = step_bound(accelerated, avatar_contact, cloth_contact)
    told = 0 if few or paired else threads
    functions = patch_functions(
        precision, bound, terms, fits, in_order=True, paired=paired, threads=told, packed=not cloth_contact
    )
    keeps = paired and fits  # registers for what is asked for before triangles are worked out
    own_vertex, two_vertices = functions.own_vertex, functions.two_vertices
    work_edges, work_corners = functions.work_edges, functions.work_corners
    vertex_slots, vertex_load = functions.vertex_slots, functions.vertex_load
    held_vertex = held_function(precision, accelerated, packed=not cloth_contact)
    kept_vertex = kept_function(precision, accelerated)
    free, next_patch = free_function(precision, terms.pins), next_functions(precision).next_patch

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=bounds)
    def advance_vertices(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(avatar_contact, collider_type),
        contact: Contact,
        patches: types.Patches,
        beside: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=order_functions(precision, not cloth_contact).move),  # [m], shape [V]
    ):
        """Moves each free vertex of an item that is not at rest by the forces that meet there; pinned ones stay."""
        thread = wp.tid()
        lane = lane_of(thread)
        block = block_of(thread)
        if wp.static(presses):
            if block < contact.pressing:
                press_share(step, state, contact, thread, contact.pressing)
                tell_blocks(contact.told)
                return
            block -= contact.pressing
        patch = patch_of(patches.patch, block)
        item = model.items[patch.item]
        soon = Patch()
        if wp.static(paired and not cloth_contact):
            if fetches(NEXT_TURN):
                soon = next_patch(patches, block)
        first, second = two_vertices(patches, patch, lane)
        if leaves(item.active, patch, first, second):
            if wp.static(presses):
                came = await_blocks(contact.told, contact.pressing)
                leave_blocks(contact.told, contact.pressing, contact.waiting, came)
            return
        work = work_edges(state, patches, patch, beside, step, lane, first, second, soon)
        if wp.static(not keeps):
            work_corners(patches, patch, beside, step, lane, work)
        ask_no_earlier()
        local = int(lane)
        if wp.static(fits):  # a thread for each vertex, and no one waits for what is asked for before the block
            own = wp.min(local, patch.owned_count - 1)
            vertex = own_vertex(patches, patch, own)
            moves = free(model, vertex)
            if wp.static(keeps):
                held = kept_vertex(model, state, beside, work.memory, own, vertex)
            else:
                held = held_vertex(model, state, vertex)
        if wp.static(keeps):
            work_corners(patches, patch, beside, step, lane, work)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        if wp.static(fits and not cloth_contact):
            known = told_before(contact, state, colliders, vertex, wp.vec3d(held.position), patch.item, item)
        wait_for_block()
        if wp.static(presses):  # all that need not wait for those that press
            known = told_before(contact, state, colliders, vertex, wp.vec3d(held.position), patch.item, item)
            sum = vec4()
            if local < patch.owned_count:
                sum = vertex_load(patches, patch, beside, work.memory, local, edges, triangles)
            came = await_blocks(contact.told, contact.pressing)
            if local < patch.owned_count:
                end_vertex(
                    step, colliders, contact, known, state, sum, held, vertex, moves, patch.item, item,
                    position_out, move_out,
                )  # fmt: skip
            leave_blocks(contact.told, contact.pressing, contact.waiting, came)
        elif wp.static(fits):
            if local < patch.owned_count:
                load = vertex_load(patches, patch, beside, work.memory, local, edges, triangles)
                if wp.static(cloth_contact):
                    known = told_before(contact, state, colliders, vertex, wp.vec3d(held.position), patch.item, item)
                end_vertex(
                    step, colliders, contact, known, state, load, held, vertex, moves, patch.item, item,
                    position_out, move_out,
                )  # fmt: skip
        else:
            while local < patch.owned_count:
                vertex = own_vertex(patches, patch, local)
                held, moves = held_vertex(model, state, vertex), free(model, vertex)
                load = vertex_load(patches, patch, beside, work.memory, local, edges, triangles)
                before = told_before(contact, state, colliders, vertex, wp.vec3d(held.position), patch.item, item)
                end_vertex(
                    step, colliders, contact, before, state, load, held, vertex, moves, patch.item, item,
                    position_out, move_out,
                )  # fmt: skip
                local += block_threads()
                edges, triangles = vertex_slots(patches, patch, local)

    return advance_vertices
