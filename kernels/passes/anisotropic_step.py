"""The anisotropic step: how much further than its stiffness bound allows a vertex may go where hardly anything resists.

A block-Jacobi bound. A yarn resists along itself; across it only its pull and the bending of cloth do, a hundred times
less. A step that is bounded alike in all directions therefore moves folds little by little. So what the bound k sums is
summed as a matrix, too: for each yarn or edge B = b (a I + (1 - a) t t^T), with b its bound, t its direction and a the
fraction that acts across it (tension.transverse_fraction); for bending b I. The compliance is (B / k + I / limit)^-1,
with Item.anisotropy_limit: a step of force over stiffness, times the compliance, still goes downhill wherever one of B
would.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.active_set import active_element
from warp_cloth.kernels.base.options import Accumulate, Terms, Yarn
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, difference_function, rests
from warp_cloth.kernels.elements.edge import edge_functions
from warp_cloth.kernels.laws.shear_hysteresis import shear_friction_tension
from warp_cloth.kernels.laws.tension import spring_constants, tension_force, tension_stiffness, transverse_fraction
from warp_cloth.kernels.laws.yarn import (
    slope_fractions,
    warp_vector,
    weft_and_warp,
    weft_vector,
    yarn_slopes,
    yarn_squares,
    yarn_stiffness,
    yarn_tension,
    yarn_transverse_fractions,
)
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  what + - * below call for packets
from warp_cloth.kernels.math.packet import component, vector4
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.math.symmetric import (
    bounded_inverse,
    inverse,
    mixed_outer,
    multiple_of_unit,
    outer,
    symmetric_times,
)
from warp_cloth.kernels.passes.scatter import sides_function
from warp_cloth.kernels.patches.packing import order_functions


@wp.func
def edge_bound(side: Any, change: Any, spring: Any, allowance: Any, horizon: Any):
    """Stiffness bound of an edge as a matrix [N/m], and its size; ``spring`` as Edges.spring."""
    rest, pull, push = spring_constants(spring)
    length, size = wp.length(side), wp.length(change)
    stretch = length - rest
    stiffness = tension_stiffness(stretch, pull, push, allowance * size)
    force = tension_force(stretch, pull, push)
    across = transverse_fraction(length, force, stiffness, size, horizon)
    along = outer(stiffness * (type(length)(1.0) - across), wp.normalize(side))
    return multiple_of_unit(stiffness * across) + along, stiffness


@wp.func
def yarns_as_they_lie(side_1: Any, side_2: Any, change_1: Any, change_2: Any, slope: Any, yarns: Any, allowance: Any):
    """What weft and warp have become; |t|^2, square of the change, tension and bound [J] of the four yarns."""
    weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
    square = yarn_squares(weft, warp)
    change = yarn_squares(weft_vector(slope, change_1, change_2), warp_vector(slope, change_1, change_2))
    pull, push = yarn_stiffness(yarns)
    length = root(square)
    tension, bound = yarn_tension(length, length - type(length)(1.0), change, pull, push, allowance)
    return weft, warp, square, change, tension, bound


@wp.func
def yarn_bounds(side_1: Any, side_2: Any, change_1: Any, change_2: Any, slope: Any, yarns: Any, step: Any):
    """What weft and warp have become, bounds of the four yarns [J], what acts across, inverses of lengths."""
    weft, warp, square, change, tension, bound = yarns_as_they_lie(
        side_1, side_2, change_1, change_2, slope, yarns, step.allowance
    )
    fraction, inverse_length = yarn_transverse_fractions(square, change, tension, bound, step.horizon)
    return weft, warp, bound, fraction, inverse_length


@wp.func
def rubbing_yarn_bounds(
    side_1: Any, side_2: Any, change_1: Any, change_2: Any, slope: Any, yarns: Any, slider: Any, step: Any
):
    """``yarn_bounds`` of yarns that have friction; ``slider`` as Triangles.shear_hysteresis."""
    weft, warp, square, change, tension, bound = yarns_as_they_lie(
        side_1, side_2, change_1, change_2, slope, yarns, step.allowance
    )
    friction, stiffer = shear_friction_tension(weft, warp, square, slider)
    tension += friction
    bound += stiffer
    fraction, inverse_length = yarn_transverse_fractions(square, change, tension, bound, step.horizon)
    return weft, warp, bound, fraction, inverse_length


@wp.func
def borne(slope: Any, corner: int):
    """Fraction of each of the four yarns' stiffness that a corner bears [1/m2]."""
    first, second = yarn_slopes(slope)
    fraction_0, fraction_1, fraction = slope_fractions(first, second)
    if corner == 0:
        fraction = fraction_0
    if corner == 1:
        fraction = fraction_1
    one = component(fraction, Yarn.WEFT)
    half, quarter = type(one)(0.5), type(one)(0.25)
    return fraction * vector4(half, half, quarter, quarter)


@wp.func
def folds_bound(bound_0: Any, bound_1: Any, bound_2: Any, corner: int):
    """Bound of the hinges of a triangle's sides at a corner [N/m], each opposite to its own, as triangle.corner_folds.

    Of the opposite side's all, of the others' half.
    """
    half = type(bound_0)(0.5)
    part_0, part_1, part_2 = bound_0 * half, bound_1 * half, bound_2 * half
    if corner == 0:
        part_0 = bound_0
    if corner == 1:
        part_1 = bound_1
    if corner == 2:
        part_2 = bound_2
    return part_0 + part_1 + part_2


@wp.func
def four_sum(figure: Any):
    """Sum of the four yarns' figures."""
    straight = component(figure, Yarn.WEFT) + component(figure, Yarn.WARP)
    return straight + component(figure, Yarn.PLUS) + component(figure, Yarn.MINUS)


@wp.func
def yarns_matrix(weft: Any, warp: Any, bounds: Any, fraction: Any, inverse_length: Any, slope: Any, corner: int):
    """Bound of a woven triangle's four yarns at one of its corners as a matrix [N/m], and its size.

    Arguments are of ``yarn_bounds``.
    """
    bound = bounds * borne(slope, corner)
    across = bound * fraction
    # of each yarn's t t^T; those of the biases are half (u + v) (u + v)^T and half (u - v) (u - v)^T
    on_weft, on_warp, both = weft_and_warp((bound - across) * inverse_length * inverse_length)
    along = outer(on_weft, weft) + outer(on_warp, warp)
    return multiple_of_unit(four_sum(across)) + (along + mixed_outer(both, weft, warp)), four_sum(bound)


def _bound_folds_kernel(precision: str, terms: Terms, packed: bool, in_order: bool) -> wp.Kernel:
    types, order = cloth_types(precision), order_functions(precision, packed, in_order)
    position_at, displacement_at = order.position_at, order.displacement_at
    real, vec2, vec4, Model, State, Edges, Step = (
        types.real,
        types.vec2,
        types.vec4,
        types.Model,
        types.State,
        types.Edges,
        types.Step,
    )
    functions = edge_functions(precision, Accumulate.ANISOTROPIC_STIFFNESS, terms)
    edge_span, edge_fold = functions.edge_span, functions.edge_fold

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def bound_folds(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.active_set, of edges
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        bound_out: wp.array(dtype=real),  # [N/m], shape [E]
    ):
        """Bounds the stiffness of each edge's hinge."""
        edge = active_element(groups, wp.tid())
        if edge >= edges.ends.shape[0]:
            return
        ends = element(edges.ends, edge)
        if rests(model, ends[0]):
            return
        adjacent = element(edges.adjacent_triangles, edge)
        rest, slider = vec2(), vec4()
        if wp.static(terms.angles):
            rest = element(edges.rest, edge)
        if wp.static(terms.hysteresis):
            slider = element(edges.hysteresis, edge)
        move, other = displacement_at(state, ends[0]), displacement_at(state, ends[1])
        first, second = position_at(state, ends[0]), position_at(state, ends[1])
        span = edge_span(first, second, move, other, root(inner(move, move)))
        normal_0, normal_1 = element(normal, adjacent[0]), element(normal, adjacent[1])
        fold = edge_fold(span, normal_0, normal_1, element(edges.hinge_stiffness, edge), rest, slider, step)
        bound_out[edge] = fold[1]

    return bound_folds


@wp.func
def compliance_of(matrix: Any, total: Any, limit: Any):
    """(B / k + I / limit)^-1, with B the matrix and k the total of what bounds the vertex's step."""
    one = type(total)(1.0)
    compliance = multiple_of_unit(one)
    if total > type(total)(0.0):
        compliance = inverse(matrix / total + multiple_of_unit(one / limit))
    return compliance


def _bound_functions(precision: str, terms: Terms, packed: bool, in_order: bool) -> SimpleNamespace:
    """Functions ``edge_matrix``, ``folds_size`` and ``yarns_bound``: bounds of a vertex's step by element."""
    types, order = cloth_types(precision), order_functions(precision, packed, in_order)
    position_at, displacement_at = order.position_at, order.displacement_at
    real, State, Step, Edges, Triangles = types.real, types.State, types.Step, types.Edges, types.Triangles
    sides_of = sides_function(precision, Accumulate.ANISOTROPIC_STIFFNESS, packed, in_order)
    difference = difference_function(precision)

    @wp.func
    def edge_matrix(state: State, edges: Edges, edge: int, step: Step):
        """Bound of an edge as a matrix [N/m], and its size."""
        ends = element(edges.ends, edge)
        side = difference(position_at(state, ends[1]), position_at(state, ends[0]))
        change = displacement_at(state, ends[1]) - displacement_at(state, ends[0])
        return edge_bound(side, change, element(edges.spring, edge), step.allowance, step.horizon)

    @wp.func
    def bound_of(side: int, bound: wp.array(dtype=real)):
        """Bound of the hinge of a side, an element of Triangles.edges [N/m]."""
        return element(bound, wp.where(side < 0, -1 - side, side))

    @wp.func
    def folds_size(triangles: Triangles, triangle: int, corner: int, bound: wp.array(dtype=real)):
        """Bound of the hinges of a triangle's sides at one of its corners [N/m]."""
        opposite = element(triangles.edges, triangle)
        bound_0, bound_1 = bound_of(opposite[0], bound), bound_of(opposite[1], bound)
        return folds_bound(bound_0, bound_1, bound_of(opposite[2], bound), corner)

    @wp.func
    def yarns_bound(state: State, triangles: Triangles, triangle: int, corner: int, step: Step):
        """Bound of a triangle's yarns at one of its corners as a matrix [N/m], and its size."""
        slope, yarns = element(triangles.slope, triangle), element(triangles.yarns, triangle)
        sides = sides_of(state, element(triangles.corners, triangle))
        if wp.static(terms.shear_hysteresis):
            weft, warp, bounds, fraction, inverse_length = rubbing_yarn_bounds(
                sides.side_1, sides.side_2, sides.change_1, sides.change_2, slope, yarns,
                element(triangles.shear_hysteresis, triangle), step,
            )  # fmt: skip
        else:
            weft, warp, bounds, fraction, inverse_length = yarn_bounds(
                sides.side_1, sides.side_2, sides.change_1, sides.change_2, slope, yarns, step
            )
        return yarns_matrix(weft, warp, bounds, fraction, inverse_length, slope, corner)

    return SimpleNamespace(edge_matrix=edge_matrix, folds_size=folds_size, yarns_bound=yarns_bound)


def _find_compliance_kernel(precision: str, terms: Terms, packed: bool, in_order: bool) -> wp.Kernel:
    types, put_compliance = cloth_types(precision), order_functions(precision, packed, in_order).put_compliance
    real, Model, State, Step = types.real, types.Model, types.State, types.Step
    Edges, Triangles, Rows = types.Edges, types.Triangles, types.Rows
    functions = _bound_functions(precision, terms, packed, in_order)
    edge_matrix, folds_size, yarns_bound = functions.edge_matrix, functions.folds_size, functions.yarns_bound

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_compliance(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.active_set, of vertices
        edges: Edges,
        triangles: Triangles,
        rows: Rows,
        bound: wp.array(dtype=real),  # of bound_folds, shape [E]
        step: Step,
    ):
        """Sets the compliance of every vertex whose item takes anisotropic steps."""
        vertex = active_element(groups, wp.tid())
        if vertex >= model.item.shape[0]:
            return
        if rests(model, vertex):
            return
        item = model.items[element(model.item, vertex)]
        limit = item.anisotropy_limit
        if limit == real(0.0):
            return
        total = element(model.weight, vertex) / item.cap
        matrix = multiple_of_unit(total)
        if wp.static(terms.edges):
            for row in range(element(rows.edge_start, vertex), element(rows.edge_start, vertex + 1)):
                more, size = edge_matrix(state, edges, element(rows.edge, row), step)
                matrix += more
                total += size
        if wp.static(terms.folds or terms.yarns):
            for row in range(element(rows.triangle_start, vertex), element(rows.triangle_start, vertex + 1)):
                entry = element(rows.triangle, row)
                triangle = entry // 3
                corner = entry - 3 * triangle
                if wp.static(terms.folds):
                    size = folds_size(triangles, triangle, corner, bound)
                    matrix += multiple_of_unit(size)
                    total += size
                if wp.static(terms.yarns):
                    more, size = yarns_bound(state, triangles, triangle, corner, step)
                    matrix += more
                    total += size
        put_compliance(state.compliance, vertex, compliance_of(matrix, total, limit))

    return find_compliance


@wp.func
def transferred(old: Any, new: Any, move: Any):
    """The part of a displacement that adds no energy to the oscillation when its vertex's compliance changes.

    A step of compliance L oscillates with the inertia k / L. Where that changes from L0 to L1, d becomes
    2 L1 (L0 + L1)^-1 d: d' k/L1 d' is never more than d k/L0 d. From update to update compliance changes so little
    that doing without takes as many iterations (a T-shirt, six starts), and saves the inverse.
    """
    return symmetric_times(new, symmetric_times(bounded_inverse((old + new) * type(old[0])(0.5)), move))


@functools.cache
def compliance_kernels(precision: str, terms: Terms, packed: bool = False, in_order: bool = False) -> SimpleNamespace:
    """Kernels ``bound_folds``, where cloth bends, and ``find_compliance``; the rest as of packing.order_functions."""
    return SimpleNamespace(
        bound_folds=_bound_folds_kernel(precision, terms, packed, in_order),
        find_compliance=_find_compliance_kernel(precision, terms, packed, in_order),
    )
