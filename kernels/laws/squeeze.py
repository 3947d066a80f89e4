"""Squeezed cloth: two pieces of cloth nearer than their thickness h push each other apart.

    E = m h^2 (1/x + 3 x - x^2 - 3) = m h^2 y^3 / x,  x = d / h,  y = 1 - x

Zero with zero slope and curvature at x = 1, without bound towards x = 0. As products, which lose no digits near x = 1
where y is known as well. ``modulus`` is m [N/m], ``inverse`` 1/x.
"""

from typing import Any

import warp as wp


@wp.func
def squeeze_energy(y: Any, inverse: Any, thickness: Any, modulus: Any):
    """Energy [J], E = m h^2 y^3 / x."""
    return modulus * thickness * thickness * (y * y * y * inverse)


@wp.func
def squeeze_force(y: Any, inverse: Any, thickness: Any, modulus: Any):
    """Force [N] that pushes them apart, -dE/dd = m h (1/x^2 - 3 + 2 x) = m h (y/x)^2 (3 - 2 y)."""
    steep = y * inverse
    return modulus * thickness * (steep * steep * (type(y)(3.0) - type(y)(2.0) * y))


@wp.func
def squeeze_stiffness(inverse: Any, modulus: Any):
    """Stiffness [N/m], d2E/dd2 = 2 m (1/x^3 - 1)."""
    return type(modulus)(2.0) * modulus * (inverse * inverse * inverse - type(modulus)(1.0))
