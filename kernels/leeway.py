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

from warp_cloth.kernels.arithmetic import inner, root
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Terms, cloth_types, difference_function, rest_function
from warp_cloth.kernels.forces import edge_functions, square_functions
from warp_cloth.kernels.stiffness import symmetric_functions
from warp_cloth.kernels.tension import share_across, tension_stiffness
from warp_cloth.kernels.weave import thread_pulls, thread_shares, warp_vector, weft_vector


def _bound_functions(precision: str) -> SimpleNamespace:
    """Functions ``spring_matrix`` and ``threads_matrix``: bounds as matrices [N/m], and how large they are."""
    types = cloth_types(precision)
    real, point, vec3, vec4, vec6, Step = types.real, types.point, types.vec3, types.vec4, types.vec6, types.Step
    symmetric = symmetric_functions(precision)
    along, even = symmetric.along, symmetric.even
    difference = difference_function(precision)
    squares = square_functions(precision).squares
    half = wp.constant(real(0.5))
    counted = wp.constant(vec4(0.5, 0.5, 0.25, 0.25))

    @wp.func
    def mixed(size: real, u: vec3, v: vec3):
        """size (u v^T + v u^T)."""
        two = real(2.0) * size
        return vec6(
            two * u[0] * v[0], two * u[1] * v[1], two * u[2] * v[2],
            size * (u[0] * v[1] + u[1] * v[0]), size * (u[0] * v[2] + u[2] * v[0]), size * (u[1] * v[2] + u[2] * v[1]),
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
        first = vec4(slope[0], slope[2], slope[0] + slope[2], slope[0] - slope[2])
        second = vec4(slope[1], slope[3], slope[1] + slope[3], slope[1] - slope[3])
        size_0, size_1, size_2 = wp.abs(first + second), wp.abs(first), wp.abs(second)
        own = wp.where(corner == 0, size_0, wp.where(corner == 1, size_1, size_2))
        return wp.cw_mul(wp.cw_mul(size_0 + size_1 + size_2, own), counted)

    @wp.func
    def threads_matrix(
        position: wp.array(dtype=point),
        moved: wp.array(dtype=vec3),
        corners: wp.vec3i,
        slope: vec4,
        law: vec4,
        corner: int,
        step: Step,
    ):
        """Bound of a woven triangle's four threads at one of its corners."""
        origin, move = position[corners[0]], moved[corners[0]]
        side_1, side_2 = difference(position[corners[1]], origin), difference(position[corners[2]], origin)
        change_1, change_2 = moved[corners[1]] - move, moved[corners[2]] - move
        weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
        square = squares(weft, warp)
        change = squares(weft_vector(slope, change_1, change_2), warp_vector(slope, change_1, change_2))
        pull = vec4(law[0], law[1], law[2], law[2])
        pulls, bound = thread_pulls(square, change, pull, pull * law[3], step.reach)
        share, inverse = thread_shares(square, change, pulls, bound, step.horizon)
        bound = wp.cw_mul(bound, borne(slope, corner))
        across = wp.cw_mul(bound, share)
        # of each thread's t t^T; those of the biases are half (u + v) (u + v)^T and half (u - v) (u - v)^T
        rest = wp.cw_mul(wp.cw_mul(bound - across, inverse), inverse)
        mean, cross = half * (rest[2] + rest[3]), half * (rest[2] - rest[3])
        matrix = even(across[0] + across[1] + across[2] + across[3])
        matrix += along(rest[0] + mean, weft) + along(rest[1] + mean, warp) + mixed(cross, weft, warp)
        return matrix, bound[0] + bound[1] + bound[2] + bound[3]

    return SimpleNamespace(spring_matrix=spring_matrix, threads_matrix=threads_matrix)


def _bound_folds_kernel(precision: str, terms: Terms) -> wp.Kernel:
    types = cloth_types(precision)
    real, vec2, vec4, Cloth, Edges, Step = types.real, types.vec2, types.vec4, types.Cloth, types.Edges, types.Step
    functions = edge_functions(precision, "leeway", terms.angles)
    edge_span, edge_fold = functions.edge_span, functions.edge_fold
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def bound_folds(
        cloth: Cloth,
        edges: Edges,
        normal: wp.array(dtype=vec4),  # of measure_normals, shape [F]
        step: Step,
        bound_out: wp.array(dtype=real),  # [N/m], shape [E]
    ):
        """Bounds the stiffness of each edge's hinge."""
        edge = wp.tid()
        ends = edges.ends[edge]
        if rests(cloth, ends[0]):
            return
        beside = edges.beside[edge]
        rest = vec2()
        if wp.static(terms.angles):
            rest = edges.rest[edge]
        move = cloth.move[ends[0]]
        span = edge_span(
            cloth.position[ends[0]], cloth.position[ends[1]], move, cloth.move[ends[1]], root(inner(move, move))
        )
        fold = edge_fold(span, normal[beside[0]], normal[beside[1]], edges.fold[edge], rest, step)
        bound_out[edge] = fold[1]

    return bound_folds


def _find_leeway_kernel(precision: str, terms: Terms) -> wp.Kernel:
    types = cloth_types(precision)
    real, vec6, Cloth, Step = types.real, types.vec6, types.Cloth, types.Step
    Edges, Triangles, Rows = types.Edges, types.Triangles, types.Rows
    symmetric = symmetric_functions(precision)
    even, inverse = symmetric.even, symmetric.inverse
    functions = _bound_functions(precision)
    spring_matrix, threads_matrix = functions.spring_matrix, functions.threads_matrix
    difference = difference_function(precision)
    rests = rest_function(precision)
    half = wp.constant(real(0.5))

    @wp.func
    def folds_bound(sides: wp.vec3i, bound: wp.array(dtype=real), corner: int):
        """What a triangle's hinges bound at one of its corners, as forces.corner_folds says."""
        total = real(0.0)
        for k in range(3):
            edge = wp.where(sides[k] < 0, -1 - sides[k], sides[k])
            total += bound[edge] * wp.where(k == corner, real(1.0), half)
        return total

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def find_leeway(
        cloth: Cloth,
        edges: Edges,
        triangles: Triangles,
        rows: Rows,
        bound: wp.array(dtype=real),  # of bound_folds, shape [E]
        step: Step,
        leeway_out: wp.array(dtype=vec6),  # shape [V]
    ):
        """Sums at each vertex what bounds its step, as a matrix, and turns it into the vertex' leeway."""
        vertex = wp.tid()
        if rests(cloth, vertex):
            return
        most = cloth.items[cloth.item[vertex]].leeway
        if most == real(0.0):
            return
        total = cloth.weight[vertex] / cloth.items[cloth.item[vertex]].cap
        matrix = even(total)
        if wp.static(terms.edges):
            for row in range(rows.edge_start[vertex], rows.edge_start[vertex + 1]):
                edge = rows.edge[row]
                ends = edges.ends[edge]
                way = difference(cloth.position[ends[1]], cloth.position[ends[0]])
                change = cloth.move[ends[1]] - cloth.move[ends[0]]
                more, size = spring_matrix(way, change, edges.law[edge], step)
                matrix += more
                total += size
        if wp.static(terms.folds or terms.threads):
            for row in range(rows.triangle_start[vertex], rows.triangle_start[vertex + 1]):
                triangle = rows.triangle[row] // 3
                corner = rows.triangle[row] - 3 * triangle
                if wp.static(terms.folds):
                    size = folds_bound(triangles.edges[triangle], bound, corner)
                    matrix += even(size)
                    total += size
                if wp.static(terms.threads):
                    corners, slope = triangles.corners[triangle], triangles.slope[triangle]
                    more, size = threads_matrix(
                        cloth.position, cloth.move, corners, slope, triangles.threads[triangle], corner, step
                    )
                    matrix += more
                    total += size
        one = real(1.0)
        leeway_out[vertex] = even(one)
        if total > real(0.0):
            leeway_out[vertex] = inverse(matrix / total + even(one / most))

    return find_leeway


@functools.cache
def changed_leeway_function(precision: str) -> wp.Function:
    """The function ``changed_leeway``."""
    types = cloth_types(precision)
    real, vec3, vec6 = types.real, types.vec3, types.vec6
    symmetric = symmetric_functions(precision)
    inverse, times = symmetric.inverse, symmetric.times
    half = wp.constant(real(0.5))

    @wp.func
    def changed_leeway(old: vec6, new: vec6, move: vec3):
        """As much of a displacement as adds no energy to the swing where its vertex goes on with another leeway.

        A step of leeway L swings with the inertia k / L. Where that changes from L0 to L1, d becomes
        2 L1 (L0 + L1)^-1 d: d' k/L1 d' is never more than d k/L0 d.
        """
        return times(new, times(inverse((old + new) * half), move))

    return changed_leeway


def _take_leeway_kernel(precision: str) -> wp.Kernel:
    types = cloth_types(precision)
    real, vec6, Cloth = types.real, types.vec6, types.Cloth
    changed_leeway = changed_leeway_function(precision)
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def take_leeway(
        cloth: Cloth,
        found: wp.array(dtype=vec6),  # of find_leeway, shape [V]
    ):
        """Goes on with the leeway found, and with as much of the last displacement as ``changed_leeway`` says."""
        vertex = wp.tid()
        if rests(cloth, vertex):
            return
        if cloth.items[cloth.item[vertex]].leeway == real(0.0):
            return
        old, new = cloth.leeway[vertex], found[vertex]
        cloth.leeway[vertex] = new
        cloth.move[vertex] = changed_leeway(old, new, cloth.move[vertex])

    return take_leeway


@functools.cache
def leeway_kernels(precision: str, terms: Terms) -> SimpleNamespace:
    """Kernels ``bound_folds``, where cloth bends, ``find_leeway`` and ``take_leeway``."""
    return SimpleNamespace(
        bound_folds=_bound_folds_kernel(precision, terms),
        find_leeway=_find_leeway_kernel(precision, terms),
        take_leeway=_take_leeway_kernel(precision),
    )
