"""The methods on the same cloth: how fast each comes to rest, at every stiffness and resolution, and is it true?

Hanging squares, cantilever strips, cloth over a ball, a sewn T-shirt. Each run goes on far beyond its certificate;
where it ends is the rest shape that its earlier shapes are measured against.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

import numpy as np

from warp_cloth.mesh import Points
from warp_cloth.scene import load_scene
from warp_cloth.set_up import SetUp, following, set_up_one, start_coarse, tolerance_of
from warp_cloth.solver.certificate import Check, Tolerance
from warp_cloth.solver.loop import CHUNK, relax_to_rest
from warp_cloth.solver.relax import StepOptions
from warp_cloth.study.extreme_meshes import sheet, write_garment

STIFFNESS = (2e3, 2e4, 2e5)  # [N/m]
SIZES = (1_000, 4_000, 16_000, 66_000)  # vertices, about
GROUPS = ("methods", "sizes", "truth")
KINDS = ("hanging", "strip", "ball")
LIMITS = MappingProxyType({"direct": 20_000, "momentum": 20_000, "accelerated": 40_000, "multilevel": 20_000})
SIDE = 1.0  # of the square [m]
STRIP = (0.1, 0.3)  # width and length [m]
CLAMP = 0.02  # of its length [m]
BULGE = 1e-3  # [m]; a square that hangs dead flat cannot choose a side to fold to

# Rest for the study: so tight that what is left is no more than a fiftieth of what is measured against it.
BEYOND = Tolerance(relative_rms=1e-3, relative_p99=5e-3, rest_error=2e-5)
LEVELS = (0.1, 0.01, 0.001)  # relative residuals whose iterations and seconds are told
GROWTH = 1.05  # shapes are kept when the iterations have grown by this factor
FURTHER = 2.0  # times the iterations to the certificate that a run goes on at least
CERTAIN = 5.0  # a distance is known where it is so many times what the end may still be from rest


@dataclass(frozen=True)
class Case:
    """One scene."""

    kind: str  # of KINDS, or "tshirt"
    vertices: int = 0  # wanted, about
    stretch: float = 0.0  # [N/m]
    friction: float = 0.5

    @property
    def name(self) -> str:
        return self.kind if self.kind == "tshirt" else f"{self.kind} {self.vertices} {self.stretch:g} {self.friction:g}"


@dataclass(frozen=True)
class Look:
    """What was seen of a run at one check."""

    iteration: int  # of the finest garment
    seconds: float  # since the start, simplified garments included
    weights: float  # residual rms in vertex weights
    relative: float
    relative_p99: float
    rest_error_mm: float  # nan while it is not known
    true_mm: float = math.nan  # rms distance from where the run ended; nan where that is not known


@dataclass(frozen=True)
class Run:
    """One method on one scene."""

    case: Case
    method: str
    device: str
    vertices: int
    coarse: float  # iterations of simplified garments, each weighted by its vertices over the garment's
    coarse_seconds: float
    rest: int  # iteration of the certificate; 0 where it was not reached
    end_mm: float  # what the end may still be from rest
    looks: tuple[Look, ...] = field(repr=False)

    @property
    def work(self) -> float:
        """Iterations to the certificate, all levels weighted by their vertices; inf where it was not reached."""
        return self.coarse + self.rest if self.rest else math.inf

    def first(self, relative: float) -> Look | None:
        """The first look from which on the relative residual stays below this."""
        found = None
        for look in reversed(self.looks):
            if not look.relative <= relative:
                break
            found = look
        return found

    def estimates(self) -> list[Look]:
        """Looks at balanced forces whose distance from rest is known."""
        return [
            look
            for look in self.looks
            if look.relative <= 0.01
            and look.relative_p99 <= 0.05
            and look.rest_error_mm == look.rest_error_mm
            and look.true_mm > CERTAIN * self.end_mm
        ]


def all_cases() -> list[tuple[str, Case, tuple[str, ...]]]:
    """What is run: group, scene, methods."""
    side = [Case("hanging", 4_000, 2e4), Case("strip", 4_000, 2e4), Case("ball", 4_000, 2e4), Case("tshirt")]
    found: list[tuple[str, Case, tuple[str, ...]]]
    found = [("methods", case, ("direct", "momentum", "accelerated", "multilevel")) for case in side]
    for size in SIZES:
        for kind in KINDS:
            for stretch in STIFFNESS:
                both = ("accelerated", "multilevel")
                found.append(("sizes", Case(kind, size, stretch), both if size < SIZES[2] else both[1:]))
    slick = [Case("ball", size, stretch, 0.0) for size in SIZES[:2] for stretch in STIFFNESS]
    return found + [("truth", case, ("accelerated", "multilevel")) for case in slick]


def case_tree(case: Case, folder: Path) -> dict[str, Any]:
    """The case as a scene; its garment's mesh is written into the folder."""
    if case.kind == "tshirt":
        return {"garment": {"shape": {"kind": "tshirt", "edge_mm": 12}, "rest": "uv", "fabric": "jersey"},
                "avatar": {"shape": {"kind": "mannequin"}, "friction": case.friction}}  # fmt: skip
    path = folder / "garment.obj"
    ticks, other = _ticks(case)
    points, triangles, flat = sheet(ticks, other)
    fabric = {"stretch": case.stretch, "weight": 0.2, "bending": 1e-7}
    garment: dict[str, Any] = {"mesh": str(path), "units": "m", "rest": "uv", "fabric": fabric}
    tree: dict[str, Any] = {"garment": garment}
    corner = 1e-4
    if case.kind == "hanging":
        points[:, 1] += 1.0
        points[:, 2] = BULGE * np.sin(14.0 * points[:, 0]) * np.sin(10.0 * points[:, 1])
        ends = [(x * SIDE, 1.0 + SIDE) for x in (0.0, 1.0)]
        garment["pin"] = [{"box": [[x - corner, y - corner, -1.0], [x + corner, y + corner, 1.0]]} for x, y in ends]
    else:
        points = np.stack([points[:, 0] - 0.5 * ticks[-1], np.zeros(len(points)), -points[:, 1]], axis=1)
        points[:, 1] += 1.0
    if case.kind == "strip":
        garment["pin"] = [{"box": [[-1.0, 0.0, -CLAMP - corner], [1.0, 2.0, 1.0]]}]
    if case.kind == "ball":
        points[:, 2] += 0.5 * SIDE
        points[:, 1] -= 0.09
        if not case.friction:
            garment["pin"] = [{"vertices": [int(np.argmin(np.hypot(points[:, 0], points[:, 2])))]}]
        shape = {"kind": "sphere", "radius": 0.3, "centre": [0.0, 0.6, 0.0]}
        tree["avatar"] = {"shape": shape, "friction": case.friction}
    write_garment(path, (points, triangles, flat))
    return tree


def _ticks(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Places of the vertices across and along [m]."""
    if case.kind == "strip":
        width, length = STRIP
        across = max(round(math.sqrt(case.vertices * width / length)), 3)
        return np.linspace(0.0, width, across), np.linspace(0.0, length, round(length / width * (across - 1)) + 1)
    count = round(math.sqrt(case.vertices))
    count += 1 - count % 2
    return np.linspace(0.0, SIDE, count), np.linspace(0.0, SIDE, count)


def step_options(method: str) -> StepOptions:
    """How the method moves cloth; momentum alone is each vertex's own step and plain momentum, nothing else."""
    if method == "momentum":
        return StepOptions(momentum=0.99, damping=1.0, viscosity=0.0, memory=0.0)
    if method == "direct":
        return StepOptions(method="direct")
    return StepOptions(method="multilevel" if method == "multilevel" else "accelerated")


def prepared(case: Case, method: str, device: str, limit: int) -> SetUp:
    """The case on the device, ready to relax."""
    with TemporaryDirectory() as folder:
        own = "accelerated" if method == "momentum" else method
        tree = {**case_tree(case, Path(folder)), "solver": {"method": own, "iterations": limit}}
        return set_up_one(load_scene(tree), device, options=step_options(method))


def run_case(case: Case, method: str, device: str, limit: int | None = None) -> Run:
    """Relaxes a case by a method, on beyond its certificate."""
    limit = LIMITS[method] if limit is None else limit
    made = prepared(case, method, device, limit)
    began = time.perf_counter()
    levels = start_coarse(made)
    before = time.perf_counter() - began
    model, looks, shapes = made.model, [], []
    wanted, idle, kept, rest = tolerance_of(made.scenes[0]), 0.0, 0, 0

    def seen(check: Check, seconds: float) -> None:
        nonlocal idle, kept, rest
        entered = time.perf_counter()
        shape: Points | None = None
        if check.iteration >= GROWTH * kept:
            kept, shape = check.iteration, model.points()
        shapes.append(shape)
        looks.append((check, before + seconds - idle))
        if not rest and check.within(wanted):
            rest = check.iteration
        idle += time.perf_counter() - entered

    outcome = relax_to_rest(
        made.relaxation, made.certifier, BEYOND, limit, follow=following(made), on_check=seen, ahead=False
    )
    end = outcome.points
    further = int(FURTHER * rest) - outcome.iterations
    for _ in range(max(further, 0) // CHUNK):
        made.relaxation.run(CHUNK)
    if further > 0:
        end = model.points()
    coarse = sum(level.iterations * level.vertices for level in levels) / model.vertex_count
    end_mm = 1e3 * outcome.check.rest_error
    told = []
    for (check, seconds), shape in zip(looks, shapes, strict=True):
        true = math.nan if shape is None else 1e3 * float(np.sqrt(np.mean(np.sum((shape - end) ** 2, axis=1))))
        left = check.residual
        error = 1e3 * check.rest_error if math.isfinite(check.rest_error) else math.nan
        told.append(Look(check.iteration, seconds, left.rms, left.relative_rms, left.relative_p99, error, true))
    return Run(case, method, device, model.vertex_count, coarse, before, rest, end_mm, tuple(told))


class MethodStudy:
    """Runs cases; what is known is kept in a file as it comes, and not run again."""

    def __init__(self, kept: Path, device: str, tell: Callable[[str], None]) -> None:
        self._kept, self._device, self._tell = kept, device, tell
        self.runs: dict[tuple[str, str], Run] = {}
        if kept.exists():
            for line in kept.read_text(encoding="utf-8").splitlines():
                run = run_from(json.loads(line))
                self.runs[run.case.name, run.method] = run

    def run(self, groups: Sequence[str], limits: Mapping[str, int] = LIMITS) -> list[Run]:
        """All cases of these groups by their methods."""
        for group, case, methods in all_cases():
            for method in methods if group in groups else ():
                if (case.name, method) in self.runs:
                    continue
                found = run_case(case, method, self._device, limits[method])
                self.runs[case.name, method] = found
                with self._kept.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(found)) + "\n")
                told = f"rest after {found.work:,.0f} iterations" if found.rest else "not at rest"
                self._tell(f"  {case.name}, {method}: {told}, {found.looks[-1].seconds:.2f} s in all")
        return list(self.runs.values())


def run_from(values: Mapping[str, Any]) -> Run:
    """A run from what ``asdict`` made of it."""
    looks = tuple(Look(**look) for look in values["looks"])
    return Run(**{**values, "case": Case(**values["case"]), "looks": looks})
