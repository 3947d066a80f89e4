"""The trade-off between error and time over a scene's knobs, measured on the scene itself."""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.threads import core_count
from warp_cloth.base.version import package_version
from warp_cloth.export.files import unwritable, whole_file
from warp_cloth.garment.outfit import load_outfit, mesh_recipes
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene, load_scene
from warp_cloth.study.knobs import (
    Settings,
    Trial,
    budget_trials,
    nothing_holds,
    reference_of,
    second_reference_of,
    single_trials,
)
from warp_cloth.study.stopped_runs import RunState, StoppedRun, run_with_stops
from warp_cloth.study.surface import distances
from warp_cloth.study.workers import run_jobs

COMBINED = ("mesh", "precision", "pixel", "collider", "cloth contact")  # knobs whose cheapest settings are combined
STOPPED = ("scene", "together", *COMBINED)  # knobs whose runs are also measured after fewer iterations

SAME_TIME = 1.15  # ratio of times that count as equal: of such settings the most accurate is recommended
MOST_WORKERS = 4  # trials at a time, on at most half of the cores, so that they hardly slow each other down
DEADLINE = 3600.0  # [s] of a trial in a process of its own
MOST_CHECKS = 4  # repeated runs of recommended settings, which may change the recommendation
NO_RESULT: dict[str, Any] = {  # of a trial that was refused, or whose process died
    "status": "refused", "seconds": math.nan, "loading": math.nan, "iterations": 0, "rms_mm": math.nan,
    "max_mm": math.nan, "penetration_mm": None, "strain_off": math.nan,
}  # fmt: skip
LIMIT = 20_000  # iterations of a trial, where the scene states none
LATER = ("solver.iterations", "solver.tolerance_mm", "solver.residual", "solver.residual_p99")  # not used while loading


@dataclass(frozen=True)
class Measured:
    """Result of a trial."""

    knob: str
    label: str
    settings: dict[str, str]
    status: str
    seconds: float  # of loading, building and relaxing, without compiling
    loading: float  # of these, before the first iteration
    iterations: int
    rms_mm: float  # distance of the vertices from the reference
    max_mm: float
    penetration_mm: float | None  # deepest, under the exact avatar
    strain_off: float  # difference of the 99th percentile of strain from the reference's

    @property
    def known(self) -> bool:
        """Whether its distance from the reference is known."""
        return bool(np.isfinite(self.rms_mm)) and self.status in ("at_rest", "iteration_limit")

    @property
    def loads_like(self) -> tuple[tuple[str, str], ...]:
        """The settings that affect loading and building."""
        return tuple(sorted((key, value) for key, value in self.settings.items() if key not in LATER))


@dataclass(frozen=True)
class Trade:
    """All trials of a scene, the Pareto front and the recommendation."""

    scene: str
    device: str
    within_mm: float
    reference: str  # message of the reference run
    reference_rests: bool
    scatter_mm: float  # rms distance between two references of equal tolerance
    measured: tuple[Measured, ...]
    front: tuple[Measured, ...]  # Pareto front of time and error, fastest first
    cheapest: Measured | None  # within the wanted error


def _decided(scene: Scene) -> Scene:
    """The scene as its first attempt has it, with a limit of iterations that a study can afford."""
    decided = first_attempt(scene, load_outfit(scene)).scene
    limit = LIMIT if scene.solver.iterations is None else scene.solver.iterations
    return decided.model_copy(update={"solver": decided.solver.model_copy(update={"iterations": limit})})


class TradeStudy:
    """Runs the trials of a scene; results are stored in a folder at once, and not computed again."""

    def __init__(
        self, scene: Scene, *, device: str, within_mm: float, folder: Path, log: Callable[[str], None]
    ) -> None:
        self._scene = _decided(scene)
        self._device = device
        self._within = within_mm
        self._log = log
        meshes = [recipe.key for recipe in mesh_recipes(scene)]  # these change with their files
        key = json.dumps([scene.settings(), meshes, device, package_version()], sort_keys=True, default=str)
        name = f"{scene.name}_tradeoff_{hashlib.sha256(key.encode()).hexdigest()[:8]}"
        self._trials_path = folder / f"{name}.jsonl"
        self._shape = folder / f"{name}.npz"
        self._meshes: tuple[Mesh, ...] = ()
        self._worn: list[Points] = []
        self._strain = 0.0
        self._measured: list[Measured] = []
        self.reference, self.reference_rests = "", False
        self.scatter_mm = float("nan")

    def run(self) -> Trade:
        """All trials: single knobs, stopped early, and the cheapest good ones combined; the best is run once more.

        Raises:
            InputError: nothing can be compared, or results cannot be stored.
        """
        falls = nothing_holds(self._scene)
        if falls:
            problem = "nothing holds it, so it falls for ever and has no rest shape"
            raise InputError(falls, problem, "pin some of its vertices, or add an avatar")
        self._load()
        self._solve_reference()
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
        """The results so far."""
        measured = self._with_least_loading()
        known = [trial for trial in measured if trial.known]
        front: list[Measured] = []
        for trial in sorted(known, key=lambda one: (one.seconds, one.rms_mm)):
            if not front or trial.rms_mm < front[-1].rms_mm:
                front.append(trial)
        good = [trial for trial in front if trial.rms_mm <= self._within]
        fast = [trial for trial in good if trial.seconds <= SAME_TIME * good[0].seconds]
        return Trade(
            scene=self._scene.name,
            device=self._device if self._device == "cpu" else wp.get_device(self._device).name,
            within_mm=self._within,
            reference=self.reference,
            reference_rests=self.reference_rests,
            scatter_mm=self.scatter_mm,
            measured=tuple(measured),
            front=tuple(front),
            cheapest=fast[-1] if fast else None,
        )

    def _with_least_loading(self) -> list[Measured]:
        """The results with the least loading time of equal settings: other load on the machine can only add to it."""
        least: dict[object, float] = {}
        for trial in self._measured:
            if trial.known:
                least[trial.loads_like] = min(trial.loading, least.get(trial.loads_like, trial.loading))
        return [
            replace(trial, seconds=trial.seconds - trial.loading + least[trial.loads_like]) if trial.known else trial
            for trial in self._measured
        ]

    def _solve_reference(self) -> None:
        """The reference shape, and its distance from a second one of equal tolerance."""
        if not self._worn:
            load_outfit(self._scene)  # raises where a file is bad
            both = [reference_of(self._scene), second_reference_of(self._scene)]
            ends = dict(self._run_trials([(trial, {}) for trial in both]))
            # again in this process where there is no result, which raises the reason
            tight, second = ((ends[number] or self._alone(trial))[-1] for number, trial in enumerate(both))
            if tight.status not in (Status.AT_REST, Status.ITERATION_LIMIT):
                raise InputError(self._scene.name, f"has no reference: {tight.message}", "change that first")
            self._meshes, self._worn, self._strain = tight.meshes, list(tight.worn), tight.strain
            self.reference, self.reference_rests = tight.message, tight.status is Status.AT_REST
            self.scatter_mm = float(np.sqrt(np.mean(self._distance(second.meshes, second.worn) ** 2)))
            with whole_file(self._shape) as place:
                np.savez(place, *self._worn)
            known = {
                "reference": self.reference,
                "reference_rests": self.reference_rests,
                "scatter_mm": self.scatter_mm,
                "strain": self._strain,
            }
            with whole_file(self._trials_path) as place:
                place.write_text(json.dumps(known), encoding="utf-8")
        self._log(f"reference: {self.reference} A second one differs by {self.scatter_mm:.2g} mm rms.")

    def _load(self) -> None:
        """Loads the results of an earlier run of the same study."""
        try:
            first, *rest = self._trials_path.read_text(encoding="utf-8").splitlines()
            with np.load(self._shape) as shapes:
                worn = [shapes[name] for name in shapes.files]
            known = json.loads(first)
            self.reference, self.reference_rests = known["reference"], known["reference_rests"]
            self.scatter_mm, self._strain = known["scatter_mm"], known["strain"]
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            return
        self._worn, self._meshes = worn, load_outfit(load_scene(self._scene.settings())).meshes
        for line in rest:
            try:
                self._measured.append(Measured(**json.loads(line)))
            except (ValueError, TypeError):  # truncated when that run ended
                continue

    def _measure(self, trials: Sequence[Trial]) -> None:
        """Runs trials that have no result yet; full runs also give results of shorter ones."""
        known = [one.settings for one in self._measured]
        wanted = [
            (trial, budget_trials(self._scene, trial.settings) if trial.knob in STOPPED else {})
            for trial in trials
            if dict(trial.settings) not in known
        ]
        for number, states in self._run_trials(wanted):
            self._store(states, *wanted[number])

    def _run_trials(self, wanted: Sequence[tuple[Trial, Mapping[int, Trial]]]) -> Iterator[tuple[int, list[RunState]]]:
        """Index and states of trials as they finish; several at a time on a CPU with enough cores."""
        jobs = [StoppedRun(self._scene.settings(), tuple(trial.overrides()), tuple(stops)) for trial, stops in wanted]
        workers = min(MOST_WORKERS, core_count() // 2) if self._device == "cpu" else 1
        if workers > 1 and len(jobs) > 1:
            yield from run_jobs(jobs, self._device, workers=workers, deadline=DEADLINE)
        else:
            yield from ((number, job.run(self._device)) for number, job in enumerate(jobs))

    def _alone(self, trial: Trial) -> list[RunState]:
        """A trial in this process, which raises its errors."""
        return run_with_stops(load_scene(self._scene.settings(), trial.overrides()), self._device, ())

    def _store(self, states: Sequence[RunState], trial: Trial, stops: Mapping[int, Trial]) -> None:
        """Stores the results of a trial, in memory and in the file."""
        found = [self._measured_of(trial, states[-1] if states else None)]
        if trial.knob in STOPPED[:2] or found[0].rms_mm <= self._within:
            found += [self._measured_of(stops[one.iterations], one) for one in states[:-1]]
        self._measured += found
        try:
            with self._trials_path.open("a", encoding="utf-8") as lines:
                lines.write("".join("\n" + json.dumps(asdict(one)) for one in found))
        except OSError as error:
            raise unwritable(self._trials_path, error) from error
        for one in found:
            how = f"{one.rms_mm:.3g} mm rms in {one.seconds:.3g} s" if states else "no result"
            self._log(f"{one.label}: {how}")

    def _measured_of(self, trial: Trial, state: RunState | None) -> Measured:
        """A trial's figures; NO_RESULT without a state."""
        nothing = Measured(trial.knob, trial.label, dict(trial.settings), **NO_RESULT)
        if state is None:
            return nothing
        away = self._distance(state.meshes, state.worn)
        return replace(
            nothing,
            status=state.status.value,
            seconds=state.loading + state.relaxing,
            loading=state.loading,
            iterations=state.iterations,
            rms_mm=float(np.sqrt(np.mean(away**2))),
            max_mm=float(away.max()),
            penetration_mm=None if state.depth is None else float(state.depth.max),
            strain_off=float(state.strain - self._strain),
        )

    def _distance(self, meshes: Sequence[Mesh], worn: Sequence[Points]) -> np.ndarray:
        """Distance of every vertex of the reference from other garments [mm]; NaN where it is unknown."""
        parts = []
        for mesh, points, other, others in zip(self._meshes, self._worn, meshes, worn, strict=True):
            away = distances(mesh, points, other, others)
            parts.append(np.full(len(points), np.nan) if away is None else 1e3 * away)
        return np.concatenate(parts)

    def _combinations(self, alone: Sequence[Trial]) -> list[Settings]:
        """Combinations of settings, one per knob, that alone are clearly faster than the scene's and good enough."""
        found = {json.dumps(one.settings): one for one in self._with_least_loading()}
        own, *others = (found[json.dumps(dict(trial.settings))] for trial in alone)
        best: dict[str, Measured] = {}
        for trial in others:
            good = trial.known and trial.rms_mm <= self._within and SAME_TIME * trial.seconds < own.seconds
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
        """Runs the recommended settings once more, which replaces their result."""
        trial = Trial(cheapest.knob, MappingProxyType(cheapest.settings))
        again = self._measured_of(trial, self._alone(trial)[-1])
        self._log(f"rerun: {again.rms_mm:.3g} mm rms in {again.seconds:.3g} s")
        at = [one.settings for one in self._measured].index(cheapest.settings)
        self._measured[at] = again


def millimetres(text: str) -> float:
    """A length as typed, "2mm", "0.2 cm" or "2", in mm.

    Raises:
        InputError: it is not a length.
    """
    units = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "": 1.0}
    stripped = text.strip().lower()
    unit = next(unit for unit in units if stripped.endswith(unit))
    try:
        value = float(stripped.removesuffix(unit)) * units[unit]
    except ValueError:
        value = float("nan")
    if not 0.0 < value < 1e6:
        raise InputError("--within", f'"{text}" is not a length', "write for instance --within 2mm")
    return value
