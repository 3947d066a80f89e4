"""Kernels that move vertices by their displacement: where they lie, or from one set of arrays to another."""

import dataclasses
import functools

import warp as wp

from warp_cloth.kernels.avatar.field import fetch_field, field_contact
from warp_cloth.kernels.base.access import element, put
from warp_cloth.kernels.base.block import (
    FEW_PER_CORE,
    await_blocks,
    block_of,
    block_threads,
    fetches,
    lane_of,
    leave_blocks,
    load_no_earlier,
    memory_functions,
    signal_done,
    wait_for_block,
)
from warp_cloth.kernels.base.options import WORN_THREADS, Accumulate, KernelOptions, block_for
from warp_cloth.kernels.base.types import MODULE_OPTIONS, Patch, cloth_types, free_function
from warp_cloth.kernels.contact.force import block_forces_function
from warp_cloth.kernels.contact.search_trigger import load_bounds, note_displacement
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.passes.gather import patch_functions
from warp_cloth.kernels.passes.step import (
    AHEAD,
    cloth_contact_type,
    colliders_type,
    displacement_function,
    prefetch_function,
    prefetched_type,
    saves_queries,
)
from warp_cloth.kernels.patches.memory import (
    NEXT_WARP,
    context_function,
    context_type,
    leaves,
    next_functions,
    patch_of,
)
from warp_cloth.kernels.patches.packing import first_three, order_functions
from warp_cloth.kernels.patches.steps import point_functions


@functools.cache
def read_function(options: KernelOptions) -> wp.Function:
    """The function that reads a vertex from memory."""
    types = cloth_types(options.precision)
    Model, State, Vertex, Item = types.Model, types.State, types.Vertex, types.Item
    order = order_functions(options.precision, options.packed, options.in_order)
    position_at, displacement_at = order.position_at, order.displacement_at

    @wp.func
    def read_vertex(model: Model, state: State, index: int, item_index: int, item: Item):
        """A vertex of an item: as it lies, its last displacement, its weight and the stiffness of its last step."""
        vertex = Vertex()
        vertex.index = index
        vertex.item_index = item_index
        vertex.item = item
        vertex.position = position_at(state, index)
        vertex.weight = element(model.weight, index)
        if wp.static(options.accelerated):
            vertex.displacement = displacement_at(state, index)
            vertex.stiffness = element(state.stiffness, index)
        return vertex

    return read_vertex


@functools.cache
def block_read_function(options: KernelOptions) -> wp.Function:
    """The function that reads a vertex of a patch, from the block's memory where that still has it."""
    precision, accelerated = options.precision, options.accelerated
    types = cloth_types(precision)
    Model, State, Vertex, Item, Context = types.Model, types.State, types.Vertex, types.Item, context_type(precision)
    point_at, read_4 = point_functions(precision, True).point_at, memory_functions(precision, True).read_4
    read_vertex = read_function(options)

    @wp.func
    def read_memory(context: Context, model: Model, state: State, local: int, index: int, item: Item):
        """``read_vertex`` of the block's vertex ``local``, before triangles' loads replace what it was read from."""
        vertex = Vertex()
        vertex.index = index
        vertex.item_index = context.patch.item
        vertex.item = item
        vertex.position = point_at(context, local)
        vertex.weight = element(model.weight, index)
        if wp.static(accelerated):
            vertex.displacement = first_three(
                read_4(context.overflow, context.memory.move + wp.static(4 * types.real_size) * local)
            )
            vertex.stiffness = element(state.stiffness, index)
        return vertex

    @wp.func
    def read_arrays(context: Context, model: Model, state: State, local: int, index: int, item: Item):
        """``read_vertex`` of the block's vertex ``local``."""
        return read_vertex(model, state, index, context.patch.item, item)

    return read_memory if _keeps(options) else read_arrays


def _keeps(options: KernelOptions) -> bool:
    """Whether there are registers for what is loaded before triangles are computed."""
    return options.paired and options.fits


@functools.cache
def displace_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``displace_vertices``, which moves the cloth where it lies."""
    types, cloth_contact = cloth_types(options.precision), options.cloth_contact
    point, vec3, vec4, Model, State, Step = (
        types.point, types.vec3, types.vec4, types.Model, types.State, types.Step,
    )  # fmt: skip
    vertex_displacement, prefetch = displacement_function(options), prefetch_function(options)
    read_vertex, free = read_function(options), free_function(options.precision, options.terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_vertices(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(options.avatar_contact, options.collider),
        contact: cloth_contact_type(cloth_contact),
        load_out: wp.array(dtype=vec4),  # the cloth's forces [N] and stiffness bounds [N/m], shape [V]; left at zero
    ):
        """Moves each free vertex of an item that is not at rest."""
        index = wp.tid()
        load = element(load_out, index)
        load_out[index] = vec4()
        item_index = element(model.item, index)
        if wp.static(options.avatar_contact is field_contact):
            if index + AHEAD < model.weight.shape[0]:
                queried = True
                if wp.static(saves_queries(options)):
                    queried = element(state.clearance, index + AHEAD) == 0.0
                if queried:
                    fetch_field(colliders[item_index], wp.vec3d(element(state.position, index + AHEAD)))
        item = model.items[item_index]
        if item.active == 0:
            return
        move = vec3()
        if wp.static(cloth_contact):
            iteration, path = load_bounds(contact, index)
        position = element(state.position, index)
        known = prefetch(state, colliders, contact, index, wp.vec3d(position), item_index, item)
        if free(model, index):
            vertex = read_vertex(model, state, index, item_index, item)
            move, inertial, stiffness = vertex_displacement(state, step, colliders, contact, known, load, vertex)
            state.displacement[index] = inertial
            state.position[index] = vertex.position + point(move)
            if wp.static(options.accelerated):
                state.stiffness[index] = stiffness
        if wp.static(cloth_contact):
            note_displacement(contact, index, known.contact, float(root(inner(move, move))), iteration, path)

    return displace_vertices


@functools.cache
def move_function(options: KernelOptions) -> wp.Function:
    """The function that ends a vertex' iteration in the kernels below."""
    types, order = cloth_types(options.precision), order_functions(options.precision, options.packed, options.in_order)
    point, vec3, State, Vertex, Step = types.point, types.vec3, types.State, types.Vertex, types.Step
    put_position, put_displacement = order.put_position, order.put_displacement
    vertex_displacement = displacement_function(options)
    Colliders = colliders_type(options.avatar_contact, options.collider)
    Contact, Prefetched = cloth_contact_type(options.cloth_contact), prefetched_type(options)

    @wp.func
    def move_vertex(  # nine arguments: those of vertex_displacement, and the arrays that kernels write
        state: State,
        step: Step,
        colliders: Colliders,
        contact: Contact,
        known: Prefetched,
        load: types.vec4,
        vertex: Vertex,
        position_out: wp.array(dtype=point),
        displacement_out: wp.array(dtype=order.move),
    ):
        """Writes where a vertex is then, and what of its displacement has momentum; a pinned one stays."""
        if wp.static(options.cloth_contact):
            iteration, path = load_bounds(contact, vertex.index)
        move, inertial = vec3(), vec3()
        if vertex.free:
            move, inertial, stiffness = vertex_displacement(state, step, colliders, contact, known, load, vertex)
            if wp.static(options.accelerated):
                put(state.stiffness, vertex.index, stiffness)
        position = vertex.position + point(move)
        put_displacement(displacement_out, vertex.index, inertial)
        put_position(position_out, vertex.index, position)
        if wp.static(options.cloth_contact):
            note_displacement(contact, vertex.index, known.contact, float(root(inner(move, move))), iteration, path)

    return move_vertex


def move_type(options: KernelOptions) -> type:
    """The type of displacements that the kernels below write."""
    move: type = order_functions(options.precision, options.packed, options.in_order).move
    return move


def _launch_bounds(options: KernelOptions) -> tuple[int, int]:
    """Threads of a block, and how many blocks a core's registers are to suffice for."""
    threads, _, many, _ = block_for(options.paired)
    if options.avatar_contact is not None and (options.cloth_contact or options.few or options.paired):
        many -= 1  # what an avatar is queried by then finds more of the core's own memory
    elif options.avatar_contact is not None:
        threads = WORN_THREADS
    return threads, FEW_PER_CORE if options.few else many


def advance_kernel(options: KernelOptions) -> wp.Kernel:
    """The kernel that gathers vertices' forces and moves them, from one set of arrays to another, patch by patch.

    Where cloth meets cloth and patches are few the first blocks press its pairs meanwhile.
    """
    options = advance_options(options)
    return _advance_kernel(options) if options.fits else _advance_large_kernel(options)


def presses_along(options: KernelOptions) -> bool:
    """Whether the kernel that moves vertices presses pairs of cloth, too."""
    return options.cloth_contact and options.few and options.fits


def advance_options(options: KernelOptions) -> KernelOptions:
    """The same, of cloth whose vertices lie in the patches' order; where single positions are read, not packed."""
    threads = 0 if options.few or options.paired else _launch_bounds(options)[0]
    return dataclasses.replace(options, in_order=True, packed=not options.cloth_contact, block_threads=threads)


@functools.cache
def _advance_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``advance_vertices``: a thread for each vertex, and none waits for what is loaded before the block.

    With ``presses_along`` the first blocks press pairs of cloth, while the others compute what they own.
    """
    types, keeps, presses = cloth_types(options.precision), _keeps(options), presses_along(options)
    vec4, Model, State, Step = types.vec4, types.Model, types.State, types.Step
    patch_context, prefetch, move_vertex = (
        context_function(options), prefetch_function(options), move_function(options),
    )  # fmt: skip
    add_block_forces = block_forces_function(options.precision, Accumulate.STIFFNESS, in_order=True)
    functions, next_patch = patch_functions(options), next_functions(options.precision).next_patch
    read_vertex, free = block_read_function(options), free_function(options.precision, options.terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=_launch_bounds(options))
    def advance_vertices(  # nine arguments: the last two are the arrays that iterations write by turns
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(options.avatar_contact, options.collider),
        contact: cloth_contact_type(options.cloth_contact),
        patches: types.Patches,
        overflow: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        position_out: wp.array(dtype=types.point),  # [m], shape [V]
        displacement_out: wp.array(dtype=move_type(options)),  # [m], shape [V]
    ):
        """Moves each free vertex of an item that is not at rest by the forces that meet there; pinned ones stay."""
        thread = wp.tid()
        lane = lane_of(thread)
        block = block_of(thread)
        if wp.static(presses):
            if block < contact.blocks.force_count:
                add_block_forces(step, state, contact, thread, contact.blocks.force_count)
                signal_done(contact.blocks.done)
                return
            block -= contact.blocks.force_count
        patch = patch_of(patches.patch, block)
        item = model.items[patch.item]
        soon = Patch()
        if wp.static(options.paired and not options.cloth_contact):
            if fetches(NEXT_WARP):
                soon = next_patch(patches, block)
        first, second = functions.two_vertices(patches, patch, lane)
        if leaves(item.active, patch, first, second):
            if wp.static(presses):
                arrived = await_blocks(contact.blocks.done, contact.blocks.force_count)
                leave_blocks(contact.blocks.done, contact.blocks.force_count, contact.blocks.move_count, arrived)
            return
        context = patch_context(step, patches, patch, overflow, lane)
        work = functions.work_edges(context, state, first, second, soon)
        if wp.static(not keeps):
            functions.work_corners(context, work)
        load_no_earlier()
        local = int(lane)
        own = wp.min(local, patch.owned_count - 1)
        index = functions.own_vertex(patches, patch, own)
        moves = free(model, index)
        vertex = read_vertex(context, model, state, own, index, item)
        vertex.free = moves
        if wp.static(keeps):
            functions.work_corners(context, work)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        if wp.static(not options.cloth_contact):
            known = prefetch(state, colliders, contact, index, wp.vec3d(vertex.position), patch.item, item)
        wait_for_block()
        if wp.static(presses):  # all that need not wait for those that press
            known = prefetch(state, colliders, contact, index, wp.vec3d(vertex.position), patch.item, item)
            load = vec4()
            if local < patch.owned_count:
                load = functions.vertex_load(context, local, edges, triangles)
            arrived = await_blocks(contact.blocks.done, contact.blocks.force_count)
        if local < patch.owned_count:
            if wp.static(not presses):
                load = functions.vertex_load(context, local, edges, triangles)
            if wp.static(options.cloth_contact and not presses):
                known = prefetch(state, colliders, contact, index, wp.vec3d(vertex.position), patch.item, item)
            move_vertex(state, step, colliders, contact, known, load, vertex, position_out, displacement_out)
        if wp.static(presses):
            leave_blocks(contact.blocks.done, contact.blocks.force_count, contact.blocks.move_count, arrived)

    return advance_vertices


@functools.cache
def _advance_large_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``advance_large``, where some patch is too large for a block's own memory or threads."""
    types, cloth_contact = cloth_types(options.precision), options.cloth_contact
    Model, State, Step = types.Model, types.State, types.Step
    patch_context, prefetch, move_vertex = (
        context_function(options), prefetch_function(options), move_function(options),
    )  # fmt: skip
    functions, next_patch = patch_functions(options), next_functions(options.precision).next_patch
    read_vertex, free = read_function(options), free_function(options.precision, options.terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False, launch_bounds=_launch_bounds(options))
    def advance_large(  # nine arguments, as advance_vertices
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(options.avatar_contact, options.collider),
        contact: cloth_contact_type(cloth_contact),
        patches: types.Patches,
        overflow: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        position_out: wp.array(dtype=types.point),  # [m], shape [V]
        displacement_out: wp.array(dtype=move_type(options)),  # [m], shape [V]
    ):
        """Moves each free vertex of an item that is not at rest by the forces that meet there; pinned ones stay."""
        thread = wp.tid()
        lane = lane_of(thread)
        block = block_of(thread)
        patch = patch_of(patches.patch, block)
        item = model.items[patch.item]
        soon = Patch()
        if wp.static(options.paired and not cloth_contact):
            if fetches(NEXT_WARP):
                soon = next_patch(patches, block)
        first, second = functions.two_vertices(patches, patch, lane)
        if leaves(item.active, patch, first, second):
            return
        context = patch_context(step, patches, patch, overflow, lane)
        work = functions.work_edges(context, state, first, second, soon)
        functions.work_corners(context, work)
        load_no_earlier()
        local = int(lane)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        wait_for_block()
        while local < patch.owned_count:
            index = functions.own_vertex(patches, patch, local)
            vertex = read_vertex(model, state, index, patch.item, item)
            vertex.free = free(model, index)
            load = functions.vertex_load(context, local, edges, triangles)
            known = prefetch(state, colliders, contact, index, wp.vec3d(vertex.position), patch.item, item)
            move_vertex(state, step, colliders, contact, known, load, vertex, position_out, displacement_out)
            local += block_threads()
            edges, triangles = functions.vertex_slots(patches, patch, local)

    return advance_large
