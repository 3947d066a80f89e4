"""A scene to a worn garment: load, plan, build, relax, certify. The one road that everything takes."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider, depth_summary, depths_under, exact_colliders
from warp_cloth.avatar.penetration import edge_places, face_places, may_show, pierced, shown
from warp_cloth.base import arguments as given
from warp_cloth.base.cache import Cache
from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.threads import in_turn, map_in_threads
from warp_cloth.contact.garments import model_crossings, worn_crossings
from warp_cloth.fitting.nested_iteration import LevelRun
from warp_cloth.fitting.predrape import prepare_start
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem, tolerance_of
from warp_cloth.fitting.warm_start import Worn, chosen_garments, saved_result, start_from
from warp_cloth.garment.outfit import Outfit
from warp_cloth.maps import FitMaps, chosen_colour, chosen_maps, measure_maps
from warp_cloth.maps.measure import check_maps
from warp_cloth.model.result import Penetration, Status, Strain, WornGarment
from warp_cloth.report.status import (
    crossed,
    fallen_pieces,
    hidden,
    misplaced,
    more_iterations,
    of_another_size,
    report_of,
    slid_off,
    too_coarse,
    unheld,
    verdict,
)
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.certifier import Check
from warp_cloth.solver.certificate.strains import Strains, measured_strains, strain_summary, thread_summaries
from warp_cloth.solver.loop import Outcome, relax_to_rest

MOST_FRAMES = 10_000  # shapes on the way; of a garment of 10,000 vertices that is 1.2 GB


@dataclass(frozen=True)
class Progress:
    """Where a fit stands; figures are None while they are not known."""

    stage: str  # "load", "compile", "build", "carry", "dress", "relax"
    iteration: int = 0
    iteration_limit: int = 0
    residual: float | None = None  # relative, rms
    rest_error_mm: float | None = None
    iterations_per_second: float | None = None


@dataclass(frozen=True, eq=False)
class Fit:
    """A finish_fits fit: how it ended, the worn garments, the report."""

    scene: Scene
    status: Status
    message: str  # one sentence, with what to change where it did not come to rest
    garments: tuple[WornGarment, ...]
    avatar: Mesh | None
    report: dict[str, Any]  # what report.json holds
    device: str
    maps: FitMaps | None = None  # where they were asked for

    def save(self, directory: str | Path, *, colour: str = "", formats: Sequence[str] = ("usdc",)) -> list[Path]:
        """Writes NAME.usdc (or other ``formats``), preview.png, report.json, report.html, pictures of maps and more.

        The map named ``colour`` becomes the stage's displayColor. Where garments came from a USD stage, NAME_over.usda
        is a layer over it. report.json is written last: where it stands, the fit is whole.

        Raises:
            InputError: the folder cannot be written, a file of the scene would be written over, or there is no such
                format or map.
        """
        from warp_cloth.export.formats import chosen_formats
        from warp_cloth.export.save import save_fit

        painted = chosen_colour(colour, place="colour")
        if painted and self.maps is None:
            raise InputError("colour", "the fit has no maps", f'fit with maps="{painted}"')
        return save_fit(
            self, given.path(directory, "directory"), colour=painted, formats=chosen_formats(formats, place="formats")
        )


@in_turn
def fit(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    device: str | None = None,
    overrides: Sequence[str] = (),
    frames: int = 0,
    maps: str | Sequence[str] = (),
    start: Fit | str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Fit:
    """Fits the garments of a scene. Several threads' fits wait for one another; ``fit_many`` fits many at once.

    Args:
        scene: a loaded scene, or what ``load_scene`` takes.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        overrides: ``KEY=VALUE`` changes, where the scene is not loaded yet.
        frames: how many shapes on the way the result keeps.
        maps: fit maps to make, by name (see ``warp_cloth.maps``): "strain,pressure,ease", or "all".
        start: an earlier result, or the file of one (.usdc and the like; .obj or .glb of one garment): the garments
            start as they are worn there, where their meshes or the names of their panels correspond.
        progress: told at every stage and check.

    Raises:
        InputError: something in the scene or its files cannot be used.
    """
    if not isinstance(frames, Integral) or not 0 <= frames <= MOST_FRAMES:
        raise InputError("frames", f"{frames} shapes on the way cannot be kept", f"choose 0 to {MOST_FRAMES}")
    if progress is not None and not callable(progress):
        raise InputError("progress", f"must be a function, not {progress}", "give one, or None")
    tell = progress or (lambda _: None)
    if isinstance(scene, Scene) and overrides:
        raise InputError("overrides", "the scene is loaded already", "give them to load_scene")
    chosen = scene if isinstance(scene, Scene) else load_scene(scene, overrides)
    wanted = check_maps(chosen_maps(maps), has_avatar=chosen.avatar is not None)
    where = device_named(device)
    if start is not None and chosen.avatar is not None and chosen.avatar.poses:
        raise InputError("avatar.poses", "a garment that goes along with an avatar has its start", "leave one out")
    earlier = None if start is None else _earlier(start, chosen)
    clock, cache = _Clock(), Cache()
    made = load_problem(chosen, where, cache=cache, tell=lambda stage: tell(Progress(stage)), lap=clock.lap)
    if chosen.solver.start == "dressed" and earlier is None:
        tell(Progress("dress"))
    levels = prepare_start(made, cache) if earlier is None else ()
    if earlier is not None and not start_from(made, earlier):
        place = start if isinstance(start, str | Path) else "start"
        problem = "its garments have neither the mesh nor the panels of the scene's"
        raise InputError(place, problem, "start from a result of the same pattern, or leave it out")
    outcome = _relax(chosen, made, frames, progress)
    clock.lap("relax")
    (fitted,) = finish_fits(made, [outcome], levels=[levels], lap=clock.lap, seconds=clock.seconds, frames=frames)
    return _with_maps(fitted, wanted, made) if wanted else fitted


def _with_maps(fitted: Fit, names: Sequence[str], made: Problem) -> Fit:
    """The fit with its maps, which its report tells of, too."""
    push = made.certifier.pushes()
    starts = made.model.vertex_start
    called = [worn.name for worn in fitted.garments]
    maps = measure_maps(
        names,
        parts=made.outfit.parts,
        worn=[worn.points for worn in fitted.garments],
        pushes=None if push is None else [push[a:b] for a, b in itertools.pairwise(starts)],
        avatar=made.skins()[0],
        garment_names=called,
        device=fitted.device,
    )
    garments = tuple(
        replace(worn, fields={**worn.fields, **fields})
        for worn, fields in zip(fitted.garments, maps.fields, strict=True)
    )
    report = {**fitted.report, "maps": maps.summary(called), "girths_mm": list(maps.girths)}
    if maps.notes:
        report["map_notes"] = list(maps.notes)
    return replace(fitted, garments=garments, report=report, maps=maps)


def _earlier(start: Fit | str | Path, scene: Scene) -> list[Worn]:
    """The garments of an earlier result that a scene's start from."""
    names = [spec.name for spec in scene.garments]
    if isinstance(start, str | Path):
        return saved_result(Path(start), names)
    if not isinstance(start, Fit):
        raise InputError("start", f"{type(start).__name__} is neither a fit nor its file", "give what fit returned")
    there = [(worn.mesh, worn.points) for worn in start.garments]
    return [there[at] for at in chosen_garments([worn.name for worn in start.garments], names, "start")]


class _Clock:
    """Seconds of each stage."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("load", "compile", "build", "carry", "relax", "measure", "export"), 0.0)
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] += now - self._last
        self._last = now


def _relax(
    scene: Scene,
    made: Problem,
    frames: int,
    progress: Callable[[Progress], None] | None,
) -> Outcome:
    limit = scene.solver.iterations
    tell = progress or (lambda _: None)

    def told(check: Check, seconds: float) -> None:
        tell(
            Progress(
                "relax",
                check.iteration,
                limit,
                check.residual.relative_rms,
                check.rest_error * 1e3,
                check.iteration / seconds if seconds > 0.0 else None,
            )
        )

    tell(Progress("relax", 0, limit))
    return relax_to_rest(
        made.relaxation,
        made.certifier,
        tolerance_of(scene),
        limit,
        frames=frames,
        follow=collider_updates(made),
        course=made.course,
        on_check=told if progress is not None else None,
    )


def finish_fits(
    made: Problem,
    outcomes: Sequence[Outcome],
    *,
    levels: Sequence[Sequence[LevelRun]],
    lap: Callable[[str], None],
    seconds: dict[str, float],
    frames: int = 0,
) -> list[Fit]:
    """Measures relaxed scenes, and puts sentence and report together; ``seconds`` of the stages, of all together.

    ``levels`` are of simplified or dressed garments that relaxed before, of each scene.
    """
    model = made.model
    for item, outcome in enumerate(outcomes):
        if outcome.status is Status.DIVERGED:
            model.set_points(outcome.points, item)
    strains = measured_strains(model)
    worn_points = [outcome.points for outcome in outcomes]
    skins = made.skins()
    exact_of = exact_colliders(skins, model.device)
    depths = _drawn_through(made, outcomes, exact_of, strains)
    if all(np.isfinite(points).all() for points in worn_points):
        crossings = model_crossings(model, made.outfits)
    else:
        crossings = worn_crossings(made.outfits, worn_points, model.device)

    def strains_of(item: int) -> tuple[Strain, dict[str, Strain]]:
        along = strains.of_threads(model.of_item(item, model.weave_start))
        return strain_summary(strains.edge[model.of_item(item, model.edge_start)]), thread_summaries(along)

    summaries = map_in_threads(strains_of, range(len(outcomes)))
    lap("measure")
    fits = []
    for item, (scene, outfit, outcome) in enumerate(zip(made.scenes, made.outfits, outcomes, strict=True)):
        crossing = crossings[item]
        garments = tuple(
            replace(worn, fields=crossing.marked(index, worn.mesh))
            for index, worn in enumerate(_worn(scene, outfit, outcome, frames))
        )
        depth = depths[item]
        contact, kind = made.touched(item), scene.collision.avatar
        last = [worn.points for worn in garments]
        met = depth if kind != "none" else None
        loss = slid_off(scene, outfit, last)
        if outcome.status is not Status.AT_REST:  # what falls is not
            loss = unheld(scene, outfit, last) or loss or fallen_pieces(scene, outfit, last)
        wrong = [loss] if loss else [misplaced(met), of_another_size(summaries[item][0])]
        seen = [hidden(contact, kind), too_coarse(met)]
        if not any(wrong):
            faces = sum(len(part.triangles) for part in outfit.parts)
            seen.append(crossed(crossing.face_count / faces, scene.collision.cloth))
        longer = [] if any(wrong) else [more_iterations(scene, outcome)]
        advice, flaw = ("; and ".join(filter(None, told)) for told in ([*wrong, *longer, *seen], [*wrong, *seen]))
        message = verdict(outcome, tolerance_of(scene), advice, flaw)
        report = report_of(
            scene,
            outfit,
            outcome,
            message=message,
            loss=loss,
            seconds=seconds if len(outcomes) == 1 else {**seconds, "relax": outcome.seconds},
            device=model.device,
            strain=summaries[item][0],
            threads=summaries[item][1],
            depth=depth,
            crossing=crossing,
            contact=contact,
            levels=levels[item],
        )
        fits.append(Fit(scene, outcome.status, message, garments, outfit.avatar, report, model.device))
    return fits


def _drawn_through(
    made: Problem,
    outcomes: Sequence[Outcome],
    exact_of: Sequence[ExactCollider | None],
    strains: Strains,
) -> list[Penetration | None]:
    """How deep every scene's vertices, edges and faces lie in its avatar; ``strains`` are those of all scenes.

    All are asked for together, as a GPU answers a million places as soon as a few.
    """
    model = made.model
    position = model.cloth.position if model.cloth.position.dtype is wp.vec3d else model.points()
    under = depths_under(position, np.diff(model.item_start).tolist(), exact_of)

    def asked(item: int) -> tuple[Points, NDArray[np.float64], Points]:
        parts, points = made.outfits[item].parts, outcomes[item].points
        first = np.cumsum([0, *(len(part.points) for part in parts)]).tolist()
        strain = strains.edge[model.of_item(item, model.edge_start)].astype(np.float64)
        edges = np.concatenate([part.rest.topology.edges + start for part, start in zip(parts, first, strict=False)])
        along = edge_places(points, edges, strain)
        longest = float(((1.0 + strain) * np.concatenate([part.rest.edge_length for part in parts])).max())
        if not may_show(longest):
            return *along, np.zeros((0, 3))
        triangles = np.concatenate([part.triangles + start for part, start in zip(parts, first, strict=False)])
        return *along, face_places(points, triangles)

    asks = map_in_threads(asked, range(len(outcomes)))
    places = np.concatenate([part for along, _, within in asks for part in (along, within)])
    inside = depths_under(places, [len(along) + len(within) for along, _, within in asks], exact_of)
    told: list[Penetration | None] = []
    for exact, depths, (along, lengths, _), own in zip(exact_of, under, asks, inside, strict=True):
        if exact is None:
            told.append(None)
            continue
        count, deepest = pierced(own[: len(along)], lengths)
        faces, most = shown(own[len(along) :])
        told.append(replace(depth_summary(depths), edges=count, edge_max=deepest, faces=faces, face_max=most))
    return told


def _worn(scene: Scene, outfit: Outfit, outcome: Outcome, frames: int) -> tuple[WornGarment, ...]:
    worn = []
    first = 0
    for spec, mesh, loaded in zip(scene.garments, outfit.garments, outfit.parts, strict=True):
        part = slice(first, first + mesh.vertex_count)
        first = part.stop
        points: Points = outcome.points[part]
        shapes = _chosen_frames(outcome, part, mesh.points, points, frames) if frames else None
        kind = spec.fabric
        worn.append(WornGarment(spec.name, mesh, points, kind.thickness, shapes, fabric=kind, rest=loaded.rest))
    return tuple(worn)


def _chosen_frames(outcome: Outcome, part: slice, first: Points, last: Points, count: int) -> NDArray[np.float32]:
    """``count`` shapes: as loaded, evenly among those kept on the way, as worn last; shape [count, V, 3].

    Where fewer shapes are known than frames are wanted, each is held for several frames.
    """
    kept = [shape[part] for iteration, shape in outcome.frames if iteration < outcome.iterations]
    known = [first.astype(np.float32), *(shape for shape in kept if np.isfinite(shape).all())]
    picks = np.linspace(0, len(known) - 1, count - 1).round().astype(int)
    return np.stack([*(known[pick] for pick in picks), last.astype(np.float32)])


__all__ = ["Fit", "Penetration", "Progress", "fit", "tolerance_of"]
