"""True rest shapes by another road: SciPy minimises the same energy in float64, without step, cap or momentum."""

from __future__ import annotations

import numpy as np
import warp as wp
from scipy.optimize import minimize

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.mesh import Mesh, Points
from warp_cloth.model import GarmentPart, build_model
from warp_cloth.rest import RestShape
from warp_cloth.solver.certificate import element_energies
from warp_cloth.solver.forces import ForcePass

UNBALANCED = 3e-4  # vertex weights, rms; of the small garments here within 3 micrometres of ten times less


class Potential:
    """Energy of a garment that touches nothing, and the force left, as functions of its free vertices."""

    def __init__(self, mesh: Mesh, rest: RestShape, pins: np.ndarray) -> None:
        part = GarmentPart(mesh.points, mesh.triangles, rest, pins)
        types = cloth_types("float64")
        self.model = build_model([part], device="cpu", precision="float64")
        self.start = mesh.points
        self.free = np.setdiff1d(np.arange(mesh.vertex_count), pins)
        self.weight = rest.vertex_weight
        self._load = wp.zeros(mesh.vertex_count, dtype=types.vec4, device="cpu")
        self._forces = ForcePass(self.model, "none", self._load)
        self._step = types.Step()

    def shape(self, free: np.ndarray) -> Points:
        points = self.start.copy()
        points[self.free] = free.reshape(-1, 3)
        return points

    def __call__(self, free: np.ndarray) -> tuple[float, np.ndarray]:
        """Energy [J] and its gradient [N] with the free vertices at ``free`` [m]."""
        points = self.shape(free)
        self.model.set_points(points)
        self._load.zero_()
        self._forces.launch(self._step)
        force = self._load.numpy()[:, :3].copy()
        force[:, 1] -= self.weight
        energy = sum(float(part.sum()) for part in element_energies(self.model)) + float(self.weight @ points[:, 1])
        return energy, -force[self.free].ravel()

    def unbalanced(self, free: np.ndarray) -> float:
        """Force left [vertex weights, rms]."""
        left = self(free)[1].reshape(-1, 3) / self.weight[self.free, None]
        return float(np.sqrt((left**2).sum(axis=1).mean()))


def true_rest(mesh: Mesh, rest: RestShape, pins: np.ndarray, start: Points) -> Points:
    """The shape of least energy that SciPy finds downhill from ``start`` [m], shape [V, 3].

    L-BFGS goes by differences of the energy, which drown in rounding near the least one, so it starts anew there.
    """
    potential = Potential(mesh, rest, pins)
    free = start[potential.free].ravel()
    scale = float(potential.weight.mean())  # forces of about 1, displacements in metres
    for _ in range(60):
        found = minimize(
            lambda x: tuple(part / scale for part in potential(x)),
            free,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 3000, "maxfun": 6000, "maxcor": 40, "ftol": 0.0, "gtol": UNBALANCED / 2},
        )
        free = found.x
        if potential.unbalanced(free) < UNBALANCED:
            break
    return potential.shape(free)
