"""Forces patch by patch: a thread block computes in shared memory all that meets at the vertices that it owns.

For CUDA. A block loads the vertices of its patch and those around into its shared memory, computes there normals, edges
and triangles, one after another, and sums what meets at each of its vertices in the order of the edges, then of the
triangles. That is the order of ``scatter``, and what borders on two patches is computed in both from the same numbers:
so every way of cutting patches, and every device, gives the same bits. No atomics, one launch.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import (
    block_of,
    block_threads,
    fetches,
    lane_of,
    wait_for_block,
)
from warp_cloth.kernels.base.options import RANKS, SLOTS, KernelOptions
from warp_cloth.kernels.base.types import MODULE_OPTIONS, Patch, cloth_types
from warp_cloth.kernels.math.real import signed_sum
from warp_cloth.kernels.patches.corners import triangle_table_function, triangles_step
from warp_cloth.kernels.patches.memory import (
    NEXT_WARP,
    access_functions,
    context_function,
    context_type,
    fetch_function,
    fetch_next,
    patch_of,
    skips_patch,
    stride_function,
    words_of,
)
from warp_cloth.kernels.patches.steps import (
    edge_table_functions,
    edges_step,
    last_first,
    normals_step,
    vertices_step,
)
from warp_cloth.kernels.patches.tiles import (
    tile_corners_step,
    tile_edges_step,
    tile_functions,
    tile_normals_step,
    tile_type,
)

FEWEST = 4  # of what meets at a vertex, at least at most of them
USUAL = 6  # of what meets at a vertex; only patches where more does look further

EDGES, TRIANGLES = "edges", "triangles"  # which meet at vertices, and what they do there is summed

_RANKED = """
    const unsigned int part = (unsigned int)word[rank >> 1];
    return (int)(rank & 1 ? part >> 16 : part & 65535u);
"""


@wp.func_native(_RANKED)
def ranked(word: wp.vec4i, rank: int) -> int:
    """One of the eight numbers below 65536 in a word of what meets at a vertex."""
    ...


@functools.cache
def ranks_sum(options: KernelOptions, kind: str, first: int, last: int) -> wp.Function:
    """Function that adds what meets at a vertex to its load: the ranks from ``first`` to before ``last`` of a word."""
    types, Context = cloth_types(options.precision), context_type(options.precision)
    row_at = access_functions(options.precision, options.fits).row_at

    @wp.func
    def edges_sum(context: Context, word: wp.vec4i, load: types.vec4):
        """A load and those of edges."""
        sum = load
        for rank in range(wp.static(first), wp.static(last)):
            entry = ranked(word, rank)
            pull = row_at(context, context.memory.edge_load, entry >> 1)
            sum = signed_sum(sum, pull, entry & 1)  # from the edge's first end, or its second
        return sum

    @wp.func
    def triangles_sum(context: Context, word: wp.vec4i, load: types.vec4):
        """A load and those of triangles' corners."""
        sum = load
        for rank in range(wp.static(first), wp.static(last)):
            sum += row_at(context, context.memory.corner_load, ranked(word, rank))
        return sum

    return edges_sum if kind == EDGES else triangles_sum


@functools.cache
def words_sum(options: KernelOptions, kind: str) -> wp.Function:
    """Function that adds all of a kind that meets at a vertex to its load.

    Where threads work on pairs of triangles, vertices where as much meets come together.
    """
    vec4, Context, by_kind = cloth_types(options.precision).vec4, context_type(options.precision), options.paired
    fewest, between = ranks_sum(options, kind, 0, FEWEST), ranks_sum(options, kind, FEWEST, USUAL)
    usual, further = ranks_sum(options, kind, 0, USUAL), ranks_sum(options, kind, USUAL, RANKS)
    whole = ranks_sum(options, kind, 0, RANKS)

    @wp.func
    def sum_of_words(
        context: Context,
        slot: wp.array(dtype=wp.vec4i),
        local: int,
        word: wp.vec4i,
        nothing: int,
        load: vec4,
    ):
        """``word`` is the first of ``slot``'s words of the vertex; what is not there is ``nothing``, or after it."""
        sum = load
        if wp.static(by_kind):
            sum = fewest(context, word, sum)
            if ranked(word, wp.static(FEWEST)) < nothing:
                sum = between(context, word, sum)
            if ranked(word, wp.static(USUAL)) < nothing:
                sum = further(context, word, sum)
        else:
            sum = usual(context, word, sum)
            if context.patch.ranks > wp.static(USUAL):
                sum = further(context, word, sum)
        for eight in range(1, words_of(context.patch.ranks)):
            other = element(slot, context.patch.slot_start + eight * context.patch.owned_count + local)
            sum = whole(context, other, sum)
        return sum

    return sum_of_words


@functools.cache
def load_functions(options: KernelOptions) -> SimpleNamespace:
    """Functions ``vertex_slots`` and ``vertex_load``."""
    types, terms, Context = cloth_types(options.precision), options.terms, context_type(options.precision)
    vec4, Patches = types.vec4, types.Patches
    all_edges, all_triangles = (words_sum(options, kind) for kind in (EDGES, TRIANGLES))
    corner_stride = stride_function(terms)

    @wp.func
    def vertex_slots(patches: Patches, patch: Patch, local: int):
        """Where a vertex's first edges and triangles have their loads; beyond the last own vertex, those of any."""
        edges, triangles = wp.vec4i(), wp.vec4i()
        own = wp.min(local, patch.owned_count - 1)
        if wp.static(terms.edges):
            edges = element(patches.edge_slot, patch.slot_start + own)
        if wp.static(terms.folds or terms.yarns):
            triangles = element(patches.slot, patch.slot_start + own)
        return edges, triangles

    @wp.func
    def vertex_load(context: Context, local: int, edges: wp.vec4i, triangles: wp.vec4i):
        """Sum over the edges, then over the triangles at a vertex that the patch owns; what is not there is nothing.

        The last two are of ``vertex_slots``.
        """
        load = vec4()
        if wp.static(terms.edges):
            nothing = 2 * context.patch.edge_count
            load = all_edges(context, context.patches.edge_slot, local, edges, nothing, load)
        if wp.static(terms.folds or terms.yarns):
            nothing = corner_stride(context.patch) + 2 * context.patch.triangle_count
            load = all_triangles(context, context.patches.slot, local, triangles, nothing, load)
        return load

    return SimpleNamespace(vertex_slots=vertex_slots, vertex_load=vertex_load)


@functools.cache
def work_type(precision: str) -> type:
    """The struct of what a thread keeps from one half of its work on a patch to the other."""

    @wp.struct
    class PatchWork:
        """The thread's tile, and what it has loaded ahead."""

        tile: tile_type(precision)
        sides: wp.uint64  # ``triangle_table`` of the thread's first triangle
        corners: wp.uint64
        edges: wp.vec4i  # ``vertex_slots`` of its first vertex
        triangles: wp.vec4i

    return PatchWork


@functools.cache
def compute_edges_function(options: KernelOptions) -> wp.Function:
    """The function ``compute_edges``: the first half of a block's work on a patch.

    (context, state, first, second, upcoming) -> PatchWork. Vertices, normals and edges of a patch, in the block's
    memory; every thread of the block calls it. ``first`` and ``second`` are of ``two_vertices``, ``upcoming`` is of
    ``next_patch`` where that is prefetched. What a step begins with is loaded a step ahead.
    """
    return _compute_tiles_function(options) if options.paired else _compute_singles_function(options)


def _compute_singles_function(options: KernelOptions) -> wp.Function:
    precision, terms = options.precision, options.terms
    types, PatchWork, Context = cloth_types(precision), work_type(precision), context_type(precision)
    fetch_tables, read_vertices = fetch_function(options), vertices_step(options).read_vertices
    compute_normals, compute_edges = normals_step(options), edges_step(options)
    edge_table, triangle_table = edge_table_functions(options).edge_table, triangle_table_function(precision, terms)
    vertex_slots = load_functions(options).vertex_slots

    @wp.func
    def compute_singles(context: Context, state: types.State, first: int, second: int, upcoming: Patch):
        """``compute_edges`` where a thread works on one edge, then one triangle, after another."""
        patches, patch = context.patches, context.patch
        fetch_tables(patches, patch)
        corner_word, end_word, constants = wp.uint64(0), wp.uint64(0), types.vec4()
        triangle = patch.triangle_start + wp.min(context.lane, patch.normal_count)
        if wp.static(terms.folds):
            corner_word = element(patches.corners, triangle)
        read_vertices(context, state, first, second)
        if wp.static(terms.folds or terms.edges):
            end_word, constants = edge_table(patches, patch, context.lane)
        wait_for_block()
        if wp.static(terms.folds):
            compute_normals(context, corner_word)
        sides, corners = triangle_table(patches, triangle)
        if wp.static(terms.folds):
            wait_for_block()
        if wp.static(terms.folds or terms.edges):
            compute_edges(context, end_word, constants)
        edges, triangles = vertex_slots(patches, patch, context.lane)
        work = PatchWork()
        work.sides = sides
        work.corners = corners
        work.edges = edges
        work.triangles = triangles
        return work

    return compute_singles


def _compute_tiles_function(options: KernelOptions) -> wp.Function:
    precision, terms, fits = options.precision, options.terms, options.fits
    types, PatchWork, Context = cloth_types(precision), work_type(precision), context_type(precision)
    fetch_tables, read_vertices = fetch_function(options), vertices_step(options).read_vertices
    load_tile, compute_tile_normals = tile_functions(precision, fits).load_tile, tile_normals_step(options)
    tiles = tile_edges_step(options)
    load_constants, compute_tile_edges = tiles.load_constants, tiles.compute_tile_edges
    compute_normals, compute_edges = normals_step(options), edges_step(options)
    edge_table, vertex_slots = edge_table_functions(options).edge_table, load_functions(options).vertex_slots

    @wp.func
    def compute_tiles(context: Context, state: types.State, first: int, second: int, upcoming: Patch):
        """``compute_edges`` where a thread works on a tile; the last threads on edges and normals that no tile has."""
        patches, patch = context.patches, context.patch
        fetch_tables(patches, patch)
        corner_word = wp.uint64(0)
        if wp.static(terms.folds):
            triangle = wp.min(patch.triangle_count + last_first(context.lane), patch.normal_count)
            corner_word = element(patches.corners, patch.triangle_start + triangle)
        loaded = load_tile(patches, patch, context.lane)
        read_vertices(context, state, first, second)
        if wp.static(options.packed):
            if fetches(NEXT_WARP):
                fetch_next(patches, state, upcoming)
        wait_for_block()
        tile = compute_tile_normals(context, loaded)
        if wp.static(terms.folds):
            compute_normals(context, corner_word)
        if wp.static(fits):
            tile = load_constants(patches, patch, tile)
        if wp.static(terms.folds):
            wait_for_block()
        tile = compute_tile_edges(context, tile)
        if wp.static(terms.folds or terms.edges):
            edge = wp.static(SLOTS) * patch.tile_count + last_first(context.lane)
            end_word, constants = edge_table(patches, patch, edge)
            compute_edges(context, end_word, constants)
        edges, triangles = vertex_slots(patches, patch, context.lane)
        work = PatchWork()
        work.tile = tile
        work.edges = edges
        work.triangles = triangles
        return work

    return compute_tiles


@functools.cache
def patch_functions(options: KernelOptions) -> SimpleNamespace:
    """Functions ``own_vertex``, ``two_vertices``, ``compute_edges``, ``compute_corners``, and of ``load_functions``.

    A vertex's load may be summed once the whole block has computed edges and corners.
    """
    terms, PatchWork, Context = options.terms, work_type(options.precision), context_type(options.precision)
    compute_tile_corners, compute_triangles = tile_corners_step(options), triangles_step(options)
    vertices, own = vertices_step(options), load_functions(options)

    @wp.func
    def compute_corners(context: Context, work: PatchWork):
        """What the patch's triangles do to their corners, after ``compute_edges``; by all threads of the block."""
        if wp.static(terms.folds or terms.yarns):
            wait_for_block()
            if wp.static(options.paired):
                compute_tile_corners(context, work.tile)
            else:
                compute_triangles(context, work.sides, work.corners)

    return SimpleNamespace(
        own_vertex=vertices.own_vertex, two_vertices=vertices.two_vertices,
        compute_edges=compute_edges_function(options), compute_corners=compute_corners,
        vertex_slots=own.vertex_slots, vertex_load=own.vertex_load,
    )  # fmt: skip


@functools.cache
def gather_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``gather_forces``, of cloth whose vertices lie as the garments have them."""
    types, patch_context = cloth_types(options.precision), context_function(options)
    functions = patch_functions(options)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def gather_forces(
        model: types.Model,
        state: types.State,
        patches: types.Patches,
        overflow: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        step: types.Step,
        load_out: wp.array(dtype=types.vec4),  # force [N] and what is accumulated besides, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        thread = wp.tid()
        patch = patch_of(patches.patch, block_of(thread))
        lane = lane_of(thread)
        first, second = functions.two_vertices(patches, patch, lane)
        if skips_patch(model.items[patch.item].active, patch, first, second):
            return
        context = patch_context(step, patches, patch, overflow, lane)
        work = functions.compute_edges(context, state, first, second, patch)
        functions.compute_corners(context, work)
        edges, triangles = wp.vec4i(work.edges), wp.vec4i(work.triangles)
        local = int(lane)
        wait_for_block()
        while local < patch.owned_count:
            vertex = functions.own_vertex(patches, patch, local)
            load_out[vertex] = functions.vertex_load(context, local, edges, triangles)
            local += block_threads()
            edges, triangles = functions.vertex_slots(patches, patch, local)

    return gather_forces
