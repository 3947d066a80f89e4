"""What a block's threads do for a patch after ``patches.steps``: what its triangles do to their corners."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import threads_function
from warp_cloth.kernels.base.options import KernelOptions, Terms
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.triangle import corner_function, triangle_functions
from warp_cloth.kernels.patches.memory import access_functions, context_type, fold_functions, stride_function
from warp_cloth.kernels.patches.packing import first_three
from warp_cloth.kernels.patches.steps import packed


@functools.cache
def sides_functions(options: KernelOptions) -> SimpleNamespace:
    """Functions ``oriented``, ``side_fold`` and ``sides_of``, by which a triangle is computed."""
    precision, terms, fits, accumulate = options.precision, options.terms, options.fits, options.accumulate
    types, Context = cloth_types(precision), context_type(precision)
    vec3 = types.vec3
    access, fold_at = access_functions(precision, fits), fold_functions(precision, terms, fits).fold_at
    point_at, row_at = access.point_at, access.row_at
    triangle_sides = triangle_functions(precision, accumulate).triangle_sides

    @wp.func
    def oriented(fold: vec3, reverse: int):
        """A hinge, its torque negated where ``reverse`` is 1."""
        return vec3(wp.where(reverse == 1, -fold[0], fold[0]), fold[1], fold[2])

    @wp.func
    def side_fold(context: Context, word: wp.uint64, side: int, along: vec3):
        """``fold_at`` of a triangle's side, its torque as the triangle is wound."""
        return oriented(fold_at(context, packed(word, side), along), (packed(word, 3) >> side) & 1)

    @wp.func
    def sides_of(context: Context, word: wp.uint64):
        """A triangle as it lies."""
        a, b, c = packed(word, 0), packed(word, 1), packed(word, 2)
        move_0, move_1, move_2 = vec3(), vec3(), vec3()
        if wp.static(accumulate.is_bound):
            move_0 = first_three(row_at(context, context.memory.move, a))
            move_1 = first_three(row_at(context, context.memory.move, b))
            move_2 = first_three(row_at(context, context.memory.move, c))
        origin = point_at(context, a)
        second = point_at(context, b)
        third = point_at(context, c)
        return triangle_sides(origin, second, third, move_0, move_1, move_2)

    return SimpleNamespace(oriented=oriented, side_fold=side_fold, sides_of=sides_of)


@functools.cache
def triangle_table_function(precision: str, terms: Terms) -> wp.Function:
    """The function that reads a triangle's words in the patch's tables."""

    @wp.func
    def triangle_table(patches: cloth_types(precision).Patches, at: int):
        """The words of a triangle's sides and corners, as far as the terms need them."""
        sides, corners = wp.uint64(0), wp.uint64(0)
        if wp.static(terms.folds):
            sides = element(patches.sides, at)
        if wp.static(terms.yarns):
            corners = element(patches.corners, at)
        return sides, corners

    return triangle_table


@functools.cache
def corners_function(options: KernelOptions) -> wp.Function:
    """The function that computes a triangle from what is known of it."""
    precision, terms, fits, accumulate = options.precision, options.terms, options.fits, options.accumulate
    types, Context = cloth_types(precision), context_type(precision)
    vec3, vec4, Sides = types.vec3, types.vec4, types.Sides
    put_row, corner_stride = access_functions(precision, fits).put_row, stride_function(terms)
    corner_loads = corner_function(precision, accumulate, terms)

    @wp.func
    def put_corners(
        context: Context,
        triangle: int,
        normal: vec4,
        sides: Sides,
        fold_0: vec3,
        fold_1: vec3,
        fold_2: vec3,
    ):
        """What yarns of a triangle and hinges of its sides do to its corners."""
        slope, yarns, slider = vec4(), vec4(), vec3()
        if wp.static(terms.yarns):
            at = context.patch.triangle_start + triangle
            slope, yarns = element(context.patches.slope, at), element(context.patches.yarns, at)
            if wp.static(terms.shear_hysteresis):
                slider = element(context.patches.shear_hysteresis, at)
        first, second, third = corner_loads(normal, fold_0, fold_1, fold_2, sides, slope, yarns, slider, context.step)
        other = corner_stride(context.patch) + triangle
        put_row(context, context.memory.corner_load, triangle, first)
        put_row(context, context.memory.corner_load, other, second)
        put_row(context, context.memory.corner_load, other + context.patch.triangle_count, third)

    return put_corners


@functools.cache
def nothing_step(options: KernelOptions) -> wp.Function:
    """The function that puts nothing after what triangles do."""
    vec4, Context = cloth_types(options.precision).vec4, context_type(options.precision)
    put_row = access_functions(options.precision, options.fits).put_row
    corner_stride = stride_function(options.terms)

    @wp.func
    def put_nothing(context: Context):
        """For vertices where no more triangles meet."""
        if context.lane == 0:
            after = corner_stride(context.patch) + 2 * context.patch.triangle_count
            put_row(context, context.memory.corner_load, after, vec4())

    return put_nothing


@functools.cache
def triangles_step(options: KernelOptions) -> wp.Function:
    """The function that computes triangles."""
    precision, terms, fits = options.precision, options.terms, options.fits
    types, block_threads = cloth_types(precision), threads_function(options.block_threads)
    Context = context_type(precision)
    vec3, vec4, Sides = types.vec3, types.vec4, types.Sides
    row_at = access_functions(precision, fits).row_at
    functions, put_corners = sides_functions(options), corners_function(options)
    sides_of, side_fold = functions.sides_of, functions.side_fold
    put_nothing = nothing_step(options)
    triangle_table = triangle_table_function(precision, terms)

    @wp.func
    def compute_triangles(context: Context, first_sides: wp.uint64, first_corners: wp.uint64):
        """What hinges and yarns of triangles do to their corners; the last two are of the thread's first one."""
        count = context.patch.triangle_count
        local = int(context.lane)
        next_sides, next_corners = first_sides, first_corners
        while local < count:
            at = context.patch.triangle_start + local
            word, corners = next_sides, next_corners
            if local + block_threads() < count:
                next_sides, next_corners = triangle_table(context.patches, at + block_threads())
            normal, sides = vec4(), Sides()
            if wp.static(terms.yarns):
                sides = sides_of(context, corners)
            fold_0, fold_1, fold_2 = vec3(), vec3(), vec3()
            if wp.static(terms.folds):
                normal = row_at(context, context.memory.normal, local)
                fold_0 = side_fold(context, word, 0, sides.side_0)
                fold_1 = side_fold(context, word, 1, sides.side_2)
                fold_2 = side_fold(context, word, 2, sides.side_1)
            put_corners(context, local, normal, sides, fold_0, fold_1, fold_2)
            local += block_threads()
        put_nothing(context)

    return compute_triangles
