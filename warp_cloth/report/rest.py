"""Did a fit come to rest? If not: what misses its limit, and which part of which garment still moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.loading.raw import counted
from warp_cloth.model.attempt import CutShort
from warp_cloth.model.first_attempt import MOST_ITERATIONS
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.model.result import Status
from warp_cloth.report.judged import JudgedScene, listed
from warp_cloth.report.numbers import short_number

if TYPE_CHECKING:
    from warp_cloth.solver.certificate.certifier import Check, Tolerance

MOVES = 0.1  # of the longest motion: a vertex that moves less is carried along


def rest_problem(of: JudgedScene) -> FitProblem | None:
    """Why a fit is not at rest; None where it is."""
    outcome = of.outcome
    if outcome.status is Status.AT_REST:
        return None
    if outcome.status is Status.DIVERGED:
        return FitProblem(
            ProblemCode.DIVERGED,
            f"The fit diverged after {outcome.check.iteration:,} iterations, beyond the range of the precision; this "
            "is the last finite shape.",
            'Use a smaller solver.cap, a softer fabric, or solver.precision = "float64".',
            figures={"iterations": outcome.check.iteration},
        )
    return _not_at_rest(of)


def _not_at_rest(of: JudgedScene) -> FitProblem:
    check = of.outcome.check
    figures: dict[str, float] = {
        "iterations": of.outcome.iterations,
        "relative_rms": check.residual.relative_rms,
        "relative_p99": check.residual.relative_p99,
        "rest_error_mm": 1e3 * check.rest_error,
        "growing_mm": 1e3 * check.growing,
    }
    missed, name, vertices = ", ".join(limits_missed(check, of.tolerance)), "", np.zeros(0, dtype=np.int64)
    sentence = f"Not at rest after {counted(of.outcome.iterations, 'iteration')}{_stalled(of)}: {missed}"
    moved = of.outcome.moved
    if moved is not None and np.isfinite(moved).all() and moved.max(initial=0.0) > 0.0:
        most = max(of.garments, key=lambda judged: float(moved[judged.vertices].max(initial=0.0)))
        own = moved[most.vertices]
        vertices, name = np.flatnonzero(own > MOVES * own.max()), most.name
        start = most.garment.points[:, 1]
        upper = float((start[vertices] >= np.median(start)).mean())
        share = len(vertices) / len(own)
        figures |= {"moved_mm": 1e3 * float(own.max()), "moving_fraction": share, "upper_fraction": upper}
        sentence += (
            f'; {_part(upper)} of "{name}" still moves, {100 * share:.0f} % of its vertices by up to '
            f"{short_number(1e3 * float(own.max()), 2)} mm from check to check"
        )
    return FitProblem(ProblemCode.NOT_AT_REST, f"{sentence}.", _remedy(of), name, figures, vertices=listed(vertices))


def limits_missed(check: Check, tolerance: Tolerance) -> list[str]:
    """The limits of the certificate that were not met, each with its figure."""
    residual = check.residual
    misses = []
    if not residual.relative_rms <= tolerance.relative_rms:
        misses.append(f"relative residual {short_number(residual.relative_rms, 2)} (limit {tolerance.relative_rms:g})")
    if not residual.relative_p99 <= tolerance.relative_p99:
        p99 = short_number(residual.relative_p99, 2)
        misses.append(f"its 99th percentile {p99} (limit {tolerance.relative_p99:g})")
    if not check.rest_error <= tolerance.rest_error:
        error = short_number(1e3 * check.rest_error, 2)
        misses.append(f"rest error {error}{' mm' * (error != 'unknown')} (limit {1e3 * tolerance.rest_error:g} mm)")
    if not check.growing <= tolerance.growing:
        misses.append(f"some folds still move faster at every check ({short_number(1e3 * check.growing, 2)} mm)")
    return misses or ["cloth is still being untangled"]


def _stalled(of: JudgedScene) -> str:
    return ", and no nearer to it any more" if of.outcome.cut_short is CutShort.STALLED else ""


def _part(upper: float) -> str:
    """Which part of a garment moves, by the fraction of what moves that is in its upper half."""
    if upper > 0.75:
        return "the upper half"
    return "the lower half" if upper < 0.25 else "all"


def _remedy(of: JudgedScene) -> str:
    if of.scene.solver.method == "direct":
        return "Leave solver.method out: the direct rule is for study, and keeps oscillating where cloth is stiff."
    if _stalled(of) or of.scene.solver.iterations == MOST_ITERATIONS:
        return (
            "Look at what moves: cloth that starts wound round a limb or jammed between garments cannot come to rest; "
            "else try a coarser mesh or a softer fabric."
        )
    return (
        f"Raise solver.iterations (now {of.scene.solver.iterations:,}); if it does not come to rest then, try a "
        "coarser mesh or a softer fabric to check that the scene is as intended."
    )
