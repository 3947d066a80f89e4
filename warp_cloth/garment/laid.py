"""What cloth with friction was laid into: the folds and shears that it counts as kept, and so the band it rests in."""

from __future__ import annotations

from dataclasses import replace

from warp_cloth.base.mesh import Points
from warp_cloth.garment.folds import fold_angles
from warp_cloth.garment.rest import RestShape
from warp_cloth.material.hysteresis import Laid, slid, slid_shear

HUNG = 3.0  # times its weight under which cloth hangs before it is let down


def laid_by(rest: RestShape, points: Points) -> Laid | None:
    """What a garment counts as laid into once it has rested in this shape; None: it has no friction."""
    fold, shear = None, None
    if rest.hinge_slider is not None:
        laid = rest.fold_angle if rest.hinge_laid is None else rest.hinge_laid
        fold = slid(laid, fold_angles(points, rest.topology), rest.hinge_slider)
    if rest.yarns is not None and rest.yarns.friction > 0.0:
        shear = slid_shear(rest.yarns, rest.yarns.sheared(points))
    return None if fold is None and shear is None else Laid(fold, shear)


def laid_into(rest: RestShape, laid: Laid | None) -> RestShape:
    """The rest shape of a garment that was laid into this; None: as it is."""
    if laid is None:
        return rest
    yarns = None if rest.yarns is None else replace(rest.yarns, laid=laid.shear)
    return replace(rest, hinge_laid=laid.fold, yarns=yarns)
