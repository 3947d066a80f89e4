"""Figures of each item of a batch by ordered sums: over slices of its vertices, then over groups of slices."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.active_set import active_element
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rests

SLICE = 16  # vertices that one thread sums: a GPU has threads for all slices at once
GROUP = 32  # sums that a thread of the next kernel sums
# Columns of a summary: free vertices, squared residuals in weights and relative, squared distances between the last
# four snapshots [m2], largest change of a coordinate since the last measurement [m], largest ``growing_displacement``
# [m], lowest and highest corner of the bounding box [m].
FREE, WEIGHTS, RELATIVE, DISTANCES, MOVED, GROWING, LOWER, UPPER, COLUMNS = 0, 1, 2, 3, 6, 7, 8, 11, 14
INFINITE = wp.constant(wp.float64(1.0e300))
ALIGNED = wp.constant(wp.float64(0.8))  # cosine from which on two displacements have the same direction
GREW_ONCE = wp.constant(wp.float64(0.2))  # what counts of one that has grown once only, as oscillation does


@functools.cache
def shapes_type(precision: str) -> type:
    """The struct ``Shapes``, which the present shape is compared with."""
    point = cloth_types(precision).point

    @wp.struct
    class Shapes:
        """Earlier shapes, and which vertices and items of the present one are summed."""

        last: wp.array(dtype=point)  # at the last measurement [m], shape [V]
        before: wp.array(dtype=point)  # at the one before
        earlier: wp.array(dtype=point)  # at the one before that
        lower_half: wp.array(dtype=wp.uint8)  # 1: of its item's lower half, which may still fold, shape [V]
        selected: wp.array(dtype=wp.uint8)  # 1: this item is measured, shape [items]
        snapshot_count: int  # snapshots taken so far: 3 or none
        snapshot_1: wp.array(dtype=wp.vec3f)  # latest [m], shape [V]
        snapshot_2: wp.array(dtype=wp.vec3f)
        snapshot_3: wp.array(dtype=wp.vec3f)

    return Shapes


@wp.func
def squared_distance(a: wp.vec3f, b: wp.vec3f):
    """|a - b|^2 [m2]."""
    d = wp.vec3d(a - b)
    return wp.dot(d, d)


@wp.func
def outgrows(displacement: wp.vec3d, before: wp.vec3d):
    """Whether a displacement is longer than the one before it, in the same direction."""
    length = wp.length(displacement)
    earlier = wp.length(before)
    return length > earlier and wp.dot(displacement, before) > ALIGNED * length * earlier


@wp.func
def growing_displacement(displacement: wp.vec3d, before: wp.vec3d, earlier: wp.vec3d):
    """Length [m] of a displacement that has grown twice, GREW_ONCE of it if only once, else 0."""
    length = wp.length(displacement)
    counted = wp.where(outgrows(before, earlier), length, GREW_ONCE * length)
    return wp.where(outgrows(displacement, before), counted, wp.float64(0.0))


@wp.func
def growing_of(shapes: Any, vertex: int, change: wp.vec3d, last: wp.vec3d):
    """A vertex's growing displacement [m]; 0 in the lower half. ``shapes`` of ``shapes_type``."""
    # loaded in any case: a GPU waits for memory far longer than it computes
    before = wp.vec3d(shapes.before[vertex])
    growing = growing_displacement(change, last - before, before - wp.vec3d(shapes.earlier[vertex]))
    return wp.where(shapes.lower_half[vertex] == wp.uint8(0), growing, wp.float64(0.0))


@wp.func
def distances_of(shapes: Any, vertex: int, position: wp.vec3d):
    """Squared distances of a vertex from here to the first snapshot, to the second, to the third [m2]."""
    one = shapes.snapshot_1[vertex]
    two = shapes.snapshot_2[vertex]
    return wp.vec3d(
        squared_distance(wp.vec3f(position), one),
        squared_distance(one, two),
        squared_distance(two, shapes.snapshot_3[vertex]),
    )


@functools.cache
def summarise_slices_kernel(precision: str) -> wp.Kernel:
    """Kernel ``summarise_slices``, which comes first."""
    Model, State, Shapes = cloth_types(precision).Model, cloth_types(precision).State, shapes_type(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def summarise_slices(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # active set of slices (kernels.base.active_set)
        first: wp.array(dtype=wp.int32),  # first vertex of each slice, and the vertex count
        residual: wp.array(dtype=wp.vec2f),  # of measure_residual, shape [V]
        shapes: Shapes,
        sum_out: wp.array2d(dtype=wp.float64),  # shape [slices, COLUMNS]
    ):
        """Figures of each slice of an item that still iterates and is selected."""
        slice = active_element(groups, wp.tid())
        if slice >= sum_out.shape[0]:
            return
        if rests(model, first[slice]) or shapes.selected[model.item[first[slice]]] == wp.uint8(0):
            return
        free = wp.float64(0.0)
        squares = wp.vec2d()
        distances = wp.vec3d()
        moved = wp.float64(0.0)
        growing = wp.float64(0.0)
        lower = wp.vec3d(INFINITE, INFINITE, INFINITE)
        upper = -lower
        for vertex in range(first[slice], first[slice + 1]):
            position = wp.vec3d(state.position[vertex])
            last = wp.vec3d(shapes.last[vertex])
            change = position - last
            moved = wp.max(moved, wp.max(wp.abs(change)))
            growing = wp.max(growing, growing_of(shapes, vertex, change, last))
            # adds 0, or NaN where the position is not finite, which comparisons would lose
            free += (change[0] - change[0]) + (change[1] - change[1]) + (change[2] - change[2])
            lower = wp.min(lower, position)
            upper = wp.max(upper, position)
            left = wp.vec2d(residual[vertex])
            squares += wp.cw_mul(left - left, left)
            if left[0] >= wp.float64(0.0):
                free += wp.float64(1.0)
                squares += wp.cw_mul(left, left)
            if shapes.snapshot_count > 0:
                distances += distances_of(shapes, vertex, position)
        sum_out[slice, wp.static(FREE)] = free
        sum_out[slice, wp.static(MOVED)] = moved
        sum_out[slice, wp.static(GROWING)] = growing
        for k in range(2):
            sum_out[slice, wp.static(WEIGHTS) + k] = squares[k]
        for k in range(3):
            sum_out[slice, wp.static(DISTANCES) + k] = distances[k]
            sum_out[slice, wp.static(LOWER) + k] = lower[k]
            sum_out[slice, wp.static(UPPER) + k] = upper[k]

    return summarise_slices


@wp.kernel(module="unique", module_options=MODULE_OPTIONS)
def summarise_groups(
    first: wp.array(dtype=wp.int32),  # first row of each group, and the row count
    sum: wp.array2d(dtype=wp.float64),  # of summarise_slices, or of this kernel, shape [rows, COLUMNS]
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
def store_snapshot_kernel(precision: str) -> wp.Kernel:
    """Kernel ``store_snapshot``."""
    Model, State = cloth_types(precision).Model, cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def store_snapshot(
        model: Model,
        state: State,
        snapshot_out: wp.array(dtype=wp.vec3f),  # [m], shape [V]
    ):
        """Stores the present shape, rounded to float32."""
        vertex = wp.tid()
        if not rests(model, vertex):
            snapshot_out[vertex] = wp.vec3f(state.position[vertex])

    return store_snapshot
