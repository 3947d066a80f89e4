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
from warp_cloth.kernels.block import block_of, lane_of, memory_functions, patch_threads, wait_for_block
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Patch, cloth_types
from warp_cloth.kernels.limits import RANKS, Terms
from warp_cloth.kernels.patch_memory import (
    PatchMemory,
    fetch_function,
    layout_function,
    leaves,
    patch_of,
    words_of,
)
from warp_cloth.kernels.patch_steps import (
    edge_table_function,
    edges_step,
    normals_step,
    triangle_table_function,
    triangles_step,
    vertices_step,
)

USUAL = 6  # of what meets at a vertex; only patches where more does look further


_RANKED = """
    const unsigned int part = (unsigned int)word[rank >> 1];
    return (int)(rank & 1 ? part >> 16 : part & 65535u);
"""


@wp.func_native(_RANKED)
def ranked(word: wp.vec4i, rank: int) -> int:
    """One of the eight numbers below 65536 in a word of what meets at a vertex."""
    ...


@functools.cache
def sum_functions(precision: str, fits: bool, first: int, last: int) -> SimpleNamespace:
    """Functions ``edges_sum`` and ``triangles_sum``, of the ranks from ``first`` to before ``last`` of a word."""
    types = cloth_types(precision)
    read_4 = memory_functions(precision, fits).read_4

    @wp.func
    def edges_sum(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, word: wp.vec4i, load: types.vec4):
        """A load and those of edges."""
        sum = load
        for rank in range(wp.static(first), wp.static(last)):
            entry = ranked(word, rank)
            pull = read_4(beside, memory.edge_load + wp.static(4 * types.real_size) * (entry >> 1))
            sum = signed_sum(sum, pull, entry & 1)  # from the edge's first end, or its second
        return sum

    @wp.func
    def triangles_sum(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, word: wp.vec4i, load: types.vec4):
        """A load and those of triangles' corners."""
        sum = load
        for rank in range(wp.static(first), wp.static(last)):
            sum += read_4(beside, memory.corner_load + wp.static(4 * types.real_size) * ranked(word, rank))
        return sum

    return SimpleNamespace(edges_sum=edges_sum, triangles_sum=triangles_sum)


@functools.cache
def load_functions(precision: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``vertex_slots`` and ``vertex_load``; arguments as of ``patch_functions``."""
    types = cloth_types(precision)
    vec4, Patches = types.vec4, types.Patches
    usual, further = sum_functions(precision, fits, 0, USUAL), sum_functions(precision, fits, USUAL, RANKS)
    whole = sum_functions(precision, fits, 0, RANKS)
    usual_edges, further_edges, more_edges = usual.edges_sum, further.edges_sum, whole.edges_sum
    usual_triangles, further_triangles, more_triangles = usual.triangles_sum, further.triangles_sum, whole.triangles_sum

    @wp.func
    def vertex_slots(patches: Patches, patch: Patch, local: int):
        """Where a vertex' first edges and triangles have their loads; beyond the last own vertex, those of any."""
        edges, triangles = wp.vec4i(), wp.vec4i()
        own = wp.min(local, patch.owned_count - 1)
        if wp.static(terms.edges):
            edges = element(patches.edge_slot, patch.edge_slot_start + own)
        if wp.static(terms.folds or terms.threads):
            triangles = element(patches.slot, patch.slot_start + own)
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
            load = usual_edges(beside, memory, edges, load)
            if patch.edge_ranks > wp.static(USUAL):
                load = further_edges(beside, memory, edges, load)
            for eight in range(1, words_of(patch.edge_ranks)):
                word = element(patches.edge_slot, patch.edge_slot_start + eight * patch.owned_count + local)
                load = more_edges(beside, memory, word, load)
        if wp.static(terms.folds or terms.threads):
            load = usual_triangles(beside, memory, triangles, load)
            if patch.ranks > wp.static(USUAL):
                load = further_triangles(beside, memory, triangles, load)
            for eight in range(1, words_of(patch.ranks)):
                word = element(patches.slot, patch.slot_start + eight * patch.owned_count + local)
                load = more_triangles(beside, memory, word, load)
        return load

    return SimpleNamespace(vertex_slots=vertex_slots, vertex_load=vertex_load)


@functools.cache
def patch_functions(precision: str, fourth: str, terms: Terms, fits: bool, in_order: bool) -> SimpleNamespace:
    """Functions ``own_vertex``, ``two_vertices``, ``work_patch``, ``vertex_slots`` and ``vertex_load``.

    The last sums a vertex' load once the whole block is through ``work_patch``.

    Args:
        precision: of positions and forces.
        fourth: one of cloth.FOURTH_PARTS.
        terms: what there is to gather.
        fits: whether no patch is too large for a block's own memory.
        in_order: whether vertices lie in the patches' order.
    """
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    patch_memory = layout_function(precision, terms, fits)
    fetch_tables = fetch_function(precision, terms)
    vertices = vertices_step(precision, fourth, fits, in_order)
    read_vertices = vertices.read_vertices
    work_normals = normals_step(precision, fits)
    work_edges = edges_step(precision, fourth, terms, fits)
    work_triangles = triangles_step(precision, fourth, terms, fits)
    edge_table, triangle_table = edge_table_function(precision, terms), triangle_table_function(precision, terms)
    own = load_functions(precision, terms, fits)
    vertex_slots = own.vertex_slots

    @wp.func
    def work_patch(
        cloth: Cloth,
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        step: Step,
        lane: int,
        first: int,
        second: int,
    ):
        """All that meets at the patch's vertices, in the block's memory; every thread of the block calls it.

        The last two are of ``two_vertices``. What a step begins with is asked for a step ahead. Returns the memory's
        places, and ``vertex_slots`` of the thread's first vertex.
        """
        fetch_tables(patches, patch)
        memory = patch_memory(patch)
        corner_word, end_word, law = wp.uint64(0), wp.uint64(0), vec4()
        side_word, side_corners = wp.uint64(0), wp.uint64(0)
        if wp.static(terms.folds):
            corner_word = element(patches.corners, patch.triangle_start + wp.min(lane, patch.normal_count))
        read_vertices(cloth, patches, patch, beside, memory, lane, first, second)
        if wp.static(terms.folds or terms.edges):
            end_word, law = edge_table(patches, patch.edge_start + wp.min(lane, patch.edge_count))
        wait_for_block()
        if wp.static(terms.folds):
            work_normals(patches, patch, beside, memory, lane, corner_word)
        if wp.static(terms.folds or terms.threads):
            side_word, side_corners = triangle_table(patches, patch.triangle_start + wp.min(lane, patch.normal_count))
        if wp.static(terms.folds):
            wait_for_block()
        if wp.static(terms.folds or terms.edges):
            work_edges(patches, patch, beside, memory, step, lane, end_word, law)
        edges, triangles = vertex_slots(patches, patch, lane)
        if wp.static(terms.folds or terms.threads):
            wait_for_block()
            work_triangles(patches, patch, beside, memory, step, lane, side_word, side_corners)
        return memory, edges, triangles

    return SimpleNamespace(
        own_vertex=vertices.own_vertex, two_vertices=vertices.two_vertices, work_patch=work_patch,
        vertex_slots=vertex_slots, vertex_load=own.vertex_load,
    )  # fmt: skip


@functools.cache
def gather_kernel(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Kernel:
    """Kernel ``gather_forces``; ``fourth`` is one of cloth.FOURTH_PARTS, ``fits`` as of ``patch_functions``."""
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    functions = patch_functions(precision, fourth, terms, fits, in_order=False)
    own_vertex, two_vertices = functions.own_vertex, functions.two_vertices
    work_patch, vertex_slots, vertex_load = functions.work_patch, functions.vertex_slots, functions.vertex_load

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
        lane = lane_of(thread)
        first, second = two_vertices(patches, patch, lane)
        if leaves(cloth.items[patch.item].active, patch, first, second):
            return
        memory, edges, triangles = work_patch(cloth, patches, patch, beside, step, lane, first, second)
        local = int(lane)
        wait_for_block()
        while local < patch.owned_count:
            vertex = own_vertex(patches, patch, local)
            load_out[vertex] = vertex_load(patches, patch, beside, memory, local, edges, triangles)
            local += patch_threads()
            edges, triangles = vertex_slots(patches, patch, local)

    return gather_forces
