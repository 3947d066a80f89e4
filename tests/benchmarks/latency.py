"""How long a T-shirt takes from its box mesh to the certificate, its graphs captured: the median of several runs.

    WARP_CLOTH_DATA=FOLDER python tests/benchmarks/latency.py --device cuda:0
    python tests/benchmarks/latency.py --scene tshirt --set garment.fabric=denim

Without ``--scene`` it is the real T-shirt on the real body, as delivered and at 200 kN/m. Every run ends with the
same bits. Loading, building and compiling are told apart.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from typing import Any

import numpy as np
import warp as wp
from wearing import BODIES, SHARED_SHIRT

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import collider_updates, load_problem, tolerance_of
from warp_cloth.scene import load_scene
from warp_cloth.solver.loop import chunks, relax_to_rest


def timed(name: str, scene: str | dict[str, Any], changes: list[str], device: str, runs: int) -> None:
    """Builds and fits a scene again and again, and tells how long it relaxed."""
    chosen = load_scene(scene, changes)
    built, seconds, ends = list[float](), list[float](), set[str]()
    for _ in range(runs + 1):  # the first compiles
        began = time.perf_counter()
        made = load_problem(chosen, device)
        for count in set(chunks(made.relaxation)):
            made.relaxation.capture(count)
        wp.synchronize_device(device)
        built.append(time.perf_counter() - began)
        tolerance, limit = tolerance_of(chosen), chosen.solver.iterations
        outcome = relax_to_rest(
            made.relaxation, made.certifier, tolerance, limit, follow=collider_updates(made), schedule=made.schedule
        )
        seconds.append(outcome.seconds)
        ends.add(f"{hashlib.sha256(outcome.points.tobytes()).hexdigest()[:12]} after {outcome.iterations:,}")
    again = seconds[1:]
    print(f"{name}: {outcome.status.value}, {', '.join(sorted(ends))} iterations")
    print(f"  median of {runs} {np.median(again):.4f} s ({min(again):.4f} to {max(again):.4f})")
    print(f"  loaded, built and captured in {np.median(built[1:]):.2f} s, the first time {built[0]:.1f}")


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--device", default="cpu")
    reader.add_argument("--runs", type=int, default=10)
    reader.add_argument("--scene")
    reader.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    asked = reader.parse_args()
    start_warp()
    if asked.scene:
        timed(asked.scene, asked.scene, asked.changes, asked.device, asked.runs)
        return
    worn = {"garment": SHARED_SHIRT, "avatar": BODIES["mean_all"]}
    timed("real T-shirt", worn, asked.changes, asked.device, asked.runs)
    stiff = [*asked.changes, "garment.fabric={stretch=2e5}"]
    timed("real T-shirt, 200 kN/m", worn, stiff, asked.device, asked.runs)


if __name__ == "__main__":
    main()
