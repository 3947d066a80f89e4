"""How much work cloth over a ball needs from starts a hundredth of a micrometre apart, by the multilevel method.

    python tests/benchmarks/starts.py --device cuda:0 --sizes 4000 66000 --stiffness 2e5 --starts 8 --processes 8

Work is iterations to the certificate, all levels weighted by their vertices. Each fit goes on for some iterations, and
how far it moves since tells whether the certificate was true. Start 0 is moved by nothing.
"""

from __future__ import annotations

import argparse
import math
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from agreement import prepared, shake
from methods_scenes import STIFFNESS, Case

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import collider_updates, start_coarse, tolerance_of
from warp_cloth.solver.loop import CHUNK, relax_to_rest

LIMIT = 20_000


def fitted(case: Case, device: str, start: int, further: int) -> str:
    """One fit in a line."""
    start_warp(False)
    made = prepared(case, device, method="multilevel", iterations=LIMIT)
    if start:
        shake(made, start)
    levels = start_coarse(made)
    outcome = relax_to_rest(
        made.relaxation, made.certifier, tolerance_of(made.scenes[0]), LIMIT, follow=collider_updates(made), ahead=False
    )
    for _ in range(further // CHUNK):
        made.relaxation.run(CHUNK)
    way = 1e3 * np.linalg.norm(made.model.points() - outcome.points, axis=1)
    work = outcome.iterations + sum(level.iterations * level.vertices for level in levels) / made.model.vertex_count
    return (
        f"{case.name}, start {start}: {outcome.status.value}, work {work:,.0f}, "
        f"{outcome.check.residual.rms:.2g} weights; "
        f"moved since by {math.sqrt(np.mean(way**2)):.2g} mm rms, {way.max():.2g} mm at most"
    )


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--device", default="cpu")
    reader.add_argument("--sizes", nargs="+", type=int, default=[4_000])
    reader.add_argument("--stiffness", nargs="+", type=float, default=list(STIFFNESS))
    reader.add_argument("--starts", type=int, default=4)
    reader.add_argument("--further", type=int, default=1_000, help="iterations after the certificate")
    reader.add_argument("--processes", type=int, default=1)
    asked = reader.parse_args()
    cases = [Case("ball", size, stretch) for size, stretch in product(asked.sizes, asked.stiffness)]
    with ProcessPoolExecutor(asked.processes, mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(fitted, case, asked.device, start, asked.further)
            for case, start in product(cases, range(asked.starts))
        ]
        for job in jobs:
            print(job.result(), flush=True)


if __name__ == "__main__":
    main()
