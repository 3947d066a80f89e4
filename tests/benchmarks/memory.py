"""Memory that a scene takes on a GPU, against what ``plan`` foretells: while it is built, relaxed and reported.

    python tests/benchmarks/memory.py hanging --set garment.shape.vertices_per_side=2048 --iterations 2400

Warp's own pool is asked, which holds every array but not what the driver takes for itself.
"""

from __future__ import annotations

import argparse
import time

import warp as wp

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.clock import StageClock
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.problem import collider_updates, load_problem, tolerance_of
from warp_cloth.scene import load_scene
from warp_cloth.solver.loop import relax_to_rest
from warp_cloth.study.footprint import memory_of


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("scene")
    reader.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    reader.add_argument("--iterations", type=int, default=2400)
    reader.add_argument("--device", default="cuda:0")
    asked = reader.parse_args()
    start_warp()
    began = last = time.perf_counter()

    def tell(stage: str, planned: float) -> None:
        nonlocal last
        now = time.perf_counter()
        used, most = (
            1e-9 * float(told(asked.device)) for told in (wp.get_mempool_used_mem_current, wp.get_mempool_used_mem_high)
        )
        print(
            f"{stage:<10} {used:7.3f} GB now, {most:7.3f} at most, {planned:7.3f} planned, {now - last:7.1f} s",
            flush=True,
        )
        last = now

    scene = load_scene(asked.scene, [*asked.changes, f"solver.iterations={asked.iterations}"])
    made = load_problem(scene, asked.device)
    planned = memory_of(made)
    whole = 1e-9 * sum(planned.values())
    print(
        f"{made.model.vertex_count:,} vertices; planned " + ", ".join(f"{k} {1e-9 * v:.3f}" for k, v in planned.items())
    )
    tell("built", whole - 1e-9 * planned["report"])
    outcome = relax_to_rest(
        made.relaxation,
        made.certifier,
        tolerance_of(scene),
        asked.iterations,
        follow=collider_updates(made),
        schedule=made.schedule,
    )
    print(f"{outcome.status.value} after {outcome.iterations:,} iterations, {outcome.seconds:.2f} s")
    tell("relaxed", whole - 1e-9 * planned["report"])
    finish_fits(made, [outcome], levels=[()], clock=StageClock())
    tell("reported", whole)
    print(f"{time.perf_counter() - began:.1f} s in all")


if __name__ == "__main__":
    main()
