"""The trade: a scene's error against its seconds over its knobs, measured on the scene itself."""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.threads import core_count
from warp_cloth.export.files import unwritable, whole_file
from warp_cloth.garment.outfit import load_outfit, mesh_recipes
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene, load_scene
from warp_cloth.study.knobs import Settings, Trial, budget_trials, nothing_holds, reference_of, single_trials, twin_of
from warp_cloth.study.passing import Passage, Passed, run_through
from warp_cloth.study.surface import distances
from warp_cloth.study.workers import run_jobs

COMBINED = ("mesh", "precision", "pixel", "collider", "cloth contact")  # knobs whose cheapest settings are put together
STOPPED = ("scene", "together", *COMBINED)  # knobs whose trials tell of shorter runs; of COMBINED only good ones

ALIKE = 1.15  # times that differ by less are the same: of such settings the closest is recommended
MOST_WORKERS = 4  # trials at a time, on no more than half of the cores, so that they hardly disturb each other's times
DEADLINE = 3600.0  # [s] of a trial in a process of its own
MOST_CHECKS = 4  # fresh runs of what is recommended: their times, too, are new
NOTHING: dict[str, Any] = {  # of a trial that was refused, or took its process along
    "status": "refused", "seconds": math.nan, "loading": math.nan, "iterations": 0, "rms_mm": math.nan,
    "max_mm": math.nan, "penetration_mm": None, "strain_off": math.nan,
}  # fmt: skip
LATER = ("solver.iterations", "solver.tolerance_mm", "solver.residual", "solver.residual_p99")  # not asked at loading


@dataclass(frozen=True)
class Measured:
    """What a trial came to."""

    knob: str
    label: str
    settings: dict[str, str]
    status: str
    seconds: float  # of loading, building and relaxing; not of compiling, which is done once
    loading: float  # of these, until the first iteration
    iterations: int
    rms_mm: float  # distance of the vertices from the reference
    max_mm: float
    penetration_mm: float | None  # deepest, under the exact avatar
    strain_off: float  # difference of the 99th percentile of strain from the reference's

    @property
    def known(self) -> bool:
        """Whether its distance could be told."""
        return bool(np.isfinite(self.rms_mm)) and self.status in ("at_rest", "iteration_limit")

    @property
    def loads_like(self) -> tuple[tuple[str, str], ...]:
        """What is the same for all settings that load and build the same."""
        return tuple(sorted((key, value) for key, value in self.settings.items() if key not in LATER))


@dataclass(frozen=True)
class Trade:
    """All trials of a scene, and what follows from them."""

    scene: str
    device: str
    within_mm: float
    reference: str  # how the reference ended
    reference_rests: bool
    scatter_mm: float  # between two references as tight as each other, rms
    measured: tuple[Measured, ...]
    front: tuple[Measured, ...]  # of those that nothing beats in both, fastest first
    cheapest: Measured | None  # that is within the error wanted


class TradeStudy:
    """Runs the trials of a scene; what is known is kept in a folder as it comes, and not run again."""

    def __init__(
        self, scene: Scene, *, device: str, within_mm: float, folder: Path, tell: Callable[[str], None]
    ) -> None:
        self._scene = scene
        self._device = device
        self._within = within_mm
        self._tell = tell
        made_of = [recipe.key for recipe in mesh_recipes(scene)]  # files that changed are other files
        key = json.dumps([scene.settings(), made_of, device, version("warp-cloth")], sort_keys=True, default=str)
        name = f"{scene.name}_tradeoff_{hashlib.sha256(key.encode()).hexdigest()[:8]}"
        self._kept = folder / f"{name}.jsonl"
        self._shape = folder / f"{name}.npz"
        self._meshes: tuple[Mesh, ...] = ()
        self._worn: list[Points] = []
        self._strain = 0.0
        self._measured: list[Measured] = []
        self.reference, self.reference_rests = "", False
        self.scatter_mm = float("nan")

    def run(self) -> Trade:
        """All trials: alone, stopped early, and the cheapest good ones together; the cheapest is run afresh.

        Raises:
            InputError: nothing can be compared, or what is known cannot be kept.
        """
        falls = nothing_holds(self._scene)
        if falls:
            problem = "nothing holds it, so it falls for ever and no shape of it is right"
            raise InputError(falls, problem, "pin some of its vertices, or let it meet an avatar")
        self._load()
        self._refer()
        trials = single_trials(self._scene)
        self._measure(trials)
        self._measure([Trial("together", MappingProxyType(settings)) for settings in self._combinations(trials)])
        checked: list[dict[str, str]] = []
        while len(checked) < MOST_CHECKS:
            cheapest = self.trade().cheapest
            if cheapest is None or cheapest.settings in checked:
                break
            self._check(cheapest)
            checked.append(cheapest.settings)
        return self.trade()

    def trade(self) -> Trade:
        """What is known so far."""
        measured = self._fair()
        known = [trial for trial in measured if trial.known]
        front: list[Measured] = []
        for trial in sorted(known, key=lambda one: (one.seconds, one.rms_mm)):
            if not front or trial.rms_mm < front[-1].rms_mm:
                front.append(trial)
        good = [trial for trial in front if trial.rms_mm <= self._within]
        alike = [trial for trial in good if trial.seconds <= ALIKE * good[0].seconds]
        return Trade(
            scene=self._scene.name,
            device=self._device if self._device == "cpu" else wp.get_device(self._device).name,
            within_mm=self._within,
            reference=self.reference,
            reference_rests=self.reference_rests,
            scatter_mm=self.scatter_mm,
            measured=tuple(measured),
            front=tuple(front),
            cheapest=alike[-1] if alike else None,
        )

    def _fair(self) -> list[Measured]:
        """What was measured, with the least time of loading: other work on the machine can only add to that."""
        least: dict[object, float] = {}
        for trial in self._measured:
            if trial.known:
                least[trial.loads_like] = min(trial.loading, least.get(trial.loads_like, trial.loading))
        return [
            replace(trial, seconds=trial.seconds - trial.loading + least[trial.loads_like]) if trial.known else trial
            for trial in self._measured
        ]

    def _refer(self) -> None:
        """The reference shape, and how far a second one as tight comes to rest from it."""
        if not self._worn:
            load_outfit(self._scene)  # which says what is wrong with a file
            both = [reference_of(self._scene), twin_of(self._scene)]
            ends = dict(self._passages([(trial, {}) for trial in both]))
            # again in this process where it came to nothing, which says why
            tight, twin = ((ends[number] or self._alone(trial))[-1] for number, trial in enumerate(both))
            if tight.status not in (Status.AT_REST, Status.ITERATION_LIMIT):
                raise InputError(self._scene.name, f"has no reference: {tight.message}", "change that first")
            self._meshes, self._worn, self._strain = tight.meshes, list(tight.worn), tight.strain
            self.reference, self.reference_rests = tight.message, tight.status is Status.AT_REST
            self.scatter_mm = float(np.sqrt(np.mean(self._distance(twin.meshes, twin.worn) ** 2)))
            with whole_file(self._shape) as place:
                np.savez(place, *self._worn)
            known = {
                "reference": self.reference,
                "reference_rests": self.reference_rests,
                "scatter_mm": self.scatter_mm,
                "strain": self._strain,
            }
            with whole_file(self._kept) as place:
                place.write_text(json.dumps(known), encoding="utf-8")
        self._tell(f"reference: {self.reference} A second one differs by {self.scatter_mm:.2g} mm rms.")

    def _load(self) -> None:
        """What an earlier run of the same study left."""
        try:
            first, *rest = self._kept.read_text(encoding="utf-8").splitlines()
            with np.load(self._shape) as shapes:
                worn = [shapes[name] for name in shapes.files]
            known = json.loads(first)
            self.reference, self.reference_rests = known["reference"], known["reference_rests"]
            self.scatter_mm, self._strain = known["scatter_mm"], known["strain"]
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            return
        self._worn, self._meshes = worn, load_outfit(load_scene(self._scene.settings())).garments
        for line in rest:
            try:
                self._measured.append(Measured(**json.loads(line)))
            except (ValueError, TypeError):  # cut off by whatever ended the run
                continue

    def _measure(self, trials: Sequence[Trial]) -> None:
        """Runs trials that are not known yet; those that go on to the end tell of shorter runs, too."""
        known = [one.settings for one in self._measured]
        wanted = [
            (trial, budget_trials(self._scene, trial.settings) if trial.knob in STOPPED else {})
            for trial in trials
            if dict(trial.settings) not in known
        ]
        for number, passed in self._passages(wanted):
            self._keep(passed, *wanted[number])

    def _passages(self, wanted: Sequence[tuple[Trial, Mapping[int, Trial]]]) -> Iterator[tuple[int, list[Passed]]]:
        """What comes of trials, as it comes: several at a time on the CPU where there are cores to spare."""
        jobs = [Passage(self._scene.settings(), tuple(trial.overrides()), tuple(stops)) for trial, stops in wanted]
        workers = min(MOST_WORKERS, core_count() // 2) if self._device == "cpu" else 1
        if workers > 1 and len(jobs) > 1:
            yield from run_jobs(jobs, self._device, workers=workers, deadline=DEADLINE)
        else:
            yield from ((number, job.run(self._device)) for number, job in enumerate(jobs))

    def _alone(self, trial: Trial) -> list[Passed]:
        """A trial in this process, which raises what is wrong with it."""
        return run_through(load_scene(self._scene.settings(), trial.overrides()), self._device, ())

    def _keep(self, passed: Sequence[Passed], trial: Trial, stops: Mapping[int, Trial]) -> None:
        """Notes what came of a trial, in memory and in the file."""
        found = [self._measured_of(trial, passed[-1] if passed else None)]
        if trial.knob in STOPPED[:2] or found[0].rms_mm <= self._within:
            found += [self._measured_of(stops[one.iterations], one) for one in passed[:-1]]
        self._measured += found
        try:
            with self._kept.open("a", encoding="utf-8") as lines:
                lines.write("".join("\n" + json.dumps(asdict(one)) for one in found))
        except OSError as error:
            raise unwritable(self._kept, error) from error
        for one in found:
            how = f"{one.rms_mm:.3g} mm rms in {one.seconds:.3g} s" if passed else "came to nothing"
            self._tell(f"{one.label}: {how}")

    def _measured_of(self, trial: Trial, passed: Passed | None) -> Measured:
        """A trial's figures; none where it came to nothing."""
        nothing = Measured(trial.knob, trial.label, dict(trial.settings), **NOTHING)
        if passed is None:
            return nothing
        away = self._distance(passed.meshes, passed.worn)
        return replace(
            nothing,
            status=passed.status.value,
            seconds=passed.loading + passed.relaxing,
            loading=passed.loading,
            iterations=passed.iterations,
            rms_mm=float(np.sqrt(np.mean(away**2))),
            max_mm=float(away.max()),
            penetration_mm=None if passed.depth is None else float(passed.depth.max),
            strain_off=float(passed.strain - self._strain),
        )

    def _distance(self, meshes: Sequence[Mesh], worn: Sequence[Points]) -> np.ndarray:
        """Distance of every vertex of the reference from other garments [mm]; NaN where it cannot be told."""
        parts = []
        for mesh, points, other, others in zip(self._meshes, self._worn, meshes, worn, strict=True):
            away = distances(mesh, points, other, others)
            parts.append(np.full(len(points), np.nan) if away is None else 1e3 * away)
        return np.concatenate(parts)

    def _combinations(self, alone: Sequence[Trial]) -> list[Settings]:
        """Of each knob the settings that are surely faster than the scene's and good enough alone, put together."""
        found = {json.dumps(one.settings): one for one in self._fair()}
        own, *others = (found[json.dumps(dict(trial.settings))] for trial in alone)
        best: dict[str, Measured] = {}
        for trial in others:
            good = trial.known and trial.rms_mm <= self._within and ALIKE * trial.seconds < own.seconds
            if trial.knob in COMBINED and good and trial.seconds < best.get(trial.knob, own).seconds:
                best[trial.knob] = trial
        ranked = sorted(best.values(), key=lambda trial: trial.seconds)
        chosen: list[Settings] = []
        joined: dict[str, str] = {}
        for trial in ranked:
            joined = {**joined, **trial.settings}
            chosen.append(dict(joined))
        return chosen

    def _check(self, cheapest: Measured) -> None:
        """Runs the recommended settings afresh; one that does not keep its word is struck off."""
        trial = Trial(cheapest.knob, MappingProxyType(cheapest.settings))
        again = self._measured_of(trial, self._alone(trial)[-1])
        self._tell(f"run afresh: {again.rms_mm:.3g} mm rms in {again.seconds:.3g} s")
        at = [one.settings for one in self._measured].index(cheapest.settings)
        self._measured[at] = again


def millimetres(text: str) -> float:
    """A length as typed, "2mm", "0.2 cm" or "2", in mm.

    Raises:
        InputError: it is none.
    """
    units = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "": 1.0}
    stripped = text.strip().lower()
    unit = next(unit for unit in units if stripped.endswith(unit))
    try:
        value = float(stripped.removesuffix(unit)) * units[unit]
    except ValueError:
        value = float("nan")
    if not 0.0 < value < 1e6:
        raise InputError("--within", f'"{text}" is no length', "write for instance --within 2mm")
    return value
