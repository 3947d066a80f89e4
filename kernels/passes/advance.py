"""Kernels that gather vertices' forces patch by patch and move them, from one set of arrays to another; for CUDA.

A block computes a patch (``passes.gather``), then its threads move the vertices that the patch owns: one each or, where
patches are too large for a block, one after another. There are two kernels: ``advance_vertices`` and, where patches are
few and cloth meets cloth, ``advance_in_contact``, whose first blocks compute contact forces meanwhile.
"""

import dataclasses
import functools
from types import SimpleNamespace

import warp as wp

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
    signal_done,
    wait_for_block,
)
from warp_cloth.kernels.base.options import WORN_THREADS, Accumulate, KernelOptions, block_for
from warp_cloth.kernels.base.types import MODULE_OPTIONS, Patch, cloth_types, free_function
from warp_cloth.kernels.contact.force import block_forces_function
from warp_cloth.kernels.contact.search_trigger import load_bounds, note_displacement
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.passes.gather import patch_functions, work_type
from warp_cloth.kernels.passes.move import read_function
from warp_cloth.kernels.passes.step import (
    cloth_contact_type,
    colliders_type,
    displacement_function,
    prefetch_function,
    prefetched_type,
)
from warp_cloth.kernels.patches.memory import (
    NEXT_WARP,
    access_functions,
    context_function,
    context_type,
    next_patch,
    patch_of,
    skips_patch,
)
from warp_cloth.kernels.patches.packing import first_three, order_functions


def advance_kernel(options: KernelOptions) -> wp.Kernel:
    """The kernel of these two that iterates such cloth."""
    options = _advance_options(options)
    return _advance_in_contact_kernel(options) if fuses_contact(options) else _advance_kernel(options)


def fuses_contact(options: KernelOptions) -> bool:
    """Whether the kernel that moves vertices also computes the contact forces of cloth on cloth."""
    return options.cloth_contact and options.few and options.fits


def _advance_options(options: KernelOptions) -> KernelOptions:
    """The same, of cloth whose vertices lie in the patches' order; where single positions are read, not packed."""
    threads = 0 if options.few or options.paired else _launch_bounds(options)[0]
    return dataclasses.replace(options, in_order=True, packed=not options.cloth_contact, block_threads=threads)


def _launch_bounds(options: KernelOptions) -> tuple[int, int]:
    """Threads of a block, and how many blocks a core's registers are to suffice for."""
    threads, _, many, _ = block_for(options.paired)
    if options.avatar_contact is not None and (options.cloth_contact or options.few or options.paired):
        many -= 1  # what an avatar is queried by then finds more of the core's own memory
    elif options.avatar_contact is not None:
        threads = WORN_THREADS
    return threads, FEW_PER_CORE if options.few else many


def _kernel_settings(options: KernelOptions) -> dict:
    """How Warp compiles the two."""
    return {
        "module": "unique",
        "module_options": MODULE_OPTIONS,
        "grid_stride": False,
        "launch_bounds": _launch_bounds(options),
    }


def _reads_early(options: KernelOptions) -> bool:
    """Whether a thread has registers for its vertex while it still computes triangles."""
    return options.paired and options.fits


@functools.cache
def block_read_function(options: KernelOptions) -> wp.Function:
    """The function that reads a vertex of a patch, from the block's memory where that still has it."""
    precision, accelerated = options.precision, options.accelerated
    types = cloth_types(precision)
    Model, State, Vertex, Item, Context = types.Model, types.State, types.Vertex, types.Item, context_type(precision)
    point_at, row_at = access_functions(precision, True).point_at, access_functions(precision, True).row_at
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
            vertex.displacement = first_three(row_at(context, context.memory.move, local))
            vertex.stiffness = element(state.stiffness, index)
        return vertex

    @wp.func
    def read_arrays(context: Context, model: Model, state: State, local: int, index: int, item: Item):
        """``read_vertex`` of the block's vertex ``local``."""
        return read_vertex(model, state, index, context.patch.item, item)

    return read_memory if _reads_early(options) else read_arrays


@functools.cache
def move_function(options: KernelOptions) -> wp.Function:
    """The function that ends a vertex's iteration in the kernels below."""
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


@functools.cache
def start_type(precision: str) -> type:
    """The struct of what a thread loads first."""

    @wp.struct
    class PatchStart:
        """A block's patch and its item, and the patch that a GPU turns to when it is through with that."""

        patch: Patch
        item: cloth_types(precision).Item
        upcoming: Patch
        first: int  # vertices, of ``two_vertices``
        second: int

    return PatchStart


@functools.cache
def advance_functions(options: KernelOptions) -> SimpleNamespace:
    """What the kernels below are made of: how they begin, what they load of contact early, how a vertex ends."""
    types, functions = cloth_types(options.precision), patch_functions(options)
    precision, early = options.precision, _reads_early(options)
    PatchStart, Context, PatchWork = start_type(precision), context_type(precision), work_type(precision)
    read_vertex, free = block_read_function(options), free_function(options.precision, options.terms.pins)

    @wp.func
    def start_patch(model: types.Model, patches: types.Patches, block: int, lane: int):
        """What a thread of a block loads first."""
        start = PatchStart()
        start.patch = patch_of(patches.patch, block)
        start.item = model.items[start.patch.item]
        if wp.static(options.paired and not options.cloth_contact):
            if fetches(NEXT_WARP):
                start.upcoming = next_patch(patches, block)
        first, second = functions.two_vertices(patches, start.patch, lane)
        start.first = first
        start.second = second
        return start

    @wp.func
    def read_own_vertex(context: Context, model: types.Model, state: types.State, local: int, item: types.Item):
        """One of the vertices that the patch owns."""
        index = functions.own_vertex(context.patches, context.patch, local)
        moves = free(model, index)
        vertex = read_vertex(context, model, state, local, index, item)
        vertex.free = moves
        return vertex

    @wp.func
    def patch_vertex(context: Context, work: PatchWork, model: types.Model, state: types.State, item: types.Item):
        """A thread's vertex, loaded while triangles are computed; beyond the last own vertex, that one."""
        if wp.static(not early):
            functions.compute_corners(context, work)
        load_no_earlier()
        vertex = read_own_vertex(context, model, state, wp.min(int(context.lane), context.patch.owned_count - 1), item)
        if wp.static(early):
            functions.compute_corners(context, work)
        return vertex

    return SimpleNamespace(
        start_patch=start_patch,
        patch_context=context_function(options),
        read_vertex=read_own_vertex,
        patch_vertex=patch_vertex,
        prefetch=prefetch_function(options),
        move_vertex=move_function(options),
    )


@functools.cache
def _advance_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``advance_vertices``: no thread waits for what is loaded before the block has computed."""
    types, own, functions = cloth_types(options.precision), advance_functions(options), patch_functions(options)
    prefetches = options.fits and not options.cloth_contact  # else there are no registers for it

    @wp.kernel(**_kernel_settings(options))
    def advance_vertices(  # nine arguments: the last two are the arrays that iterations write by turns
        model: types.Model,
        state: types.State,
        step: types.Step,
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
        start = own.start_patch(model, patches, block_of(thread), lane)
        patch, item = start.patch, start.item
        if skips_patch(item.active, patch, start.first, start.second):
            return
        context = own.patch_context(step, patches, patch, overflow, lane)
        work = functions.compute_edges(context, state, start.first, start.second, start.upcoming)
        vertex = own.patch_vertex(context, work, model, state, item)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        if wp.static(prefetches):
            known = own.prefetch(state, colliders, contact, vertex.index, wp.vec3d(vertex.position), patch.item, item)
        wait_for_block()
        local = int(lane)
        while local < patch.owned_count:
            load = functions.vertex_load(context, local, edges, triangles)
            if wp.static(not prefetches):
                known = own.prefetch(
                    state, colliders, contact, vertex.index, wp.vec3d(vertex.position), patch.item, item
                )
            own.move_vertex(state, step, colliders, contact, known, load, vertex, position_out, displacement_out)
            local += block_threads()
            if wp.static(options.fits):  # a thread has one vertex only
                local = patch.owned_count
            elif local < patch.owned_count:
                edges, triangles = functions.vertex_slots(patches, patch, local)
                vertex = own.read_vertex(context, model, state, local, item)

    return advance_vertices


@functools.cache
def _advance_in_contact_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``advance_in_contact``: its first blocks compute contact forces, the others wait for these at last."""
    types, own, functions = cloth_types(options.precision), advance_functions(options), patch_functions(options)
    add_block_forces = block_forces_function(options.precision, Accumulate.STIFFNESS, in_order=True)

    @wp.kernel(**_kernel_settings(options))
    def advance_in_contact(  # nine arguments, as advance_vertices
        model: types.Model,
        state: types.State,
        step: types.Step,
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
        signalling, waiting = contact.blocks.force_count, contact.blocks.move_count
        if block < signalling:
            add_block_forces(step, state, contact, signalling)
            signal_done(contact.blocks.done)
            return
        start = own.start_patch(model, patches, block - signalling, lane)
        patch, item = start.patch, start.item
        if skips_patch(item.active, patch, start.first, start.second):
            arrived = await_blocks(contact.blocks.done, signalling)
            leave_blocks(contact.blocks.done, signalling, waiting, arrived)
            return
        context = own.patch_context(step, patches, patch, overflow, lane)
        work = functions.compute_edges(context, state, start.first, start.second, start.upcoming)
        vertex = own.patch_vertex(context, work, model, state, item)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        wait_for_block()
        # all that need not wait for contact forces
        known = own.prefetch(state, colliders, contact, vertex.index, wp.vec3d(vertex.position), patch.item, item)
        load = types.vec4()
        if lane < patch.owned_count:
            load = functions.vertex_load(context, lane, edges, triangles)
        arrived = await_blocks(contact.blocks.done, signalling)
        if lane < patch.owned_count:
            own.move_vertex(state, step, colliders, contact, known, load, vertex, position_out, displacement_out)
        leave_blocks(contact.blocks.done, signalling, waiting, arrived)

    return advance_in_contact
