"""What the threads of a block do for a patch of cloth: vertices, normals, edges; then ``patches.corners``.

A step loads what it needs first before it waits for the step before, and the data of its next round while it computes.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import block_threads, threads_function
from warp_cloth.kernels.base.options import (
    NUMBER_BITS,
    SLOTS,
    WORD_CONSTANTS,
    Accumulate,
    KernelOptions,
    SpringField,
)
from warp_cloth.kernels.base.types import Patch, cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.elements.edge import edge_functions
from warp_cloth.kernels.elements.triangle import triangle_functions
from warp_cloth.kernels.patches.memory import access_functions, context_type, fold_functions
from warp_cloth.kernels.patches.packing import first_three, order_functions

_PACKED = """
    const unsigned int pair = (unsigned int)(place < 2 ? word : word >> 32);
    return (int)(place & 1 ? pair >> 16 : pair & 65535u);
"""


@wp.func_native(_PACKED)
def packed(word: wp.uint64, place: int) -> int:
    """One of the four numbers below 65536 in a word."""
    ...


@wp.func_native("return (int)(word >> start) & ((1 << bits) - 1);")
def bits_of(word: wp.uint64, start: int, bits: int) -> int:
    """The number in so many bits of a word, from a certain bit on."""
    ...


@wp.func
def number_of(word: wp.uint64, place: int):
    """One of the numbers in a word of a tile or of a loose edge."""
    return bits_of(word, wp.static(NUMBER_BITS) * place, wp.static(NUMBER_BITS))


@wp.func
def last_first(lane: int):
    """A thread's number, counted from the block's last one; the first ones tiles keep busy."""
    return block_threads() - 1 - lane


@functools.cache
def own_function(precision: str, in_order: bool) -> wp.Function:
    """The function ``own_vertex``; ``in_order``: these lie in the patches' order."""
    Patches = cloth_types(precision).Patches

    @wp.func
    def own_vertex(patches: Patches, patch: Patch, local: int):
        """One of the vertices that a patch owns."""
        vertex = patch.place + local
        if wp.static(not in_order):
            vertex = element(patches.vertex, patch.vertex_start + local)
        return vertex

    return own_vertex


@functools.cache
def vertices_step(options: KernelOptions) -> SimpleNamespace:
    """Functions ``own_vertex``, ``two_vertices`` and ``read_vertices``."""
    precision, fits, accumulate = options.precision, options.fits, options.accumulate
    types, block_threads = cloth_types(precision), threads_function(options.block_threads)
    State, Patches, Context = types.State, types.Patches, context_type(precision)
    own_vertex = own_function(precision, options.in_order)
    order = order_functions(precision, options.packed, options.in_order)
    position_at, displacement4_at = order.position_at, order.displacement4_at
    put_point, put_row = access_functions(precision, fits).put_point, access_functions(precision, fits).put_row

    @wp.func
    def keep(context: Context, state: State, local: int, vertex: int):
        """Keeps a vertex in the block's memory."""
        position = position_at(state, vertex)
        if wp.static(accumulate.is_bound):
            put_row(context, context.memory.move, local, displacement4_at(state, vertex))
        put_point(context, local, position)

    @wp.func
    def vertex_at(patches: Patches, patch: Patch, local: int):
        """One of the vertices that a patch has; beyond the last, any."""
        vertex = own_vertex(patches, patch, wp.min(local, patch.owned_count - 1))
        if local >= patch.owned_count and local < patch.vertex_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
        return vertex

    @wp.func
    def two_vertices(patches: Patches, patch: Patch, local: int):
        """The vertices that a thread loads in a round."""
        return vertex_at(patches, patch, local), vertex_at(patches, patch, local + block_threads())

    @wp.func
    def read_vertices(context: Context, state: State, first: int, second: int):
        """Brings the vertices that the patch needs into the block's memory, two of each thread at a time.

        The last two are of ``two_vertices``, which is called as early as may be.
        """
        local = int(context.lane)
        while local < context.patch.vertex_count:
            other = local + block_threads()
            keep(context, state, local, first)
            if other < context.patch.vertex_count:
                keep(context, state, other, second)
            local = other + block_threads()
            first, second = two_vertices(context.patches, context.patch, local)

    return SimpleNamespace(own_vertex=own_vertex, two_vertices=two_vertices, read_vertices=read_vertices)


@functools.cache
def normals_step(options: KernelOptions) -> wp.Function:
    """The function that computes normals; where threads work on pairs, of triangles that are in none."""
    precision, fits, paired = options.precision, options.fits, options.paired
    Context, block_threads = context_type(precision), threads_function(options.block_threads)
    point_at, put_row = access_functions(precision, fits).point_at, access_functions(precision, fits).put_row
    triangle_normal = triangle_functions(precision, Accumulate.NONE).triangle_normal

    @wp.func
    def compute_normals(context: Context, first: wp.uint64):
        """Normals of the patch's triangles and of those beyond its edges; ``first``: corners of a thread's first."""
        local = int(context.lane)
        if wp.static(paired):
            local = context.patch.triangle_count + last_first(context.lane)
        following = first
        while local < context.patch.normal_count:
            word = following
            if local + block_threads() < context.patch.normal_count:
                following = element(context.patches.corners, context.patch.triangle_start + local + block_threads())
            origin = point_at(context, packed(word, 0))
            second = point_at(context, packed(word, 1))
            third = point_at(context, packed(word, 2))
            normal = triangle_normal(origin, second, third)
            put_row(context, context.memory.normal, local, normal)
            local += block_threads()

    return compute_normals


@functools.cache
def edge_table_functions(options: KernelOptions) -> SimpleNamespace:
    """Functions ``constants_at``, ``constants_of`` and ``edge_table``."""
    types, terms, paired = cloth_types(options.precision), options.terms, options.paired

    @wp.func
    def constants_at(patches: types.Patches, at: int):
        """The constants of an edge and its hinge (options.SpringField)."""
        constants = types.vec4()
        if wp.static(terms.edges):
            constants = element(patches.edge_constants, at)
        if wp.static(terms.folds and not terms.edges):
            constants[SpringField.HINGE] = element(patches.hinge_stiffness, at)
        return constants

    @wp.func
    def constants_of(patches: types.Patches, patch: Patch, number: int):
        """The constants of a patch that have this number; beyond the last, any."""
        return constants_at(patches, patch.constants_start + wp.min(number, patch.constants_count))

    @wp.func
    def edge_table(patches: types.Patches, patch: Patch, local: int):
        """An edge's word, and its constants; beyond the last edge, any."""
        at = patch.edge_start + wp.min(local, patch.edge_count)
        word = element(patches.ends, at)
        if wp.static(paired):
            return word, constants_of(patches, patch, bits_of(word, wp.static(WORD_CONSTANTS), wp.static(NUMBER_BITS)))
        else:
            return word, constants_at(patches, at)

    return SimpleNamespace(constants_at=constants_at, constants_of=constants_of, edge_table=edge_table)


@functools.cache
def ends_function(paired: bool) -> wp.Function:
    """The function that takes an edge's word apart; ``paired`` as of ``edges_step``."""

    @wp.func
    def ends_of(word: wp.uint64):
        """An edge's ends and its two triangles."""
        return packed(word, 0), packed(word, 1), packed(word, 2), packed(word, 3)

    @wp.func
    def loose_ends_of(word: wp.uint64):
        """An edge's ends and its two triangles."""
        return number_of(word, 0), number_of(word, 1), number_of(word, 2), number_of(word, 3)

    return loose_ends_of if paired else ends_of


@functools.cache
def patch_edge_function(options: KernelOptions) -> wp.Function:
    """The function that computes an edge from what is known of it."""
    precision, terms, fits, accumulate = options.precision, options.terms, options.fits, options.accumulate
    types, Context = cloth_types(precision), context_type(precision)
    vec2, vec3, vec4 = types.vec2, types.vec3, types.vec4
    access = access_functions(precision, fits)
    point_at, row_at, put_row = access.point_at, access.row_at, access.put_row
    edge = edge_functions(precision, accumulate, terms)
    side_span, edge_load, edge_fold = edge.side_span, edge.edge_load, edge.edge_fold
    exact = takes_exact_stretch(precision, accumulate)

    @wp.func
    def compute_edge(
        context: Context,
        local: int,
        first: int,
        second: int,
        side: vec3,
        normal_0: vec4,
        normal_1: vec4,
        constants: vec4,
    ):
        """Tension of an edge between two vertices, and two triangles with these normals; returns its hinge."""
        move_0 = vec4()
        move_1 = vec4()
        if wp.static(accumulate.is_bound):
            move_0 = row_at(context, context.memory.move, first)
            move_1 = row_at(context, context.memory.move, second)
        span = side_span(side, first_three(move_0), first_three(move_1), move_0[3])
        if wp.static(exact):
            span.exact = point_at(context, second) - point_at(context, first)
        if wp.static(terms.edges):
            load = edge_load(span, first_three(constants), context.step)
            put_row(context, context.memory.edge_load, local, load)
        fold = vec3()
        if wp.static(terms.folds):
            rest, slider = vec2(), vec4()
            if wp.static(terms.angles):
                rest = element(context.patches.rest, context.patch.edge_start + local)
            if wp.static(terms.hysteresis):
                slider = element(context.patches.hysteresis, context.patch.edge_start + local)
            fold = edge_fold(span, normal_0, normal_1, constants[SpringField.HINGE], rest, slider, context.step)
        return fold

    return compute_edge


@functools.cache
def edges_step(options: KernelOptions) -> wp.Function:
    """The function that computes edges; where threads work on pairs, those that are in none."""
    precision, terms, fits, paired = options.precision, options.terms, options.fits, options.paired
    types, block_threads = cloth_types(precision), threads_function(options.block_threads)
    Context = context_type(precision)
    vec4 = types.vec4
    access = access_functions(precision, fits)
    point_at, row_at, put_row = access.point_at, access.row_at, access.put_row
    edge_table = edge_table_functions(options).edge_table
    compute_edge, ends_of = patch_edge_function(options), ends_function(paired)
    put_fold = fold_functions(precision, terms, fits).put_fold
    difference = difference_function(precision)

    @wp.func
    def compute_edges(context: Context, first_word: wp.uint64, first_constants: vec4):
        """Tensions and hinges of the patch's edges; the last two are of the thread's first edge."""
        local = int(context.lane)
        if wp.static(paired):
            local = wp.static(SLOTS) * context.patch.tile_count + last_first(context.lane)
        next_word, next_constants = first_word, first_constants
        while local < context.patch.edge_count:
            word, constants = next_word, next_constants
            if local + block_threads() < context.patch.edge_count:
                next_word, next_constants = edge_table(context.patches, context.patch, local + block_threads())
            first, second, one, other = ends_of(word)
            side = difference(point_at(context, second), point_at(context, first))
            normal_0, normal_1 = vec4(), vec4()
            if wp.static(terms.folds):
                normal_0 = row_at(context, context.memory.normal, one)
                normal_1 = row_at(context, context.memory.normal, other)
            fold = compute_edge(context, local, first, second, side, normal_0, normal_1, constants)
            put_fold(context, local, fold)
            local += block_threads()
        if wp.static(terms.edges):
            if context.lane == 0:
                put_row(context, context.memory.edge_load, context.patch.edge_count, vec4())

    return compute_edges
