"""Friction within bent cloth (KES 2HB): a spring and a slider in each hinge, added to its elastic torque.

    torque m min(|n0 - n1| / e, 1), back to the angle that the cloth was laid into

The friction moment m is reached at the fold e, up to which yarns cling; beyond it they slip. n1 is rotated back by
the laid angle beforehand (``hinge.rotated_back``). Folds are |n0 - n1| = 2 sin(angle / 2): no inverse trigonometry.

The laid angle does not change in an iteration, so that the torque has a potential, every step leads downhill, and rest
is a minimum of energy and of what friction takes on the way from the laid shape: one step of the incremental problem of
rate-independent friction (Mielke). Where folds have only grown on that way, it is the friction of the whole path.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import SliderField
from warp_cloth.kernels.laws.bending import THINNEST
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import component, cross, maximum, minimum, negative, where_greater
from warp_cloth.kernels.math.real import inner, root, scaled_sum, single

_THINNEST = wp.constant(single(THINNEST))
SMALLEST = wp.constant(single(1.0e-12))  # divisor


@wp.func
def slider_stiffness(fold: Any, moment: Any, steepness: Any):
    """Torque of the slider over its fold [N m]; ``steepness`` is 1 / e.

    The slider's potential is concave in the square of the fold. So a quadratic one of this stiffness, which touches it
    here, lies above it everywhere, and a step by it leads downhill however far it goes.
    """
    return moment * minimum(steepness, type(fold)(1.0) / maximum(fold, type(fold)(SMALLEST)))


@wp.func
def friction_torque(
    normal_0: Any,
    inverse_0: Any,
    normal_1: Any,
    inverse_1: Any,
    axis: Any,
    length: Any,
    stiffness: Any,
    slider: Any,
):
    """Torque of friction in a hinge [N m], and a bound of its stiffness [N/m].

    The sign of ``stiffness`` and all arguments before it are those of ``bending.hinge_torque``; where a triangle
    collapses the torque fades likewise. ``slider`` as Edges.hysteresis.
    """
    zero, one = type(stiffness)(0.0), type(stiffness)(1.0)
    difference = scaled_sum(normal_1, where_greater(zero, stiffness, one, -one), normal_0)  # n0 - n1
    fold = root(inner(difference, difference))
    stiff = slider_stiffness(fold, component(slider, SliderField.MOMENT), component(slider, SliderField.STEEPNESS))
    most = one / (type(length)(_THINNEST) * (length * length))
    bounded_0, bounded_1 = minimum(inverse_0, most), minimum(inverse_1, most)
    least = type(fold)(SMALLEST)
    faded = stiff * fold * (bounded_0 / maximum(inverse_0, least)) * (bounded_1 / maximum(inverse_1, least))
    signed = where_greater(zero, inner(cross(difference, normal_0), axis), negative(faded), faded)
    per_height = length * (bounded_0 + bounded_1)
    smaller = minimum(inverse_0, inverse_1)
    return where_greater(smaller, zero, signed, zero), where_greater(
        smaller, zero, stiff * per_height * per_height, zero
    )
