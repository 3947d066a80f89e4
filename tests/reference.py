"""True rest shapes by another road: SciPy minimises the same energy in float64, without step, cap or momentum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import warp as wp
from scipy.optimize import minimize
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import RestShape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_kernels, stiffness_types
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.solver.certificate.strains import element_energies
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.implicit.vertex_pairs import PairTable, build_pairs

UNBALANCED = 3e-4  # vertex weights, rms; of the small garments here within 3 micrometres of ten times less


class Potential:
    """Energy of a garment that touches nothing, and the force left, as functions of its free vertices."""

    def __init__(self, mesh: Mesh, rest: RestShape, pins: np.ndarray) -> None:
        garment = Garment(mesh.points, mesh.triangles, rest, pins)
        types = cloth_types("float64")
        self.model = build_model([garment], device="cpu", precision="float64")
        self.start = mesh.points
        self.free = np.setdiff1d(np.arange(mesh.vertex_count), pins)
        self.weight = rest.vertex_weight
        self._load = wp.zeros(mesh.vertex_count, dtype=types.vec4, device="cpu")
        self._forces = ForcePass(self.model, Accumulate.NONE, self._load)
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
        energy = sum(float(garment.sum()) for garment in element_energies(self.model)) + float(
            self.weight @ points[:, 1]
        )
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
            lambda x: tuple(garment / scale for garment in potential(x)),
            free,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 3000, "maxfun": 6000, "maxcor": 40, "ftol": 0.0, "gtol": UNBALANCED / 2},
        )
        free = found.x
        if potential.unbalanced(free) < UNBALANCED:
            break
    return potential.shape(free)


def preconditioned_rest(potential: Potential, start: Points, rounds: int = 300) -> tuple[Points, float, int]:
    """The same energy's least shape near ``start`` [m], for large garments: L-BFGS on top of a direct solution.

    The first guess of every step solves the linearised forces with a sparse factorisation. Returns the shape, the
    force left [vertex weights, rms], and the rounds that it took.
    """
    x = start[potential.free].ravel()
    energy, slope = potential(x)
    solve = _factorised(potential)
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    count = 0
    for count in range(1, rounds + 1):
        way = -_two_loops(kept, slope, solve)
        if slope @ way >= 0.0:
            kept, way = [], -solve(slope)
        length = min(1.0, 5e-3 / max(float(np.abs(way).max()), 1e-30))
        while True:
            new, new_slope = potential(x + length * way)
            # near the least energy its differences drown in rounding; there the slope decides
            better = new <= energy + 1e-4 * length * (slope @ way)
            if better or (abs(new_slope @ way) <= 0.9 * abs(slope @ way) and new <= energy + 1e-12 * abs(energy)):
                break
            length *= 0.5
            if length < 1e-8:
                return potential.shape(x), potential.unbalanced(x), count
        step, change = length * way, new_slope - slope
        if step @ change > 0.0:
            kept = [*kept[-29:], (step, change)]
        x, energy, slope = x + step, new, new_slope
        if count % 40 == 0:
            solve, kept = _factorised(potential), []
        if float(np.sqrt(np.mean(step**2))) < 1e-8 and potential.unbalanced(x) < UNBALANCED:
            break
    return potential.shape(x), potential.unbalanced(x), count


def _two_loops(kept: list[tuple[np.ndarray, np.ndarray]], slope: np.ndarray, solve: Callable) -> np.ndarray:
    """The inverse curvature, as the last steps tell it, times the slope."""
    q, shares = slope.copy(), []
    for step, change in reversed(kept):
        shares.append((step @ q) / (step @ change))
        q -= shares[-1] * change
    r = solve(q)
    for (step, change), share in zip(kept, reversed(shares), strict=True):
        r += step * (share - (change @ r) / (step @ change))
    return np.asarray(r)


def couplings(model: ClothModel) -> tuple[PairTable, np.ndarray]:
    """Pairs of a model's vertices, and the 3 x 3 blocks of its linearised forces by rows of these [N/m]."""
    table = build_pairs(model)
    kernels, own = stiffness_kernels(model.precision, model.terms), stiffness_types(model.precision)
    gradient = wp.zeros((4, model.hinge_count), dtype=cloth_types(model.precision).vec3, device="cpu")
    side = wp.zeros((3, model.weave_count), dtype=own.vec6, device="cpu")
    count = len(table.ends)
    coupling = wp.zeros(2 * count, dtype=own.mat3, device="cpu")
    pair = wp.zeros(count, dtype=own.vec6, device="cpu")
    if model.hinges is not None:
        wp.launch(kernels.linearise_hinges, model.hinge_count, [model.state, model.hinges, gradient], device="cpu")
    if model.weave is not None:
        wp.launch(kernels.linearise_weave, model.weave_count, [model.state, model.weave, 0.0, side], device="cpu")
    arguments = [model.state, model.edges, table.pairs, 0.0, gradient, side, coupling, pair]
    wp.launch(kernels.couple_pairs, count, arguments, device="cpu")
    return table, coupling.numpy()


def _factorised(potential: Potential) -> Callable[[np.ndarray], np.ndarray]:
    """Solves with the linearised forces of the shape that the potential was asked for last."""
    model = potential.model
    table, blocks = couplings(model)
    start, other = table.start.numpy(), table.neighbour.numpy()
    vertices = model.vertex_count
    row = np.repeat(np.arange(vertices), np.diff(start))
    diagonal = np.zeros((vertices, 3, 3))
    np.add.at(diagonal, row, blocks)
    diagonal += np.eye(3) * (potential.weight / 0.1)[:, None, None]  # no vertex moves by more than 0.1 m of itself
    at, to = np.concatenate([row, np.arange(vertices)]), np.concatenate([other, np.arange(vertices)])
    values = np.concatenate([-blocks, diagonal])
    cells = np.arange(3)
    i = np.broadcast_to(3 * at[:, None, None] + cells[None, :, None], values.shape).ravel()
    j = np.broadcast_to(3 * to[:, None, None] + cells[None, None, :], values.shape).ravel()
    matrix = coo_matrix((values.ravel(), (i, j)), shape=(3 * vertices, 3 * vertices)).tocsc()
    free = (3 * potential.free[:, None] + cells).ravel()
    matrix = matrix[free][:, free]
    even = (0.5 * (matrix + matrix.T)).tocsc()
    solution = splu(even, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return solution.solve
