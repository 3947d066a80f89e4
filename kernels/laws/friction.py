"""Coulomb friction, stick and slip, as a limit on displacement; for the avatar and for cloth on cloth alike."""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call
from warp_cloth.kernels.math.real import inner, root, scaled_sum


@wp.func
def friction_slide(displacement: Any, normal: Any, push: Any, friction: Any):
    """Displacement [m] after friction: d_n + d_t max(|d_t| - friction push, 0) / |d_t|.

    Its tangential part d_t is shortened by friction times the push, at most to nothing. ``push`` is how far contact
    moved the point along ``normal`` in this step [m] (the paper, section 5).
    """
    zero = type(push)(0.0)
    along = normal * inner(displacement, normal)
    tangent = displacement - along
    slide = root(inner(tangent, tangent))
    left = wp.max(slide - friction * push, zero)
    return scaled_sum(tangent, wp.where(slide > zero, left / slide, zero), along)


@wp.func
def friction_residual(force: Any, normal: Any, friction: Any):
    """What is left of a force [N] after contact took its push into the surface and friction up to its cone.

    max(|f + n p| - friction p, 0), with p = max(-f . n, 0) the push; |f| where the force does not push.
    """
    zero = type(friction)(0.0)
    push = wp.max(-wp.dot(force, normal), zero)
    left = wp.length(force)
    if push > zero:
        left = wp.max(wp.length(force + normal * push) - friction * push, zero)
    return left
