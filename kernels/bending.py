"""Bending of a hinge: the paper's cosine law (section 2.2 b, equations 1 to 3) on the wings, completed on the axis.

E = C (|theta| - sin |theta|); torque C (1 - cos theta) back to flat, largest at 180 degrees. No inverse trigonometry.
"""

from typing import Any

import warp as wp


@wp.func
def hinge_fold(axis: Any, wing_0: Any, wing_1: Any):
    """Unit normals of the two triangles and twice their areas [m2]; zero normals where a triangle has no area.

    All three arguments are relative to the axis' first vertex [m]. Flat cloth has equal normals.
    """
    normal_0 = wp.cross(axis, wing_0)
    normal_1 = wp.cross(wing_1, axis)
    return wp.normalize(normal_0), wp.normalize(normal_1), wp.length(normal_0), wp.length(normal_1)


# A triangle thinner than this share of its axis has no usable direction, and 1 / d no bound: as it collapses the
# hinge's torque fades with it, for both wings alike, so that forces stay balanced and bounded.
THINNEST = wp.constant(1.0e-3)


@wp.func
def thinness(area: Any, axis: Any):
    """Share of a hinge's torque that a triangle of twice this area bears: 1 but for collapsed ones."""
    return wp.min(area / (type(area)(THINNEST) * wp.dot(axis, axis)), type(area)(1.0))


@wp.func
def hinge_torque(normal_0: Any, normal_1: Any, axis: Any, stiffness: Any):
    """Signed torque [N m] that unfolds the hinge: C (1 - cos theta), sign from (n0 x n1) . axis.

    1 - cos theta is taken as |n0 - n1|^2 / 2, which keeps its digits where the hinge is nearly flat.
    """
    difference = normal_0 - normal_1
    torque = stiffness * type(stiffness)(0.5) * wp.dot(difference, difference)
    return wp.where(wp.dot(wp.cross(normal_0, normal_1), axis) < type(stiffness)(0.0), -torque, torque)


@wp.func
def hinge_forces(axis: Any, wing_0: Any, wing_1: Any, stiffness: Any):
    """Forces [N] on both wings and on the axis' second vertex; the first vertex takes minus their sum.

    On a wing: torque / distance from the axis, along the triangle's normal (equation 3). On the axis: the wings'
    forces shared by the feet of their perpendiculars, so that neither a net force nor a net torque is left.
    """
    zero = type(stiffness)(0.0)
    normal_0, normal_1, area_0, area_1 = hinge_fold(axis, wing_0, wing_1)
    force_0 = wing_0 * zero
    force_1 = wing_0 * zero
    force_axis = wing_0 * zero
    if area_0 > zero and area_1 > zero:
        length = wp.length(axis)
        torque = hinge_torque(normal_0, normal_1, axis, stiffness) * thinness(area_0, axis) * thinness(area_1, axis)
        force_0 = normal_0 * (torque * length / area_0)
        force_1 = normal_1 * (torque * length / area_1)
        scale = type(stiffness)(1.0) / (length * length)
        foot_0 = wp.dot(wing_0, axis) * scale
        foot_1 = wp.dot(wing_1, axis) * scale
        force_axis = -(force_0 * foot_0 + force_1 * foot_1)
    return force_0, force_1, force_axis


@wp.func
def hinge_energy(axis: Any, wing_0: Any, wing_1: Any, stiffness: Any):
    """Energy [J], E = C (|theta| - sin |theta|), of which ``hinge_forces`` are minus the gradient.

    Near flat the difference is taken from its series, which keeps its digits.
    """
    normal_0, normal_1, area_0, area_1 = hinge_fold(axis, wing_0, wing_1)
    one = type(stiffness)(1.0)
    angle = type(stiffness)(2.0) * wp.atan2(wp.length(normal_0 - normal_1), wp.length(normal_0 + normal_1))
    square = angle * angle
    series = one - square / type(stiffness)(42.0) * (one - square / type(stiffness)(72.0))
    excess = angle * square / type(stiffness)(6.0) * (one - square / type(stiffness)(20.0) * series)
    if angle > type(stiffness)(0.1):
        excess = angle - wp.sin(angle)
    return wp.where(
        area_0 > type(stiffness)(0.0) and area_1 > type(stiffness)(0.0),
        stiffness * excess,
        stiffness * type(stiffness)(0.0),
    )


@wp.func
def hinge_stiffness_bound(axis: Any, wing_0: Any, wing_1: Any, stiffness: Any, reach: Any):
    """Bound of a hinge's stiffness [N/m] at any of its vertices while these move by no more than ``reach`` [m].

    C (|sin theta| + angle that ``reach`` can add) (1 / h0 + 1 / h1)^2, with |sin theta| <= |n0 - n1|.
    """
    zero = type(stiffness)(0.0)
    normal_0, normal_1, area_0, area_1 = hinge_fold(axis, wing_0, wing_1)
    bound = zero
    if area_0 > zero and area_1 > zero:
        thinnest = type(stiffness)(THINNEST) * wp.dot(axis, axis)
        inverse = type(stiffness)(1.0) / wp.max(area_0, thinnest) + type(stiffness)(1.0) / wp.max(area_1, thinnest)
        per_height = wp.length(axis) * inverse
        fold = wp.min(wp.length(normal_0 - normal_1) + reach * per_height, type(stiffness)(2.0))
        bound = stiffness * fold * per_height * per_height
    return bound
