"""Coulomb friction as a limit on displacement; serves the avatar and cloth on cloth alike."""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.real import inner, quotient, root, scaled_sum


@wp.func
def friction_slide(displacement: Any, normal: Any, push: Any, friction: Any):
    """Displacement [m] after friction: its tangential part shortened by friction times the push, at most to nothing.

    ``push`` is how far contact moved the point along ``normal`` in this step [m] (the paper, section 5).
    """
    along = normal * inner(displacement, normal)
    tangent = displacement - along
    slide = root(inner(tangent, tangent))
    kept = wp.max(slide - friction * push, type(push)(0.0))
    return scaled_sum(tangent, wp.where(slide > type(push)(0.0), quotient(kept, slide), type(push)(0.0)), along)


@wp.func
def friction_residual(force: Any, normal: Any, friction: Any):
    """What is left of a force [N] after contact took its push into the surface and friction up to its cone."""
    push = wp.max(-wp.dot(force, normal), type(friction)(0.0))
    left = wp.length(force)
    if push > type(friction)(0.0):
        left = wp.max(wp.length(force + normal * push) - friction * push, type(friction)(0.0))
    return left
