"""A fit that goes on while its scene is changed under it."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.device import device_named
from warp_cloth.base.mesh import Points
from warp_cloth.fitting.problem import Problem, build_problem, load_problem, tolerance_of
from warp_cloth.fitting.warm_start import start_from
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.maps import MAPS, measure_maps
from warp_cloth.model.result import WornGarment
from warp_cloth.scene import MannequinShape, Scene, TshirtShape, load_scene
from warp_cloth.solver.certificate.certifier import Check

CHUNK = 20  # iterations between two pictures, where they take no longer than a picture may
LEAST_CHUNK = 5
SLOW, FAST = 0.06, 0.02  # [s] of a chunk; slower ones are halved, faster ones doubled: 10 pictures a second and more
CHECK_ITERATIONS = 100  # between two checks
PLOT_POINTS = 400  # the oldest are thinned out
BODY_MEASURES = ("stature", "chest", "waist", "hip")


@dataclass
class History:
    """What the plots show: iteration, relative residual, iterations a second."""

    iteration: list[float] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)

    def add(self, iteration: int, residual: float, speed: float) -> None:
        """Notes one check; thins out what is old."""
        for values, value in ((self.iteration, iteration), (self.residual, residual), (self.speed, speed)):
            values.append(float(value))
            if len(values) > PLOT_POINTS:
                del values[1:-1:2]


def changed(now: Mapping[str, str], asked: Mapping[str, str | None], first: Mapping[str, str]) -> dict[str, str]:
    """Changes of a scene, once others are asked for: each in place of what the key and those below it have ``now``.

    A key that is asked for with None has what it and those below it had ``first``.
    """

    def below(changes: Mapping[str, str], key: str) -> dict[str, str]:
        return {own: value for own, value in changes.items() if f"{own}.".startswith(f"{key}.")}

    together = dict(now)
    for key, value in asked.items():
        for own in below(together, key):
            del together[own]
        together.update(below(first, key) if value is None else {key: value})
    return together


class LiveFit:
    """A scene that relaxes chunk by chunk; changes keep the worn shape where they can."""

    def __init__(
        self,
        source: str | Path | Mapping[str, Any],
        changes: Mapping[str, str],
        device: str | None,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        """``source`` and ``changes`` as of ``load_scene``; ``tell`` is told each stage of the first set-up."""
        self._source = source
        self._changes = self._first = dict(changes)
        self._mesh_cache = MeshCache()
        self.device = device_named(device)
        self.scene = self._load(self._changes)
        self.made: Problem = load_problem(self.scene, self.device, mesh_cache=self._mesh_cache, tell=tell)
        self._start()

    def _load(self, changes: Mapping[str, str]) -> Scene:
        return load_scene(self._source, [f"{key}={value}" for key, value in changes.items()])

    def _start(self) -> None:
        self.iteration = 0
        self.at_rest = self.diverged = False
        self.history = History()
        self.check: Check | None = None
        self._unchecked = 0
        self._chunk = CHUNK
        self._seconds = 0.0
        self.points: Points = self.made.model.points()
        if self.made.course is not None:
            self.made.course.advance(0)

    @property
    def ended(self) -> bool:
        """Whether nothing moves any more."""
        return self.at_rest or self.diverged

    @property
    def sized(self) -> bool:
        """Whether the garment has sizes."""
        return isinstance(self.scene.garments[0].shape, TshirtShape)

    @property
    def body(self) -> dict[str, float] | None:
        """The mannequin's measures [m]; None where the body is none."""
        shape = self.scene.avatar.shape if self.scene.avatar is not None else None
        if not isinstance(shape, MannequinShape):
            return None
        from warp_cloth.garment.outfit import worn_size
        from warp_cloth.shapes import mannequin_measures

        measures = mannequin_measures(shape, size=worn_size(self.scene))
        return {name: float(getattr(measures, name)) for name in BODY_MEASURES}

    def advance(self) -> None:
        """A chunk of iterations; now and then a check."""
        if self.ended:
            return
        began = time.perf_counter()
        made = self.made
        count = min(self._chunk, CHECK_ITERATIONS - self._unchecked)
        made.relaxation.run(count)
        points = made.model.points()
        self.iteration += count
        self._unchecked += count
        spent = time.perf_counter() - began
        self._seconds += spent
        if spent > SLOW:
            self._chunk = max(self._chunk // 2, LEAST_CHUNK)
        elif spent < FAST:
            self._chunk = min(2 * self._chunk, CHUNK)
        if not np.isfinite(points).all():
            self.diverged = True
            return
        self.points = points
        if not made.contact.covers(points):
            collider = made.contact.collider(points)
            made.relaxation.meet(0, collider)
        if self._unchecked >= CHECK_ITERATIONS:
            tolerance = tolerance_of(self.scene)
            self.check = made.certifier.check(made.certifier.look(self.iteration), 0)
            made.certifier.turn_page(self.iteration)
            speed = self._unchecked / max(self._seconds, 1e-9)
            self.history.add(self.iteration, self.check.residual.relative_rms, speed)
            made.relaxation.loosen(np.array([self.check.residual.relative_rms]))
            self._seconds, self._unchecked = 0.0, 0
            self.diverged = not self.check.finite
            settled = made.course is None or made.course.advance(self.iteration)
            self.at_rest = settled and self.check.within(tolerance)

    def change(self, changes: Mapping[str, str | None]) -> None:
        """Changes scene keys and goes on from the worn shape, where the new garment can take it over.

        A key that is given None is as it was first, with the keys below it.

        Raises:
            InputError: a value that the scene refuses; nothing has changed then.
        """
        together = changed(self._changes, changes, self._first)
        scene = self._load(together)
        old, worn = self.made, self.points
        outfit = load_outfit(scene, self._mesh_cache)
        # what is worn has gone through the avatar's poses: it would take as long as all else to do so once more
        standing = outfit if self.diverged else replace(outfit, poses=())
        made = build_problem([scene], [standing], self.device, earlier=old.contact)
        if not self.diverged:
            worn_parts = [worn[first:last] for first, last in itertools.pairwise(old.model.vertex_start)]
            taken = start_from(made, list(zip(old.outfit.garments, worn_parts, strict=True)))
            if outfit.poses and not taken:
                made = build_problem([scene], [outfit], self.device)
        self.scene, self.made, self._changes = scene, made, together
        self._start()

    def reset(self) -> None:
        """Back to where the garments are loaded."""
        self.made = load_problem(self.scene, self.device, mesh_cache=self._mesh_cache, earlier=self.made.contact)
        self._start()

    def values(self, name: str) -> tuple[list[NDArray[np.float32]], tuple[float, float]] | None:
        """A map of every garment as it lies now, and the range of its colours; None where there is none."""
        if name not in MAPS or (MAPS[name].needs_avatar and self.made.outfit.avatar is None):
            return None
        made = self.made
        push = made.certifier.pushes() if name == "pressure" else None
        parts, starts = made.outfit.parts, made.model.vertex_start
        spans = list(itertools.pairwise(starts))
        found = measure_maps(
            (name,),
            parts=parts,
            worn=[self.points[a:b] for a, b in spans],
            pushes=None if push is None else [push[a:b] for a, b in spans],
            avatar=made.outfit.avatar,
            garment_names=[spec.name for spec in self.scene.garments],
            device=self.device,
            girths=False,
        )
        if name not in found.ranges:
            return None
        none = np.zeros(0, dtype=np.float32)
        return [fields.get(name, none) for fields in found.fields], found.ranges[name]

    def garments(self) -> tuple[WornGarment, ...]:
        """The garments as they lie now."""
        starts = self.made.model.vertex_start
        return tuple(
            WornGarment(
                spec.name, mesh, self.points[starts[index] : starts[index + 1]], spec.fabric.thickness,
                fabric=spec.fabric, rest=part.rest,
            )
            for index, (spec, mesh, part) in enumerate(
                zip(self.scene.garments, self.made.outfit.garments, self.made.outfit.parts, strict=True)
            )
        )  # fmt: skip

    def saved(self, folder: Path, map_name: str = "") -> Path:
        """Writes the stage as it is now, with the map chosen."""
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
        avatar = self.made.outfit.avatar
        write_stage(path, garments=garments, avatar=avatar, name=self.scene.name, ranges=ranges, colour=map_name)
        return path

    def status(self) -> str:
        """One line on how it stands."""
        if self.diverged:
            return "The numbers left their range: reset, or take a softer fabric."
        if self.check is None:
            return f"{self.iteration:,} iterations"
        rest = f"{1e3 * self.check.rest_error:.2g} mm" if np.isfinite(self.check.rest_error) else "unknown"
        said = "At rest" if self.at_rest else "Relaxing"
        return (
            f"{said}: {self.iteration:,} iterations, residual {self.check.residual.relative_rms:.2g}, rest error {rest}"
        )
