"""Friction between yarns that cross (KES 2HG): a spring and a slider in each woven triangle, over its shear.

    W'(g) = A h min(|g - g0| / e, 1) sign(g - g0)        g = u . v

u and v are what units of cloth along weft and warp have become: g is the sine of the shear angle, but for the yarns'
stretch. h is the friction per width, half of the loop's width 2HG (Kawabata, The Standardization and Analysis of Hand
Evaluation, 1980): a force per width times an angle is energy per area. Yarns cling up to the shear e, then slip. g0 is
the shear that the cloth was laid into, which stays during an iteration, as in ``hysteresis``: so W is a potential.

With the biases p = (u + v) / 2^(1/2) and q = (u - v) / 2^(1/2), g is (|p|^2 - |q|^2) / 2. So friction is a tension W' p
of one bias and -W' q of the other, and enters where the yarns' own tension does. What rotates is not sheared: neither
a net force nor a torque is left.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import ShearSliderField, Yarn
from warp_cloth.kernels.laws.hysteresis import slider_stiffness
from warp_cloth.kernels.math.operators import add, div, mul, sub  # noqa: F401  what + - * / below call for packets
from warp_cloth.kernels.math.packet import vector4
from warp_cloth.kernels.math.real import inner


@wp.func
def shear_friction(weft: Any, warp: Any, slider: Any):
    """W'(g) of a triangle [J], and the stiffness of a quadratic that lies above W and touches it there [J]."""
    change = inner(weft, warp) - slider[ShearSliderField.LAID]
    stiffness = slider_stiffness(wp.abs(change), slider[ShearSliderField.FRICTION], slider[ShearSliderField.STEEPNESS])
    return stiffness * change, stiffness


@wp.func
def shear_friction_tension(weft: Any, warp: Any, square: Any, slider: Any):
    """What friction adds to ``yarn_tension`` of the four yarns: tension over length and bound of stiffness, both [J].

    ``square`` is |t|^2 of the yarns. (p . dp - q . dq)^2 is at most twice the sum of both squares, and equal to that
    where the cloth is only sheared.
    """
    friction, stiffness = shear_friction(weft, warp, slider)
    zero, along, across = type(friction)(0.0), type(friction)(2.0) * stiffness, wp.abs(friction)
    on_plus, on_minus = along * square[Yarn.PLUS] + across, along * square[Yarn.MINUS] + across
    return vector4(zero, zero, friction, -friction), vector4(zero, zero, on_plus, on_minus)
