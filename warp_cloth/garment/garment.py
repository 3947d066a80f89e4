"""A garment as loaded: initial positions, rest shape, pins. It needs no Warp, so any process can build it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.garment.rest import RestShape, in_another_fabric
from warp_cloth.kernels.base.options import Terms
from warp_cloth.material.fabric import Fabric


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

    @property
    def is_modelled(self) -> bool:
        """Whether it was modelled in 3-D, so that its mesh is its rest shape and there is nothing to sew."""
        return self.rest.source.kind == "mesh"

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


def garments_in(fabric: Fabric, garments: Sequence[Garment], cache: Cache) -> tuple[Garment, ...]:
    """The garments in this fabric; what follows from cut and fabric is kept in ``cache``, for every body and attempt.

    Raises:
        ValueError: the panels of a garment are not known.
    """

    def within(garment: Garment) -> Garment:
        rest = garment.rest
        make = partial(in_another_fabric, rest, len(garment.points), fabric)
        sources = rest.topology, rest.edge_length
        return replace(garment, rest=cache.get_or_make("in another fabric", sources, make, fabric))

    return tuple(map(within, garments))
