"""A garment as loaded, with what a model needs of it: what may be made in any process, as it needs no Warp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.garment.rest import RestShape
from warp_cloth.kernels.base.options import Terms


@dataclass(frozen=True, eq=False)
class GarmentPart:
    """One garment as it enters the model: where it starts, its constants, its pins."""

    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    rest: RestShape
    pins: Indices  # pinned vertices

    @cached_property
    def box(self) -> tuple[Points, Points]:
        """Lowest and highest corner of where it starts [m], each shape [3]; asked for several times in a batch."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @cached_property
    def terms(self) -> Terms:
        """What acts in it."""
        rest = self.rest
        return Terms(
            edges=bool(rest.edge_pull.any() or rest.edge_push.any()),
            folds=bool(rest.hinge_stiffness.any()),
            yarns=rest.yarns is not None,
            angles=rest.hinge_angle is not None and bool(rest.hinge_angle[rest.hinge_stiffness > 0.0].any()),
            pins=len(self.pins) > 0,
        )


def terms_of(parts: Sequence[GarmentPart]) -> Terms:
    """What acts in these garments."""
    return Terms(*(any(each) for each in zip(*(part.terms for part in parts), strict=True)))
