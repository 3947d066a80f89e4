"""A strip set on edge, held at one end: the weight at which it buckles sideways, against a deep cantilever's.

A deep cantilever of length L and depth d buckles under its own weight w per area at (Timoshenko and Gere, Theory of
Elastic Stability, 6.3)

    w L^3 = 12.85 (EI GJ)^(1/2) / d = 12.85 2^(1/2) B        EI = B d, GJ = 2 B d

with B the moment per curvature and twisting as stiff as bending: B (k_1^2 + k_2^2) / 2 is the energy per area. Its own
weight rather than an end load, for that is what cloth bears. The elastic law M = b k^2 / 2 has no B at k = 0, so that
such cloth buckles under any weight; with friction it is B = h / clinging, as long as no yarn slips.

The strip rests in its own plane. There the forces sideways are the lateral stiffness times the displacement sideways;
its smallest eigenvalue falls through zero where the strip buckles, and no relaxation near that weight is needed.

python tests/benchmarks/validation/on_edge.py --across 4 8 16
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context

import numpy as np
import warp as wp
from elastica import Floats
from scipy.linalg import eigvalsh
from scipy.optimize import brentq
from strips import FABRIC, MESHES, Figures, irregular_strip, report, script_parser

from warp_cloth.base.mesh import Indices
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.swatch import strip as regular_strip
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.hysteresis import CLINGING
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.model.model import build_model
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.step_options import StepOptions

LENGTH, DEPTHS = 0.1, (0.02, 0.0125)  # [m]
FACTOR = 12.85 * 2.0**0.5
STIFFNESS = FABRIC.weight * GRAVITY * LENGTH**3 / FACTOR  # B [N m]: theory's buckling weight is the fabric's own
FRICTION = STIFFNESS * CLINGING  # h [N]
RUBBING = replace(FABRIC, bending_friction_warp=FRICTION, bending_friction_weft=FRICTION)
ACROSS = (4, 8, 16)  # elements over the depth
MOVED = 1e-9  # [m] sideways, for the stiffness: at 1e-7 the elastic law already counts on fine meshes
CURVED = 1e-3  # curvature, and twist [1/m]; likewise
PLANAR = Tolerance(relative_rms=1e-4, relative_p99=1e-3, rest_error=1e-5)
LIMIT = 20_000  # iterations
LIGHT, HEAVY = 0.01, 4.0  # times theory's weight, between which the strip buckles


class OnEdge:
    """A strip set on edge, in its own plane."""

    def __init__(self, mesh: str, depth: float, across: int, rubs: bool) -> None:
        edge = depth / across
        rows = round(LENGTH / edge + 0.5)
        edge = LENGTH / (rows - 0.5)  # the clamp lies between its two rows
        flat = (regular_strip if mesh == "regular" else irregular_strip)(depth, edge * rows, edge)
        s = 0.5 * edge * (rows - 1) - flat.points[:, 2]
        held = s < 0.6 * edge
        self.piece = piece(flat, RUBBING if rubs else FABRIC, np.flatnonzero(held).astype(np.int32))
        self.points = np.column_stack([np.zeros(len(s)), flat.points[:, 0], s])
        self._free = np.flatnonzero(~held)
        self.at_rest = True

    def stiffness(self, weight: float) -> float:
        """Smallest eigenvalue of the lateral stiffness [N/m], under this many times the fabric's weight."""
        rest = self.piece.rest
        heavy = replace(self.piece, rest=replace(rest, vertex_weight=weight * rest.vertex_weight))
        (found,) = Specimens([heavy], weightless=False, options=StepOptions(method="multilevel")).settle_all(
            [self.points], PLANAR, LIMIT
        )
        self.at_rest &= found.check.within(PLANAR)
        self.points = found.points
        return float(eigvalsh(_lateral(self.piece, found.points, self._free), subset_by_index=[0, 0])[0])


class Sideways:
    """Forces across the plane of a strip [N], in float64."""

    def __init__(self, garment: Garment) -> None:
        types = cloth_types("float64")
        self._step, self._model = types.Step(), build_model([garment], device="cpu", precision="float64")
        self._load = wp.zeros(self._model.vertex_count, dtype=types.vec4, device="cpu")
        self._forces = ForcePass(self._model, Accumulate.NONE, self._load)

    def of(self, points: Floats) -> Floats:
        self._model.set_points(points)
        self._load.zero_()
        self._forces.launch(self._step)
        return np.array(self._load.numpy()[:, 0])


def _lateral(garment: Garment, points: Floats, free: Indices) -> Floats:
    """Minus the change of the forces across the plane with displacements across it [N/m], by central differences."""
    forces, columns = Sideways(garment), np.zeros((len(free), len(free)))
    for column, vertex in enumerate(free):
        for way in (MOVED, -MOVED):
            moved = points.copy()
            moved[vertex, 0] += way
            columns[:, column] -= forces.of(moved)[free] / (2.0 * way)
    return np.asarray(0.5 * (columns + columns.T))


def stiffnesses(depth: float, mesh: str, across: int) -> dict[str, float]:
    """B of a strip without weight that is bent evenly along itself, and twisted evenly, over theory's."""
    start_warp(False)
    strip = OnEdge(mesh, depth, across, True)
    points, own = strip.points, strip.piece
    shapes = {"bent": 0.5 * points[:, 2] ** 2, "twisted": points[:, 1] * points[:, 2] * 2.0**-0.5}
    forces, found = Sideways(own), {}
    for name, shape in shapes.items():
        moved = np.column_stack([CURVED * shape, points[:, 1:]])
        work = float(-forces.of(moved) @ shape) / CURVED
        found[name] = work / (own.rest.area * STIFFNESS)
    return found


def buckling(depth: float, case: tuple[str, int]) -> tuple[float, bool]:
    """Buckling weight over theory's, and whether the strip was at rest in its plane."""
    start_warp(False)
    strip = OnEdge(case[0], depth, case[1], True)
    return float(brentq(strip.stiffness, 0.5, HEAVY, xtol=1e-2)), strip.at_rest


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--across", type=int, nargs="+", default=ACROSS, help="elements over the depth")
    parser.add_argument("--workers", type=int, default=1)
    chosen = parser.parse_args()
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, cores=chosen.workers) as figures,
    ):
        for depth in DEPTHS:
            for mesh in MESHES:
                found = list(pool.map(partial(buckling, depth), [(mesh, count) for count in chosen.across]))
                errors = [100.0 * (weight - 1.0) for weight, _ in found]
                name = f"depth_{depth / LENGTH:g}.{mesh}"
                report(figures, name, errors, [rest for _, rest in found], FABRIC.weight, chosen.across)
                own = [stiffnesses(depth, mesh, count) for count in chosen.across]
                for way in own[0]:
                    shown = ", ".join(f"{each[way]:.2f}" for each in own)
                    figures.add(f"{name}.{way}", shown, "times theory's B, no weight")
        start_warp(False)
        for mesh in MESHES:
            least = OnEdge(mesh, DEPTHS[0], min(chosen.across), False).stiffness(LIGHT)
            figures.add(
                f"elastic.{mesh}", f"{least:.2g}", f"N/m sideways at {LIGHT:g} of that weight: negative, it buckles"
            )


if __name__ == "__main__":
    main()
