"""One garment of a relaxed scene, with all that was measured of it: what its problems are found in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.model.result import Status

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Indices, Mesh, Points
    from warp_cloth.garment.garment import Garment
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.report.measurements import Measurements
    from warp_cloth.scene import Scene
    from warp_cloth.scene.wearables import GarmentSpec
    from warp_cloth.solver.certificate.certifier import Tolerance
    from warp_cloth.solver.goal import Outcome


@dataclass(frozen=True, eq=False)
class JudgedScene:
    """A relaxed scene and what was measured of it."""

    scene: Scene
    outfit: Outfit
    outcome: Outcome
    measured: Measurements
    tolerance: Tolerance

    @property
    def body(self) -> Mesh | None:
        """The avatar that holds the garments; None where there is none, or they do not touch it."""
        return self.outfit.avatar if self.scene.collision.avatar != "none" else None

    @cached_property
    def falling(self) -> NDArray[np.bool_]:
        """Which vertices of all garments fall past all that could catch them, shape [V]."""
        if self.outcome.status is Status.AT_REST:
            return np.zeros(len(self.outcome.points), dtype=np.bool_)
        outfit = self.outfit if self.body is self.outfit.avatar else replace(self.outfit, avatar=None)
        return outfit.catcher.falling(self.outcome.points)

    @cached_property
    def garments(self) -> tuple[Judged, ...]:
        """The scene's garments, inner to outer."""
        garments = self.outfit.garments
        starts = [
            np.cumsum([0, *counts]).tolist()
            for counts in (
                [len(garment.points) for garment in garments],
                [len(garment.rest.topology.edges) for garment in garments],
                [len(garment.triangles) for garment in garments],
            )
        ]
        parts = zip(*([slice(*pair) for pair in pairwise(start)] for start in starts), strict=True)
        return tuple(Judged(self, index, *part) for index, part in enumerate(parts))


@dataclass(frozen=True, eq=False)
class Judged:
    """One garment of it. Slices are its part of arrays over all garments."""

    of: JudgedScene
    index: int
    vertices: slice
    edges: slice
    faces: slice

    @property
    def spec(self) -> GarmentSpec:
        return self.of.scene.garments[self.index]

    @property
    def name(self) -> str:
        return self.spec.name

    @property
    def garment(self) -> Garment:
        """As it started."""
        return self.of.outfit.garments[self.index]

    @property
    def points(self) -> Points:
        """Worn [m], shape [V, 3]."""
        return self.of.outcome.points[self.vertices]

    @property
    def edge_ends(self) -> Indices:
        """Vertices of its edges, shape [E, 2]."""
        return self.garment.rest.topology.edges

    @property
    def strains(self) -> NDArray[Any]:
        """Of its edges, shape [E]."""
        return self.of.measured.edge_strains[self.edges]

    @property
    def pinned(self) -> bool:
        return len(self.garment.pins) > 0


def own(numbers: NDArray[Any], part: slice) -> NDArray[np.bool_]:
    """Which of some numbers of a scene's elements are in a garment's part."""
    found: NDArray[np.bool_] = (numbers >= part.start) & (numbers < part.stop)
    return found


def listed(numbers: NDArray[Any] | Sequence[int]) -> tuple[int, ...]:
    """Indices, each once and in order."""
    return tuple(np.unique(np.asarray(numbers, dtype=np.int64)).tolist())
