"""The content of report.json, under stable keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from warp_cloth.model.plan import make_plan
from warp_cloth.report.verdict import is_worn, verdict

if TYPE_CHECKING:
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.model.attempt import Attempt
    from warp_cloth.model.fit_problem import FitProblem
    from warp_cloth.model.result import AttemptRun
    from warp_cloth.report.measurements import Measurements
    from warp_cloth.scene import Scene
    from warp_cloth.solver.goal import Outcome


def build_report(
    attempt: Attempt,
    outfit: Outfit,
    outcome: Outcome,
    measured: Measurements,
    *,
    problems: Sequence[FitProblem],
    attempts: Sequence[AttemptRun],
    seconds: dict[str, float],
    device: str,
) -> dict[str, Any]:
    """The report of one scene; units are in the keys' names.

    Args:
        attempt: the one whose shape is the result.
        outfit: its garments and avatar.
        outcome: of the relaxation.
        measured: of the worn shape.
        problems: what is wrong with the garments.
        attempts: all of them, in order.
        seconds: of each stage.
        device: Warp's name of it.
    """
    scene = attempt.scene
    relaxing, overlap, crossings = seconds["relax"], measured.overlap, measured.crossings
    topologies = [garment.rest.topology for garment in outfit.garments]
    yarns = {direction: asdict(strain) for direction, strain in measured.yarn_strains.items()}
    return {
        "status": outcome.status.value,
        "message": verdict(outcome, problems),
        "worn": is_worn(outcome.status, problems),
        "problems": [problem.as_json() for problem in problems],
        "vertices": sum(len(garment.points) for garment in outfit.garments),
        "faces": sum(len(garment.triangles) for garment in outfit.garments),
        "edges": sum(len(topology.edges) for topology in topologies),
        "hinges": sum(len(topology.hinges) for topology in topologies),
        "iterations": outcome.iterations,
        "levels": [{**asdict(level), "status": level.status.value} for level in measured.levels],
        "attempts": [{**asdict(attempt), "status": attempt.status.value} for attempt in attempts],
        "seconds": seconds,
        "iterations_per_second": sum(each.iterations for each in attempts) / relaxing if relaxing > 0.0 else None,
        "device": device,
        "precision": scene.solver.precision,
        "residual": asdict(outcome.check.residual),
        "rest_error_mm": 1e3 * outcome.check.rest_error,
        "growing_mm": 1e3 * outcome.check.growing,
        "strain": {**asdict(measured.strain), **yarns},
        "penetration_mm": asdict(overlap.summary) if overlap is not None else None,
        "crossings": {"pairs": crossings.pairs, "between_garments": crossings.between, "faces": crossings.face_count},
        "contact": measured.contact,
        "garments": _garments(scene, outfit, measured),
        "avatar": {"unit": outfit.avatar.unit, "notes": list(outfit.avatar.notes)} if outfit.avatar else None,
        "choices": [asdict(choice) for choice in measured.choices],
        "plan": [asdict(term) for term in make_plan(scene, outfit)],
        "settings": attempt.stated.settings(),
    }


def _garments(scene: Scene, outfit: Outfit, measured: Measurements) -> list[dict[str, Any]]:
    garments = zip(scene.garments, outfit.meshes, outfit.garments, measured.crossings.faces, strict=True)
    return [
        {
            "name": spec.name,
            "unit": mesh.unit,
            "area_m2": garment.rest.area,
            "pinned": len(garment.pins),
            "notes": [*mesh.notes, *garment.rest.notes],
            "crossing_faces": faces.tolist(),
        }
        for spec, mesh, garment, faces in garments
    ]
