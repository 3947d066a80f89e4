"""Specimens in the machine: clamped where their vertices are given, relaxed by the ordinary solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.part import GarmentPart
from warp_cloth.garment.rest import GRAVITY, Floats, build_rest_shape
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.model.model import build_model
from warp_cloth.solver.certificate.certifier import Certifier, Check, Tolerance
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation, build_relaxation
from warp_cloth.solver.loop import Goal, relax_items
from warp_cloth.solver.relax import StepOptions

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric


@dataclass(frozen=True)
class Settled:
    """A specimen at rest, or as near as the iterations came."""

    points: Points  # [m], shape [V, 3]
    forces: NDArray[np.float64]  # of the cloth on its vertices [N], shape [V, 3]: what clamps hold against
    check: Check


class Specimen:
    """A flat piece of a fabric whose clamped vertices are put where a test wants them, again and again.

    ``count`` of them, all alike, lie side by side; none knows of the others.
    """

    def __init__(
        self,
        mesh: Mesh,
        fabric: Fabric,
        clamped: Indices,
        *,
        grain_degrees: float = 0.0,
        weightless: bool = True,
        device: str = "cpu",
        options: StepOptions | None = None,
        count: int = 1,
    ) -> None:
        rest = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(grain_degrees))
        rest = replace(rest, vertex_weight=weights_by_area(mesh, fabric.weight))
        part = GarmentPart(mesh.points, mesh.triangles, rest, clamped)
        self.mesh = mesh
        self.rest = rest
        self.clamped = clamped
        self.count = count
        self.model = build_model([part] * count, device=device, precision="mixed", garments=[1] * count)
        self._relaxation = build_relaxation(options or StepOptions(), self.model, [Collider()] * count, [part] * count)
        if weightless:
            self._relaxation.step.gravity = cloth_types("mixed").vec3(0.0, 0.0, 0.0)
        self._certifier: Certifier | None = None
        self._load = wp.zeros(self.model.vertex_count, dtype=wp.vec4f, device=device)
        self._forces = ForcePass(self.model, "none", self._load)
        kernels = [*self._relaxation.kernels(), *self._forces.kernels()]
        certifier = Certifier(self._relaxation)
        wp.force_load(device, modules=[kernel.module for kernel in kernels + certifier.kernels()])

    def settle(self, start: Points, tolerance: Tolerance, limit: int, *, near_rest: bool = False) -> Settled:
        """Relaxes from these positions, in which the clamps stand where they stay; ``near_rest``: and hardly falls."""
        (settled,) = self.settle_all([start], tolerance, limit, near_rest=near_rest)
        return settled

    def settle_all(
        self, starts: Sequence[Points], tolerance: Tolerance, limit: int, *, near_rest: bool = False
    ) -> list[Settled]:
        """Relaxes every specimen from its own positions; otherwise as ``settle``.

        Each ends in the bits that it would have alone, as long as none starts with overstretched edges.
        """
        for item, start in enumerate(starts):
            self.model.set_points(start, item)
        if near_rest and isinstance(self._relaxation, MultilevelRelaxation):
            self._relaxation.start_near_rest()
        if self.model.state.stiffness:
            self.model.state.stiffness.zero_()
        certifier = Certifier(self._relaxation)
        outcomes = relax_items(self._relaxation, certifier, [Goal(tolerance, limit)] * self.count)
        for item, outcome in enumerate(outcomes):
            self.model.set_points(outcome.points, item)
        self._load.zero_()
        self._forces.launch(self._relaxation.step)
        load: Any = self._load.numpy()
        forces = np.array(load, dtype=np.float64)[:, :3].reshape(self.count, -1, 3)
        return [Settled(one.points, force, one.check) for one, force in zip(outcomes, forces, strict=True)]


def weights_by_area(mesh: Mesh, weight: float) -> Floats:
    """Weight of the cloth that each vertex of a specimen stands for [N], shape [V]; the fabric's in kg/m2.

    Garments weigh the same at every vertex (the paper, section 2.3). There a border's vertex weighs twice what it
    stands for, so that a strip hangs as if it were half an edge longer, more on coarse meshes than on fine ones.
    """
    first, second, third = np.swapaxes(mesh.points[mesh.triangles], 0, 1)
    areas = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    share = np.bincount(mesh.triangles.ravel(), np.repeat(areas / 3.0, 3), mesh.vertex_count)
    return np.asarray(share * (weight * GRAVITY))
