"""Seconds of a T-shirt from its box mesh to the certificate, with captured graphs: the median of several runs.

    WARP_CLOTH_DATA=FOLDER python tests/benchmarks/latency.py --device cuda:0
    python tests/benchmarks/latency.py --scene tshirt --set garment.fabric=denim

Without ``--scene`` it is the real T-shirt on the real body without contact of cloth with cloth, as delivered and at
200 kN/m. The first attempt is timed, which is the only one of these. Every run must end with the same bits. Loading,
building and compiling are timed separately.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from measured import Figures, script_parser
from wearing import BODIES, SHARED_SHIRT

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.attempts import relax_alone
from warp_cloth.fitting.problem import load_problem
from warp_cloth.scene import load_scene
from warp_cloth.solver.loop import bursts


def timed(figures: Figures, name: str, scene: str | dict[str, Any], options: argparse.Namespace) -> None:
    """Builds and fits a scene several times, and adds the times."""
    device, runs, changes = options.device, options.runs, options.changes
    chosen = load_scene(scene, changes)
    built, seconds, ends = list[float](), list[float](), set[str]()
    for _ in range(runs + 1):  # the first compiles
        began = time.perf_counter()
        problem = load_problem(chosen, device)
        for count in set(bursts(problem.relaxation)):
            problem.relaxation.capture(count)
        wp.synchronize_device(device)
        built.append(time.perf_counter() - began)
        outcome = relax_alone(problem)
        seconds.append(outcome.seconds)
        ends.add(f"{hashlib.sha256(outcome.points.tobytes()).hexdigest()[:12]} after {outcome.iterations:,}")
    again = seconds[1:]
    print(f"{name}: {outcome.status.value}, {', '.join(sorted(ends))} iterations")
    figures.add(f"{name}.relax", float(np.median(again)), "s")
    figures.add(f"{name}.relax_least", min(again), "s")
    figures.add(f"{name}.relax_most", max(again), "s")
    figures.add(f"{name}.iterations", outcome.iterations, "iterations")
    figures.add(f"{name}.load_and_build", float(np.median(built[1:])), "s")
    figures.add(f"{name}.load_and_compile", built[0], "s")


def main() -> None:
    reader = script_parser(__doc__, device="cpu")
    reader.add_argument("--runs", type=int, default=10)
    reader.add_argument("--scene")
    reader.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    options = reader.parse_args()
    start_warp()
    with Figures(__file__, options, device=options.device) as figures:
        if options.scene:
            timed(figures, Path(options.scene).stem, options.scene, options)
            return
        worn = {"garment": SHARED_SHIRT, "avatar": BODIES["mean_all"], "collision": {"cloth": False}}
        timed(figures, "real_tshirt", worn, options)
        stiff = {**worn, "garment": {**SHARED_SHIRT, "fabric": {"stretch": 2e5}}}
        timed(figures, "real_tshirt_200kN", stiff, options)


if __name__ == "__main__":
    main()
