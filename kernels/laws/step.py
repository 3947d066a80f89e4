"""One vertex's step: force, cap, displacement (the paper, section 4); ``direct_step`` is the paper's own rule.

This is gradient descent on the energy within a trust region, the cap; ``accelerated`` adds a step size of each vertex's
own (force over a stiffness bound) and momentum. All functions take one vertex or a packet of eight.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import maximum, minimum, where_greater
from warp_cloth.kernels.math.real import inner, root, scaled_sum


@wp.func
def capped(force: Any, limit: Any):
    """The vector, or where it is longer than the limit one of that length in its direction: f min(1, limit / |f|)."""
    size = root(inner(force, force))
    longest = type(size)(limit)
    return force * where_greater(size, longest, longest / size, type(size)(1.0))


@wp.func
def step_stiffness(bound: Any, weight: Any, last: Any, cap: Any, memory: Any):
    """Stiffness [N/m] that a step goes by, and its ratio to the last one's, at most 1.

    k = max(bound + w / cap, memory k_last): what bounds the cloth's stiffness, what keeps a free fall within the cap,
    and no sudden drop from the last step's ``last``.
    """
    stiffness = maximum(bound + weight / type(weight)(cap), last * memory)
    return stiffness, minimum(last / stiffness, type(last)(1.0))


@wp.func
def accelerated_displacement(force: Any, descent: Any, last: Any, momentum: Any, damping: Any, cap: Any):
    """Displacement [m]: descent + m last, capped; ``descent`` is force over stiffness, ``last`` the last displacement.

    m is ``momentum``, times ``damping`` where the last displacement points against the force.
    """
    zero = type(momentum)(0.0)
    kept = where_greater(zero, inner(last, force), momentum * damping, momentum)
    return capped(scaled_sum(last, kept, descent), cap)
