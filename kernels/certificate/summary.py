"""Figures of each item of a batch: over chunks of its vertices, then over groups of these, always in one order."""

import functools

import warp as wp

from warp_cloth.kernels.base.subset import listed
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rest_function

CHUNK = 16  # vertices that one thread sums: a GPU has threads for them all, and each waits for its own in turn
GROUP = 32  # sums that the next thread sums
# Columns of a summary: free vertices, squares of the residual in weights and relative; squares of three ways [m2];
# largest coordinate's change since the last look [m]; largest ``growing_way`` [m]; lowest and highest corner of the
# bounding box [m].
FREE, WEIGHTS, RELATIVE, WAYS, MOVED, FASTER, LOWER, UPPER, COLUMNS = 0, 1, 2, 3, 6, 7, 8, 11, 14
NOWHERE = wp.constant(wp.float64(1.0e300))
ALONG = wp.constant(wp.float64(0.8))  # cosine between two ways from which on they run the same way
ONCE = wp.constant(wp.float64(0.2))  # how much of a way counts that has grown once only: what trembles grows by turns


@functools.cache
def looks_type(precision: str) -> type:
    """The struct of the shapes that the one now is compared with."""
    point = cloth_types(precision).point

    @wp.struct
    class Looks:
        """Shapes on the way."""

        last: wp.array(dtype=point)  # at the last look [m], shape [V]
        before: wp.array(dtype=point)  # at the one before
        earlier: wp.array(dtype=point)  # at the one before that
        low: wp.array(dtype=wp.uint8)  # 1: of its item's lower half, which carries little and may fold, shape [V]
        asked: wp.array(dtype=wp.uint8)  # 1: of this item figures are asked for, shape [items]
        marks: int  # how many of the earlier shapes are known: 3 or none
        mark_1: wp.array(dtype=wp.vec3f)  # [m], shape [V]
        mark_2: wp.array(dtype=wp.vec3f)
        mark_3: wp.array(dtype=wp.vec3f)

    return Looks


@wp.func
def squared_way(a: wp.vec3f, b: wp.vec3f):
    """|a - b|^2 [m2]."""
    d = wp.vec3d(a - b)
    return wp.dot(d, d)


@wp.func
def outgrows(way: wp.vec3d, before: wp.vec3d):
    """Whether a way is longer than the one before it, and runs as that did."""
    length = wp.length(way)
    earlier = wp.length(before)
    return length > earlier and wp.dot(way, before) > ALONG * length * earlier


@wp.func
def growing_way(way: wp.vec3d, before: wp.vec3d, earlier: wp.vec3d):
    """Length of a way [m] that has grown twice, ONCE of it if only once; 0 of any other."""
    length = wp.length(way)
    counted = wp.where(outgrows(before, earlier), length, ONCE * length)
    return wp.where(outgrows(way, before), counted, wp.float64(0.0))


@functools.cache
def chunk_kernel(precision: str) -> wp.Kernel:
    """Kernel ``summarise_chunks``, which goes first."""
    Model, State, Looks = cloth_types(precision).Model, cloth_types(precision).State, looks_type(precision)
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def summarise_chunks(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.subset, of chunks
        first: wp.array(dtype=wp.int32),  # first vertex of each chunk, and the vertex count
        left: wp.array(dtype=wp.vec2f),  # of measure_residual, shape [V]
        looks: Looks,
        sum_out: wp.array2d(dtype=wp.float64),  # shape [chunks, COLUMNS]
    ):
        """Figures of each chunk of an item that still iterates and is asked for."""
        chunk = listed(groups, wp.tid())
        if chunk >= sum_out.shape[0]:
            return
        if rests(model, first[chunk]) or looks.asked[model.item[first[chunk]]] == wp.uint8(0):
            return
        free = wp.float64(0.0)
        squares = wp.vec2d()
        ways = wp.vec3d()
        moved = wp.float64(0.0)
        growing = wp.float64(0.0)
        lower = wp.vec3d(NOWHERE, NOWHERE, NOWHERE)
        upper = -lower
        for vertex in range(first[chunk], first[chunk + 1]):
            here = wp.vec3d(state.position[vertex])
            last = wp.vec3d(looks.last[vertex])
            change = here - last
            moved = wp.max(moved, wp.max(wp.abs(change)))
            # asked for with the rest: a GPU waits for memory far longer than it works
            before = wp.vec3d(looks.before[vertex])
            way = growing_way(change, last - before, before - wp.vec3d(looks.earlier[vertex]))
            growing = wp.max(growing, wp.where(looks.low[vertex] == wp.uint8(0), way, wp.float64(0.0)))
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
        sum_out[chunk, wp.static(FASTER)] = growing
        for k in range(2):
            sum_out[chunk, wp.static(WEIGHTS) + k] = squares[k]
        for k in range(3):
            sum_out[chunk, wp.static(WAYS) + k] = ways[k]
            sum_out[chunk, wp.static(LOWER) + k] = lower[k]
            sum_out[chunk, wp.static(UPPER) + k] = upper[k]

    return summarise_chunks


@wp.kernel(module="unique", module_options=MODULE_OPTIONS)
def summarise_groups(
    first: wp.array(dtype=wp.int32),  # first row of each group, and the row count
    sum: wp.array2d(dtype=wp.float64),  # of summarise_chunks, or of this kernel, shape [rows, COLUMNS]
    sum_out: wp.array2d(dtype=wp.float64),  # shape [groups, COLUMNS]
):
    """Figures of each group: sums, the smallest of the lower corners, the largest of the rest."""
    group, column = wp.tid()
    figure = sum[first[group], column]
    for row in range(first[group] + 1, first[group + 1]):
        other = sum[row, column]
        if column < wp.static(MOVED):
            figure += other
        elif column >= wp.static(LOWER) and column < wp.static(UPPER):
            figure = wp.min(figure, other)
        else:
            figure = wp.max(figure, other)
    sum_out[group, column] = figure


@functools.cache
def keep_kernel(precision: str) -> wp.Kernel:
    """Kernel ``keep_shape``, which rounds it to float32."""
    Model, State = cloth_types(precision).Model, cloth_types(precision).State
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def keep_shape(
        model: Model,
        state: State,
        shape_out: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    ):
        """Keeps the shape as it is, rounded to float32."""
        vertex = wp.tid()
        if not rests(model, vertex):
            shape_out[vertex] = wp.vec3f(state.position[vertex])

    return keep_shape
