"""Friction of every hinge from a fabric and a rest shape: the moment at which the cloth slips, on every mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.material.bending import (
    ROUNDS,
    Balance,
    Folds,
    Rubbing,
    bending_directions,
    border_folds,
    inner_folds,
    near_border,
    within_border,
)
from warp_cloth.material.constants import Sheet, YarnConstants
from warp_cloth.material.laboratory import MATCHED_FOLD, bending_length, rigidity_of_bending
from warp_cloth.material.patch_factors import Fit, Patches

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

Floats = NDArray[np.float64]

# Curvature up to which yarns cling [1/m]: beyond it the friction moment is reached. An assumption, of no published
# value: KES-F bends to 250, so that its loop is closed within a tenth of the stroke.
CLINGING = 10.0
# Fold per curvature that counts at least, of a hinge's height. Those that neither warp nor weft folds would be so steep
# that strips of 20 edges a bending length take 48,000 iterations (0.05) or 13,000 (0.25) for 7,000, and rest alike.
LEAST_FOLD = 0.5


def rubbing_constants(sheet: Sheet, fabric: Fabric, length: Floats) -> tuple[Floats, Floats]:
    """C of every hinge [N m], shape [H], and friction moment [N m] and inverse of the fold that reaches it, [H, 2].

    As ``hinge_constants``; besides, patches bent evenly along the warp, and along the weft, by a curvature more take
    friction times that curvature per area: the sum of moment times fold. Friction keeps hinges from sharing a bend as
    those that are only elastic do. So both are fitted to folds that balance at the curvature to which the cloth's own
    weight bends it, where B was matched.
    """
    folds = inner_folds(sheet, length)
    elastic, friction = (
        _Term.of(sheet, folds, *own)
        for own in (
            (fabric.bending_warp, fabric.bending_weft),
            (fabric.bending_friction_warp, fabric.bending_friction_weft),
        )
    )
    usual = elastic.usual * folds.size, friction.usual * folds.size * folds.across**2
    fixed = near_border(sheet)
    within = np.asarray(~fixed[sheet.topology.hinges].any(axis=1))
    patches, balance = Patches(sheet, len(fixed)), Balance(sheet, folds, fixed)
    fits = [Fit(patches, own, elastic.lean) for own in usual]
    evens = [folds.evenly(bend) for bend in elastic.bends]
    biased = [folds.evenly(angle * np.pi) for angle in (0.25, 0.75)] if sheet.directed else []
    curvature = MATCHED_FOLD / bending_length(rigidity_of_bending(fabric.bending, fabric.weight), fabric.weight)
    displacements = np.zeros((len(evens), len(fixed)))
    scales = [_scales(sheet, length, folds, elastic.bends, patches, power) for power in (3, 1)]
    # a grid's diagonals fold along the biases alone: yarns cling up to the same curvature in these, too
    bias = np.max(np.abs(biased), axis=0) if biased else np.zeros_like(folds.across)
    largest = np.maximum(np.max(np.abs(evens), axis=0), bias)
    for rounds in ROUNDS:
        largest = np.maximum(largest, LEAST_FOLD * folds.across)
        rubbing = Rubbing(fits[1].stiffness / curvature**2, CLINGING * largest / curvature)
        balanced = [
            balance.folded(fits[0].stiffness, even, displacement, rounds, rubbing).copy()  # which it uses again
            for even, displacement in zip(evens, displacements, strict=True)
        ]
        largest = np.where(within, np.maximum(np.max(np.abs(balanced), axis=0), bias), largest)
        for fit, term, power, scale in zip(fits, (elastic, friction), (3, 1), scales, strict=True):
            counted = np.where(within, fit.stiffness, 0.0)
            works, eases = [], []
            for even, own in zip(evens, balanced, strict=True):
                stiff, eased = (np.abs(each) ** power for each in (even, own))
                total = float(np.sum(stiff * counted))
                eases.append(float(np.sum(eased * counted)) / total if total > 0.0 else 1.0)
                works.append(within_border(eases[-1], within, eased, stiff) if total > 0.0 else stiff)
            if biased:  # they count a little
                works.append(np.mean(eases) * np.mean([np.abs(own) ** power for own in biased], axis=0))
            fit.improve(works, scale, term.wanted)
    clinging = CLINGING * np.maximum(largest, LEAST_FOLD * folds.across)
    return fits[0].stiffness, np.column_stack([fits[1].stiffness, 1.0 / clinging])


@dataclass(frozen=True, eq=False)
class _Term:
    """What patches should resist, by ``bending_directions``; along the biases the mean of warp and weft."""

    wanted: list[float]
    bends: list[Floats]
    lean: Floats
    usual: Floats

    @staticmethod
    def of(sheet: Sheet, folds: Folds, warp: float, weft: float) -> _Term:
        largest = max(warp, weft) if sheet.directed else float(np.sqrt(warp * weft))
        wanted, bends, lean, usual = bending_directions(sheet, folds, (warp, weft), largest)
        return _Term([*wanted, 0.5 * sum(wanted)] if sheet.directed else wanted, bends, lean, usual)


def _scales(
    sheet: Sheet, length: Floats, folds: Folds, bends: list[Floats], patches: Patches, power: int
) -> list[Floats]:
    """Factors that make patch sums of constant times |fold|^power densities, one for each of ``wanted``, shape [V]."""
    border, ends = border_folds(sheet, length)
    scales = []
    for bend in bends:
        direction = float(bend[0]) if np.ptp(bend) == 0.0 else border.angle + float((bend - folds.angle)[0])
        half = 0.5 * _size(border, power) * np.abs(border.evenly(direction)) ** power
        beyond = np.asarray(np.bincount(ends.ravel(), np.repeat(0.5 * half, 2), patches.count), float)
        scales.append(patches.scale((np.abs(folds.evenly(bend)) ** power, _size(folds, power)), beyond))
    return [*scales, np.mean(scales, axis=0)] if sheet.directed else scales


def _size(folds: Folds, power: int) -> Floats:
    """What a hinge's constant is proportional to: size for stiffness, axis for friction."""
    return folds.size if power == 3 else folds.size * folds.across**2


@dataclass(frozen=True, eq=False)
class Laid:
    """What a piece of cloth with friction was laid into; None: as at rest."""

    fold: Floats | None = None  # angle of every hinge [rad], shape [H]
    shear: Floats | None = None  # of every woven triangle (kernels.laws.shear_hysteresis), shape [T]


def slid(laid: Floats, angle: Floats, slider: Floats) -> Floats:
    """Angles that hinges count as laid into once they stay at ``angle`` [rad]: those that slipped follow. Shape [H].

    The friction torque there is the same as before, so that a shape at rest stays so.
    """
    cling = 2.0 * np.arcsin(np.minimum(0.5 / np.maximum(slider[:, 1], 0.5), 1.0))
    change = (angle - laid + np.pi) % (2.0 * np.pi) - np.pi
    return np.where(np.abs(change) <= cling, laid, angle - np.copysign(cling, change))


def slid_shear(yarns: YarnConstants, shear: Floats) -> Floats:
    """Likewise the shears that woven triangles count as laid into once they stay at ``shear``, shape [T]."""
    laid = 0.0 if yarns.laid is None else yarns.laid
    change = shear - laid
    return np.where(np.abs(change) <= yarns.clinging, laid, shear - np.copysign(yarns.clinging, change))
