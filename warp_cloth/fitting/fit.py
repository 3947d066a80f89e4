"""The public entry point: a scene to a worn garment. Load, build, relax, certify."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any

import warp as wp

from warp_cloth.base import arguments, mesh_formats
from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.first_run import note_kernels
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.export.formats import check_frames, chosen_formats
from warp_cloth.fitting.attempts import finished_runs, relax_problem, tried_further
from warp_cloth.fitting.band import check_band, with_band
from warp_cloth.fitting.film import Dressing
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.measured_maps import with_maps
from warp_cloth.fitting.predrape import prepare_start
from warp_cloth.fitting.problem import Problem, load_problem
from warp_cloth.fitting.warm_start import earlier_garments, start_from
from warp_cloth.garment.outfit import MeshCache
from warp_cloth.maps import add_girths, chosen_colour, chosen_maps
from warp_cloth.maps.measure import check_maps
from warp_cloth.model.attempt import Patience
from warp_cloth.model.result import FitResult, LevelRun
from warp_cloth.report.shown import shown_verdict
from warp_cloth.scene import Scene, load_scene
from warp_cloth.scene.held_mesh import Held
from warp_cloth.solver.certificate.certifier import Measurement
from warp_cloth.solver.frame_recorder import FrameRecorder
from warp_cloth.solver.goal import Outcome
from warp_cloth.solver.loop import BURST

MOST_KEPT = 256  # entries of either cache; a T-shirt's fabric takes 2 and its size about 10, of some megabytes together
DEVICE_BYTES = 1 << 28  # [bytes] of colliders that later answers may use
MOST_FRAMES = 10_000  # intermediate shapes; for a garment of 10,000 vertices that is 1.2 GB


@dataclass(frozen=True)
class Progress:
    """Progress of a running fit; a number is None while it is not known."""

    # "load", "compile", "build", "carry" (through avatar.poses), "dress" (predrape, posed start), "relax", "measure"
    stage: str
    iteration: int = 0
    iteration_limit: int = 0  # 0: the fit goes on while it makes progress
    residual: float | None = None  # relative, rms
    rest_error_mm: float | None = None
    iterations_per_second: float | None = None
    tolerance_mm: float | None = None  # of the rest error, at which a garment is at rest


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FitResult):
    """A finished fit: whether the garments are worn, what is wrong, their shapes, the report.

    scene     as checked, with what was decided for "auto"
    status    how the relaxation ended: at_rest, iteration_limit, diverged, invalid
    worn      at rest, without a problem that is more than a note
    problems  what is wrong, likeliest cause first: each a code, a message, a remedy, vertices and faces
    message   the verdict in words
    garments  a WornGarment each: points [m], shape [V, 3]; fields; edge_strain, face_strains
    avatar    the body's mesh [m]; None without one
    report    what report.json holds
    device    on which it was made
    maps      ranges of the requested maps' colours; None: no maps
    avatar_frames  its intermediate shapes, float32 [N, V, 3], where it moved to dress; None: it stands still
    ease      girths as cut less the body's [m], by garment and level
    """

    def __repr__(self) -> str:
        problems = ", ".join(problem.code.value for problem in self.problems)
        ended = f"{shown_verdict(self.report).words}, {self.status.value.replace('_', ' ')}"
        return f"<Fit of {self.scene.name!r}: {ended}{f' ({problems})' if problems else ''}>"

    def _repr_html_(self) -> str:
        """What notebooks show: verdict, ease and picture."""
        from warp_cloth.export.notebook import fit_html

        return fit_html(self)

    @property
    def ease(self) -> dict[str, dict[str, float | None]]:
        """By garment and level (chest, waist, hip): its girth as cut less the body's [m]; None: not closed round it.

        Levels that a garment does not reach are left out; without a standing body there are none.
        """
        add_girths(self)
        found: dict[str, dict[str, float | None]] = {}
        for row in self.report["girths_mm"]:
            ease = row["ease"]
            found.setdefault(row["garment"], {})[row["level"]] = None if ease is None else 1e-3 * ease
        return found

    def save(self, directory: str | Path, *, colour: str = "", formats: Sequence[str] = ("usdc",)) -> list[Path]:
        """Writes the result files, and returns their paths.

        These are NAME.usdc (or other ``formats``: usda, usdz, glb, obj, pc2), preview.png, report.json, report.html,
        and a picture of each map. Where the garments came from a USD stage, NAME_over.usda is a layer over that stage.
        report.json is written last: if it is there, the result is complete.

        Args:
            directory: where to write; created if it is missing.
            colour: the map that becomes the garments' displayColor.
            formats: file formats of the worn garments.

        Raises:
            InputError: the directory cannot be written, a file that the scene reads would be overwritten, or there is
                no such format or map.
        """
        from warp_cloth.export.save import save_fit

        map_name = chosen_colour(colour, place="colour")
        if map_name and self.maps is None:
            raise InputError("colour", "the fit has no maps", f'fit with maps="{map_name}"')
        folder, chosen = arguments.path(directory, "directory"), chosen_formats(formats, place="formats")
        framed = any(worn.frames is not None for worn in self.garments)
        check_frames(chosen, frames=framed, place="formats", remedy="fit with frames=48")
        return save_fit(self, folder, colour=map_name, formats=chosen)

    @classmethod
    def of(cls, result: FitResult) -> Fit:
        """The fit of this data."""
        return cls(**{each.name: getattr(result, each.name) for each in fields(FitResult)})


def fit(
    scene: Scene | str | Path | Mapping[str, Any] | Held,
    *,
    on: str | Path | Held | None = None,
    fabric: Any = None,
    device: str | None = None,
    overrides: Sequence[str] | Mapping[str, Any] = (),
    frames: int = 0,
    maps: str | Sequence[str] = (),
    start: Fit | str | Path | None = None,
    band: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Fit:
    """Fits the garments of a scene.

    Calls from several threads run one after another; ``warp_cloth.batch.fit_many`` fits many scenes at once.

    Args:
        scene: the name of a shipped scene, a scene file (TOML), a USD stage, a dict with the keys of a scene file, or
            the result of ``load_scene``; or, with ``on``, a garment's mesh or pattern. Meshes may be in memory,
            see ``load_scene``.
        on: a body's mesh file, or "mannequin", in place of the scene's avatar; ``fit("shirt.obj", on="body.obj",
            fabric="jersey")`` needs no scene.
        fabric: of all garments: a shipped name, a .toml file, a table or a ``Fabric``.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        overrides: changes to the scene, each ``"KEY=VALUE"``, or a dict: ``{"garment.fabric": "denim"}``; not for a
            scene that is loaded already.
        frames: number of intermediate shapes to keep; where the garments were dressed on a moving body, half of them
            show that, and ``avatar_frames`` holds the body's.
        maps: fit maps to compute, such as "strain,pressure,gap", or "all".
        start: an earlier result, or its file (.usdc, .obj, .glb and the like). The garments start as they are worn
            there, if they have the same mesh or panels of the same names.
        band: whether garments that have friction are also let down from the hang, the other end of the band in which
            they may rest: ``garment.let_down`` and report["friction_band"]. It takes about as long again.
        progress: called with a ``Progress`` at every stage and check.

    Raises:
        InputError: the scene or one of its files cannot be used.
    """
    load = partial(loaded_scene, scene, overrides, on, fabric)
    return fit_loaded(load, device, Caches(), frames=frames, maps=maps, start=start, band=band, progress=progress)


@dataclass(frozen=True)
class Caches:
    """Meshes and problems that several fits share."""

    meshes: MeshCache = field(default_factory=MeshCache)
    problems: Cache = field(default_factory=Cache)

    @classmethod
    def limited(cls) -> Caches:
        """Empty caches for a process that goes on fitting: DEVICE_BYTES of colliders at most."""
        caches = cls()
        caches.problems.limit = DEVICE_BYTES
        return caches

    def within_limits(self) -> Caches:
        """These caches; new ones where they hold more than MOST_KEPT entries."""
        return self if max(self.meshes.count, self.problems.count) <= MOST_KEPT else Caches.limited()


@one_thread_at_a_time
def fit_loaded(
    load: Callable[[], Scene],
    device: str | None,
    caches: Caches,
    *,
    frames: int = 0,
    maps: str | Sequence[str] = (),
    start: Fit | str | Path | None = None,
    band: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Fit:
    """Fits the scene that ``load`` returns; ``caches`` hold what earlier fits left; the rest as for ``fit``."""
    if not isinstance(frames, Integral) or not 0 <= frames <= MOST_FRAMES:
        raise InputError("frames", f"must be an integer from 0 to {MOST_FRAMES}, not {frames}")
    if progress is not None and not callable(progress):
        raise InputError("progress", f"must be a function, not {progress}", "pass a function, or None")
    report_progress = progress or (lambda _: None)
    clock, cache = StageClock(lambda stage: report_progress(Progress(stage))), caches.problems
    chosen = load()
    map_names = check_maps(chosen_maps(maps), has_avatar=chosen.avatar is not None)
    clock.lap("load")
    device_name = device_named(device)
    clock.lap("warp")
    if start is not None and chosen.avatar is not None and chosen.avatar.poses:
        raise InputError("avatar.poses", "cannot be combined with an earlier result as the start", "remove one of them")
    earlier = None if start is None else earlier_garments(start, chosen)
    problem = load_problem(
        chosen, device_name, mesh_cache=caches.meshes, cache=cache, clock=clock, may_pose=earlier is None
    )

    if band:
        check_band(problem.outfit)
    watched: list[Dressing] | None = [] if frames and not _from_stage(chosen) else None

    def begin(problem: Problem) -> tuple[LevelRun, ...]:
        """Brings the garments to where every attempt starts: the earlier result, if there is one."""
        if earlier is None or problem.attempts[0].posed or problem.attempts[0].thins:
            return prepare_start(problem, cache, clock, watched)
        if not start_from(problem, earlier):
            place = start if isinstance(start, str | Path) else "start"
            fault = "its garments have neither the mesh nor the panels of the scene's garments"
            raise InputError(place, fault, "start from a result of the same pattern, or from none")
        clock.lap("build")
        return ()

    levels = begin(problem)
    relax = partial(_relax, frames=frames, progress=progress)
    outcome = relax(problem)
    clock.lap("relax")
    (first,) = finished_runs(problem, [outcome], [levels])
    clock.lap("measure")
    course = tried_further(first, begin, relax, cache=cache, clock=clock)
    problem = course.best.problem
    report_progress(Progress("measure"))
    (result,) = finish_fits([course], clock=clock, frames=frames, dressings=watched or ())
    result = with_maps(result, map_names, problem) if map_names else result
    clock.lap("measure")
    if band:
        result = with_band(result, problem, partial(_relax, frames=0, progress=progress), cache, clock)
    fitted = Fit.of(result)
    note_kernels(device_name, wp.config.kernel_cache_dir)
    return fitted


def _from_stage(scene: Scene) -> bool:
    """Whether a garment comes from a USD stage: a layer over that can move garments, but not its avatar."""
    return any(spec.mesh is not None and spec.mesh.suffix.lower() in mesh_formats.USD for spec in scene.garments)


def loaded_scene(scene: Any, overrides: Any, on: Any, fabric: Any) -> Scene:
    """The scene, which is changed only while it is loaded."""
    if not isinstance(scene, Scene):
        return load_scene(scene, overrides, on=on, fabric=fabric)
    given = {"overrides": len(list(overrides)) > 0, "on": on is not None, "fabric": fabric is not None}
    for late in (name for name, stated in given.items() if stated):
        raise InputError(late, "the scene is loaded already", "pass it to load_scene")
    return scene


def _relax(problem: Problem, frames: int, progress: Callable[[Progress], None] | None) -> Outcome:
    """Relaxes a lone scene, and reports progress at every check."""
    (goal,) = problem.goals()
    limit = goal.limit if goal.patience is Patience.NONE else 0
    tolerance = problem.scenes[0].solver.tolerance_mm

    def report_check(measured: Measurement, seconds: float) -> None:
        if progress is not None:
            check = problem.certifier.check(measured, 0)
            rate = check.iteration / seconds if seconds > 0.0 else None
            residual = check.residual.relative_rms
            progress(Progress("relax", check.iteration, limit, residual, check.rest_error * 1e3, rate, tolerance))

    if progress is not None:
        progress(Progress("relax", 0, limit))
    recorder = FrameRecorder(frames, BURST, goal.limit)
    (outcome,) = relax_problem(problem, recorder.offer if frames else None, report_check)
    outcome.frames = recorder.frames
    return outcome
