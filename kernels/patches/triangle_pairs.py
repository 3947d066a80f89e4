"""What a thread does for its item: two triangles that share an edge, or a single one (model.patches.triangle_pairs).

Triangles are a, b, c and b, a, d, each wound like that, of cloth without yarns. What a thread has read of their
vertices serves both normals and the edges that it computes. Where every item has a thread of its own, this keeps that
while the block waits; otherwise it is computed again.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import block_threads, memory_functions
from warp_cloth.kernels.base.options import (
    BEGIN_BITS,
    CODE_AFTER,
    CODE_BACK,
    CODE_BITS,
    NUMBER_BITS,
    REVERSED_BITS,
    SIDE_AD,
    SIDE_BC,
    SIDE_CA,
    SIDE_DB,
    SLOTS,
    WORD_ACROSS,
    WORD_BEGIN,
    WORD_CODE,
    WORD_REVERSED,
    KernelOptions,
)
from warp_cloth.kernels.base.types import Patch, cloth_types, difference_function
from warp_cloth.kernels.laws.bending import unit_normal
from warp_cloth.kernels.patches.corners import corners_function, nothing_step, sides_functions
from warp_cloth.kernels.patches.memory import context_type
from warp_cloth.kernels.patches.steps import (
    bits_of,
    edge_functions_of_patch,
    edge_table_functions,
    number_of,
    point_functions,
)


@functools.cache
def item_type(precision: str) -> type:
    """The struct of what a thread knows of its item."""
    types = cloth_types(precision)

    @wp.struct
    class PatchItem:
        """An item, its triangles' sides as these are wound [m] and their normals (``triangle_normal``)."""

        vertices: wp.uint64  # two of its words, the third is ``constants``
        sides: wp.uint64
        constants: wp.uint64
        last_constants: int  # where those are of the last edge that it takes
        shared_constants: types.vec4  # of the edge that its triangles share
        first_constants: types.vec4  # and of the first of the others that it takes
        side_ab: types.vec3
        side_bc: types.vec3
        side_ca: types.vec3
        side_ad: types.vec3
        side_db: types.vec3
        normal_0: types.vec4
        normal_1: types.vec4
        fold: types.vec3  # ``edge_fold`` of the shared edge

    return PatchItem


@wp.func
def begin_of(sides: wp.uint64, which: int):
    """At which of a, b, c the mesh's first triangle begins, or at which of b, a, d its second one."""
    return bits_of(sides, wp.static(WORD_BEGIN) + wp.static(BEGIN_BITS) * which, wp.static(BEGIN_BITS))


@functools.cache
def item_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``load_item``, ``measure_item``, ``item_side``."""
    types = cloth_types(precision)
    vec3, vec4, Patches, PatchItem = types.vec3, types.vec4, types.Patches, item_type(precision)
    point_at, difference = point_functions(precision, fits).point_at, difference_function(precision)
    Context = context_type(precision)

    @wp.func
    def load_item(patches: Patches, patch: Patch, local: int):
        """Loads an item's words from the tables; beyond the last one, any item's."""
        at = patch.edge_start + wp.max(wp.min(local, patch.item_count - 1), 0)
        item = PatchItem()
        item.vertices = element(patches.ends, at)
        item.sides = element(patches.ends, at + patch.item_count)
        item.constants = element(patches.ends, at + wp.static(SLOTS - 1) * patch.item_count)
        return item

    @wp.func
    def normal_of(begin: int, one: vec3, two: vec3, three: vec3):
        """``triangle_normal`` of a triangle with these sides, as the mesh begins it."""
        first = wp.where(begin == 0, one, wp.where(begin == 1, two, three))
        last = -wp.where(begin == 0, three, wp.where(begin == 1, one, two))
        normal, inverse = unit_normal(first, last)
        return vec4(normal[0], normal[1], normal[2], inverse)

    @wp.func
    def measure_item(context: Context, loaded: PatchItem):
        """Sides and normals of an item."""
        item = PatchItem()
        item.vertices = loaded.vertices
        item.sides = loaded.sides
        item.constants = loaded.constants
        a = point_at(context, number_of(item.vertices, 0))
        b = point_at(context, number_of(item.vertices, 1))
        c = point_at(context, number_of(item.vertices, 2))
        d = point_at(context, number_of(item.vertices, 3))
        item.side_ab = difference(b, a)
        item.side_bc = difference(c, b)
        item.side_ca = difference(a, c)
        item.side_ad = difference(d, a)
        item.side_db = difference(b, d)
        item.normal_0 = normal_of(begin_of(item.sides, 0), item.side_ab, item.side_bc, item.side_ca)
        item.normal_1 = normal_of(begin_of(item.sides, 1), -item.side_ab, item.side_ad, item.side_db)
        return item

    @wp.func
    def item_side(item: PatchItem, code: int):
        """The side that an edge is, as the edge runs, and the edge's ends."""
        which = code & 7
        a, b = number_of(item.vertices, 0), number_of(item.vertices, 1)
        c, d = number_of(item.vertices, 2), number_of(item.vertices, 3)
        is_bc, is_ca = which == wp.static(SIDE_BC), which == wp.static(SIDE_CA)
        is_ad, is_db = which == wp.static(SIDE_AD), which == wp.static(SIDE_DB)
        side = wp.where(is_bc, item.side_bc, item.side_ab)
        side = wp.where(is_ca, item.side_ca, side)
        side = wp.where(is_ad, item.side_ad, side)
        side = wp.where(is_db, item.side_db, side)
        first = wp.where(is_bc, b, wp.where(is_ca, c, wp.where(is_db, d, a)))
        second = wp.where(is_bc, c, wp.where(is_ca, a, wp.where(is_ad, d, b)))
        back = (code & wp.static(CODE_BACK)) != 0
        return wp.where(back, -side, side), wp.where(back, second, first), wp.where(back, first, second)

    return SimpleNamespace(load_item=load_item, measure_item=measure_item, item_side=item_side)


@functools.cache
def item_normals_step(options: KernelOptions) -> wp.Function:
    """The function that computes items as they lie."""
    precision, fits = options.precision, options.fits
    types, Context = cloth_types(precision), context_type(precision)
    PatchItem, size_4 = item_type(precision), 4 * types.real_size
    functions, write_4 = item_functions(precision, fits), memory_functions(precision, fits).write_4
    load_item, measure_item = functions.load_item, functions.measure_item

    @wp.func
    def put_normals(context: Context, local: int, item: PatchItem):
        """Keeps an item's normals for others."""
        write_4(context.overflow, context.memory.normal + wp.static(size_4) * local, item.normal_0)
        if local < context.patch.triangle_count - context.patch.item_count:
            write_4(
                context.overflow,
                context.memory.normal + wp.static(size_4) * (context.patch.item_count + local),
                item.normal_1,
            )

    @wp.func
    def work_item_normals(context: Context, loaded: PatchItem):
        """Normals of the items' triangles; returns the thread's own; ``loaded`` is of ``load_item``."""
        item = PatchItem()
        if wp.static(fits):
            item = measure_item(context, loaded)
            if context.lane < context.patch.item_count:
                put_normals(context, context.lane, item)
        else:
            local = int(context.lane)
            while local < context.patch.item_count:
                put_normals(context, local, measure_item(context, load_item(context.patches, context.patch, local)))
                local += block_threads()
        return item

    return work_item_normals


@functools.cache
def item_edges_step(options: KernelOptions) -> SimpleNamespace:
    """Functions ``load_constants`` and ``work_item_edges``."""
    precision, fits = options.precision, options.fits
    types, Context = cloth_types(precision), context_type(precision)
    vec4, Patches, PatchItem = types.vec4, types.Patches, item_type(precision)
    functions, read_4 = item_functions(precision, fits), memory_functions(precision, fits).read_4
    load_item, measure_item, item_side = functions.load_item, functions.measure_item, functions.item_side
    edge = edge_functions_of_patch(options)
    work_edge, put_fold = edge.work_edge, edge.put_fold
    tables = edge_table_functions(options)
    constants_at, constants_of = tables.constants_at, tables.constants_of

    @wp.func
    def load_constants(patches: Patches, patch: Patch, item: PatchItem):
        """An item, and how the first of its edges pull and bend."""
        item.shared_constants = constants_of(patches, patch, number_of(item.constants, 0))
        item.first_constants = constants_of(patches, patch, number_of(item.constants, 1))
        item.last_constants = patch.constants_start + wp.min(number_of(item.constants, 2), patch.constants_count)
        return item

    @wp.func
    def taken_edge(context: Context, local: int, item: PatchItem, code: int, beyond: int, constants: vec4):
        """An edge that an item takes, and the triangle beyond; where it takes none, nobody reads the result."""
        which = code & 7
        on_second = which == wp.static(SIDE_AD) or which == wp.static(SIDE_DB)
        own = wp.where(on_second, item.normal_1, item.normal_0)
        across = read_4(context.overflow, context.memory.normal + wp.static(4 * types.real_size) * beyond)
        after = (code & wp.static(CODE_AFTER)) != 0
        one, other = wp.where(after, across, own), wp.where(after, own, across)
        side, first, second = item_side(item, code)
        fold = work_edge(context, local, first, second, side, one, other, constants)
        put_fold(context, local, fold)

    @wp.func
    def edges_of(context: Context, local: int, item: PatchItem):
        """Tensions and hinges of an item's edges; returns the shared one's hinge, or any where there is none."""
        last_constants = constants_at(context.patches, item.last_constants)
        a, b = number_of(item.vertices, 0), number_of(item.vertices, 1)
        fold = work_edge(context, local, a, b, item.side_ab, item.normal_0, item.normal_1, item.shared_constants)
        other = context.patch.item_count + local
        code = bits_of(item.vertices, wp.static(WORD_CODE), wp.static(CODE_BITS))
        beyond = bits_of(item.vertices, wp.static(WORD_ACROSS), wp.static(NUMBER_BITS))
        taken_edge(context, other, item, code, beyond, item.first_constants)
        other += context.patch.item_count
        code = bits_of(item.vertices, wp.static(WORD_CODE + CODE_BITS), wp.static(CODE_BITS))
        beyond = bits_of(item.sides, wp.static(WORD_ACROSS), wp.static(NUMBER_BITS))
        taken_edge(context, other, item, code, beyond, last_constants)
        return fold

    @wp.func
    def work_item_edges(context: Context, item: PatchItem):
        """Edges of the patch's items; the last is the thread's own, with ``load_constants``, and is returned."""
        if wp.static(fits):
            if context.lane < context.patch.item_count:
                item.fold = edges_of(context, context.lane, item)
        else:
            local = int(context.lane)
            while local < context.patch.item_count:
                measured = measure_item(context, load_item(context.patches, context.patch, local))
                fold = edges_of(context, local, load_constants(context.patches, context.patch, measured))
                put_fold(context, local, fold)
                local += block_threads()
        return item

    return SimpleNamespace(load_constants=load_constants, work_item_edges=work_item_edges)


@functools.cache
def item_corners_step(options: KernelOptions) -> wp.Function:
    """The function that computes what the triangles of items do."""
    precision, fits = options.precision, options.fits
    types, Context = cloth_types(precision), context_type(precision)
    vec3, vec4, Sides = types.vec3, types.vec4, types.Sides
    PatchItem, size_4 = item_type(precision), 4 * types.real_size
    load_item, read_4 = item_functions(precision, fits).load_item, memory_functions(precision, fits).read_4
    functions, put_nothing = sides_functions(options), nothing_step(options)
    fold_at, oriented = functions.fold_at, functions.oriented
    put_corners = corners_function(options)

    @wp.func
    def triangle_corners(context: Context, item: PatchItem, which: int, triangle: int, shared: vec3, normal: vec4):
        """What the first or the second triangle of an item does; ``shared``: the hinge of the side opposite c or d."""
        begin = begin_of(item.sides, which)
        one, other = number_of(item.sides, 2 * which), number_of(item.sides, 2 * which + 1)
        bits = bits_of(
            item.sides, wp.static(WORD_REVERSED) + wp.static(REVERSED_BITS) * which, wp.static(REVERSED_BITS)
        )
        fold_1, fold_2 = fold_at(context, one, vec3()), fold_at(context, other, vec3())
        fold_0 = oriented(wp.where(begin == 2, shared, fold_1), bits & 1)
        fold_1 = oriented(wp.where(begin == 1, shared, wp.where(begin == 2, fold_1, fold_2)), (bits >> 1) & 1)
        fold_2 = oriented(wp.where(begin == 0, shared, fold_2), bits >> 2)
        put_corners(context, triangle, normal, Sides(), fold_0, fold_1, fold_2)

    @wp.func
    def corners_of(context: Context, local: int, item: PatchItem):
        """What an item's triangles do to their corners."""
        other = context.patch.item_count + local
        paired = other < context.patch.triangle_count
        shared = item.fold
        if not paired:
            shared = fold_at(context, number_of(item.sides, 2), vec3())
        triangle_corners(context, item, 0, local, shared, item.normal_0)
        if paired:
            triangle_corners(context, item, 1, other, shared, item.normal_1)

    @wp.func
    def work_item_corners(context: Context, item: PatchItem):
        """What the items' triangles do to their corners; the last is the thread's own."""
        if wp.static(fits):
            if context.lane < context.patch.item_count:
                corners_of(context, context.lane, item)
        else:
            local = int(context.lane)
            while local < context.patch.item_count:
                again = load_item(context.patches, context.patch, local)
                again.normal_0 = read_4(context.overflow, context.memory.normal + wp.static(size_4) * local)
                if context.patch.item_count + local < context.patch.triangle_count:
                    again.normal_1 = read_4(
                        context.overflow, context.memory.normal + wp.static(size_4) * (context.patch.item_count + local)
                    )
                again.fold = fold_at(context, local, vec3())
                corners_of(context, local, again)
                local += block_threads()
        put_nothing(context)

    return work_item_corners
