"""Panels against closed forms: one that hangs from its upper edge and stretches, one sheared in a picture frame.

Hanging along its warp or weft, a panel of weight w per area carries w s at s over its lower edge, and stretches there
by e = (w s / K)^(1/2): in all by 2/3 (w L / K)^(1/2) L. In the frame every yarn keeps its length; at the shear angle
g one bias is (1 + sin g)^(1/2) times as long, the other (1 - sin g)^(1/2) times. They pull by K e^2 and push by
c K e^2, with K = 8 shear / (1 + c), so that the frame's moment per area is shear g^2 at small angles.

python tests/benchmarks/validation/panels.py --workers 8
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
from strips import MESHES, TIGHT, Figures, irregular_strip, report, script_parser

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.swatch import strip as regular_strip
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.solver.step_options import StepOptions

CLOTH = Fabric(weight=0.16, stretch_warp=2e3, stretch_weft=6e3, shear=100.0, bending_warp=1e-7, bending_weft=1e-7)
WIDTH, LENGTH = 0.1, 0.2  # of the hanging panel [m]
SIDE = 0.1  # of the sheared one [m]
ANGLES = (4.0, 10.0)  # of shear [degrees]
PER_SIDE = (10, 20, 40)  # elements on a side
LIMIT = 60_000


def panel(mesh: str, width: float, length: float, count: int) -> Mesh:
    return (regular_strip if mesh == "regular" else irregular_strip)(width, length, length / count)


def stretched(grain: float, device: str, case: tuple[str, int]) -> tuple[float, bool]:
    """How much longer the panel becomes [m]."""
    start_warp(False)
    mesh = panel(case[0], WIDTH, LENGTH, case[1])
    place = 0.5 * LENGTH - mesh.points[:, 2]
    held = np.flatnonzero(place < 1e-9).astype(np.int32)
    specimen = Specimens([piece(mesh, CLOTH, held, grain_degrees=grain)], weightless=False, device=device)
    found = specimen.settle(np.column_stack([mesh.points[:, 0], -place, np.zeros(len(place))]), TIGHT, LIMIT)
    low = place > LENGTH * (1.0 - 1e-9)
    return -float(found.points[low, 1].mean()) - LENGTH, found.check.within(TIGHT)


def sheared(degrees: float, device: str, case: tuple[str, int]) -> tuple[float, bool]:
    """Moment of the frame per area of the cloth [N/m]."""
    start_warp(False)
    mesh = panel(case[0], SIDE, SIDE, case[1])
    flat = mesh.points[:, [0, 2]]
    held = np.flatnonzero(np.abs(flat).max(axis=1) > 0.5 * SIDE * (1.0 - 1e-9)).astype(np.int32)
    angle = np.radians(degrees)
    points, way = mesh.points.copy(), np.zeros_like(mesh.points)
    points[:, 0] -= np.sin(angle) * flat[:, 1]
    points[:, 2] = np.cos(angle) * flat[:, 1]
    way[:, 0], way[:, 2] = -np.cos(angle) * flat[:, 1], -np.sin(angle) * flat[:, 1]
    specimen = Specimens([piece(mesh, CLOTH, held)], device=device, options=StepOptions(method="multilevel"))
    found = specimen.settle(points, TIGHT, LIMIT)
    return -float((found.forces[held] * way[held]).sum()) / SIDE**2, found.check.within(TIGHT)


def moment(angle: float) -> float:
    """The frame's moment per area [N/m] by the closed form."""
    shear, weaker = CLOTH.shear or 0.0, CLOTH.compression
    longer, shorter = np.sqrt(1.0 + np.sin(angle)), np.sqrt(1.0 - np.sin(angle))
    pulled = (longer - 1.0) ** 2 / longer + weaker * (1.0 - shorter) ** 2 / shorter
    return float(8.0 * shear / (1.0 + weaker) * 0.5 * np.cos(angle) * pulled)


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--per-side", type=int, nargs="+", default=PER_SIDE)
    parser.add_argument("--workers", type=int, default=1)
    chosen = parser.parse_args()
    weight = CLOTH.weight * GRAVITY
    cases = {
        f"stretched_{way}": (partial(stretched, grain, chosen.device), 2 / 3 * (weight * LENGTH / own) ** 0.5 * LENGTH)
        for way, grain, own in (("warp", 0.0, CLOTH.stretch_warp), ("weft", 90.0, CLOTH.stretch_weft))
    }
    for degrees in ANGLES:
        cases[f"sheared_{degrees:g}"] = (partial(sheared, degrees, chosen.device), moment(np.radians(degrees)))
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, device=chosen.device, cores=1) as figures,
    ):
        for name, (measure, value) in cases.items():
            for mesh in MESHES:
                found = list(pool.map(measure, [(mesh, count) for count in chosen.per_side]))
                errors = [100.0 * (each / value - 1.0) for each, _ in found]
                report(figures, f"{name}.{mesh}", errors, [rest for _, rest in found], value, chosen.per_side)


if __name__ == "__main__":
    main()
