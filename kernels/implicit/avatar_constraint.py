"""Stick and slip on the avatar within an implicit step: contact detection and Coulomb friction's cone."""

from typing import Any

import warp as wp

from warp_cloth.kernels.implicit.system import FIXED, FREE, SLIDING
from warp_cloth.kernels.math.symmetric import symmetric_times

# Up to this far above the contact offset a vertex that the force presses onto the avatar counts as in contact; one on
# which contact acted in the last step, up to CLOSE_AFTER_CONTACT: a field's distance and its slope agree no better.
CLOSE = wp.constant(2.0e-5)  # [m]
CLOSE_AFTER_CONTACT = wp.constant(1.0e-3)  # [m]

# A vertex that moved by less in the last step sticks [m].
STICKS = wp.constant(1.0e-7)


@wp.func
def close(gap: Any, in_contact: wp.uint8):
    """Whether the gap [m] to the contact offset is small; less so where contact acted in the last step."""
    return gap < type(gap)(CLOSE) or (gap < type(gap)(CLOSE_AFTER_CONTACT) and in_contact != wp.uint8(0))


@wp.func
def presses(force: Any, normal: Any, gap: Any, block: Any):
    """Whether the normal force closes the gap against the vertex's own stiffness: -n . F > gap (n . block n).

    What is balanced a little above the surface is not constrained: it would be drawn down and let go for ever.
    """
    return -wp.dot(force, normal) > wp.max(gap, type(gap)(0.0)) * wp.dot(normal, symmetric_times(block, normal))


@wp.func
def stick_or_slip(force: Any, normal: Any, friction: Any, displacement: Any):
    """Constraint of a vertex on the avatar, the force that friction leaves [N], and its drag [N/m].

    Outside the friction cone, |F_t| > friction |F_n|, friction takes all it can: F_t (1 - friction |F_n| / |F_t|).
    Inside, a vertex that stood sticks; one that slid by d in the last step is slowed by a drag, friction |F_n| / d
    times how far it slides in this one.
    """
    constraint = int(FREE)
    left = force
    drag = type(friction)(0.0)
    normal_force = -wp.dot(force, normal)
    if normal_force > type(friction)(0.0):
        tangent = force + normal * normal_force
        size = wp.length(tangent)
        excess = size - friction * normal_force
        slid = wp.length(displacement - normal * wp.dot(displacement, normal))
        constraint = int(FIXED)
        left = type(force)()
        if excess > type(friction)(0.0):
            constraint = int(SLIDING)
            left = tangent * (excess / size)
        elif slid > type(friction)(STICKS):
            constraint = int(SLIDING)
            left = tangent
            drag = friction * normal_force / slid
    return constraint, left, drag
