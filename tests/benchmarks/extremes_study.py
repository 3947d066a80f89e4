"""The extremes: where the solver comes to rest, where it is bounded and says that it is not, what it refuses."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

import extreme_meshes as meshes
import numpy as np
from extreme_meshes import Drawn

sys.path.insert(0, str(Path(__file__).parents[1]))
from meshfiles import write_obj

from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import core_count
from warp_cloth.fitting.fit import Fit, fit
from warp_cloth.study.workers import run_jobs

STIFFNESS = tuple(10.0**power for power in range(9))  # [N/m]
CAPS = tuple(10.0**power for power in range(-7, 1))  # [m]
SIZES = (5, 9, 17)  # vertices a side of the precision map
GROUPS = ("cases", "map", "precision")
METHODS = ("direct", "accelerated")
LIMIT = 20_000  # iterations of the maps
DEADLINE = 300.0  # [s] of a run, compiling included; the slowest known takes 3 s
MOST_ON_GPU = 4  # processes that share one
CASE_LIMIT = 3000  # of the single cases

# The hanging sheet of the maps: ROWS rows of edges under a pinned one.
SIDE, ROWS, WEIGHT, GRAVITY = 0.5, 8, 0.2, 9.80665  # [m], -, [kg/m2], [m/s2]
TOP = {"box": [[-10.0, 1.4999, -10.0], [10.0, 10.0, 10.0]]}


@dataclass(frozen=True, eq=False)
class Case:
    """One scene at an end of what is possible."""

    group: str
    name: str
    tree: Mapping[str, Any]
    drawn: Drawn | None = None  # written as garment.obj


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case."""

    group: str
    name: str
    method: str
    precision: str
    verdict: str  # "at rest", "not at rest", "diverged", "refused"; never "not finite", "crashed", "hung"
    message: str
    iterations: int = 0
    seconds: float = 0.0
    residual: float = math.nan  # relative, rms
    furthest: float = math.nan  # of any vertex from its start [m]
    values: Mapping[str, float] = field(default_factory=dict)  # of the maps: stiffness, cap, size

    @property
    def kept(self) -> bool:
        """Whether it ended as every case must: at rest, honestly not, or refused."""
        return self.verdict in ("at rest", "not at rest", "diverged", "refused") and bool(self.message)


@dataclass(frozen=True, eq=False)
class Job:
    """One run of a case."""

    case: Case
    method: str
    precision: str
    limit: int  # iterations
    values: Mapping[str, float]

    def run(self, device: str) -> Outcome:
        """Its outcome."""
        return replace(run_case(self.case, self.method, self.precision, device, self.limit), values=self.values)

    def lost(self, verdict: str, message: str) -> Outcome:
        """The outcome of a run whose process died or hung."""
        return Outcome(
            self.case.group, self.case.name, self.method, self.precision, verdict, message, values=self.values
        )


def theory_cap(stiffness: float) -> float:
    """Largest cap [m] at which the direct rule should come to rest on the maps' sheet.

    A gravity step of e L / (2 n) for a chain of n rows of length L each, e the strain under the load:
    K e^2 = weight below per width; the cap is what 1.1 weights move a vertex by (the model, section 5).
    """
    strain = math.sqrt(WEIGHT * GRAVITY * SIDE / stiffness)
    return 1.1 * strain * (SIDE / ROWS) / (2.0 * ROWS)


def run_case(case: Case, method: str, precision: str, device: str, limit: int) -> Outcome:
    """Fits a case as a user would: from its files."""
    tree = {**case.tree, "solver": {**case.tree.get("solver", {}), "method": method, "precision": precision}}
    tree["solver"].setdefault("iterations", limit)
    names: dict[str, Any] = {"group": case.group, "name": case.name, "method": method, "precision": precision}
    began = time.perf_counter()
    with TemporaryDirectory() as folder:
        if case.drawn is not None:
            write_obj(Path(folder) / "garment.obj", *case.drawn)
            tree["garment"] = {**tree["garment"], "mesh": str(Path(folder) / "garment.obj"), "units": "m"}
        try:
            fitted = fit(tree, device=device)
        except InputError as error:
            return Outcome(**names, verdict="refused", message=str(error).replace(folder, ""))
        except Exception as error:
            return Outcome(**names, verdict="crashed", message=f"{type(error).__name__}: {error}")
    return _outcome(fitted, names, time.perf_counter() - began)


def _outcome(fitted: Fit, names: dict[str, Any], seconds: float) -> Outcome:
    report = fitted.report
    moved = np.concatenate([worn.points - worn.mesh.points for worn in fitted.garments])
    away = float(np.linalg.norm(moved, axis=1).max()) if np.isfinite(moved).all() else math.inf
    verdicts = {"at_rest": "at rest", "iteration_limit": "not at rest", "diverged": "diverged", "invalid": "diverged"}
    verdict = verdicts[report["status"]]
    figures = [report["residual"]["relative_rms"], *(report["strain"][key] for key in ("p50", "p99", "max", "min"))]
    if not math.isfinite(away) or (verdict == "at rest" and not all(math.isfinite(figure) for figure in figures)):
        verdict = "not finite"
    return Outcome(
        **names,
        verdict=verdict,
        message=fitted.message,
        iterations=report["iterations"],
        seconds=seconds,
        residual=report["residual"]["relative_rms"],
        furthest=away,
    )


def hanging(
    stiffness: float = 2e4, count: int = ROWS + 1, fabric: Mapping[str, float] = MappingProxyType({})
) -> dict[str, Any]:
    """The maps' sheet, its top edge pinned."""
    shape = {"kind": "square", "side": SIDE, "vertices_per_side": count, "plane": "vertical", "height": 1.5}
    values = {"weight": WEIGHT, "bending": 0.0, "stretch": stiffness, **fabric}
    return {"garment": {"shape": shape, "fabric": values, "pin": TOP}}


def map_cases() -> Iterator[tuple[Case, dict[str, float]]]:
    """Stiffness against cap."""
    for stiffness in STIFFNESS:
        for cap in CAPS:
            tree = {**hanging(stiffness), "solver": {"cap": cap}}
            yield Case("map", f"K = {stiffness:g} N/m, cap = {cap:g} m", tree), {"stiffness": stiffness, "cap": cap}


def precision_cases() -> Iterator[tuple[Case, dict[str, float]]]:
    """Stiffness against resolution."""
    for stiffness in STIFFNESS:
        for count in SIZES:
            name = f"K = {stiffness:g} N/m, {count} a side"
            yield Case("precision", name, hanging(stiffness, count)), {"stiffness": stiffness, "size": float(count)}


def single_cases() -> list[Case]:
    """Everything else, one end at a time."""
    cases = [
        Case(f"fabric: {key}", f"{key} {value:g}", hanging(fabric={key: value}))
        for key, values in {
            "compression": (0.0, 1e-6, 0.1, 0.5, 1.0),
            "bending": (0.0, 1e-9, 1e-6, 1e-3, 1.0),
            "weight": (1e-3, 1e-2, 1.0, 10.0, 100.0),
            "shear": (0.0, 1e-3, 1.0, 5e3),
        }.items()
        for value in values
    ]
    body = {"shape": {"kind": "sphere", "radius": 0.2, "centre": [0.0, 1.2, 0.0], "edge_mm": 30}}
    seen = {"pixel_mm": 5}
    over = {"kind": "square", "side": SIDE, "vertices_per_side": 9, "plane": "horizontal", "height": 1.41}
    for friction in (0.0, 0.01, 0.5, 1.0, 10.0):
        tree = {"garment": {"shape": over}, "avatar": {**body, "friction": friction}, "collision": seen}
        cases.append(Case("friction", f"friction {friction:g}", tree))
    return [*cases, *_sizes(), *_shapes(), *_starts(body, seen), *_places(body, seen, over)]


def _mesh_case(group: str, name: str, drawn: Drawn, **more: Any) -> Case:
    garment = {"rest": "uv" if drawn[2] is not None else "mesh", "fabric": {"bending": 1e-7}, **more.pop("garment", {})}
    return Case(group, name, {"garment": garment, **more}, drawn)


def _sizes() -> list[Case]:
    cases = []
    for edge in (1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0):
        drawn = meshes.square(9, 8.0 * edge)
        pin = {"box": [[-1e3, 1.5 - 1e-3 * edge, -1.0], [1e3, 2.0, 1.0]]}
        cases.append(_mesh_case("edge length", f"edges of {edge:g} m", drawn, garment={"pin": pin}))
    for shortest in (1e-5, 1e-4, 1e-3):
        drawn = meshes.graded(shortest, 0.1)
        name = f"edges of {shortest:g} to 0.1 m in one mesh"
        cases.append(_mesh_case("edge length", name, drawn, garment={"pin": TOP}))
    return cases


def _shapes() -> list[Case]:
    pin = {"box": [[-1.0, 1.49, -1.0], [2.0, 2.0, 1.0]]}
    shapes = [(f"needles 1:{ratio:g}", meshes.needles(ratio)) for ratio in (10.0, 1e2, 1e3, 1e4, 1e7)]
    shapes += [(f"caps of height {flat:g}", meshes.caps(flat)) for flat in (0.1, 1e-2, 1e-4, 1e-7)]
    return [_mesh_case("triangles", name, drawn, garment={"pin": pin}) for name, drawn in shapes]


def _starts(body: dict[str, Any], seen: dict[str, Any]) -> list[Case]:
    held = {"garment": {"pin": {"vertices": [0]}}}
    plain = meshes.square(9)
    middle = np.array([0.0, 1.25, 0.0])

    def scaled(factor: float) -> Drawn:
        return meshes.moved(plain, lambda points: middle + factor * (points - middle))

    cases = [_mesh_case("start", f"{times:g} times too large", scaled(times), **held) for times in (5.0, 1000.0)]
    cases += [_mesh_case("start", f"{times:g} of its size", scaled(times), **held) for times in (0.2, 1e-3, 0.0)]
    cases += [
        _mesh_case("start", f"seam {times:g} times too long", meshes.torn(times), **held) for times in (50.0, 1e3)
    ]
    cases += [_mesh_case("start", f"half a heap of {size:g} m", meshes.crumpled(size), **held) for size in (1e-2, 1e-9)]
    worn = {"avatar": body, "collision": seen}
    cases += [
        _mesh_case("start", "inside out round the avatar", meshes.ball(0.22, inside_out=True), **worn),
        _mesh_case("start", "wholly inside the avatar", meshes.ball(0.1), **worn),
        _mesh_case("start", "wholly inside, inside out", meshes.ball(0.1, inside_out=True), **worn),
        _mesh_case("start", "the avatar's own surface", meshes.ball(0.2), **worn),
        _mesh_case("start", "tube cut half as wide as the body", meshes.tube(0.21, 0.5), **worn),
        _mesh_case("start", "tube cut a fifth as wide as the body", meshes.tube(0.21, 0.2), **worn),
        _mesh_case("start", "tube cut 5 times as wide as the body", meshes.tube(0.21, 5.0), **worn),
    ]
    return cases


def _places(body: dict[str, Any], seen: dict[str, Any], over: dict[str, Any]) -> list[Case]:
    cases = []
    for far in (1e2, 1e4, 9e5):
        there = {**body["shape"], "centre": [0.0, far + 1.2, 0.0]}
        tree = {"garment": {"shape": {**over, "height": far + 1.41}}, "avatar": {"shape": there}, "collision": seen}
        cases.append(Case("place", f"draped {far:g} m from the origin", tree))
        pin = {"vertices": [72, 80]}  # the top corners
        shape = {"kind": "square", "side": SIDE, "vertices_per_side": 9, "plane": "vertical", "height": far}
        cases.append(Case("place", f"hanging {far:g} m from the origin", {"garment": {"shape": shape, "pin": pin}}))
    return cases


def jobs_of(groups: Sequence[str]) -> list[Job]:
    """Every run of the groups."""
    jobs: list[Job] = []
    if "cases" in groups:
        kinds = (("accelerated", "mixed"), ("direct", "mixed"), ("accelerated", "float32"))
        jobs += [Job(case, *kind, CASE_LIMIT, {}) for case in single_cases() for kind in kinds]
    if "map" in groups:
        jobs += [Job(case, method, "mixed", LIMIT, values) for case, values in map_cases() for method in METHODS]
    if "precision" in groups:
        both = ("float32", "mixed")
        jobs += [Job(case, "accelerated", kind, LIMIT, values) for case, values in precision_cases() for kind in both]
    return jobs


def run_extremes(
    device: str, log: Callable[[str], None], groups: Sequence[str] = GROUPS, *, deadline: float = DEADLINE
) -> list[Outcome]:
    """Runs every case of the groups in processes of their own, on all cores, or a few at a time on a GPU."""
    jobs = jobs_of(groups)
    found: dict[int, Outcome] = {}
    workers = core_count() if device == "cpu" else MOST_ON_GPU
    for number, outcome in run_jobs(jobs, device, workers=workers, deadline=deadline):
        found[number] = outcome
        words = f"{outcome.name}, {outcome.method}, {outcome.precision}: {outcome.verdict}"
        log(f"{len(found)}/{len(jobs)} {words}")
    return [found[number] for number in range(len(jobs))]
