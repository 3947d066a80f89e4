"""Problems of a shape that a test made, measured as those of a fit, without one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warp_cloth.base.mesh import Points
from warp_cloth.fitting.judge import measured_shape
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import Residual, Status
from warp_cloth.report.problems import find_problems
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.certifier import Check, Tolerance
from warp_cloth.solver.goal import Outcome


def loaded(values: dict[str, Any], start: Points | None = None) -> tuple[Scene, Outfit]:
    """A scene as its first attempt has it, and what is loaded for it.

    ``start`` replaces where its only garment begins [m], shape [V, 3].
    """
    scene = load_scene(values)
    outfit = load_outfit(scene)
    if start is not None:
        (garment,) = outfit.garments
        outfit = replace(outfit, garments=(replace(garment, points=start),))
    return first_attempt(scene, outfit).scene, outfit


def judge(
    scene: Scene,
    outfit: Outfit,
    worn: Points | None = None,
    *,
    status: Status = Status.AT_REST,
    check: Check | None = None,
    moved: Points | None = None,
    contact: dict[str, Any] | None = None,
) -> dict[str, FitProblem]:
    """The problems of garments at these points [m], shape [V, 3], by code; None: where they start."""
    points = np.concatenate([garment.points for garment in outfit.garments]) if worn is None else worn
    check = check or Check(100, Residual(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, True)
    measured = measured_shape(outfit, points, "cpu", contact)
    outcome = Outcome(status, check, points, check.iteration, 0.0, moved=moved)
    found = find_problems(scene, outfit, outcome, measured, Tolerance())
    return {problem.code.value: problem for problem in found}
