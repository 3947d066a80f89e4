"""Figures of each item of a batch: over chunks of its vertices, then over its chunks, always in the same order."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, cloth_types, rest_function

CHUNK = 64  # vertices that one thread sums: enough of them on a GPU, and few sums left over
# Columns of a summary: free vertices, squares of the residual in weights and relative; squares of three ways [m2];
# largest coordinate's change since the last look [m]; lowest and highest corner of the bounding box [m].
FREE, WEIGHTS, RELATIVE, WAYS, MOVED, LOWER, UPPER, COLUMNS = 0, 1, 2, 3, 6, 7, 10, 13
NOWHERE = wp.constant(wp.float64(1.0e300))


@functools.cache
def summary_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``summarise_chunks``, ``summarise_items`` and ``keep_shape`` in one precision."""
    types = cloth_types(precision)
    point, Cloth = types.point, types.Cloth

    rests = rest_function(precision)

    @wp.struct
    class Looks:
        """Shapes that the one now is compared with."""

        last: wp.array(dtype=point)  # at the last look [m], shape [V]
        marks: int  # how many of the earlier shapes are known: 3 or none
        mark_1: wp.array(dtype=wp.vec3f)  # [m], shape [V]
        mark_2: wp.array(dtype=wp.vec3f)
        mark_3: wp.array(dtype=wp.vec3f)

    @wp.func
    def squared_way(a: wp.vec3f, b: wp.vec3f):
        """|a - b|^2 [m2]."""
        d = wp.vec3d(a - b)
        return wp.dot(d, d)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def summarise_chunks(
        first: wp.array(dtype=wp.int32),  # first vertex of each chunk, and the vertex count
        cloth: Cloth,
        left: wp.array(dtype=wp.vec2f),  # of measure_residual, shape [V]
        looks: Looks,
        sum_out: wp.array2d(dtype=wp.float64),  # shape [chunks, COLUMNS]
    ):
        """Figures of each chunk of an item that still iterates."""
        chunk = wp.tid()
        if rests(cloth, first[chunk]):
            return
        free = wp.float64(0.0)
        squares = wp.vec2d()
        ways = wp.vec3d()
        moved = wp.float64(0.0)
        lower = wp.vec3d(NOWHERE, NOWHERE, NOWHERE)
        upper = -lower
        for vertex in range(first[chunk], first[chunk + 1]):
            here = wp.vec3d(cloth.position[vertex])
            change = here - wp.vec3d(looks.last[vertex])
            moved = wp.max(moved, wp.max(wp.abs(change)))
            # adding nothing, or what is not finite: that must not be lost in a comparison
            free += (change[0] - change[0]) + (change[1] - change[1]) + (change[2] - change[2])
            lower = wp.min(lower, here)
            upper = wp.max(upper, here)
            residual = wp.vec2d(left[vertex])
            squares += wp.cw_mul(residual - residual, residual)
            if residual[0] >= wp.float64(0.0):
                free += wp.float64(1.0)
                squares += wp.cw_mul(residual, residual)
            if looks.marks > 0:
                one = looks.mark_1[vertex]
                two = looks.mark_2[vertex]
                ways += wp.vec3d(
                    squared_way(wp.vec3f(here), one), squared_way(one, two), squared_way(two, looks.mark_3[vertex])
                )
        sum_out[chunk, wp.static(FREE)] = free
        sum_out[chunk, wp.static(MOVED)] = moved
        for k in range(2):
            sum_out[chunk, wp.static(WEIGHTS) + k] = squares[k]
        for k in range(3):
            sum_out[chunk, wp.static(WAYS) + k] = ways[k]
            sum_out[chunk, wp.static(LOWER) + k] = lower[k]
            sum_out[chunk, wp.static(UPPER) + k] = upper[k]

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def summarise_items(
        first: wp.array(dtype=wp.int32),  # first chunk of each item, and the chunk count
        sum: wp.array2d(dtype=wp.float64),  # of summarise_chunks
        figure_out: wp.array2d(dtype=wp.float64),  # shape [items, COLUMNS]
    ):
        """Figures of each item: sums, the smallest of the lower corners, the largest of the rest."""
        item, column = wp.tid()
        figure = sum[first[item], column]
        for chunk in range(first[item] + 1, first[item + 1]):
            other = sum[chunk, column]
            if column < wp.static(MOVED):
                figure += other
            elif column >= wp.static(LOWER) and column < wp.static(UPPER):
                figure = wp.min(figure, other)
            else:
                figure = wp.max(figure, other)
        figure_out[item, column] = figure

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def keep_shape(
        cloth: Cloth,
        shape_out: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    ):
        """Keeps the shape as it is, rounded to float32."""
        vertex = wp.tid()
        if not rests(cloth, vertex):
            shape_out[vertex] = wp.vec3f(cloth.position[vertex])

    return SimpleNamespace(
        Looks=Looks, summarise_chunks=summarise_chunks, summarise_items=summarise_items, keep_shape=keep_shape
    )
