"""Finds the problems of a relaxed scene, each with what was measured and what to change."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import Status
from warp_cloth.report.body import body_problems, unseen_body
from warp_cloth.report.cloth import cloth_problems
from warp_cloth.report.judged import JudgedScene
from warp_cloth.report.rest import rest_problem
from warp_cloth.report.support import support_problems

if TYPE_CHECKING:
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.report.measurements import Measurements
    from warp_cloth.scene import Scene
    from warp_cloth.solver.certificate.certifier import Tolerance
    from warp_cloth.solver.goal import Outcome


def find_problems(
    scene: Scene, outfit: Outfit, outcome: Outcome, measured: Measurements, tolerance: Tolerance
) -> tuple[FitProblem, ...]:
    """The problems of all garments, the likeliest cause first.

    Nothing else is reported of a shape that diverged: where its vertices are means nothing.
    """
    of = JudgedScene(scene, outfit, outcome, measured, tolerance)
    found = [problem for problem in (rest_problem(of), unseen_body(of)) if problem is not None]
    if outcome.status is not Status.DIVERGED and np.isfinite(outcome.points).all():
        for judged in of.garments:
            found += [*support_problems(judged), *body_problems(judged), *cloth_problems(judged)]
    return tuple(sorted(found, key=lambda problem: problem.code.rank))
