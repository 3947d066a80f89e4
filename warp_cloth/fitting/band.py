"""The other end of the band in which cloth with friction may rest: the worn garments, let down from the hang.

A fit lays cloth from its rest shape. Whoever dresses pulls it down and lets it go: so the worn garments relax once more
under HUNG times their weight, count as laid into that, and relax under their own. Both shapes are at rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Points
from warp_cloth.base.quantiles import quantiles
from warp_cloth.fitting.problem import Problem, build_problem
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.laid import HUNG, laid_by, laid_into
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import FitResult
from warp_cloth.solver.goal import Outcome
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation


@dataclass(frozen=True)
class Band:
    """How the garments rest once let down, and how far from the fit's own shape that is; for the report."""

    status: str  # how that relaxation ended
    pulled_down: str  # how the one under HUNG times their weight did
    relative_rms: float  # residual
    relative_p99: float
    rest_error_mm: float
    iterations: int  # of both
    apart_mm: dict[str, float]  # distances of vertices of both shapes: p50, p95, max


def check_band(outfit: Outfit) -> None:
    """Refuses garments that rest in one shape.

    Raises:
        InputError: no fabric has friction.
    """
    if not any(garment.terms.hysteresis or garment.terms.shear_hysteresis for garment in outfit.garments):
        remedy = "state bending_hysteresis_2HB or shear_hysteresis_2HG of a fabric, or do without the band"
        raise InputError("band", "no fabric has friction, so that rest is one shape", remedy)


def with_band(
    result: FitResult, problem: Problem, relax: Callable[[Problem], Outcome], cache: Cache, clock: StageClock
) -> FitResult:
    """The result of a lone scene with the other end of its band, in its garments and in the report."""
    worn = [garment.points for garment in result.garments]
    heavy = [
        replace(each, rest=replace(each.rest, vertex_weight=HUNG * each.rest.vertex_weight))
        for each in problem.outfit.garments
    ]
    pulled, pulled_points = _relaxed(problem, heavy, worn, relax, cache, clock)
    laid = [
        replace(each, rest=laid_into(each.rest, laid_by(each.rest, points)))
        for each, points in zip(problem.outfit.garments, pulled_points, strict=True)
    ]
    down, down_points = _relaxed(problem, laid, pulled_points, relax, cache, clock)
    apart = np.linalg.norm(np.concatenate(down_points) - np.concatenate(worn), axis=1)
    p50, p95 = quantiles(apart, 0.5, 0.95)
    residual = down.check.residual
    band = Band(
        status=down.status.value,
        pulled_down=pulled.status.value,
        relative_rms=residual.relative_rms,
        relative_p99=residual.relative_p99,
        rest_error_mm=1e3 * down.check.rest_error,
        iterations=pulled.iterations + down.iterations,
        apart_mm={"p50": 1e3 * p50, "p95": 1e3 * p95, "max": 1e3 * float(apart.max())},
    )
    garments = tuple(replace(each, let_down=points) for each, points in zip(result.garments, down_points, strict=True))
    return replace(result, garments=garments, report={**result.report, "friction_band": asdict(band)})


def _relaxed(
    problem: Problem,
    garments: Sequence[Garment],
    starts: Sequence[Points],
    relax: Callable[[Problem], Outcome],
    cache: Cache,
    clock: StageClock,
) -> tuple[Outcome, list[Points]]:
    """How these garments rest from where they lie, and their shapes there."""
    there = tuple(replace(each, points=start) for each, start in zip(garments, starts, strict=True))
    outfit = replace(problem.outfit, garments=there, poses=(), predrape_garments=())
    attempt = replace(problem.attempts[0], posed=True)  # nothing is moved clear of the avatar again
    again = build_problem([attempt], [outfit], problem.model.device, earlier=problem.contact, cache=cache, clock=clock)
    if isinstance(again.relaxation, MultilevelRelaxation):
        again.relaxation.start_near_rest()
    outcome = relax(again)
    clock.lap("band")
    ends = itertools.pairwise(again.model.vertex_start)
    return outcome, [outcome.points[first:last] for first, last in ends]
