"""Energies of tension, yarns, bending and of both frictions: forces are minus their gradient.

The certificate reports them. They are apart from the forces because + - * / here are Warp's own, of one value.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.options import ShearSliderField


@wp.func
def tension_energy(stretch: Any, pull: Any, push: Any):
    """Energy of an edge [J], E = k/3 |s|^3, whose gradient is ``tension_force``; of a yarn per area times stiffness."""
    stiffness = wp.where(stretch > type(stretch)(0.0), pull, push)
    return stiffness * stretch * stretch * wp.abs(stretch) / type(stretch)(3.0)


@wp.func
def yarn_energy(yarn: Any, pull: Any, push: Any):
    """Energy of a yarn [J], E = K A / 3 | |t| - 1 |^3, with t the vector that a unit of cloth along it has become."""
    return tension_energy(wp.length(yarn) - type(pull)(1.0), pull, push)


@wp.func
def bending_energy(normal_0: Any, normal_1: Any, stiffness: Any):
    """Energy of a hinge [J], E = C (|theta| - sin |theta|), of which ``hinge_torque`` is minus the derivative.

    Near flat the difference is taken from its series, which keeps its digits.
    """
    one = type(stiffness)(1.0)
    angle = type(stiffness)(2.0) * wp.atan2(wp.length(normal_0 - normal_1), wp.length(normal_0 + normal_1))
    square = angle * angle
    series = one - square / type(stiffness)(42.0) * (one - square / type(stiffness)(72.0))
    excess = angle * square / type(stiffness)(6.0) * (one - square / type(stiffness)(20.0) * series)
    if angle > type(stiffness)(0.1):
        excess = angle - wp.sin(angle)
    return stiffness * excess


@wp.func
def slider_energy(normal_0: Any, normal_1: Any, moment: Any, steepness: Any):
    """Potential of a hinge's friction [J], of which ``friction_torque`` is minus the derivative by the angle a.

    Up to the fold e = 1 / ``steepness``, 2 sin(a / 2) = e, it is m / e 8 sin^2(a / 4); beyond it m per angle more.
    """
    zero, one, half = type(moment)(0.0), type(moment)(1.0), type(moment)(0.5)
    angle = type(moment)(2.0) * wp.atan2(wp.length(normal_0 - normal_1), wp.length(normal_0 + normal_1))
    slipping = type(moment)(2.0) * wp.asin(wp.min(half / steepness, one))
    sine = wp.sin(type(moment)(0.25) * wp.min(angle, slipping))
    clinging = type(moment)(8.0) * moment * steepness * sine * sine
    return clinging + moment * wp.max(angle - slipping, zero)


@wp.func
def shear_slider_energy(weft: Any, warp: Any, slider: Any):
    """Potential of the friction of a triangle's yarns [J], W(g) of ``shear_hysteresis``."""
    friction, steepness = slider[ShearSliderField.FRICTION], slider[ShearSliderField.STEEPNESS]
    change, half = wp.abs(wp.dot(weft, warp) - slider[ShearSliderField.LAID]), type(friction)(0.5)
    clinging = wp.min(change, type(friction)(1.0) / steepness)
    return friction * (half * steepness * clinging * clinging + (change - clinging))
