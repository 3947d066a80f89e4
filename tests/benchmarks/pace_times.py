"""Time and launches of a round of the multilevel method, cloth over a ball, at every pace.

    python tests/benchmarks/pace_times.py [--device cuda:0] [--sizes 4000 66000] [--stiffness 2e4]

Implicit steps from the scene's start, at a fixed pace: microseconds and launches of each round of conjugate gradients,
including their part of the level of rigid modes and of its renewal every 40 rounds.
"""

from __future__ import annotations

import time

import numpy as np
import warp as wp
from measured import Figures, script_parser
from methods_scenes import SIZES, Case
from methods_study import prepared

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import BURST
from warp_cloth.study.launches import launches_of

WARMING, BURSTS, REPEATS = 10, 10, 3  # bursts before the clock runs, bursts under it, how often
RESIDUALS = {"falls": 1.0, "calm": 0.01, "still": 0.001, "at rest": 0.0001}  # relative, that a pace goes with


def microseconds(relaxation: MultilevelRelaxation) -> float:
    """The least time of a round of several."""
    device, taken = relaxation.model.device, []
    for _ in range(REPEATS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        for _ in range(BURSTS):
            relaxation.run(BURST)
        wp.synchronize_device(device)
        taken.append(time.perf_counter() - began)
    return 1e6 * min(taken) / (BURSTS * BURST)


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--sizes", nargs="+", type=int, default=[4000], choices=list(SIZES))
    parser.add_argument("--stiffness", type=float, default=2e4, help="[N/m]")
    options = parser.parse_args()
    figures = Figures(__file__, options, device=options.device)
    start_warp(False)
    with figures:
        for size in options.sizes:
            relaxation = prepared(Case("ball", size, options.stiffness), "multilevel", options.device, BURST).relaxation
            assert isinstance(relaxation, MultilevelRelaxation)
            relaxation.run(BURST)
            for pace, residual in RESIDUALS.items():
                relaxation.update_anisotropy(np.array([residual]))
                for _ in range(WARMING):
                    relaxation.run(BURST)
                launches = len(launches_of(lambda: relaxation.iterate(BURST))) / BURST  # noqa: B023 - called at once
                rounds = microseconds(relaxation)
                figures.add(f"{size}.{pace.replace(' ', '_')}", rounds, "us a round")
                figures.add(f"{size}.{pace.replace(' ', '_')}.launches", launches, "launches a round")


if __name__ == "__main__":
    main()
