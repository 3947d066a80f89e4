"""The result of a fit: status, verdict and problems, the certificate's figures, worn garments, maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.trims import Trims
from warp_cloth.material.strain import face_strains
from warp_cloth.model.fit_problem import FitProblem

if TYPE_CHECKING:
    from warp_cloth.garment.rest import RestShape
    from warp_cloth.material.fabric import Fabric
    from warp_cloth.scene import Scene


class Status(str, Enum):
    """How a fit ended. A failure is a value with a sentence, not an exception."""

    AT_REST = "at_rest"
    ITERATION_LIMIT = "iteration_limit"
    DIVERGED = "diverged"
    INVALID = "invalid"


@dataclass(frozen=True)
class Residual:
    """Net force left on free vertices after what contact and pins can carry.

    ``rms``, ``p99`` and ``max`` are in vertex weights; the relative ones are divided by the vertex's weight plus the
    sum of the magnitudes of the forces on it.
    """

    rms: float
    p99: float
    max: float
    relative_rms: float
    relative_p99: float


@dataclass(frozen=True)
class Strain:
    """Strain (r - L) / L of edges or yarns: percentiles of its magnitude, and its signed extremes."""

    p50: float
    p99: float
    max: float
    min: float


@dataclass(frozen=True)
class Penetration:
    """Depth of garment vertices below the exact avatar mesh [mm]: maximum, 99.9th percentile, fraction of vertices.

    ``edges`` is the number of edges that pass through the avatar, up to ``edge_max`` [mm] deep; ``faces`` that of faces
    that it shows through by up to ``face_max`` [mm], although their vertices may all be outside.
    """

    max: float
    p999: float
    fraction: float
    edges: int = 0
    edge_max: float = 0.0
    faces: int = 0
    face_max: float = 0.0


@dataclass(frozen=True)
class LevelRun:
    """A relaxation that came before the fit's own: of a coarse garment, or of one in another fabric."""

    vertices: int
    iterations: int
    status: Status


@dataclass(frozen=True)
class AttemptRun:
    """One of a fit's attempts."""

    method: str
    cloth_contact: bool
    iterations: int
    status: Status
    crossings: int  # pairs of triangles that pass through each other
    start: str = "placed"  # "placed", "dressed", "posed" (round the avatar within the garment), "earlier attempt"
    chosen: bool = False  # whether its shape is the result


@dataclass(frozen=True, eq=False)
class WornGarment:
    """One garment as worn: V vertices, F triangles, E edges.

    name       as in the scene
    mesh       as loaded: points [m], shape [V, 3]; triangles [F, 3]; panels [F] and panel_names
    points     worn shape [m], float64 [V, 3]
    thickness  of the fabric [m]
    frames     intermediate shapes [m], float32 [N, V, 3], the last as worn; None: none were requested
    fields     values per vertex, float32 [V], by name: the maps that were requested (strains as fractions, shear in
               degrees, pressure in kPa, gap in mm), and where crossings were found, their vertices
    fabric     where known
    let_down   the other end of the band that friction lets it rest in [m], [V, 3]; None: not requested
    rest       the rest shape: ``edges`` [E, 2], ``edge_strain`` [E] and ``face_strains`` [F] come from it; these need
               no request, and are computed when they are first read
    """

    name: str
    mesh: Mesh  # as loaded
    points: Points  # worn shape [m], shape [V, 3]
    thickness: float  # fabric thickness [m]
    frames: NDArray[np.float32] | None = None  # intermediate shapes [m], shape [N, V, 3]; the last is the worn shape
    fields: dict[str, NDArray[np.float32]] = field(default_factory=dict)  # per-vertex values by name, shape [V]
    fabric: Fabric | None = None  # where known, written with the stage's physics
    rest: RestShape | None = None
    let_down: Points | None = None  # [m], shape [V, 3]

    @cached_property
    def trims(self) -> Trims | None:
        """Loose parts of its file that lie on it, such as buttons: ``trims.at(points)`` is where they go with it."""
        return Trims.of(self.mesh)

    @property
    def edges(self) -> Indices:
        """Vertices at the ends of every edge, shape [E, 2]."""
        return self._rest_shape.topology.edges

    @cached_property
    def edge_strain(self) -> NDArray[np.float64]:
        """Strain (r - L) / L of every edge, r its length as worn and L at rest, shape [E]."""
        ends = self.points[self.edges]
        length = self._rest_shape.edge_length
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / length - 1.0)

    @cached_property
    def face_strains(self) -> dict[str, NDArray[np.float64]]:
        """Strains of every triangle of ``mesh``, by the names of maps, shape [F] each.

        "strain", the largest, and where the warp's direction is known "strain_warp", "strain_weft", "strain_bias", and
        the angle "shear" [degrees].
        """
        sheet = self._rest_shape.sheet
        return {} if sheet is None else face_strains(self.points, sheet)

    @property
    def _rest_shape(self) -> RestShape:
        if self.rest is None:
            raise InputError(f'garment "{self.name}"', "was read from a file without its rest shape", "fit it again")
        return self.rest


@dataclass(frozen=True, eq=False)
class FitMaps:
    """Maps of every garment, and the range that each map's colours span."""

    fields: tuple[dict[str, NDArray[np.float32]], ...]  # of each garment: a map's values per vertex, shape [V]
    ranges: dict[str, tuple[float, float]]  # of a map's colours, over all garments
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FitResult:
    """The data of a fit: how it ended, the worn garments, the report. What ``warp_cloth.export`` writes."""

    scene: Scene
    status: Status
    worn: bool  # at rest, without a problem that is more than a note
    problems: tuple[FitProblem, ...]  # the likeliest cause first
    message: str  # the verdict in words: how it ended, what is wrong, what to change
    garments: tuple[WornGarment, ...]
    avatar: Mesh | None
    report: dict[str, Any]  # the content of report.json
    device: str
    maps: FitMaps | None = None  # None: no maps were requested
    avatar_frames: NDArray[np.float32] | None = None  # [m], shape [N, V, 3], with those of the garments; None: it stays
    facing: int = 0  # quarter turns about y from +z to the wearer's front

    @property
    def map_ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of the colours of the maps that were requested, by name."""
        return {} if self.maps is None else self.maps.ranges


def matched(available: Sequence[str], wanted: Sequence[str]) -> list[int] | None:
    """Indices of an earlier result's garments that match the wanted ones: by name or, if there are as many, by order.

    None if neither is possible.
    """
    if all(available.count(name) == 1 for name in wanted):
        return [available.index(name) for name in wanted]
    return list(range(len(available))) if len(available) == len(wanted) else None
