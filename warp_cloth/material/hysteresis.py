"""Friction of every hinge from a fabric and a rest shape: the moment at which the cloth slips, on every mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.material.bending import (
    ROUNDS,
    Balance,
    Folds,
    bending_directions,
    border_folds,
    inner_folds,
    near_border,
    within_border,
)
from warp_cloth.material.constants import Sheet
from warp_cloth.material.patch_factors import Fit, Patches

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

Floats = NDArray[np.float64]

# Curvature up to which yarns cling [1/m]: beyond it the friction moment is reached. KES-F's loops rise from the end of
# a stroke within 0.1 to 0.2 per cm of curvature, that is from -m to m within twice this.
CLINGING = 10.0
FITS = 2  # times that factors are improved; the second changes them by less than 1 %


def hinge_sliders(sheet: Sheet, fabric: Fabric, length: Floats, stiffness: Floats) -> Floats | None:
    """Friction moment [N m] and inverse of the fold at which it is reached, of every hinge, shape [H, 2]; None: none.

    Patches bent evenly along the warp, and along the weft, by a curvature more take friction times that curvature per
    area: sum of moment times fold over the hinges, these folded as ``stiffness`` [N m], their C, lets them.
    """
    own = (fabric.bending_friction_warp, fabric.bending_friction_weft)
    largest = max(own) if sheet.directed else float(np.sqrt(own[0] * own[1]))
    folds = inner_folds(sheet, length)
    if largest == 0.0 or not stiffness.any():
        return None
    wanted, bends, lean, usual = bending_directions(sheet, folds, own, largest)
    axis = folds.size * folds.across**2
    fixed = near_border(sheet)
    within = np.asarray(~fixed[sheet.topology.hinges].any(axis=1))
    patches, balance = Patches(sheet, len(fixed)), Balance(sheet, folds, fixed)
    beyond = _beyond(sheet, length, folds, bends, len(fixed))
    counted, works, scales = np.where(within, usual * axis, 0.0), [], []
    for bend, more in zip(bends, beyond, strict=True):
        even = folds.evenly(bend)
        balanced = np.abs(balance.folded(stiffness, even, np.zeros(len(fixed)), ROUNDS[0]))
        even = np.abs(even)
        total = float(np.sum(even * counted))
        ease = float(np.sum(balanced * counted)) / total if total > 0.0 else 1.0
        works.append(within_border(ease, within, balanced, even))
        scales.append(patches.scale((even, axis), more))
    fit = Fit(patches, usual * axis, lean)
    for _ in range(FITS):
        fit.improve(works, scales, wanted)
    return np.column_stack([fit.stiffness, 1.0 / (CLINGING * folds.across)])


def _beyond(sheet: Sheet, length: Floats, folds: Folds, bends: list[Floats], count: int) -> list[Floats]:
    """Half of axis times fold at every vertex, as if the cloth continued beyond the border; per bend [m2], [V]."""
    border, ends = border_folds(sheet, length)
    summed = []
    for bend in bends:
        direction = float(bend[0]) if np.ptp(bend) == 0.0 else border.angle + float((bend - folds.angle)[0])
        half = 0.5 * border.size * border.across**2 * np.abs(border.evenly(direction))
        summed.append(np.asarray(np.bincount(ends.ravel(), np.repeat(0.5 * half, 2), count), float))
    return summed


def slid(laid: Floats, angle: Floats, slider: Floats) -> Floats:
    """Angles that hinges count as laid into once they stay at ``angle`` [rad]: those that slipped follow. Shape [H].

    The friction torque there is the same as before, so that a shape at rest stays so.
    """
    cling = 2.0 * np.arcsin(np.minimum(0.5 / np.maximum(slider[:, 1], 0.5), 1.0))
    change = (angle - laid + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(angle - np.clip(change, -cling, cling))
