"""How far fits end from a float64 reference, and after how much work: hanging squares, strips, cloth over a ball.

    python tests/benchmarks/agreement.py --device cuda:0 --out agreement.json --processes 8

Each fit continues from the certificate (the work until then is printed, all levels weighted by vertices) to a stricter
one; contact-free ones until the forces are balanced to a hundredth of a vertex's weight. The reference of these is the
least energy in float64 near where the fit ended, by L-BFGS preconditioned with the linearised forces; of many vertices
the float64 kernels, run on from there far past the tolerance. Over a ball (friction 0.5, nothing pinned) these, too.

The folds depend on the last bits of the start: ``--starts 4`` fits each case from so many starts, a hundredth of a
micrometre apart. Fine and stiff cloth over a ball may need ``--limit 40000`` till the reference itself is at rest.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1]))

from measured import Figures, script_parser
from methods_scenes import KINDS, SIZES, STIFFNESS, Case, case_tree
from reference import Potential, preconditioned_rest

from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import (
    Problem,
    build_problem,
    collider_updates,
    load_problem,
    start_coarse,
    tolerance_of,
)
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import Check, Measurement, Tolerance
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import relax_items

WITHIN_MM = {"hanging": 0.1, "strip": 0.1, "ball": 0.5}  # rms
WEIGHTS = 0.01  # rms, of contact-free scenes
LIMIT = 20_000
MOVED = 1e-8  # [m], standard deviation of each coordinate, of the starts that are moved
PRINTED = 2_000  # iterations between two lines about a reference
NEVER = Tolerance(0.0, 0.0, 0.0)
BEYOND = Tolerance(relative_rms=1e-3, relative_p99=5e-3, rest_error=1e-5)  # what a reference is run on to
BEYOND_LIMIT = {"accelerated": 60_000, "multilevel": 10_000}
FACTORISED = 5_000  # vertices up to which the linearised forces are factorised


@dataclass(frozen=True)
class FitOptions:
    """How to fit a case and find its reference."""

    device: str
    precision: str
    reference: str  # method of the float64 kernels that run on over a ball
    limit: int | None  # of their iterations; None: BEYOND_LIMIT of the method
    factorised: int
    start: int = 0  # number of the random start; 0 is moved by nothing


class ReachedError(Exception):
    """All that was wanted of a relaxation holds."""


@dataclass
class Watch:
    """Sees a fit through its first certificate to what is wanted for beyond."""

    problem: Problem
    wanted: Tolerance
    beyond: Tolerance
    weights: float
    rest: int = 0  # iteration of the first certificate
    at_rest: Points | None = None  # the shape there
    check: Check | None = field(default=None)

    def see(self, measured: Measurement, _: float) -> None:
        """Called with every measurement."""
        self.check = check = self.problem.certifier.check(measured, 0)
        if not self.rest and check.within(self.wanted):
            self.rest, self.at_rest = check.iteration, self.problem.model.points()
        if self.done():
            raise ReachedError

    def done(self) -> bool:
        """Whether the shape of the last check is good enough."""
        found = self.check
        return found is not None and found.within(self.beyond) and found.residual.rms <= self.weights


def prepared(case: Case, device: str, **solver: Any) -> Problem:
    """A case on the device."""
    with TemporaryDirectory() as folder:
        tree = {**case_tree(case, Path(folder)), "solver": {"iterations": LIMIT, **solver}}
        return load_problem(load_scene(tree), device)


def shake(problem: Problem, start: int) -> None:
    """Moves the garments by MOVED where they start, by the random numbers of that start."""
    random = np.random.default_rng(start)
    for garment in problem.outfit.garments:
        garment.points[:] += MOVED * random.standard_normal(garment.points.shape)
    problem.model.set_points(np.concatenate([garment.points for garment in problem.outfit.garments]))


def fitted(case: Case, problem: Problem, row: dict[str, Any]) -> Watch:
    """The fit, beyond its certificate."""
    began = time.perf_counter()
    levels = start_coarse(problem)
    coarse_seconds = time.perf_counter() - began
    wanted = tolerance_of(problem.scenes[0])
    beyond = Tolerance(wanted.relative_rms, wanted.relative_p99, 1e-3 * WITHIN_MM[case.kind])
    watch = Watch(problem, wanted, beyond, math.inf if case.kind == "ball" else WEIGHTS)
    with suppress(ReachedError):
        relax_items(
            problem.certifier,
            [Goal(NEVER, LIMIT)],
            follow=collider_updates(problem),
            on_check=watch.see,
            ahead=False,
        )
    check, coarse = watch.check, sum(level.iterations * level.vertices for level in levels) / problem.model.vertex_count
    row |= {
        "vertices": problem.model.vertex_count, "precision": problem.model.precision,
        "coarse": round(coarse), "work": round(coarse + watch.rest) if watch.rest else math.inf,
        "status": "at_rest" if watch.done() else "iteration_limit", "iterations": check.iteration,
        "weights": check.residual.rms, "relative": check.residual.relative_rms,
        "rest_error_mm": 1e3 * check.rest_error, "coarse_seconds": coarse_seconds,
        "fit_seconds": time.perf_counter() - began,
    }  # fmt: skip
    return watch


def float64_problem(problem: Problem, method: str) -> Problem:
    """The same garments by a method, in float64."""
    (scene,) = problem.scenes
    solver = scene.solver.model_copy(update={"method": method, "precision": "float64"})
    return build_problem([scene.model_copy(update={"solver": solver})], problem.outfits, problem.model.device)


def apart(a: Points, b: Points) -> tuple[float, float]:
    """Distance of two shapes' vertices [mm]: rms, and the largest."""
    distance = 1e3 * np.linalg.norm(a - b, axis=1)
    return float(np.sqrt(np.mean(distance**2))), float(distance.max())


def run_on(case: Case, wanted: FitOptions, other: Problem, problem: Problem) -> tuple[Points, float, str]:
    """The float64 kernels from where a fit ended far past the tolerance: where, the force left in weights, in words.

    They use that fit's last distance field of the body: a new one would differ by micrometres.
    """
    points = problem.model.points()
    other.model.set_points(points)
    method = "accelerated"
    if isinstance(other.relaxation, MultilevelRelaxation):
        other.relaxation.start_near_rest()
        method = "multilevel"
    if case.kind == "ball":
        other.relaxation.set_collider(0, other.contact.reused_from(problem.contact, points))
    most = BEYOND_LIMIT[method] if wanted.limit is None else wanted.limit

    def show(measured: Measurement, seconds: float) -> None:
        if measured.iteration % PRINTED == 0:
            check = other.certifier.check(measured, 0)
            rms, largest = apart(other.model.points(), points)
            print(
                f"{case.name}, {wanted.start}: {rms:.3g} mm rms, {largest:.3g} at most after {check.iteration}, "
                f"{1e3 * check.rest_error:.3g} left, {seconds:.0f} s",
                flush=True,
            )

    (outcome,) = relax_items(other.certifier, [Goal(BEYOND, most)], follow=collider_updates(other), on_check=show)
    words = f"float64 {method}, {outcome.iterations} iterations, {1e3 * outcome.check.rest_error:.3g} mm left"
    return outcome.points, outcome.check.residual.rms, words


def line_of(row: dict[str, Any]) -> str:
    """A row in one line."""
    return " ".join(
        f"{key}={value:.3g}" if isinstance(value, float) else f"{key}={value}" for key, value in row.items()
    )


def judged(job: tuple[Case, FitOptions, AbstractContextManager]) -> dict[str, Any]:
    """One case; on a GPU few processes relax at a time, as more would only slow each other down."""
    case, wanted, slot = job
    start_warp(False)
    row: dict[str, Any] = {"scene": case.name, "start": wanted.start}
    began = time.perf_counter()
    problem = prepared(case, wanted.device, method="multilevel", precision=wanted.precision)
    if wanted.start:
        shake(problem, wanted.start)
    row["set_up_seconds"] = time.perf_counter() - began
    with slot:
        watch = fitted(case, problem, row)
        points = problem.model.points()
    print("fit", line_of(row), flush=True)  # the reference takes longer
    began = time.perf_counter()
    if case.kind == "ball" or len(points) > wanted.factorised:
        other = float64_problem(problem, wanted.reference if case.kind == "ball" else "multilevel")
        with slot:
            true, row["left"], row["reference"] = run_on(case, wanted, other, problem)
    else:
        (mesh,), (garment,) = problem.outfit.meshes, problem.outfit.garments
        true, row["left"], rounds = preconditioned_rest(Potential(mesh, garment.rest, garment.pins), points)
        row["reference"] = f"L-BFGS, {rounds} rounds"
    row["rms_mm"], row["max_mm"] = apart(points, true)
    if watch.at_rest is not None:
        row["certified_rms_mm"], row["certified_max_mm"] = apart(watch.at_rest, true)
    row["reference_seconds"] = time.perf_counter() - began
    return row


def rows_of(cases: list[Case], wanted: Sequence[FitOptions], processes: int, slots: int) -> Iterator[dict[str, Any]]:
    """The cases' rows, as they are found."""
    context = get_context("spawn")
    with context.Manager() as manager, context.Pool(processes) as pool:
        slot = manager.BoundedSemaphore(slots)
        yield from pool.imap_unordered(judged, [(case, each, slot) for case in cases for each in wanted])


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--out", type=Path, default=Path("agreement.json"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--slots", type=int, default=3, help="processes that relax at a time")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    parser.add_argument("--sizes", nargs="+", type=int, default=list(SIZES))
    parser.add_argument("--stiffness", nargs="+", type=float, default=list(STIFFNESS))
    parser.add_argument("--limit", type=int, help="iterations of float64 kernels that run on")
    parser.add_argument("--starts", type=int, default=1, help="of each case, a hundredth of a micrometre apart")
    parser.add_argument("--precision", default="mixed")
    parser.add_argument("--reference", choices=list(BEYOND_LIMIT), default="multilevel", help="over a ball")
    parser.add_argument("--factorised", type=int, default=FACTORISED, help="vertices up to which SciPy factorises")
    options = parser.parse_args()
    sizes = sorted(options.sizes, reverse=True)
    cases = [Case(kind, size, k) for size in sizes for kind in options.kinds for k in options.stiffness]
    wanted = FitOptions(options.device, options.precision, options.reference, options.limit, options.factorised)
    rows = []
    starts = [replace(wanted, start=start) for start in range(options.starts)]
    for row in rows_of(cases, starts, options.processes, options.slots):
        rows.append({key: None if value == math.inf else value for key, value in row.items()})
        print("@", line_of(row), flush=True)
        options.out.write_text(json.dumps(rows, indent=1))
    with Figures(__file__, options, device=options.device) as figures:
        add_figures(figures, "ball", [row for row in rows if row["scene"].startswith("ball")])
        add_figures(figures, "hanging_and_strips", [row for row in rows if not row["scene"].startswith("ball")])


def add_figures(figures: Figures, label: str, rows: Sequence[dict[str, Any]]) -> None:
    """Adds how far the fits of some kinds are from their references, at most."""
    if rows:
        figures.add(f"{label}.fits", len(rows), "fits")
        figures.add(f"{label}.largest_residual", max(row["weights"] for row in rows), "vertex weights")
        figures.add(f"{label}.rms", max(row["rms_mm"] for row in rows), "mm")
        figures.add(f"{label}.max", max(row["max_mm"] for row in rows), "mm")


if __name__ == "__main__":
    wp.config.quiet = True
    main()
