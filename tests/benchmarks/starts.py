"""Work of cloth over a ball from starts a hundredth of a micrometre apart, by the multilevel method.

    python tests/benchmarks/starts.py --device cuda:0 --sizes 4000 66000 --stiffness 2e5 --starts 8 --processes 8

Work is rounds to the certificate, all levels weighted by their vertices. Each fit continues for some iterations; its
movement in these shows whether the certificate was true. Start 0 is not perturbed.
"""

from __future__ import annotations

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from measured import Figures, script_parser

sys.path.insert(0, str(Path(__file__).parent))

from agreement import prepared, shake
from methods_scenes import STIFFNESS, Case

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import collider_updates, start_coarse, tolerance_of
from warp_cloth.model.result import Status
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import BURST, relax_items

LIMIT = 20_000


def fitted(case: Case, device: str, start: int, further: int) -> tuple[float, str]:
    """Work of one fit (infinite where it was not certified), and the fit in a line."""
    start_warp(False)
    problem = prepared(case, device, method="multilevel", iterations=LIMIT)
    if start:
        shake(problem, start)
    levels = start_coarse(problem)
    (outcome,) = relax_items(
        problem.certifier,
        [Goal(tolerance_of(problem.scenes[0]), LIMIT)],
        follow=collider_updates(problem),
        ahead=False,
    )
    for _ in range(further // BURST):
        problem.relaxation.run(BURST)
    displacement = 1e3 * np.linalg.norm(problem.model.points() - outcome.points, axis=1)
    work = outcome.iterations + sum(level.iterations * level.vertices for level in levels) / problem.model.vertex_count
    rounds = work if outcome.status is Status.AT_REST else math.inf
    return rounds, (
        f"{case.name}, start {start}: {outcome.status.value}, work {work:,.0f}, "
        f"{outcome.check.residual.rms:.2g} weights; "
        f"moved since by {math.sqrt(np.mean(displacement**2)):.2g} mm rms, {displacement.max():.2g} mm at most"
    )


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--sizes", nargs="+", type=int, default=[4_000])
    parser.add_argument("--stiffness", nargs="+", type=float, default=list(STIFFNESS))
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--further", type=int, default=1_000, help="iterations after the certificate")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    cases = [Case("ball", size, stretch) for size, stretch in product(options.sizes, options.stiffness)]
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        starts = range(options.starts)
        jobs = {
            case: [pool.submit(fitted, case, options.device, start, options.further) for start in starts]
            for case in cases
        }
        with Figures(__file__, options, device=options.device) as figures:
            for case, fits in jobs.items():
                results = [fit.result() for fit in fits]
                print("\n".join(line for _, line in results), flush=True)
                name = f"ball.{case.stretch / 1e3:g}kN.{case.vertices}"
                figures.add(name, float(np.mean([work for work, _ in results])), "rounds to rest, mean")


if __name__ == "__main__":
    main()
