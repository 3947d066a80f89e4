"""A garment as loaded: initial positions, rest shape, pins. It needs no Warp, so any process can build it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.garment.rest import RestShape
from warp_cloth.kernels.base.options import Terms


@dataclass(frozen=True, eq=False)
class Garment:
    """One garment as it enters the model: initial positions, constants, pins."""

    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    rest: RestShape
    pins: Indices  # pinned vertices

    @cached_property
    def box(self) -> tuple[Points, Points]:
        """Lowest and highest corner of its initial bounding box [m], each shape [3]."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @cached_property
    def terms(self) -> Terms:
        """The terms of the model that act in it."""
        rest = self.rest
        return Terms(
            edges=bool(rest.edge_pull.any() or rest.edge_push.any()),
            folds=bool(rest.hinge_stiffness.any()),
            yarns=rest.yarns is not None,
            angles=rest.hinge_angle is not None and bool(rest.hinge_angle[rest.hinge_stiffness > 0.0].any()),
            pins=len(self.pins) > 0,
            hysteresis=rest.hinge_slider is not None and bool(rest.hinge_slider[rest.hinge_stiffness > 0.0, 0].any()),
            shear_hysteresis=rest.yarns is not None and rest.yarns.friction > 0.0,
        )


def terms_of(garments: Sequence[Garment]) -> Terms:
    """The terms of the model that act in any of these garments."""
    return Terms(*(any(each) for each in zip(*(garment.terms for garment in garments), strict=True)))
