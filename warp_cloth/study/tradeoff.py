"""The trade: a scene's error against its seconds over its knobs, measured on the scene itself."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType

import numpy as np

from warp_cloth.errors import InputError
from warp_cloth.fitting import Fit, fit
from warp_cloth.mesh import Mesh, Points
from warp_cloth.scene import Scene, load_scene
from warp_cloth.study.knobs import Settings, Trial, budget_trials, reference_of, single_trials, twin_of
from warp_cloth.study.surface import distances

COMBINED = ("mesh", "precision", "pixel", "collider", "cloth contact")  # knobs whose cheapest settings are put together

ALIKE = 1.15  # times that differ by less are the same: of such settings the closest is recommended
MOST_CHECKS = 4  # fresh runs of what is recommended: their times, too, are new


@dataclass(frozen=True)
class Measured:
    """What a trial came to."""

    knob: str
    label: str
    settings: dict[str, str]
    status: str
    seconds: float  # of loading, building and relaxing; not of compiling, which is done once
    iterations: int
    rms_mm: float  # distance of the vertices from the reference
    max_mm: float
    penetration_mm: float | None  # deepest, under the exact avatar
    strain_off: float  # difference of the 99th percentile of strain from the reference's

    @property
    def known(self) -> bool:
        """Whether its distance could be told."""
        return bool(np.isfinite(self.rms_mm)) and self.status in ("at_rest", "iteration_limit")


@dataclass(frozen=True)
class Trade:
    """All trials of a scene, and what follows from them."""

    scene: str
    device: str
    within_mm: float
    reference: str  # how the reference ended
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
        key = json.dumps([scene.settings(), device, version("warp-cloth")], sort_keys=True, default=str)
        name = f"{scene.name}_tradeoff_{hashlib.sha256(key.encode()).hexdigest()[:8]}"
        self._kept = folder / f"{name}.jsonl"
        self._shape = folder / f"{name}.npz"
        self._meshes: tuple[Mesh, ...] = ()
        self._worn: list[Points] = []
        self._strain = 0.0
        self._measured: list[Measured] = []
        self.reference = ""
        self.scatter_mm = float("nan")

    def run(self) -> Trade:
        """All trials: alone, stopped early, and the cheapest good ones together; the cheapest is run afresh."""
        self._load()
        self._refer()
        alone = [self._measure(trial) for trial in single_trials(self._scene)]
        own = alone[0]
        self._all(budget_trials(self._scene, {}, own.iterations))
        for settings in self._combinations(own, alone):
            whole = self._measure(Trial("together", MappingProxyType(settings)))
            if whole.known:
                self._all(budget_trials(self._scene, settings, whole.iterations))
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
        known = [trial for trial in self._measured if trial.known]
        front: list[Measured] = []
        for trial in sorted(known, key=lambda one: (one.seconds, one.rms_mm)):
            if not front or trial.rms_mm < front[-1].rms_mm:
                front.append(trial)
        good = [trial for trial in front if trial.rms_mm <= self._within]
        alike = [trial for trial in good if trial.seconds <= ALIKE * good[0].seconds]
        return Trade(
            scene=self._scene.name,
            device=self._device,
            within_mm=self._within,
            reference=self.reference,
            scatter_mm=self.scatter_mm,
            measured=tuple(self._measured),
            front=tuple(front),
            cheapest=alike[-1] if alike else None,
        )

    def _refer(self) -> None:
        """The reference shape, and how far a second one as tight comes to rest from it."""
        if not self._worn:
            fitted = self._fit(reference_of(self._scene))
            self._meshes = tuple(worn.mesh for worn in fitted.garments)
            self._worn = [worn.points for worn in fitted.garments]
            self._strain = fitted.report["strain"]["p99"]
            self.reference = fitted.message
            twin = self._fit(twin_of(self._scene))
            self.scatter_mm = float(np.sqrt(np.mean(self._distance(twin) ** 2)))
            with self._kept.open("w", encoding="utf-8") as lines:
                known = {"reference": self.reference, "scatter_mm": self.scatter_mm, "strain": self._strain}
                lines.write(json.dumps(known) + "\n")
            np.savez(self._shape, *self._worn)
        self._tell(f"reference: {self.reference} A second one differs by {self.scatter_mm:.2g} mm rms.")

    def _load(self) -> None:
        """What an earlier run of the same study left."""
        try:
            first, *rest = self._kept.read_text(encoding="utf-8").splitlines()
            with np.load(self._shape) as shapes:
                worn = [shapes[name] for name in shapes.files]
            known = json.loads(first)
        except (OSError, ValueError):
            return
        from warp_cloth.wardrobe import open_wardrobe

        self._worn, self._meshes = worn, open_wardrobe(load_scene(self._scene.settings())).garments
        self.reference, self.scatter_mm, self._strain = known["reference"], known["scatter_mm"], known["strain"]
        for line in rest:
            try:
                self._measured.append(Measured(**json.loads(line)))
            except (ValueError, TypeError):  # cut off by whatever ended the run
                continue

    def _all(self, trials: Iterable[Trial]) -> list[Measured]:
        return [self._measure(trial) for trial in trials]

    def _measure(self, trial: Trial) -> Measured:
        for known in self._measured:
            if known.settings == dict(trial.settings):
                return known
        found = self._measured_of(trial, self._fit(trial))
        self._measured.append(found)
        with self._kept.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(asdict(found)) + "\n")
        self._tell(f"{trial.label}: {found.rms_mm:.3g} mm rms in {found.seconds:.3g} s")
        return found

    def _measured_of(self, trial: Trial, fitted: Fit) -> Measured:
        away = self._distance(fitted)
        seconds, depth = fitted.report["seconds"], fitted.report["penetration_mm"]
        return Measured(
            knob=trial.knob,
            label=trial.label,
            settings=dict(trial.settings),
            status=fitted.status.value,
            seconds=seconds["load"] + seconds["build"] + seconds["relax"],
            iterations=fitted.report["iterations"],
            rms_mm=float(np.sqrt(np.mean(away**2))),
            max_mm=float(away.max()),
            penetration_mm=None if depth is None else float(depth["max"]),
            strain_off=float(fitted.report["strain"]["p99"] - self._strain),
        )

    def _fit(self, trial: Trial) -> Fit:
        return fit(load_scene(self._scene.settings(), trial.overrides()), device=self._device)

    def _distance(self, fitted: Fit) -> np.ndarray:
        """Distance of every vertex of the reference from the fit [mm]; NaN where it cannot be told."""
        parts = []
        for mesh, points, worn in zip(self._meshes, self._worn, fitted.garments, strict=True):
            away = distances(mesh, points, worn.mesh, worn.points)
            parts.append(np.full(len(points), np.nan) if away is None else 1e3 * away)
        return np.concatenate(parts)

    def _combinations(self, own: Measured, alone: Sequence[Measured]) -> list[Settings]:
        """Of each knob the settings that are faster than the scene's and good enough alone, put together."""
        best: dict[str, Measured] = {}
        for trial in alone:
            good = trial.known and trial.rms_mm <= self._within and trial.seconds < own.seconds
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
        again = self._measured_of(trial, self._fit(trial))
        self._tell(f"run afresh: {again.rms_mm:.3g} mm rms in {again.seconds:.3g} s")
        self._measured[self._measured.index(cheapest)] = again


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
