"""Stick and slip on the avatar within an implicit step: contact detection and Coulomb friction's cone."""

import functools

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.implicit.system import FIXED, FREE, SLIDING
from warp_cloth.kernels.math.symmetric import symmetric_times

# Up to this far above the contact offset a vertex that the force presses onto the avatar counts as in contact; one on
# which contact acted in the last step, up to CLOSE_AFTER_CONTACT: a field's distance and its slope agree no better.
CLOSE = wp.constant(2.0e-5)  # [m]
CLOSE_AFTER_CONTACT = wp.constant(1.0e-3)  # [m]

# A vertex that moved by less in the last step sticks [m].
STICKS = wp.constant(1.0e-7)


@functools.cache
def close_function(precision: str) -> wp.Function:
    """The function ``close``: whether a vertex is near enough to the contact offset to be in contact."""
    real = cloth_types(precision).real

    @wp.func
    def close(gap: real, in_contact: wp.uint8):
        """Whether the gap [m] to the contact offset is small; less so where contact acted in the last step."""
        return gap < real(CLOSE) or (gap < real(CLOSE_AFTER_CONTACT) and in_contact != wp.uint8(0))

    return close


@functools.cache
def presses_function(precision: str) -> wp.Function:
    """The function ``presses``: whether the force on a vertex takes it to the avatar's surface."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3
    vec6 = cloth_types(precision).vec6

    @wp.func
    def presses(force: vec3, normal: vec3, gap: real, block: vec6):
        """Whether the normal force closes the gap against the vertex's own stiffness: -n . F > gap (n . block n).

        What is balanced a little above the surface is not constrained: it would be drawn down and let go for ever.
        """
        return -wp.dot(force, normal) > wp.max(gap, real(0.0)) * wp.dot(normal, symmetric_times(block, normal))

    return presses


@functools.cache
def stick_or_slip_function(precision: str) -> wp.Function:
    """The function ``stick_or_slip``: what the avatar leaves of a vertex's freedom and of the force on it."""
    real, vec3 = cloth_types(precision).real, cloth_types(precision).vec3

    @wp.func
    def stick_or_slip(force: vec3, normal: vec3, friction: real, displacement: vec3):
        """Constraint of a vertex on the avatar, the force that friction leaves [N], and its drag [N/m].

        Outside the friction cone, |F_t| > friction |F_n|, friction takes all it can: F_t (1 - friction |F_n| / |F_t|).
        Inside, a vertex that stood sticks; one that slid by d in the last step is slowed by a drag, friction |F_n| / d
        times how far it slides in this one.
        """
        constraint = int(FREE)
        left = force
        drag = real(0.0)
        normal_force = -wp.dot(force, normal)
        if normal_force > real(0.0):
            tangent = force + normal * normal_force
            size = wp.length(tangent)
            excess = size - friction * normal_force
            slid = wp.length(displacement - normal * wp.dot(displacement, normal))
            constraint = int(FIXED)
            left = vec3()
            if excess > real(0.0):
                constraint = int(SLIDING)
                left = tangent * (excess / size)
            elif slid > real(STICKS):
                constraint = int(SLIDING)
                left = tangent
                drag = friction * normal_force / slid
        return constraint, left, drag

    return stick_or_slip
