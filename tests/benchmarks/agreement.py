"""How far fits end from a float64 reference: hanging squares, strips, cloth over a ball, at every size and stiffness.

    python tests/benchmarks/agreement.py --device cuda:0 --out agreement.json --processes 8

Contact-free scenes: the least energy in float64 near where the fit ended, by L-BFGS preconditioned with the linearised
forces; of many vertices the float64 kernels, run on from there far past the tolerance. Over a ball the same kernels by
the other method.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1]))

from reference import Potential, preconditioned_rest

from warp_cloth.mesh import Points
from warp_cloth.quiet import start_warp
from warp_cloth.scene import load_scene
from warp_cloth.set_up import SetUp, following, set_up_one, start_coarse, tolerance_of
from warp_cloth.solver.certificate import Tolerance
from warp_cloth.solver.loop import relax_to_rest
from warp_cloth.solver.multilevel import MultilevelRelaxation
from warp_cloth.study.methods_scenes import KINDS, SIZES, STIFFNESS, Case, case_tree

WITHIN_MM = {"hanging": 0.1, "strip": 0.1, "ball": 0.5}  # rms
WEIGHTS = 0.01  # rms, of contact-free scenes
LIMIT = 20_000
BEYOND = Tolerance(relative_rms=1e-3, relative_p99=5e-3, rest_error=1e-5)
BEYOND_LIMIT = {"accelerated": 60_000, "multilevel": 6_000}
FACTORISED = 5_000  # vertices up to which the linearised forces are factorised


def set_up(case: Case, device: str, **solver: Any) -> SetUp:
    with TemporaryDirectory() as folder:
        tree = {**case_tree(case, Path(folder)), "solver": {"iterations": LIMIT, **solver}}
        return set_up_one(load_scene(tree), device)


def fitted(case: Case, device: str, precision: str) -> dict[str, Any]:
    """The fit at the tolerance that the distance wanted asks for; contact-free ones until weights are balanced."""
    made = set_up(case, device, method="multilevel", tolerance_mm=WITHIN_MM[case.kind], precision=precision)
    levels = start_coarse(made)
    tolerance, done = tolerance_of(made.scenes[0]), 0
    while True:
        outcome = relax_to_rest(made.relaxation, made.certifier, tolerance, LIMIT, follow=following(made))
        done += outcome.iterations
        balanced = case.kind == "ball" or outcome.check.residual.rms <= WEIGHTS
        if balanced or outcome.status.value != "at_rest" or done >= LIMIT:
            break
        tolerance = Tolerance(0.5 * tolerance.relative_rms, tolerance.relative_p99, tolerance.rest_error)
    coarse = sum(level.iterations * level.vertices for level in levels) / made.model.vertex_count
    return {
        "scene": case.name, "vertices": made.model.vertex_count, "precision": precision,
        "status": outcome.status.value, "iterations": done, "work": round(coarse + done),
        "weights": outcome.check.residual.rms, "relative": outcome.check.residual.relative_rms,
        "rest_error_mm": 1e3 * outcome.check.rest_error, "points": outcome.points, "made": made,
    }  # fmt: skip


def run_on(case: Case, device: str, method: str, points: Points) -> tuple[Points, float, str]:
    """The float64 kernels from these points far past the tolerance: where, the force left in weights, in words."""
    made = set_up(case, device, method=method, precision="float64")
    made.model.set_points(points)
    if isinstance(made.relaxation, MultilevelRelaxation):
        made.relaxation.start_near_rest()
    if case.kind == "ball":
        made.relaxation.meet(0, made.contact.collider(points))
    limit = BEYOND_LIMIT[method]
    outcome = relax_to_rest(made.relaxation, made.certifier, BEYOND, limit, follow=following(made))
    told = f"float64 {method}, {outcome.iterations} iterations, {1e3 * outcome.check.rest_error:.3g} mm left"
    return outcome.points, outcome.check.residual.rms, told


def judged(job: tuple[Case, str, str, int]) -> dict[str, Any]:
    case, device, precision, factorised = job
    start_warp(False)
    row = fitted(case, device, precision)
    points, made = row.pop("points"), row.pop("made")
    began = time.perf_counter()
    if case.kind == "ball":
        true, row["left"], row["reference"] = run_on(case, device, "accelerated", points)
    elif len(points) > factorised:
        true, row["left"], row["reference"] = run_on(case, device, "multilevel", points)
    else:
        (mesh,), (part,) = made.wardrobe.garments, made.wardrobe.parts
        potential = Potential(mesh, part.rest, part.pins)
        true, row["left"], rounds = preconditioned_rest(potential, points)
        row["reference"] = f"L-BFGS, {rounds} rounds"
    way = 1e3 * np.linalg.norm(points - true, axis=1)
    row["rms_mm"], row["max_mm"] = float(np.sqrt(np.mean(way**2))), float(way.max())
    row["honest"] = bool(row["rms_mm"] <= row["rest_error_mm"])
    row["seconds"] = time.perf_counter() - began
    return row


def main() -> None:
    parse = argparse.ArgumentParser()
    parse.add_argument("--device", default="cpu")
    parse.add_argument("--out", type=Path, default=Path("agreement.json"))
    parse.add_argument("--processes", type=int, default=2)
    parse.add_argument("--kinds", nargs="+", default=list(KINDS))
    parse.add_argument("--sizes", nargs="+", type=int, default=list(SIZES))
    parse.add_argument("--stiffness", nargs="+", type=float, default=list(STIFFNESS))
    parse.add_argument("--precision", default="mixed")
    parse.add_argument("--factorised", type=int, default=FACTORISED, help="vertices up to which SciPy is asked")
    asked = parse.parse_args()
    cases = [Case(kind, size, k) for size in sorted(asked.sizes)[::-1] for kind in asked.kinds for k in asked.stiffness]
    jobs = [(case, asked.device, asked.precision, asked.factorised) for case in cases]
    rows = []
    with get_context("spawn").Pool(asked.processes) as pool:
        for row in pool.imap_unordered(judged, jobs):
            rows.append({key: None if value == math.inf else value for key, value in row.items()})
            told = " ".join(
                f"{key}={value:.3g}" if isinstance(value, float) else f"{key}={value}" for key, value in row.items()
            )
            print("@", told, flush=True)
            asked.out.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    wp.config.quiet = True
    main()
