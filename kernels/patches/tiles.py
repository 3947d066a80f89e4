"""What a thread does for its tile: two triangles that share an edge, or a single one (model.patches.tiles).

Triangles are a, b, c and b, a, d, each wound like that, of cloth without yarns. What a thread has read of their
vertices serves both normals and the edges that it computes. Where every tile has a thread of its own, this keeps that
while the block waits; otherwise it is computed again.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import block_threads
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
from warp_cloth.kernels.patches.memory import access_functions, context_type, fold_functions
from warp_cloth.kernels.patches.steps import (
    bits_of,
    edge_table_functions,
    number_of,
    patch_edge_function,
)


@functools.cache
def tile_type(precision: str) -> type:
    """The struct of what a thread knows of its tile."""
    types = cloth_types(precision)

    @wp.struct
    class Tile:
        """A tile, its triangles' sides as these are wound [m] and their normals (``triangle_normal``)."""

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

    return Tile


@wp.func
def begin_of(sides: wp.uint64, which: int):
    """At which of a, b, c the mesh's first triangle begins, or at which of b, a, d its second one."""
    return bits_of(sides, wp.static(WORD_BEGIN) + wp.static(BEGIN_BITS) * which, wp.static(BEGIN_BITS))


@functools.cache
def tile_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``load_tile``, ``measure_tile``, ``tile_side``."""
    types = cloth_types(precision)
    vec3, vec4, Patches, Tile = types.vec3, types.vec4, types.Patches, tile_type(precision)
    point_at, difference = access_functions(precision, fits).point_at, difference_function(precision)
    Context = context_type(precision)

    @wp.func
    def load_tile(patches: Patches, patch: Patch, local: int):
        """Loads a tile's words from the tables; beyond the last one, any tile's."""
        at = patch.edge_start + wp.max(wp.min(local, patch.tile_count - 1), 0)
        tile = Tile()
        tile.vertices = element(patches.ends, at)
        tile.sides = element(patches.ends, at + patch.tile_count)
        tile.constants = element(patches.ends, at + wp.static(SLOTS - 1) * patch.tile_count)
        return tile

    @wp.func
    def normal_of(begin: int, one: vec3, two: vec3, three: vec3):
        """``triangle_normal`` of a triangle with these sides, as the mesh begins it."""
        first = wp.where(begin == 0, one, wp.where(begin == 1, two, three))
        last = -wp.where(begin == 0, three, wp.where(begin == 1, one, two))
        normal, inverse = unit_normal(first, last)
        return vec4(normal[0], normal[1], normal[2], inverse)

    @wp.func
    def measure_tile(context: Context, loaded: Tile):
        """Sides and normals of a tile."""
        tile = Tile()
        tile.vertices = loaded.vertices
        tile.sides = loaded.sides
        tile.constants = loaded.constants
        a = point_at(context, number_of(tile.vertices, 0))
        b = point_at(context, number_of(tile.vertices, 1))
        c = point_at(context, number_of(tile.vertices, 2))
        d = point_at(context, number_of(tile.vertices, 3))
        tile.side_ab = difference(b, a)
        tile.side_bc = difference(c, b)
        tile.side_ca = difference(a, c)
        tile.side_ad = difference(d, a)
        tile.side_db = difference(b, d)
        tile.normal_0 = normal_of(begin_of(tile.sides, 0), tile.side_ab, tile.side_bc, tile.side_ca)
        tile.normal_1 = normal_of(begin_of(tile.sides, 1), -tile.side_ab, tile.side_ad, tile.side_db)
        return tile

    @wp.func
    def tile_side(tile: Tile, code: int):
        """The side that an edge is, as the edge runs, and the edge's ends."""
        which = code & 7
        a, b = number_of(tile.vertices, 0), number_of(tile.vertices, 1)
        c, d = number_of(tile.vertices, 2), number_of(tile.vertices, 3)
        is_bc, is_ca = which == wp.static(SIDE_BC), which == wp.static(SIDE_CA)
        is_ad, is_db = which == wp.static(SIDE_AD), which == wp.static(SIDE_DB)
        side = wp.where(is_bc, tile.side_bc, tile.side_ab)
        side = wp.where(is_ca, tile.side_ca, side)
        side = wp.where(is_ad, tile.side_ad, side)
        side = wp.where(is_db, tile.side_db, side)
        first = wp.where(is_bc, b, wp.where(is_ca, c, wp.where(is_db, d, a)))
        second = wp.where(is_bc, c, wp.where(is_ca, a, wp.where(is_ad, d, b)))
        back = (code & wp.static(CODE_BACK)) != 0
        return wp.where(back, -side, side), wp.where(back, second, first), wp.where(back, first, second)

    return SimpleNamespace(load_tile=load_tile, measure_tile=measure_tile, tile_side=tile_side)


@functools.cache
def tile_normals_step(options: KernelOptions) -> wp.Function:
    """The function that computes tiles as they lie."""
    precision, fits = options.precision, options.fits
    Context, Tile = context_type(precision), tile_type(precision)
    functions, put_row = tile_functions(precision, fits), access_functions(precision, fits).put_row
    load_tile, measure_tile = functions.load_tile, functions.measure_tile

    @wp.func
    def put_normals(context: Context, local: int, tile: Tile):
        """Keeps a tile's normals for others."""
        put_row(context, context.memory.normal, local, tile.normal_0)
        if local < context.patch.triangle_count - context.patch.tile_count:
            put_row(context, context.memory.normal, context.patch.tile_count + local, tile.normal_1)

    @wp.func
    def compute_tile_normals(context: Context, loaded: Tile):
        """Normals of the tiles' triangles; returns the thread's own; ``loaded`` is of ``load_tile``."""
        tile = Tile()
        if wp.static(fits):
            tile = measure_tile(context, loaded)
            if context.lane < context.patch.tile_count:
                put_normals(context, context.lane, tile)
        else:
            local = int(context.lane)
            while local < context.patch.tile_count:
                put_normals(context, local, measure_tile(context, load_tile(context.patches, context.patch, local)))
                local += block_threads()
        return tile

    return compute_tile_normals


@functools.cache
def tile_edges_step(options: KernelOptions) -> SimpleNamespace:
    """Functions ``load_constants`` and ``compute_tile_edges``."""
    precision, fits = options.precision, options.fits
    types, Context = cloth_types(precision), context_type(precision)
    vec4, Patches, Tile = types.vec4, types.Patches, tile_type(precision)
    functions, row_at = tile_functions(precision, fits), access_functions(precision, fits).row_at
    load_tile, measure_tile, tile_side = functions.load_tile, functions.measure_tile, functions.tile_side
    compute_edge = patch_edge_function(options)
    put_fold = fold_functions(precision, options.terms, fits).put_fold
    tables = edge_table_functions(options)
    constants_at, constants_of = tables.constants_at, tables.constants_of

    @wp.func
    def load_constants(patches: Patches, patch: Patch, tile: Tile):
        """A tile, and how the first of its edges pull and bend."""
        tile.shared_constants = constants_of(patches, patch, number_of(tile.constants, 0))
        tile.first_constants = constants_of(patches, patch, number_of(tile.constants, 1))
        tile.last_constants = patch.constants_start + wp.min(number_of(tile.constants, 2), patch.constants_count)
        return tile

    @wp.func
    def taken_edge(context: Context, local: int, tile: Tile, code: int, beyond: int, constants: vec4):
        """An edge that a tile takes, and the triangle beyond; where it takes none, nobody reads the result."""
        which = code & 7
        on_second = which == wp.static(SIDE_AD) or which == wp.static(SIDE_DB)
        own = wp.where(on_second, tile.normal_1, tile.normal_0)
        across = row_at(context, context.memory.normal, beyond)
        after = (code & wp.static(CODE_AFTER)) != 0
        one, other = wp.where(after, across, own), wp.where(after, own, across)
        side, first, second = tile_side(tile, code)
        fold = compute_edge(context, local, first, second, side, one, other, constants)
        put_fold(context, local, fold)

    @wp.func
    def edges_of(context: Context, local: int, tile: Tile):
        """Tensions and hinges of a tile's edges; returns the shared one's hinge, or any where there is none."""
        last_constants = constants_at(context.patches, tile.last_constants)
        a, b = number_of(tile.vertices, 0), number_of(tile.vertices, 1)
        fold = compute_edge(context, local, a, b, tile.side_ab, tile.normal_0, tile.normal_1, tile.shared_constants)
        other = context.patch.tile_count + local
        code = bits_of(tile.vertices, wp.static(WORD_CODE), wp.static(CODE_BITS))
        beyond = bits_of(tile.vertices, wp.static(WORD_ACROSS), wp.static(NUMBER_BITS))
        taken_edge(context, other, tile, code, beyond, tile.first_constants)
        other += context.patch.tile_count
        code = bits_of(tile.vertices, wp.static(WORD_CODE + CODE_BITS), wp.static(CODE_BITS))
        beyond = bits_of(tile.sides, wp.static(WORD_ACROSS), wp.static(NUMBER_BITS))
        taken_edge(context, other, tile, code, beyond, last_constants)
        return fold

    @wp.func
    def compute_tile_edges(context: Context, tile: Tile):
        """Edges of the patch's tiles; the last is the thread's own, with ``load_constants``, and is returned."""
        if wp.static(fits):
            if context.lane < context.patch.tile_count:
                tile.fold = edges_of(context, context.lane, tile)
        else:
            local = int(context.lane)
            while local < context.patch.tile_count:
                measured = measure_tile(context, load_tile(context.patches, context.patch, local))
                fold = edges_of(context, local, load_constants(context.patches, context.patch, measured))
                put_fold(context, local, fold)
                local += block_threads()
        return tile

    return SimpleNamespace(load_constants=load_constants, compute_tile_edges=compute_tile_edges)


@functools.cache
def tile_corners_step(options: KernelOptions) -> wp.Function:
    """The function that computes what the triangles of tiles do."""
    precision, fits = options.precision, options.fits
    types, Context = cloth_types(precision), context_type(precision)
    vec3, vec4, Sides = types.vec3, types.vec4, types.Sides
    Tile = tile_type(precision)
    load_tile, row_at = tile_functions(precision, fits).load_tile, access_functions(precision, fits).row_at
    oriented, put_nothing = sides_functions(options).oriented, nothing_step(options)
    fold_at = fold_functions(precision, options.terms, fits).fold_at
    put_corners = corners_function(options)

    @wp.func
    def triangle_corners(context: Context, tile: Tile, which: int, triangle: int, shared: vec3, normal: vec4):
        """What the first or the second triangle of a tile does; ``shared``: the hinge of the side opposite c or d."""
        begin = begin_of(tile.sides, which)
        one, other = number_of(tile.sides, 2 * which), number_of(tile.sides, 2 * which + 1)
        bits = bits_of(
            tile.sides, wp.static(WORD_REVERSED) + wp.static(REVERSED_BITS) * which, wp.static(REVERSED_BITS)
        )
        fold_1, fold_2 = fold_at(context, one, vec3()), fold_at(context, other, vec3())
        fold_0 = oriented(wp.where(begin == 2, shared, fold_1), bits & 1)
        fold_1 = oriented(wp.where(begin == 1, shared, wp.where(begin == 2, fold_1, fold_2)), (bits >> 1) & 1)
        fold_2 = oriented(wp.where(begin == 0, shared, fold_2), bits >> 2)
        put_corners(context, triangle, normal, Sides(), fold_0, fold_1, fold_2)

    @wp.func
    def corners_of(context: Context, local: int, tile: Tile):
        """What a tile's triangles do to their corners."""
        other = context.patch.tile_count + local
        paired = other < context.patch.triangle_count
        shared = tile.fold
        if not paired:
            shared = fold_at(context, number_of(tile.sides, 2), vec3())
        triangle_corners(context, tile, 0, local, shared, tile.normal_0)
        if paired:
            triangle_corners(context, tile, 1, other, shared, tile.normal_1)

    @wp.func
    def compute_tile_corners(context: Context, tile: Tile):
        """What the tiles' triangles do to their corners; the last is the thread's own."""
        if wp.static(fits):
            if context.lane < context.patch.tile_count:
                corners_of(context, context.lane, tile)
        else:
            local = int(context.lane)
            while local < context.patch.tile_count:
                again = load_tile(context.patches, context.patch, local)
                again.normal_0 = row_at(context, context.memory.normal, local)
                if context.patch.tile_count + local < context.patch.triangle_count:
                    again.normal_1 = row_at(context, context.memory.normal, context.patch.tile_count + local)
                again.fold = fold_at(context, local, vec3())
                corners_of(context, local, again)
                local += block_threads()
        put_nothing(context)

    return compute_tile_corners
