"""Test specimens: flat pieces of a fabric, clamped at given vertices, relaxed by the ordinary solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.laid import laid_into
from warp_cloth.garment.rest import Floats, build_rest_shape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.hysteresis import Laid
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.model.model import build_model
from warp_cloth.solver.certificate.certifier import Certifier, Check, Tolerance
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation, build_relaxation
from warp_cloth.solver.loop import relax_items
from warp_cloth.solver.step_options import StepOptions

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric


@dataclass(frozen=True)
class Settled:
    """A specimen at rest, or after the last iteration."""

    points: Points  # [m], shape [V, 3]
    forces: NDArray[np.float64]  # of the cloth on its vertices [N], shape [V, 3]: what the clamps must hold
    check: Check


def piece(
    mesh: Mesh, fabric: Fabric, clamped: Indices, *, grain_degrees: float = 0.0, laid: Laid | None = None
) -> Garment:
    """A flat piece of a fabric, held at these vertices; ``laid``: where not flat."""
    rest = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(grain_degrees))
    rest = laid_into(replace(rest, vertex_weight=weights_by_area(mesh, fabric.weight)), laid)
    return Garment(mesh.points, mesh.triangles, rest, clamped)


class Specimens:
    """Flat pieces of fabrics that relax together, independently of one another."""

    def __init__(
        self,
        pieces: Sequence[Garment],
        *,
        weightless: bool = True,
        device: str = "cpu",
        options: StepOptions | None = None,
        collider: Collider | None = None,
    ) -> None:
        """``collider``: of a body without friction that they lie on; None: there is none."""
        self.count = len(pieces)
        self.model = build_model(pieces, device=device, precision="mixed", garment_counts=[1] * self.count)
        colliders = [collider or Collider()] * self.count
        self._relaxation = build_relaxation(options or StepOptions(), self.model, colliders, pieces)
        if weightless:
            self._relaxation.step.gravity = cloth_types("mixed").vec3(0.0, 0.0, 0.0)
        self._certifier: Certifier | None = None
        self._load = wp.zeros(self.model.vertex_count, dtype=wp.vec4f, device=device)
        self._forces = ForcePass(self.model, Accumulate.NONE, self._load)
        kernels = [*self._relaxation.kernels(), *self._forces.kernels()]
        certifier = Certifier(self._relaxation)
        wp.force_load(device, modules=[kernel.module for kernel in kernels + certifier.kernels()])

    def settle_all(
        self, starts: Sequence[Points], tolerance: Tolerance, limit: int, *, near_rest: bool = False
    ) -> list[Settled]:
        """Relaxes every piece from its own positions, clamped vertices included.

        ``near_rest``: they are close to the rest shape.

        Each result has the bits that it would have alone, as long as none starts with overstretched edges.
        """
        for item, start in enumerate(starts):
            self.model.set_points(start, item)
        if near_rest and isinstance(self._relaxation, MultilevelRelaxation):
            self._relaxation.start_near_rest()
        if self.model.state.stiffness:
            self.model.state.stiffness.zero_()
        certifier = Certifier(self._relaxation)
        outcomes = relax_items(certifier, [Goal(tolerance, limit)] * self.count)
        for item, outcome in enumerate(outcomes):
            self.model.set_points(outcome.points, item)
        self._load.zero_()
        self._forces.launch(self._relaxation.step)
        load: Any = self._load.numpy()
        forces = np.array(load, dtype=np.float64)[:, :3]
        return [
            Settled(outcome.points, forces[self.model.of_item(item)], outcome.check)
            for item, outcome in enumerate(outcomes)
        ]

    def settle(self, start: Points, tolerance: Tolerance, limit: int) -> Settled:
        """Relaxes a lone piece from these positions, clamped vertices included."""
        (settled,) = self.settle_all([start], tolerance, limit)
        return settled


def weights_by_area(mesh: Mesh, weight: float) -> Floats:
    """Weight of the area of each vertex of a specimen [N], shape [V]; ``weight`` is that of the fabric [kg/m2].

    In garments all vertices weigh the same (the paper, section 2.3). Vertices on the border then weigh twice as much
    as their area does, and a strip hangs as if it were half an edge longer, which matters on coarse meshes.
    """
    first, second, third = np.swapaxes(mesh.points[mesh.triangles], 0, 1)
    areas = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    vertex_areas = np.bincount(mesh.triangles.ravel(), np.repeat(areas / 3.0, 3), mesh.vertex_count)
    return np.asarray(vertex_areas * (weight * GRAVITY))
