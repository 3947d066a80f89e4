"""Memory of a scene on a GPU, and what ``warp-cloth plan`` states: while it is built, relaxed and reported.

    python tests/benchmarks/memory.py hanging --set garment.shape.vertices_per_side=2048 --iterations 2400

Measured is Warp's memory pool, which holds every array but not what the driver needs.
"""

from __future__ import annotations

import time

import warp as wp
from measured import Figures, script_parser

from warp_cloth.base.clock import StageClock
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.attempts import Course, finished_runs
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.problem import collider_updates, load_problem, tolerance_of
from warp_cloth.scene import load_scene
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items
from warp_cloth.study.footprint import memory_of


def main() -> None:
    reader = script_parser(__doc__, device="cuda:0")
    reader.add_argument("scene")
    reader.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    reader.add_argument("--iterations", type=int, default=2400)
    options = reader.parse_args()
    figures = Figures(__file__, options, device=options.device)
    start_warp()
    began = last = time.perf_counter()

    def tell(stage: str, planned: float) -> None:
        nonlocal last
        now = time.perf_counter()
        used, most = (
            1e-9 * float(used_bytes(options.device))
            for used_bytes in (wp.get_mempool_used_mem_current, wp.get_mempool_used_mem_high)
        )
        figures.add(f"{options.scene}.{stage}.planned", planned, "GB")
        figures.add(f"{options.scene}.{stage}.used", used, "GB")
        figures.add(f"{options.scene}.{stage}.most", most, "GB")
        print(f"  {now - last:.1f} s", flush=True)
        last = now

    scene = load_scene(options.scene, [*options.changes, f"solver.iterations={options.iterations}"])
    problem = load_problem(scene, options.device)
    planned = memory_of(problem)
    whole = 1e-9 * sum(planned.values())
    print(
        f"{problem.model.vertex_count:,} vertices; planned "
        + ", ".join(f"{k} {1e-9 * v:.3f}" for k, v in planned.items())
    )
    tell("built", whole - 1e-9 * planned["report"])
    (outcome,) = relax_items(
        problem.certifier,
        [Goal(tolerance_of(scene), options.iterations)],
        follow=collider_updates(problem),
        schedule=problem.schedule,
    )
    print(f"{outcome.status.value} after {outcome.iterations:,} iterations, {outcome.seconds:.2f} s")
    tell("relaxed", whole - 1e-9 * planned["report"])
    finish_fits([Course(tuple(finished_runs(problem, [outcome], [()])))], clock=StageClock())
    tell("reported", whole)
    with figures:  # writes them
        print(f"{time.perf_counter() - began:.1f} s in all")


if __name__ == "__main__":
    main()
