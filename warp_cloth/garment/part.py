"""A garment as loaded, with what a model needs of it: what may be made in any process, as it needs no Warp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from warp_cloth.garment.rest import RestShape
from warp_cloth.kernels.limits import Terms
from warp_cloth.mesh import Indices, Points


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


def terms_of(parts: Sequence[GarmentPart]) -> Terms:
    """What acts in these garments."""
    rests = [part.rest for part in parts]
    return Terms(
        edges=any(bool(rest.edge_pull.any() or rest.edge_push.any()) for rest in rests),
        folds=any(bool(rest.hinge_stiffness.any()) for rest in rests),
        threads=any(rest.weave is not None for rest in rests),
        angles=any(bool(rest.fold_angle[rest.hinge_stiffness > 0.0].any()) for rest in rests),
        pins=any(len(part.pins) > 0 for part in parts),
    )
