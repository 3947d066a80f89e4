"""A live fit: it continues to relax while its scene is changed."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.clock import StageClock
from warp_cloth.base.device import device_named
from warp_cloth.base.mesh import Points
from warp_cloth.fitting.attempts import Course, finished_runs
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.fit import Caches, Fit, Progress, fit_loaded
from warp_cloth.fitting.problem import Problem, build_problem, load_problem, tolerance_of
from warp_cloth.fitting.warm_start import start_from
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.maps import MAPS, add_girths, measure_maps
from warp_cloth.model.result import FitResult, Status, WornGarment
from warp_cloth.scene import MannequinShape, Scene, TshirtShape, load_scene
from warp_cloth.solver.certificate.certifier import Check
from warp_cloth.solver.goal import Outcome

BURST = 20  # iterations between two pictures, at most
LEAST_BURST = 5
SLOW, FAST = 0.06, 0.02  # [s] for a burst; slower ones are halved, faster ones doubled: at least 10 pictures a second
CHECK_ITERATIONS = 100  # between two checks
PLOT_POINTS = 400  # beyond that, every second point is dropped
BODY_MEASURES = ("stature", "chest", "waist", "hip")


@dataclass
class History:
    """Values of the plots: iteration, relative residual, iterations per second."""

    iteration: list[float] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)

    def add(self, iteration: int, residual: float, speed: float) -> None:
        """Adds one check; drops every second point where there are too many."""
        for values, value in ((self.iteration, iteration), (self.residual, residual), (self.speed, speed)):
            values.append(float(value))
            if len(values) > PLOT_POINTS:
                del values[1:-1:2]


def merged_overrides(now: Mapping[str, str], new: Mapping[str, str | None], first: Mapping[str, str]) -> dict[str, str]:
    """Overrides of a scene: ``now`` and the ``new`` ones, each in place of those of its key and of keys below it.

    A new value of None restores the ``first`` overrides of its key and of keys below it.
    """

    def below(overrides: Mapping[str, str], key: str) -> dict[str, str]:
        return {own: value for own, value in overrides.items() if f"{own}.".startswith(f"{key}.")}

    merged = dict(now)
    for key, value in new.items():
        for own in below(merged, key):
            del merged[own]
        merged.update(below(first, key) if value is None else {key: value})
    return merged


class LiveFit:
    """A scene that relaxes in bursts of iterations; a change keeps the worn shape where possible."""

    def __init__(
        self,
        source: str | Path | Mapping[str, Any],
        changes: Mapping[str, str],
        device: str | None,
        progress: Callable[[str], None] = lambda _: None,
        on: str | Path | None = None,
        fabric: Any = None,
    ) -> None:
        """Loads ``load_scene(source, changes, on=on, fabric=fabric)``; ``progress`` is called with each first stage."""
        self._load_changed = partial(load_scene, source, on=on, fabric=fabric)
        self._changes = self._first = dict(changes)
        self._caches = Caches.limited()
        self.device = device_named(device)
        self.scene = self._load(self._changes)
        self.problem: Problem = load_problem(
            self.scene, self.device, mesh_cache=self._caches.meshes, clock=StageClock(progress), **self._shared()
        )
        self._start()

    def _shared(self) -> dict[str, Any]:
        """What every problem is built with: what those before it left, as in a ``Fitter``."""
        self._caches = self._caches.within_limits()
        return {"cache": self._caches.problems}

    def _load(self, changes: Mapping[str, str]) -> Scene:
        """The scene; where it leaves contact of cloth with cloth open, without, which follows changes at once."""
        scene = self._load_whole(changes)
        if scene.collision.cloth != "auto":
            return scene
        return scene.model_copy(update={"collision": scene.collision.model_copy(update={"cloth": False})})

    def _load_whole(self, changes: Mapping[str, str]) -> Scene:
        return self._load_changed([f"{key}={value}" for key, value in changes.items()])

    def _start(self) -> None:
        self.iteration = 0
        self.fitted: Fit | None = None  # what ``fit`` gave, while that is shown
        self._judged: FitResult | None = None  # of the shape at rest
        self.at_rest = self.diverged = False
        self.history = History()
        self.check: Check | None = None
        self._unchecked = 0
        self._burst = BURST
        self._seconds = 0.0
        self.points: Points = self.problem.model.points()
        if self.problem.schedule is not None:
            self.problem.schedule.advance(0)

    @property
    def ended(self) -> bool:
        """Whether the garments have stopped moving: at rest, or diverged."""
        return self.at_rest or self.diverged

    @property
    def sized(self) -> bool:
        """Whether the garment comes in sizes."""
        return isinstance(self.scene.garments[0].shape, TshirtShape)

    @property
    def body(self) -> dict[str, float] | None:
        """The mannequin's measures [m]; None for any other body."""
        shape = self.scene.avatar.shape if self.scene.avatar is not None else None
        if not isinstance(shape, MannequinShape):
            return None
        from warp_cloth.shapes import mannequin_measures

        measures = mannequin_measures(shape)
        return {name: float(getattr(measures, name)) for name in BODY_MEASURES}

    def advance(self) -> None:
        """Runs a burst of iterations; checks the certificate now and then."""
        if self.ended:
            return
        began = time.perf_counter()
        problem = self.problem
        count = min(self._burst, CHECK_ITERATIONS - self._unchecked)
        problem.relaxation.run(count)
        points = problem.model.points()
        self.iteration += count
        self._unchecked += count
        spent = time.perf_counter() - began
        self._seconds += spent
        if spent > SLOW:
            self._burst = max(self._burst // 2, LEAST_BURST)
        elif spent < FAST:
            self._burst = min(2 * self._burst, BURST)
        if not np.isfinite(points).all():
            self.diverged = True
            return
        self.points = points
        if not problem.contact.covers(points):
            collider = problem.contact.collider(points)
            problem.relaxation.set_collider(0, collider)
        if self._unchecked >= CHECK_ITERATIONS:
            tolerance = tolerance_of(self.scene)
            self.check = problem.certifier.check(problem.certifier.measure(self.iteration), 0)
            problem.certifier.take_snapshot(self.iteration)
            speed = self._unchecked / max(self._seconds, 1e-9)
            self.history.add(self.iteration, self.check.residual.relative_rms, speed)
            problem.relaxation.update_anisotropy(np.array([self.check.residual.relative_rms]))
            self._seconds, self._unchecked = 0.0, 0
            self.diverged = not self.check.finite
            settled = problem.schedule is None or problem.schedule.advance(self.iteration)
            self.at_rest = settled and self.check.within(tolerance)

    def change(self, changes: Mapping[str, str | None]) -> None:
        """Overrides scene keys, and continues from the worn shape where the new garment corresponds to the old one.

        A value of None restores a key, and the keys below it, to what they were first.

        Raises:
            InputError: a value is not valid; nothing has changed then.
        """
        overrides = merged_overrides(self._changes, changes, self._first)
        scene = self._load(overrides)
        old, worn = self.problem, self.points
        shared = self._shared()
        outfit = load_outfit(scene, self._caches.meshes)
        # the worn shape has gone through the avatar's poses already; to repeat that would take as long as all the rest
        in_last_pose = outfit if self.diverged else replace(outfit, poses=())
        problem = build_problem([scene], [in_last_pose], self.device, earlier=old.contact, **shared)
        if not self.diverged:
            worn_parts = [worn[first:last] for first, last in itertools.pairwise(old.model.vertex_start)]
            started = start_from(problem, list(zip(old.outfit.meshes, worn_parts, strict=True)))
            if outfit.poses and not started:
                problem = build_problem([scene], [outfit], self.device, **shared)
        self.scene, self.problem, self._changes = scene, problem, overrides
        self._start()

    def reset(self) -> None:
        """Puts the garments back to where they were loaded."""
        shared = self._shared()
        self.problem = load_problem(
            self.scene, self.device, mesh_cache=self._caches.meshes, earlier=self.problem.contact, **shared
        )
        self._start()

    def fit(self, progress: Callable[[Progress], None] | None = None) -> Fit:
        """The fit of the scene as it is now, as ``warp_cloth.fit`` makes it; its shape is shown from now on.

        It has the same bits, and takes less time, as it shares what the live fit has loaded.
        """
        self._shared()
        fitted = fit_loaded(lambda: self._load_whole(self._changes), self.device, self._caches, progress=progress)
        points = np.concatenate([worn.points for worn in fitted.garments])
        if np.isfinite(points).all():
            self.problem.model.set_points(points)
            self.points = points
        self.at_rest, self.diverged = fitted.status is not Status.DIVERGED, fitted.status is Status.DIVERGED
        self.iteration, self.fitted = int(fitted.report["iterations"]), fitted
        return fitted

    def judged(self) -> FitResult | None:
        """What is to be said of the shape shown, with its girths: worn or not, problems; None while it moves."""
        if self.fitted is not None:
            add_girths(self.fitted)
            return self.fitted
        if self.check is None or not self.at_rest:
            return None
        if self._judged is None:
            outcome = Outcome(Status.AT_REST, self.check, self.points, self.iteration, 0.0)
            runs = finished_runs(self.problem, [outcome], [()])
            (self._judged,) = finish_fits([Course(tuple(runs))], clock=StageClock())
            add_girths(self._judged)
        return self._judged

    def values(self, name: str) -> tuple[list[NDArray[np.float32]], tuple[float, float]] | None:
        """A map of every garment in its present shape, and the range of its colours; None where there is none."""
        if name not in MAPS or (MAPS[name].needs_avatar and self.problem.outfit.avatar is None):
            return None
        problem = self.problem
        forces = problem.certifier.normal_forces() if name == "pressure" else None
        garments, starts = problem.outfit.garments, problem.model.vertex_start
        spans = list(itertools.pairwise(starts))
        found = measure_maps(
            (name,),
            garments=garments,
            worn=[self.points[a:b] for a, b in spans],
            normal_forces=None if forces is None else [forces[a:b] for a, b in spans],
            avatar=problem.outfit.avatar,
            garment_names=[spec.name for spec in self.scene.garments],
            device=self.device,
        )
        if name not in found.ranges:
            return None
        none = np.zeros(0, dtype=np.float32)
        return [fields.get(name, none) for fields in found.fields], found.ranges[name]

    def garments(self) -> tuple[WornGarment, ...]:
        """The garments in their present shape."""
        starts = self.problem.model.vertex_start
        return tuple(
            WornGarment(
                spec.name, mesh, self.points[starts[index] : starts[index + 1]], spec.fabric.thickness,
                fabric=spec.fabric, rest=garment.rest,
            )
            for index, (spec, mesh, garment) in enumerate(
                zip(self.scene.garments, self.problem.outfit.meshes, self.problem.outfit.garments, strict=True)
            )
        )  # fmt: skip

    def saved(self, folder: Path, map_name: str = "") -> Path:
        """Writes the garments in their present shape as a stage (.usdz), coloured by a map; returns its path."""
        from warp_cloth.export.stage import write_stage

        garments, ranges = self.garments(), {}
        shown = self.values(map_name)
        if shown is not None:
            ranges[map_name] = shown[1]
            garments = tuple(
                replace(worn, fields={map_name: values} if len(values) else {})
                for worn, values in zip(garments, shown[0], strict=True)
            )
        path = folder / f"{self.scene.name}.usdz"
        avatar = self.problem.outfit.avatar
        write_stage(path, garments=garments, avatar=avatar, name=self.scene.name, ranges=ranges, colour=map_name)
        return path

    def status(self) -> str:
        """The state of the fit, in one line."""
        if self.diverged:
            return "Diverged: press reset, or choose a softer fabric."
        if self.fitted is not None:
            return self.fitted.message
        if self.check is None:
            return f"{self.iteration:,} iterations"
        rest = f"{1e3 * self.check.rest_error:.2g} mm" if np.isfinite(self.check.rest_error) else "unknown"
        state = "At rest" if self.at_rest else "Relaxing"
        residual = self.check.residual.relative_rms
        return f"{state}: {self.iteration:,} iterations, residual {residual:.2g}, rest error {rest}"
