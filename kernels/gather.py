"""Forces by a kernel per triangle (its folds) and a kernel per vertex that sums what meets there in a fixed order.

For CUDA: no atomics, so the same input gives the same bits however the launch is scheduled. A triangle t with unit
normal n adds to its corner i the bending force n (q_jk - (1 - s_k) q_ij - s_j q_ki), where q is a side's torque over
the triangle's height above it, and s_k, s_j are the feet of the perpendiculars from the other corners on i's sides.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.bending import hinge_fold, hinge_stiffness_bound, hinge_torque, thinness
from warp_cloth.kernels.cloth import cloth_types, difference_function
from warp_cloth.kernels.tension import edge_drag, tension_force, tension_stiffness


@functools.cache
def gather_kernels(precision: str, fourth: str, bending: bool) -> SimpleNamespace:
    """Kernels ``fold_triangles`` and ``gather_forces``; the second reads folds only where there is bending.

    ``fourth`` is one of cloth.FOURTH_PARTS.
    """
    types = cloth_types(precision)
    real, point, vec3, vec4 = types.real, types.point, types.vec3, types.vec4
    Cloth, EdgeRows, Folds, FoldRows, Step = types.Cloth, types.EdgeRows, types.Folds, types.FoldRows, types.Step
    difference = difference_function(precision)

    @wp.func
    def side_fold(cloth: Cloth, step: Step, start: point, axis: vec3, opposite: vec3, wing: int, stiffness: real):
        """Torque of a side over the triangle's height above it [N], and the hinge's stiffness bound [N/m]."""
        push = real(0.0)
        bound = real(0.0)
        if wing >= 0:
            beyond = difference(cloth.position[wing], start)
            normal_0, normal_1, area_0, area_1 = hinge_fold(axis, opposite, beyond)
            if area_0 > real(0.0) and area_1 > real(0.0):
                torque = hinge_torque(normal_0, normal_1, axis, stiffness)
                torque = torque * thinness(area_0, axis) * thinness(area_1, axis)
                push = torque * wp.length(axis) / area_0
                if wp.static(fourth == "stiffness"):
                    reach = step.reach * wp.length(cloth.move[wing])
                    bound = hinge_stiffness_bound(axis, opposite, beyond, stiffness, reach)
        return push, bound

    @wp.kernel(module="unique", enable_backward=False)
    def fold_triangles(
        cloth: Cloth,
        folds: Folds,
        step: Step,
        fold_out: wp.array(dtype=vec4),  # q of each side [N] and the sum of their bounds [N/m], shape [F]
    ):
        """Bending of the three hinges round each triangle, seen from that triangle."""
        triangle = wp.tid()
        corners = folds.corners[triangle]
        wings = folds.wings[triangle]
        stiffness = folds.stiffness[triangle]
        a = cloth.position[corners[0]]
        b = cloth.position[corners[1]]
        c = cloth.position[corners[2]]
        ab = difference(b, a)
        bc = difference(c, b)
        ca = difference(a, c)
        q_ab, bound_ab = side_fold(cloth, step, a, ab, -ca, wings[0], stiffness[0])
        q_bc, bound_bc = side_fold(cloth, step, b, bc, -ab, wings[1], stiffness[1])
        q_ca, bound_ca = side_fold(cloth, step, c, ca, -bc, wings[2], stiffness[2])
        fold_out[triangle] = vec4(q_ab, q_bc, q_ca, bound_ab + bound_bc + bound_ca)

    @wp.func
    def fold_parts(to_next: vec3, to_last: vec3, q: vec4, corner: int):
        """Parts of a triangle's bending force on its corner, along its normal [N]: opposite, next, last side."""
        q_next = q[corner]
        q_opposite = q[(corner + 1) % 3]
        q_last = q[(corner + 2) % 3]
        along = wp.dot(to_next, to_last)
        foot_last = along / wp.max(wp.dot(to_next, to_next), real(1.0e-30))
        foot_next = along / wp.max(wp.dot(to_last, to_last), real(1.0e-30))
        return vec3(q_opposite, (real(1.0) - foot_last) * q_next, (real(1.0) - foot_next) * q_last)

    @wp.kernel(module="unique", enable_backward=False)
    def gather_forces(
        cloth: Cloth,
        edges: EdgeRows,
        folds: FoldRows,
        fold: wp.array(dtype=vec4),  # from fold_triangles
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums tension over the edges and bending over the triangles that meet at a vertex."""
        vertex = wp.tid()
        here = cloth.position[vertex]
        force = vec3()
        part = real(0.0)
        for row in range(edges.start[vertex], edges.start[vertex + 1]):
            other = edges.other[row]
            law = edges.law[row]
            d = difference(cloth.position[other], here)
            length = wp.length(d)
            if length > real(0.0):
                tension = tension_force(length, law[0], law[1], law[2])
                force += d * (tension / length)
                if wp.static(fourth == "size"):
                    part += wp.abs(tension)
            if wp.static(fourth == "stiffness"):
                change = cloth.move[other] - cloth.move[vertex]
                stiffness = tension_stiffness(length, law[0], law[1], law[2], step.reach * wp.length(change))
                force += edge_drag(change, stiffness, step.viscosity)
                part += stiffness
        if wp.static(bending):
            for row in range(folds.start[vertex], folds.start[vertex + 1]):
                following = folds.following[row]
                to_next = difference(cloth.position[following[0]], here)
                to_last = difference(cloth.position[following[1]], here)
                q = fold[folds.triangle[row]]
                parts = fold_parts(to_next, to_last, q, int(folds.corner[row]))
                force += wp.normalize(wp.cross(to_next, to_last)) * (parts[0] - parts[1] - parts[2])
                if wp.static(fourth == "stiffness"):
                    part += q[3]
                if wp.static(fourth == "size"):
                    part += wp.abs(parts[0]) + wp.abs(parts[1]) + wp.abs(parts[2])
        load_out[vertex] = vec4(force[0], force[1], force[2], part)

    return SimpleNamespace(fold_triangles=fold_triangles, gather_forces=gather_forces)
