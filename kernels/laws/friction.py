"""Coulomb friction, stick and slip, as a limit on displacement; for the avatar and for cloth on cloth alike."""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call
from warp_cloth.kernels.math.real import inner, root, scaled_sum


@wp.func
def friction_slide(displacement: Any, normal: Any, depth: Any, friction: Any):
    """Displacement [m] after friction: d_n + d_t max(|d_t| - friction depth, 0) / |d_t|.

    Its tangential part d_t is shortened by friction times the depth, at most to nothing. ``depth`` is how far contact
    moved the point along ``normal`` in this step [m] (the paper, section 5).
    """
    zero = type(depth)(0.0)
    along = normal * inner(displacement, normal)
    tangent = displacement - along
    slide = root(inner(tangent, tangent))
    left = wp.max(slide - friction * depth, zero)
    return scaled_sum(tangent, wp.where(slide > zero, left / slide, zero), along)


@wp.func
def friction_residual(force: Any, normal: Any, friction: Any):
    """What is left of a force [N] after contact took the normal force and friction up to its cone.

    max(|f + n p| - friction p, 0), with p = max(-f . n, 0) the normal force; |f| where there is none.
    """
    zero = type(friction)(0.0)
    normal_force = wp.max(-wp.dot(force, normal), zero)
    left = wp.length(force)
    if normal_force > zero:
        left = wp.max(wp.length(force + normal * normal_force) - friction * normal_force, zero)
    return left
