"""A specimen in the machine: clamped where its vertices are given, relaxed by the ordinary solver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.grain import Grain
from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.mesh import Indices, Mesh, Points
from warp_cloth.model import GarmentPart, build_model
from warp_cloth.rest import build_rest_shape
from warp_cloth.solver.certificate import Certifier, Check, Tolerance
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.loop import relax_to_rest
from warp_cloth.solver.multilevel import MultilevelRelaxation, relaxation_by
from warp_cloth.solver.relax import Collider, StepOptions

if TYPE_CHECKING:
    from warp_cloth.fabric import Fabric


@dataclass(frozen=True)
class Settled:
    """A specimen at rest, or as near as the iterations came."""

    points: Points  # [m], shape [V, 3]
    forces: NDArray[np.float64]  # of the cloth on its vertices [N], shape [V, 3]: what clamps hold against
    check: Check


class Specimen:
    """A flat piece of a fabric whose clamped vertices are put where a test wants them, again and again."""

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
    ) -> None:
        rest = build_rest_shape(mesh, fabric, rest="uv", grain=Grain(grain_degrees))
        part = GarmentPart(mesh.points, mesh.triangles, rest, clamped)
        self.mesh = mesh
        self.rest = rest
        self.clamped = clamped
        self.model = build_model([part], device=device, precision="mixed")
        self._relaxation = relaxation_by(options or StepOptions(), self.model, [Collider()], [part])
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
        self.model.set_points(start)
        if near_rest and isinstance(self._relaxation, MultilevelRelaxation):
            self._relaxation.start_near_rest()
        if self.model.cloth.stiffness:
            self.model.cloth.stiffness.zero_()
        certifier = Certifier(self._relaxation)
        outcome = relax_to_rest(self._relaxation, certifier, tolerance, limit)
        self.model.set_points(outcome.points)
        self._load.zero_()
        self._forces.launch(self._relaxation.step)
        forces: Any = self._load.numpy()
        return Settled(outcome.points, np.array(forces, dtype=np.float64)[:, :3], outcome.check)
