"""What a triangle does to its vertices, in one precision; ``scatter``, ``gather`` sum it.

A load is a force [N] and a fourth part (one of cloth.FOURTH_PARTS). A hinge turns its two triangles, each of which
answers along its own normal: so a hinge's forces are summed triangle by triangle, of three hinges at a time.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.options import Terms
from warp_cloth.kernels.base.types import BOUNDS, cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.laws.bending import unit_normal
from warp_cloth.kernels.laws.yarn import slope_shares, stretched_pulls, thread_shares, warp_vector, weft_vector
from warp_cloth.kernels.math.packet import (
    alike,
    differences,
    four,
    most,
    opposite,
    part,
    products,
    scaled,
    sizes,
    sums,
    three,
    times,
)
from warp_cloth.kernels.math.real import chosen, fused, inner, inverses, roots, scaled_sum, shaped


@functools.cache
def triangle_functions(precision: str, fourth: str) -> SimpleNamespace:
    """Functions ``triangle_sides`` and ``triangle_normal``."""
    types = cloth_types(precision)
    point, vec3, vec4, Sides = types.point, types.vec3, types.vec4, types.Sides
    difference, exact = difference_function(precision), takes_exact_stretch(precision, fourth)

    @wp.func
    def triangle_sides(origin: point, second: point, third: point, move: vec3, second_move: vec3, third_move: vec3):
        """A triangle as it lies, and what last moved it."""
        sides = Sides()
        sides.side_1 = difference(second, origin)
        sides.side_2 = difference(third, origin)
        sides.side_0 = difference(third, second)
        if wp.static(exact):
            sides.exact_1 = second - origin
            sides.exact_2 = third - origin
        if wp.static(fourth in BOUNDS):
            sides.change_1 = second_move - move
            sides.change_2 = third_move - move
        return sides

    @wp.func
    def triangle_normal(origin: point, second: point, third: point):
        """Unit normal, and the inverse of twice the area [1/m2]."""
        normal, inverse = unit_normal(difference(second, origin), difference(third, origin))
        return vec4(normal[0], normal[1], normal[2], inverse)

    return SimpleNamespace(triangle_sides=triangle_sides, triangle_normal=triangle_normal)


@functools.cache
def corner_fold_function(precision: str, fourth: str, eight: bool = False) -> wp.Function:
    """The function that adds what a triangle's hinges do to its corners to their loads; of one or of eight."""
    types = shaped(cloth_types(precision).real, eight)
    vec3, vec4, corner_folds = types.vec3, types.vec4, _fold_function(precision, fourth, eight)

    @wp.func
    def with_fold(load: vec4, normal: vec4, along: types.real, more: types.real):
        """Load of a corner and what ``corner_folds`` says of it."""
        return four(
            fused(part(normal, 0), along, part(load, 0)),
            fused(part(normal, 1), along, part(load, 1)),
            fused(part(normal, 2), along, part(load, 2)),
            sums(part(load, 3), more),
        )

    @wp.func
    def with_folds(normal: vec4, fold_0: vec3, fold_1: vec3, fold_2: vec3, first: vec4, second: vec4, third: vec4):
        """Loads of the corners and of the hinges of the triangle's sides."""
        along, more = corner_folds(part(normal, 3), fold_0, fold_1, fold_2)
        return (
            with_fold(first, normal, part(along, 0), part(more, 0)),
            with_fold(second, normal, part(along, 1), part(more, 1)),
            with_fold(third, normal, part(along, 2), part(more, 2)),
        )

    return with_folds


@functools.cache
def corner_function(precision: str, fourth: str, terms: Terms) -> wp.Function:
    """The function that says what a triangle does to its corners, by all terms that there are."""
    types = cloth_types(precision)
    vec3, vec4, Sides, Step = types.vec3, types.vec4, types.Sides, types.Step
    with_folds, thread_loads = corner_fold_function(precision, fourth), thread_function(precision, fourth)
    exact_excess = _excess_function(precision)

    @wp.func
    def corner_loads(
        normal: vec4, fold_0: vec3, fold_1: vec3, fold_2: vec3, sides: Sides, slope: vec4, law: vec4, step: Step
    ):
        """Loads of the corners: of the triangle's threads, then of the hinges of its sides."""
        first = vec4()
        second = vec4()
        third = vec4()
        if wp.static(terms.threads):
            excess = vec4()
            if wp.static(takes_exact_stretch(precision, fourth)):
                excess = exact_excess(sides, slope)
            force_0, force_1, force_2, parts = thread_loads(
                sides.side_1, sides.side_2, excess, sides.change_1, sides.change_2, slope, law, step
            )
            first = vec4(force_0[0], force_0[1], force_0[2], parts[0])
            second = vec4(force_1[0], force_1[1], force_1[2], parts[1])
            third = vec4(force_2[0], force_2[1], force_2[2], parts[2])
        if wp.static(terms.folds):
            first, second, third = with_folds(normal, fold_0, fold_1, fold_2, first, second, third)
        return first, second, third

    return corner_loads


def _fold_function(precision: str, fourth: str, eight: bool) -> wp.Function:
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    one, vec3 = types.real, types.vec3
    half = wp.constant(real(0.5))

    @wp.func
    def foot(own: one, other: one, opposite_side: one):
        """Dot product of two sides that leave a corner, from the squares of all three."""
        return times(differences(sums(own, other), opposite_side), half)

    @wp.func
    def corner_folds(inverse: one, fold_0: vec3, fold_1: vec3, fold_2: vec3):
        """What the hinges of a triangle's sides do to its corners: forces along its normal [N], and fourth parts.

        With p_i the turn of side i over twice the area, it pushes corner i by p_i L_i^2 and the side's ends by -p_i
        times the dot product of the sides that leave the other end: each end's share of L_i^2 by the foot of the
        corner's perpendicular. So no net force is left, nor with the other triangle's a net torque.

        Args:
            inverse: of twice the area [1/m2].
            fold_0: ``edge_fold`` of the side opposite to the first corner, its turn as the triangle is wound.
            fold_1: that of the next.
            fold_2: that of the last.
        """
        square_0, square_1, square_2 = part(fold_0, 2), part(fold_1, 2), part(fold_2, 2)
        dot_0 = foot(square_1, square_2, square_0)
        dot_1 = foot(square_2, square_0, square_1)
        dot_2 = foot(square_0, square_1, square_2)
        push_0, push_1 = products(part(fold_0, 0), inverse), products(part(fold_1, 0), inverse)
        push_2 = products(part(fold_2, 0), inverse)
        along_1 = fused(push_1, square_1, opposite(fused(push_0, dot_2, products(push_2, dot_0))))
        along_2 = fused(push_2, square_2, opposite(fused(push_0, dot_1, products(push_1, dot_0))))
        parts = vec3()
        if wp.static(fourth in BOUNDS):
            # a wing's bound is in its own triangle, an axis' in both of the hinge's
            bound_0, bound_1, bound_2 = part(fold_0, 1), part(fold_1, 1), part(fold_2, 1)
            halves = alike(bound_0, half)
            both = times(sums(sums(bound_0, bound_1), bound_2), half)
            parts = three(fused(bound_0, halves, both), fused(bound_1, halves, both), fused(bound_2, halves, both))
        if wp.static(fourth == "size"):
            parts = vec3(
                wp.abs(push_0) * square_0 + wp.abs(push_1 * dot_2) + wp.abs(push_2 * dot_1),
                wp.abs(push_1) * square_1 + wp.abs(push_0 * dot_2) + wp.abs(push_2 * dot_0),
                wp.abs(push_2) * square_2 + wp.abs(push_0 * dot_1) + wp.abs(push_1 * dot_0),
            )
        return three(opposite(sums(along_1, along_2)), along_1, along_2), parts

    return corner_folds


def _thread_parts_function(precision: str, fourth: str, eight: bool) -> wp.Function:
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    one, vec4 = types.real, types.vec4
    # of the warp and weft threads' figures, and of those of both biases, whose slopes are taken sqrt(2) times too large
    straight = wp.constant(real(0.5 if fourth in BOUNDS else 1.0))
    bias = wp.constant(real(0.25 if fourth in BOUNDS else 0.5**0.5))

    @wp.func
    def corner_share(slope_1: one, slope_2: one):
        """What a thread's figure counts for at each corner: stiffness by ``slope_shares``, size by the slopes."""
        share_0, share_1, share_2 = sizes(sums(slope_1, slope_2)), sizes(slope_1), sizes(slope_2)
        if wp.static(fourth in BOUNDS):
            share_0, share_1, share_2 = slope_shares(slope_1, slope_2)
        return three(share_0, share_1, share_2)

    @wp.func
    def corner_parts(slope: vec4, figure: vec4):
        """Fourth parts of the corners from the figures of the weft, warp and both bias threads."""
        weft_1, weft_2, warp_1, warp_2 = part(slope, 0), part(slope, 1), part(slope, 2), part(slope, 3)
        parts = scaled(corner_share(weft_1, weft_2), times(part(figure, 0), straight))
        parts = scaled_sum(corner_share(warp_1, warp_2), times(part(figure, 1), straight), parts)
        plus = corner_share(sums(weft_1, warp_1), sums(weft_2, warp_2))
        minus = corner_share(differences(weft_1, warp_1), differences(weft_2, warp_2))
        return scaled_sum(minus, times(part(figure, 3), bias), scaled_sum(plus, times(part(figure, 2), bias), parts))

    return corner_parts


@functools.cache
def square_functions(precision: str, eight: bool = False) -> SimpleNamespace:
    """Functions ``squares``, ``changes_along`` and ``along_and_across`` of a triangle's four threads, or of eight's."""
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    vec3 = types.vec3
    half = wp.constant(real(0.5))

    @wp.func
    def squares(weft: vec3, warp: vec3):
        """Squares of the lengths of what a unit of cloth along the weft, the warp and both biases has become.

        A bias is half the square root of 2 times the sum or the difference of the others.
        """
        weft_2, warp_2, both = inner(weft, weft), inner(warp, warp), inner(weft, warp)
        mean, none = times(sums(weft_2, warp_2), half), alike(both, real(0.0))
        return four(weft_2, warp_2, most(sums(mean, both), none), most(differences(mean, both), none))

    @wp.func
    def changes_along(weft: vec3, warp: vec3, weft_change: vec3, warp_change: vec3):
        """Dot products of those four with what changed them."""
        weft_2, warp_2 = inner(weft, weft_change), inner(warp, warp_change)
        both = times(sums(inner(weft, warp_change), inner(warp, weft_change)), half)
        mean = times(sums(weft_2, warp_2), half)
        return four(weft_2, warp_2, sums(mean, both), differences(mean, both))

    @wp.func
    def along_and_across(figure: types.vec4):
        """What the four threads' figures are along weft, along warp and from each to the other."""
        plus, minus = part(figure, 2), part(figure, 3)
        mean, across = times(sums(plus, minus), half), times(differences(plus, minus), half)
        return sums(part(figure, 0), mean), sums(part(figure, 1), mean), across

    return SimpleNamespace(squares=squares, changes_along=changes_along, along_and_across=along_and_across)


def _excess_function(precision: str) -> wp.Function:
    types = cloth_types(precision)
    real, wide, vec4, Sides = types.real, types.wide, types.vec4, types.Sides
    half, one = wp.constant(wide(0.5)), wp.constant(wide(1.0))

    @wp.func
    def exact_excess(sides: Sides, slope: vec4):
        """|t|^2 - 1 of the four threads, in the positions' own precision."""
        weft = sides.exact_1 * wide(slope[0]) + sides.exact_2 * wide(slope[1])
        warp = sides.exact_1 * wide(slope[2]) + sides.exact_2 * wide(slope[3])
        weft_2, warp_2, both = inner(weft, weft) - one, inner(warp, warp) - one, inner(weft, warp)
        mean = half * (weft_2 + warp_2)
        return vec4(real(weft_2), real(warp_2), real(mean + both), real(mean - both))

    return exact_excess


def _drag_function(precision: str, eight: bool) -> wp.Function:
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    vec4, Step = types.vec4, cloth_types(precision).Step

    @wp.func
    def split_drag(drag: vec4, square: vec4, change: vec4, product: vec4, along: vec4, stiff: vec4, step: Step):
        """What of the threads' drag acts in all directions, and what along them only, over their lengths' squares.

        ``tension.drag_across`` of the four.
        """
        share, inverse = thread_shares(square, change, along, stiff, step.horizon)
        ones = alike(square, real(1.0))
        shortened = most(share, alike(share, step.buckling))
        even = products(drag, chosen(differences(square, ones), share, shortened))
        return even, products(products(products(differences(drag, even), product), inverse), inverse)

    return split_drag


@functools.cache
def thread_function(precision: str, fourth: str, eight: bool = False) -> wp.Function:
    """The function ``thread_loads`` of a woven triangle, or of eight."""
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    vec3, vec4, Step = types.vec3, types.vec4, cloth_types(precision).Step
    corner_parts, split_drag = _thread_parts_function(precision, fourth, eight), _drag_function(precision, eight)
    functions = square_functions(precision, eight)
    squares, changes_along, along_and_across = functions.squares, functions.changes_along, functions.along_and_across

    @wp.func
    def thread_loads(
        side_1: vec3, side_2: vec3, excess: vec4, change_1: vec3, change_2: vec3, slope: vec4, law: vec4, step: Step
    ):
        """Forces of the four threads on the corners, and the corners' fourth parts.

        ``excess`` is |t|^2 - 1 of the threads where that is taken exactly, from which |t| - 1 = excess / (|t| + 1).
        """
        along_u = weft_vector(slope, side_1, side_2)
        along_v = warp_vector(slope, side_1, side_2)
        change_u = vec3()
        change_v = vec3()
        square = squares(along_u, along_v)
        change = vec4()
        if wp.static(fourth in BOUNDS):
            change_u = weft_vector(slope, change_1, change_2)
            change_v = warp_vector(slope, change_1, change_2)
            change = squares(change_u, change_v)
        bias = part(law, 2)
        pull = four(part(law, 0), part(law, 1), bias, bias)
        compression = part(law, 3)
        push = products(pull, four(compression, compression, compression, compression))
        length, ones = roots(square), alike(square, real(1.0))
        stretch = differences(length, ones)
        if wp.static(takes_exact_stretch(precision, fourth)):
            stretch = products(excess, inverses(sums(length, ones)))
        along, stiff = stretched_pulls(length, stretch, change, pull, push, step.reach)
        weft = vec3()
        warp = vec3()
        parts = vec3()
        if wp.static(fourth in BOUNDS):
            # resists the threads' changing, as an edge's load does
            drag = times(stiff, step.viscosity)
            if wp.static(fourth == "leeway"):
                product = changes_along(along_u, along_v, change_u, change_v)
                drag, more = split_drag(drag, square, change, product, along, stiff, step)
                along = sums(along, more)
            on_weft, on_warp, across = along_and_across(drag)
            weft = scaled_sum(change_u, on_weft, scaled(change_v, across))
            warp = scaled_sum(change_v, on_warp, scaled(change_u, across))
            parts = corner_parts(slope, stiff)
        if wp.static(fourth == "size"):
            parts = corner_parts(slope, products(sizes(along), length))
        # what the biases pull along weft and warp, each along itself and along the other
        on_weft, on_warp, across = along_and_across(along)
        weft = scaled_sum(along_v, across, scaled_sum(along_u, on_weft, weft))
        warp = scaled_sum(along_u, across, scaled_sum(along_v, on_warp, warp))
        back = real(-1.0)
        force_1 = times(scaled_sum(weft, part(slope, 0), scaled(warp, part(slope, 2))), back)
        force_2 = times(scaled_sum(weft, part(slope, 1), scaled(warp, part(slope, 3))), back)
        return times(sums(force_1, force_2), back), force_1, force_2, parts

    return thread_loads
