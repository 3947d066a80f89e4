"""From relaxed scenes to fits: measure the draped shapes, write status sentence and report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider, depth_summary, depths_under, exact_colliders
from warp_cloth.avatar.penetration import edge_places, face_places, may_show, pierced, shown
from warp_cloth.base.mesh import Points
from warp_cloth.base.threads import map_in_threads
from warp_cloth.contact.garments import model_crossings, worn_crossings
from warp_cloth.fitting.clock import StageClock
from warp_cloth.fitting.problem import Problem, tolerance_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import FitResult, LevelRun, Penetration, Status, Strain, WornGarment
from warp_cloth.report.build import build_report
from warp_cloth.report.measurements import Measurements
from warp_cloth.report.status import status_sentence
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.strains import Strains, measured_strains, strain_summary, yarn_summaries
from warp_cloth.solver.loop import Outcome


def finish_fits(
    problem: Problem,
    outcomes: Sequence[Outcome],
    *,
    levels: Sequence[Sequence[LevelRun]],
    clock: StageClock,
    frames: int = 0,
) -> list[FitResult]:
    """Measures relaxed scenes, and writes their status sentences and reports.

    Args:
        problem: the scenes, as they were relaxed.
        outcomes: of each scene.
        levels: relaxations that came before, of each scene.
        clock: of the stages, for all scenes together.
        frames: number of intermediate shapes that each garment keeps.
    """
    measured = _measure(problem, outcomes, levels)
    clock.lap("measure")
    results = []
    for scene, outfit, outcome, found in zip(problem.scenes, problem.outfits, outcomes, measured, strict=True):
        garments = tuple(
            replace(worn, fields=found.crossings.marked(index, worn.mesh))
            for index, worn in enumerate(_worn_garments(scene, outfit, outcome, frames))
        )
        worn = [garment.points for garment in garments]
        message, loss = status_sentence(scene, outfit, outcome, found, worn, tolerance_of(scene))
        report = build_report(
            scene,
            outfit,
            outcome,
            found,
            message=message,
            loss=loss,
            seconds=clock.seconds if len(outcomes) == 1 else {**clock.seconds, "relax": outcome.seconds},
            device=problem.model.device,
        )
        results.append(FitResult(scene, outcome.status, message, garments, outfit.avatar, report, problem.model.device))
    return results


def _measure(problem: Problem, outcomes: Sequence[Outcome], levels: Sequence[Sequence[LevelRun]]) -> list[Measurements]:
    """Strains, penetration and crossings of every scene as it was relaxed."""
    model = problem.model
    for item, outcome in enumerate(outcomes):
        if outcome.status is Status.DIVERGED:
            model.set_points(outcome.points, item)
    strains = measured_strains(model)
    worn = [outcome.points for outcome in outcomes]
    depths = _penetrations(problem, outcomes, exact_colliders(problem.avatar_surfaces(), model.device), strains)
    if all(np.isfinite(points).all() for points in worn):
        crossings = model_crossings(model, problem.outfits)
    else:
        crossings = worn_crossings(problem.outfits, worn, model.device)

    def strains_of(item: int) -> tuple[Strain, dict[str, Strain]]:
        yarns = strains.of_yarns(model.of_item(item, model.weave_start))
        return strain_summary(strains.edge[model.of_item(item, model.edge_start)]), yarn_summaries(yarns)

    summaries = map_in_threads(strains_of, range(len(outcomes)))
    return [
        Measurements(*summaries[item], depths[item], crossings[item], problem.contact_report(item), levels[item])
        for item in range(len(outcomes))
    ]


def _penetrations(
    problem: Problem,
    outcomes: Sequence[Outcome],
    exact_of: Sequence[ExactCollider | None],
    strains: Strains,
) -> list[Penetration | None]:
    """Depth of every scene's vertices, edges and faces in its avatar; ``strains`` are those of all scenes.

    One query serves all scenes, as a GPU answers a million points as fast as a few.
    """
    model = problem.model
    position = model.state.position if model.state.position.dtype is wp.vec3d else model.points()
    vertex_depths = depths_under(position, np.diff(model.item_start).tolist(), exact_of)

    def sample_points(item: int) -> tuple[Points, NDArray[np.float64], Points]:
        """Points along edges that may pass through the avatar, the edges' lengths, and points within large faces."""
        garments, points = problem.outfits[item].garments, outcomes[item].points
        first = np.cumsum([0, *(len(garment.points) for garment in garments)]).tolist()
        strain = strains.edge[model.of_item(item, model.edge_start)].astype(np.float64)
        edges = np.concatenate(
            [garment.rest.topology.edges + start for garment, start in zip(garments, first, strict=False)]
        )
        along = edge_places(points, edges, strain)
        longest = float(((1.0 + strain) * np.concatenate([garment.rest.edge_length for garment in garments])).max())
        if not may_show(longest):
            return *along, np.zeros((0, 3))
        triangles = np.concatenate([garment.triangles + start for garment, start in zip(garments, first, strict=False)])
        return *along, face_places(points, triangles)

    samples = map_in_threads(sample_points, range(len(outcomes)))
    queries = np.concatenate([points for along, _, within in samples for points in (along, within)])
    sample_depths = depths_under(queries, [len(along) + len(within) for along, _, within in samples], exact_of)
    penetrations: list[Penetration | None] = []
    for exact, depths, (along, lengths, _), own in zip(exact_of, vertex_depths, samples, sample_depths, strict=True):
        if exact is None:
            penetrations.append(None)
            continue
        edges, edge_max = pierced(own[: len(along)], lengths)
        faces, face_max = shown(own[len(along) :])
        penetrations.append(
            replace(depth_summary(depths), edges=edges, edge_max=edge_max, faces=faces, face_max=face_max)
        )
    return penetrations


def _worn_garments(scene: Scene, outfit: Outfit, outcome: Outcome, frames: int) -> tuple[WornGarment, ...]:
    worn = []
    first = 0
    for spec, mesh, garment in zip(scene.garments, outfit.meshes, outfit.garments, strict=True):
        vertices = slice(first, first + mesh.vertex_count)
        first = vertices.stop
        points: Points = outcome.points[vertices]
        shapes = _chosen_frames(outcome, vertices, mesh.points, points, frames) if frames else None
        fabric = spec.fabric
        worn.append(WornGarment(spec.name, mesh, points, fabric.thickness, shapes, fabric=fabric, rest=garment.rest))
    return tuple(worn)


def _chosen_frames(outcome: Outcome, vertices: slice, first: Points, last: Points, count: int) -> NDArray[np.float32]:
    """``count`` shapes: the loaded one first, then evenly chosen ones, the worn one last; shape [count, V, 3].

    Where fewer shapes are known than frames are requested, each serves for several frames.
    """
    shapes = [shape[vertices] for iteration, shape in outcome.frames if iteration < outcome.iterations]
    known = [first.astype(np.float32), *(shape for shape in shapes if np.isfinite(shape).all())]
    picks = np.linspace(0, len(known) - 1, count - 1).round().astype(int)
    return np.stack([*(known[pick] for pick in picks), last.astype(np.float32)])
