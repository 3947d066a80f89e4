"""From relaxed scenes to fits: measure the draped shapes, find what is wrong with them, write the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from warp_cloth.base.clock import StageClock
from warp_cloth.base.forks import map_in_forks
from warp_cloth.base.mesh import Points
from warp_cloth.contact.garments import GarmentCrossings
from warp_cloth.fitting.attempts import Course, Run
from warp_cloth.fitting.film import Dressing, Film, film_of
from warp_cloth.fitting.problem import tolerance_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import FitResult, WornGarment
from warp_cloth.report.build import build_report
from warp_cloth.report.measurements import Measurements
from warp_cloth.report.problems import find_problems
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.strains import Strains, measured_strains, strain_summary, yarn_summaries
from warp_cloth.solver.goal import Outcome


def finish_fits(
    courses: Sequence[Course],
    *,
    clock: StageClock,
    frames: int = 0,
    dressings: Sequence[Dressing] = (),
    copies: int = 0,
) -> list[FitResult]:
    """Measures relaxed scenes, finds their problems, and writes their reports.

    Args:
        courses: of each scene; the problem of its best run holds the scene as that left it.
        clock: of the stages, for all scenes together.
        frames: number of intermediate shapes that each garment keeps.
        dressings: of each garment of a lone scene, where it was dressed on a body that moved.
        copies: of this process, that measure some scenes each, at most.
    """
    runs = [course.best for course in courses]
    alone = len(runs) == 1
    # here, not in copies: the device may be needed
    strains = {model: measured_strains(model) for model in dict.fromkeys(run.problem.model for run in runs)}
    contacts = [run.problem.contact_report(run.item) for run in runs]
    modelled = [course.modelled if course.best.crossings.pairs else () for course in courses]

    def told(place: int) -> tuple[tuple[FitProblem, ...], dict[str, Any]]:
        course, run, outfit = courses[place], runs[place], runs[place].outfit
        scene, outcome = run.attempt.scene, run.outcome
        measured = _measured(run, strains[run.problem.model], contacts[place], modelled[place])
        problems = find_problems(scene, outfit, outcome, measured, tolerance_of(scene))
        report = build_report(
            run.attempt,
            outfit,
            outcome,
            measured,
            problems=problems,
            attempts=course.summary(),
            seconds=clock.seconds if alone else {**clock.seconds, "relax": course.seconds},
            device=run.problem.model.device,
        )
        return problems, report

    clock.lap("measure")
    every = map_in_forks(told, range(len(runs)), copies)
    results = []
    for course, run, (problems, report) in zip(courses, runs, every, strict=True):
        scene, outfit, outcome = run.attempt.scene, run.outfit, run.outcome
        film = film_of(course, outfit, frames, dressings) if frames else None
        garments = tuple(
            replace(worn, fields=run.crossings.marked(index, worn.mesh))
            for index, worn in enumerate(_worn_garments(scene, outfit, outcome, film))
        )
        ended = outcome.status, report["worn"], problems, report["message"]
        made = garments, outfit.avatar, report, run.problem.model.device
        moves = None if film is None else film.avatar
        facing = next((each.skeleton.facing for each in outfit.wearing if each is not None), 0)
        results.append(FitResult(run.attempt.stated, *ended, *made, avatar_frames=moves, facing=facing))
    clock.lap("measure")
    return results


def _measured(
    run: Run, strains: Strains, contact: dict[str, Any] | None, modelled: Sequence[GarmentCrossings]
) -> Measurements:
    """What the report says of a scene as it was relaxed."""
    model, item = run.problem.model, run.item
    edge_strains = strains.edge[model.of_item(item, model.edge_start)]
    yarns = yarn_summaries(strains.of_yarns(model.of_item(item, model.weave_start)))
    return Measurements(
        strain_summary(edge_strains),
        yarns,
        edge_strains=edge_strains,
        overlap=run.overlap,
        crossings=run.crossings,
        contact=contact,
        misplaced=run.placement.misplaced,
        off_shoulders=run.placement.off_shoulders,
        modelled=modelled,
        levels=run.levels,
        choices=run.problem.choices(item),
    )


def _worn_garments(scene: Scene, outfit: Outfit, outcome: Outcome, film: Film | None) -> tuple[WornGarment, ...]:
    worn = []
    first = 0
    for number, (spec, mesh, garment) in enumerate(zip(scene.garments, outfit.meshes, outfit.garments, strict=True)):
        vertices = slice(first, first + mesh.vertex_count)
        first = vertices.stop
        points: Points = outcome.points[vertices]
        shapes, fabric = None if film is None else film.garments[number], spec.fabric
        worn.append(WornGarment(spec.name, mesh, points, fabric.thickness, shapes, fabric=fabric, rest=garment.rest))
    return tuple(worn)
