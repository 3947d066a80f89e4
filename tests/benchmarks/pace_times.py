"""What a round of the multilevel method takes over a ball at every pace, and in how many launches.

    python tests/benchmarks/pace_times.py [--device cuda:0] [--sizes 4000 66000] [--stiffness 2e4]

Implicit steps from the scene's start, at a pace that is kept: microseconds and launches for each round of conjugate
gradients. What the level that turns takes is shared out to them, its renewal, each 40 rounds, in the time, too.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import warp as wp
from methods_scenes import SIZES, Case
from methods_study import prepared

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import CHUNK
from warp_cloth.study.launches import launches_of

WARMING, CHUNKS, REPEATS = 10, 10, 3  # chunks before the clock runs, chunks under it, how often
RESIDUALS = {"falls": 1.0, "calm": 0.01, "still": 0.001, "at rest": 0.0001}  # relative, that a pace goes with


def microseconds(relaxation: MultilevelRelaxation) -> float:
    """The least time of a round of several."""
    device, taken = relaxation.model.device, []
    for _ in range(REPEATS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        for _ in range(CHUNKS):
            relaxation.run(CHUNK)
        wp.synchronize_device(device)
        taken.append(time.perf_counter() - began)
    return 1e6 * min(taken) / (CHUNKS * CHUNK)


def main() -> None:
    parse = argparse.ArgumentParser()
    parse.add_argument("--device", default="cpu")
    parse.add_argument("--sizes", nargs="+", type=int, default=[4000], choices=list(SIZES))
    parse.add_argument("--stiffness", type=float, default=2e4, help="[N/m]")
    asked = parse.parse_args()
    start_warp(False)
    for size in asked.sizes:
        relaxation = prepared(Case("ball", size, asked.stiffness), "multilevel", asked.device, CHUNK).relaxation
        assert isinstance(relaxation, MultilevelRelaxation)
        relaxation.run(CHUNK)
        for pace, residual in RESIDUALS.items():
            relaxation.loosen(np.array([residual]))
            for _ in range(WARMING):
                relaxation.run(CHUNK)
            launches = len(launches_of(lambda: relaxation.iterate(CHUNK))) / CHUNK  # noqa: B023 - asked at once
            rounds = microseconds(relaxation)
            print(f"{relaxation.model.vertex_count:6} {pace:8} {rounds:8.1f} us {launches:5.1f} launches", flush=True)


if __name__ == "__main__":
    main()
