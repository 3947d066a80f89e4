"""Leeway: how much further than its stiffness bound lets it a vertex may go in directions that hardly resist.

A thread resists along itself; across it do only its pull and the bending of cloth, a hundred times less. A step that is
bounded alike in all directions therefore moves folds little by little. So what the bound k sums is summed as a matrix,
too: for each thread or edge B = b (a I + (1 - a) t t^T), with b its bound, t its direction and a what resists across it
(tension.share_across); for bending b I. The leeway is (B / k + I / most)^-1, with ``most`` its own limit: a step of
force over stiffness, times the leeway, still goes downhill wherever one of B would.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.options import Terms
from warp_cloth.kernels.base.subset import listed
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, difference_function, rest_function
from warp_cloth.kernels.elements.edge import edge_functions
from warp_cloth.kernels.elements.stiffness import matrix_functions, symmetric_functions, symmetric_times
from warp_cloth.kernels.elements.triangle import square_functions
from warp_cloth.kernels.laws.tension import share_across, tension_stiffness
from warp_cloth.kernels.laws.yarn import thread_pulls, thread_shares, warp_vector, weft_vector
from warp_cloth.kernels.math.packet import (
    alike,
    differences,
    four,
    part,
    products,
    six,
    sizes,
    sums,
    times,
)
from warp_cloth.kernels.math.real import inner, root, shaped
from warp_cloth.kernels.passes.scatter import sides_function
from warp_cloth.kernels.patches.packing import order_functions


def bound_functions(precision: str, eight: bool = False) -> SimpleNamespace:
    """Functions ``spring_matrix``, ``threads_bounds`` and ``threads_matrix``: bounds as matrices [N/m], and their size.

    Of one, or of ``eight`` at a time.
    """
    real, types = cloth_types(precision).real, shaped(cloth_types(precision).real, eight)
    one, vec3, vec4, Step = types.real, types.vec3, types.vec4, cloth_types(precision).Step
    squares = square_functions(precision, eight).squares
    matrices = matrix_functions(precision, eight)
    along, even = matrices.along, matrices.even
    half, quarter = wp.constant(real(0.5)), wp.constant(real(0.25))

    @wp.func
    def crossed(size: one, u: vec3, v: vec3, first: int, second: int):
        """A component off the diagonal of size (u v^T + v u^T)."""
        both = sums(products(part(u, first), part(v, second)), products(part(u, second), part(v, first)))
        return products(size, both)

    @wp.func
    def mixed(size: one, u: vec3, v: vec3):
        """size (u v^T + v u^T)."""
        two = times(size, real(2.0))
        return six(
            products(products(two, part(u, 0)), part(v, 0)),
            products(products(two, part(u, 1)), part(v, 1)),
            products(products(two, part(u, 2)), part(v, 2)),
            crossed(size, u, v, 0, 1), crossed(size, u, v, 0, 2), crossed(size, u, v, 1, 2),
        )  # fmt: skip

    @wp.func
    def spring_matrix(way: vec3, change: vec3, law: vec3, step: Step):
        """Bound of an edge; law is its length at rest, pull and push."""
        length, size = wp.length(way), wp.length(change)
        stiffness = tension_stiffness(length, law[0], law[1], law[2], step.reach * size)
        across = share_across(length, law[0], law[1], law[2], stiffness, size, step.horizon)
        return even(stiffness * across) + along(stiffness * (real(1.0) - across), wp.normalize(way)), stiffness

    @wp.func
    def borne(slope: vec4, corner: int):
        """Share of each of four threads' stiffness that a corner bears [1/m2], as forces.corner_parts has it."""
        weft_1, weft_2, warp_1, warp_2 = part(slope, 0), part(slope, 1), part(slope, 2), part(slope, 3)
        first = four(weft_1, warp_1, sums(weft_1, warp_1), differences(weft_1, warp_1))
        second = four(weft_2, warp_2, sums(weft_2, warp_2), differences(weft_2, warp_2))
        size_0, size_1, size_2 = sizes(sums(first, second)), sizes(first), sizes(second)
        own = size_2
        if corner == 0:
            own = size_0
        if corner == 1:
            own = size_1
        straight, bias = alike(weft_1, half), alike(weft_1, quarter)
        return products(products(sums(sums(size_0, size_1), size_2), own), four(straight, straight, bias, bias))

    @wp.func
    def threads_bounds(side_1: vec3, side_2: vec3, change_1: vec3, change_2: vec3, slope: vec4, law: vec4, step: Step):
        """What weft and warp have become, bounds of the four threads [J], what acts across, inverses of lengths."""
        weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
        square = squares(weft, warp)
        change = squares(weft_vector(slope, change_1, change_2), warp_vector(slope, change_1, change_2))
        bias, compression = part(law, 2), part(law, 3)
        pull = four(part(law, 0), part(law, 1), bias, bias)
        push = products(pull, four(compression, compression, compression, compression))
        pulls, bound = thread_pulls(square, change, pull, push, step.reach)
        share, inverse = thread_shares(square, change, pulls, bound, step.horizon)
        return weft, warp, bound, share, inverse

    @wp.func
    def threads_matrix(weft: vec3, warp: vec3, bounds: vec4, share: vec4, inverse: vec4, slope: vec4, corner: int):
        """Bound of a woven triangle's four threads at one of its corners, of what ``threads_bounds`` tells."""
        bound = products(bounds, borne(slope, corner))
        across = products(bound, share)
        # of each thread's t t^T; those of the biases are half (u + v) (u + v)^T and half (u - v) (u - v)^T
        rest = products(products(differences(bound, across), inverse), inverse)
        mean = times(sums(part(rest, 2), part(rest, 3)), half)
        cross = times(differences(part(rest, 2), part(rest, 3)), half)
        own = sums(along(sums(part(rest, 0), mean), weft), along(sums(part(rest, 1), mean), warp))
        matrix = sums(even(total_of(across)), sums(own, mixed(cross, weft, warp)))
        return matrix, total_of(bound)

    @wp.func
    def total_of(figure: vec4):
        """Sum of the four threads' figures."""
        return sums(sums(sums(part(figure, 0), part(figure, 1)), part(figure, 2)), part(figure, 3))

    return SimpleNamespace(spring_matrix=spring_matrix, threads_bounds=threads_bounds, threads_matrix=threads_matrix)


def _bound_folds_kernel(precision: str, terms: Terms, packed: bool, in_order: bool) -> wp.Kernel:
    types, order = cloth_types(precision), order_functions(precision, packed, in_order)
    position_at, move_at = order.position_at, order.move_at
    real, vec2, vec4, Model, State, Edges, Step = (
        types.real,
        types.vec2,
        types.vec4,
        types.Model,
        types.State,
        types.Edges,
        types.Step,
    )
    functions = edge_functions(precision, "leeway", terms.angles)
    edge_span, edge_fold = functions.edge_span, functions.edge_fold
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def bound_folds(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.subset, of edges
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        bound_out: wp.array(dtype=real),  # [N/m], shape [E]
    ):
        """Bounds the stiffness of each edge's hinge."""
        edge = listed(groups, wp.tid())
        if edge >= edges.ends.shape[0]:
            return
        ends = element(edges.ends, edge)
        if rests(model, ends[0]):
            return
        beside = element(edges.beside, edge)
        rest = vec2()
        if wp.static(terms.angles):
            rest = element(edges.rest, edge)
        move, other = move_at(state, ends[0]), move_at(state, ends[1])
        first, second = position_at(state, ends[0]), position_at(state, ends[1])
        span = edge_span(first, second, move, other, root(inner(move, move)))
        normal_0, normal_1 = element(normal, beside[0]), element(normal, beside[1])
        fold = edge_fold(span, normal_0, normal_1, element(edges.fold, edge), rest, step)
        bound_out[edge] = fold[1]

    return bound_folds


@functools.cache
def leeway_function(precision: str) -> wp.Function:
    """The function that turns a vertex' bounds into its leeway."""
    real, vec6 = cloth_types(precision).real, cloth_types(precision).vec6
    symmetric = symmetric_functions(precision)
    even, inverse = symmetric.even, symmetric.inverse

    @wp.func
    def leeway_of(matrix: vec6, total: real, most: real):
        """(B / k + I / most)^-1."""
        one = real(1.0)
        leeway = even(one)
        if total > real(0.0):
            leeway = inverse(matrix / total + even(one / most))
        return leeway

    return leeway_of


def _find_leeway_kernel(precision: str, terms: Terms, packed: bool, in_order: bool) -> wp.Kernel:
    types, order = cloth_types(precision), order_functions(precision, packed, in_order)
    position_at, move_at, put_leeway = order.position_at, order.move_at, order.put_leeway
    real, Model, State, Step = types.real, types.Model, types.State, types.Step
    Edges, Triangles, Rows = types.Edges, types.Triangles, types.Rows
    even, leeway_of = symmetric_functions(precision).even, leeway_function(precision)
    functions = bound_functions(precision)
    spring_matrix, threads_bounds, threads_matrix = (
        functions.spring_matrix, functions.threads_bounds, functions.threads_matrix,
    )  # fmt: skip
    sides_of = sides_function(precision, "leeway", packed, in_order)
    difference = difference_function(precision)
    rests = rest_function(precision)
    half = wp.constant(real(0.5))

    @wp.func
    def folds_bound(sides: wp.vec3i, bound: wp.array(dtype=real), corner: int):
        """What a triangle's hinges bound at one of its corners, as forces.corner_folds says."""
        total = real(0.0)
        for k in range(3):
            edge = wp.where(sides[k] < 0, -1 - sides[k], sides[k])
            total += element(bound, edge) * wp.where(k == corner, real(1.0), half)
        return total

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_leeway(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.subset, of vertices
        edges: Edges,
        triangles: Triangles,
        rows: Rows,
        bound: wp.array(dtype=real),  # of bound_folds, shape [E]
        step: Step,
    ):
        """Has every vertex whose item is loose go on with the leeway that the matrix of what bounds its step leaves."""
        vertex = listed(groups, wp.tid())
        if vertex >= model.item.shape[0]:
            return
        if rests(model, vertex):
            return
        item = model.items[element(model.item, vertex)]
        most = item.anisotropy_limit
        if most == real(0.0):
            return
        total = element(model.weight, vertex) / item.cap
        matrix = even(total)
        if wp.static(terms.edges):
            for row in range(element(rows.edge_start, vertex), element(rows.edge_start, vertex + 1)):
                edge = element(rows.edge, row)
                ends = element(edges.ends, edge)
                way = difference(position_at(state, ends[1]), position_at(state, ends[0]))
                change = move_at(state, ends[1]) - move_at(state, ends[0])
                more, size = spring_matrix(way, change, element(edges.law, edge), step)
                matrix += more
                total += size
        if wp.static(terms.folds or terms.threads):
            for row in range(element(rows.triangle_start, vertex), element(rows.triangle_start, vertex + 1)):
                entry = element(rows.triangle, row)
                triangle = entry // 3
                corner = entry - 3 * triangle
                if wp.static(terms.folds):
                    size = folds_bound(element(triangles.edges, triangle), bound, corner)
                    matrix += even(size)
                    total += size
                if wp.static(terms.threads):
                    slope, law = element(triangles.slope, triangle), element(triangles.threads, triangle)
                    sides = sides_of(state, element(triangles.corners, triangle))
                    weft, warp, bounds, share, shorter = threads_bounds(
                        sides.side_1, sides.side_2, sides.change_1, sides.change_2, slope, law, step
                    )
                    more, size = threads_matrix(weft, warp, bounds, share, shorter, slope, corner)
                    matrix += more
                    total += size
        put_leeway(state.compliance, vertex, leeway_of(matrix, total, most))

    return find_leeway


@functools.cache
def changed_leeway_function(precision: str) -> wp.Function:
    """The function ``changed_leeway``."""
    types = cloth_types(precision)
    real, vec3, vec6 = types.real, types.vec3, types.vec6
    inverse, half = symmetric_functions(precision).leeway_inverse, wp.constant(real(0.5))

    @wp.func
    def changed_leeway(old: vec6, new: vec6, move: vec3):
        """As much of a displacement as adds no energy to the swing where its vertex goes on with another leeway.

        A step of leeway L swings with the inertia k / L. Where that changes from L0 to L1, d becomes
        2 L1 (L0 + L1)^-1 d: d' k/L1 d' is never more than d k/L0 d. From look to look leeway changes so little that
        doing without takes as many iterations (a T-shirt, six starts), and saves the inverse.
        """
        return symmetric_times(new, symmetric_times(inverse((old + new) * half), move))

    return changed_leeway


@functools.cache
def leeway_kernels(precision: str, terms: Terms, packed: bool = False, in_order: bool = False) -> SimpleNamespace:
    """Kernels ``bound_folds``, where cloth bends, and ``find_leeway``; the rest as of packing.order_functions."""
    return SimpleNamespace(
        bound_folds=_bound_folds_kernel(precision, terms, packed, in_order),
        find_leeway=_find_leeway_kernel(precision, terms, packed, in_order),
    )
