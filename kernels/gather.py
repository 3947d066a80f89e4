"""Forces patch by patch: a thread block works out all that meets at the vertices that it owns.

For CUDA. A block reads the vertices of its patch and those around into its own memory, works out there, one after
another, normals, edges and triangles, and sums what meets at each of its vertices in the order of the edges, then of
the triangles. That is the order of ``scatter``, and what borders on two patches is worked out in both from the same
numbers: so every way of cutting patches, and every device, gives the same bits. No atomics, one launch.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.arithmetic import signed_sum
from warp_cloth.kernels.block import (
    BESIDE,
    block_of,
    block_threads,
    lane_of,
    memory_functions,
    own_memory,
    wait_for_block,
)
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Patch, Terms, cloth_types
from warp_cloth.kernels.patch_steps import (
    PatchMemory,
    edges_step,
    fetch_function,
    normals_step,
    own_function,
    patch_of,
    triangles_step,
    vertices_step,
)

RANKS = 8  # of what meets at a vertex that share a word


_RANKED = """
    const unsigned int part = (unsigned int)word[rank >> 1];
    return (int)(rank & 1 ? part >> 16 : part & 65535u);
"""


@wp.func_native(_RANKED)
def ranked(word: wp.vec4i, rank: int) -> int:
    """One of the eight numbers below 65536 in a word of what meets at a vertex."""
    ...


@functools.cache
def layout_function(precision: str, terms: Terms) -> wp.Function:
    """The function that lays out the block's memory; the host counts the same bytes."""
    real = 8 if precision == "float64" else 4
    point = 12 if precision == "float32" else 24

    @wp.func
    def patch_memory(patch: Patch):
        """Places in the block's memory; without threads, corners' loads come to lie where the vertices lay."""
        memory = PatchMemory()
        at = own_memory()
        if patch.overflow >= 0:
            at = patch.overflow | BESIDE
        if wp.static(terms.edges):
            memory.edge_load = at
            at += wp.static(4 * real) * (patch.edge_count + 1)
        if wp.static(terms.folds):
            memory.normal = at
            at += wp.static(4 * real) * patch.normal_count
        memory.corner_load = at
        if wp.static(terms.threads):
            at += wp.static(4 * real) * (3 * patch.triangle_count + 1)
        memory.move = at
        at += wp.static(4 * real) * patch.vertex_count
        memory.position = at
        at += (wp.static(point) * patch.vertex_count + 7) & -8
        if wp.static(terms.folds and not terms.threads):
            at = wp.max(at, memory.corner_load + wp.static(4 * real) * (3 * patch.triangle_count + 1))
        memory.fold = at
        return memory

    return patch_memory


@functools.cache
def load_functions(precision: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``vertex_slots`` and ``vertex_load``; arguments as of ``patch_functions``."""
    types = cloth_types(precision)
    vec4, Patches = types.vec4, types.Patches
    read_4 = memory_functions(precision, fits).read_4

    @wp.func
    def vertex_slots(patches: Patches, patch: Patch, local: int):
        """Where a vertex' first edges and triangles have their loads."""
        edges, triangles = wp.vec4i(), wp.vec4i()
        if local < patch.owned_count:
            if wp.static(terms.edges):
                if patch.edge_words > 0:
                    edges = element(patches.edge_slot, patch.edge_slot_start + local)
            if wp.static(terms.folds or terms.threads):
                if patch.words > 0:
                    triangles = element(patches.slot, patch.slot_start + local)
        return edges, triangles

    @wp.func
    def vertex_load(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        local: int,
        edges: wp.vec4i,
        triangles: wp.vec4i,
    ):
        """Sum over the edges, then over the triangles at a vertex that the patch owns; what is not there is nothing.

        The last two are of ``vertex_slots``.
        """
        load = vec4()
        if wp.static(terms.edges):
            word = edges
            for eight in range(patch.edge_words):
                if eight > 0:
                    word = element(patches.edge_slot, patch.edge_slot_start + eight * patch.owned_count + local)
                for rank in range(wp.static(RANKS)):
                    entry = ranked(word, rank)
                    pull = read_4(beside, memory.edge_load + wp.static(4 * types.real_size) * (entry >> 1))
                    load = signed_sum(load, pull, entry & 1)  # from the edge's first end, or its second
        if wp.static(terms.folds or terms.threads):
            word = triangles
            for eight in range(patch.words):
                if eight > 0:
                    word = element(patches.slot, patch.slot_start + eight * patch.owned_count + local)
                for rank in range(wp.static(RANKS)):
                    entry = ranked(word, rank)
                    load += read_4(beside, memory.corner_load + wp.static(4 * types.real_size) * entry)
        return load

    return SimpleNamespace(vertex_slots=vertex_slots, vertex_load=vertex_load)


@functools.cache
def patch_functions(precision: str, fourth: str, terms: Terms, fits: bool, in_order: bool) -> SimpleNamespace:
    """Functions ``fetch_tables``, ``own_vertex``, ``work_patch``, ``vertex_slots`` and ``vertex_load``.

    The last sums a vertex' load once the whole block is through ``work_patch``.

    Args:
        precision: of positions and forces.
        fourth: one of cloth.FOURTH_PARTS.
        terms: what there is to gather.
        fits: whether no patch is too large for a block's own memory.
        in_order: whether vertices lie in the patches' order.
    """
    types = cloth_types(precision)
    Cloth, Step, Patches = types.Cloth, types.Step, types.Patches
    patch_memory = layout_function(precision, terms)
    own_vertex = own_function(precision, in_order)
    read_vertices = vertices_step(precision, fourth, fits, own_vertex)
    work_normals = normals_step(precision, fits)
    work_edges = edges_step(precision, fourth, terms, fits)
    work_triangles = triangles_step(precision, fourth, terms, fits)

    @wp.func
    def work_patch(
        cloth: Cloth, patches: Patches, patch: Patch, beside: wp.array(dtype=wp.uint8), step: Step, lane: int
    ):
        """All that meets at the patch's vertices, in the block's memory; every thread of the block calls it."""
        memory = patch_memory(patch)
        read_vertices(cloth, patches, patch, beside, memory, lane)
        if wp.static(terms.folds):
            work_normals(patches, patch, beside, memory, lane)
        if wp.static(terms.folds or terms.edges):
            work_edges(patches, patch, beside, memory, step, lane)
        if wp.static(terms.folds or terms.threads):
            work_triangles(patches, patch, beside, memory, step, lane)
        return memory

    own = load_functions(precision, terms, fits)
    return SimpleNamespace(
        fetch_tables=fetch_function(precision, terms), own_vertex=own_vertex, work_patch=work_patch,
        vertex_slots=own.vertex_slots, vertex_load=own.vertex_load,
    )  # fmt: skip


@functools.cache
def gather_kernel(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Kernel:
    """Kernel ``gather_forces``; ``fourth`` is one of cloth.FOURTH_PARTS, ``fits`` as of ``patch_functions``."""
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    functions = patch_functions(precision, fourth, terms, fits, in_order=False)
    fetch_tables, own_vertex, work_patch = functions.fetch_tables, functions.own_vertex, functions.work_patch
    vertex_slots, vertex_load = functions.vertex_slots, functions.vertex_load

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def gather_forces(
        cloth: Cloth,
        patches: Patches,
        beside: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        thread = wp.tid()
        patch = patch_of(patches.patch, block_of(thread))
        if cloth.items[patch.item].active == 0:
            return
        lane = lane_of(thread)
        fetch_tables(patches, patch)
        memory = work_patch(cloth, patches, patch, beside, step, lane)
        local = int(lane)
        edges, triangles = vertex_slots(patches, patch, local)
        wait_for_block()
        while local < patch.owned_count:
            vertex = own_vertex(patches, patch, local)
            load_out[vertex] = vertex_load(patches, patch, beside, memory, local, edges, triangles)
            local += block_threads()
            edges, triangles = vertex_slots(patches, patch, local)

    return gather_forces
