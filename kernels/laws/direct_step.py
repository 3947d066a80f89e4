"""The paper's own rule for a vertex's step (section 4): total force, capped slightly above gravity, moves the vertex.

Apart from ``step``, as / here is Warp's own division.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.laws.step import capped


@wp.func
def direct_displacement(force: Any, weight: Any, cap: Any):
    """Displacement [m] by the paper's rule: total force, capped slightly above gravity, added to the position.

    capped(f, 1.1 w) cap / (1.1 w): a force of 1.1 weights w is "slightly larger than gravity" and moves by ``cap``.
    """
    limit = type(weight)(1.1) * weight
    return capped(force, limit) * (cap / limit)
