"""Bytes and time of an iteration on an NVIDIA GPU: as `warp-cloth plan` tells them, and as ncu measures them.

    python tests/benchmarks/traffic.py --data ../shared/data --out traffic --scene layers4k --scene ball

Each scene is planned as the command does it. It then goes the same way under ncu, iteration for iteration, and some
launches of each kernel, evenly over the way, are measured: of the iterations that the plan watched launch by launch
some rounds are gone launch by launch again, all others as captured graphs, which ncu does not see into. How often a
kernel is launched is as the plan counted it; what a launch moves, and how long it takes, is held against the mean of
those measured. Beside the table the plans, and each launch that was measured, are kept in the folder.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import warp as wp

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import load_problem
from warp_cloth.scene import load_scene
from warp_cloth.solver.loop import CHUNK
from warp_cloth.study.footprint import footprint_of
from warp_cloth.study.timing import TIMED, Way

ASKED = ("l1tex__m_xbar2l1tex_read_bytes.sum", "l1tex__m_l1tex2xbar_write_bytes.sum")  # between the cache and the cores
MEMORY = ("dram__bytes_read.sum", "dram__bytes_write.sum")
DURATION = "gpu__time_duration.sum"
# What tells where these come from: loads, stores, what is added to, and what registers do not hold.
KINDS = (
    *(f"l1tex__m_xbar2l1tex_read_bytes_mem_{what}.sum" for what in ("lg_op_ld", "global_op_atom")),
    *(f"l1tex__m_l1tex2xbar_write_bytes_mem_{what}.sum" for what in ("lg_op_st", "global_op_red", "global_op_atom")),
    *(
        f"l1tex__t_sectors_pipe_lsu_mem_local_op_{what}.sum"
        for what in ("ld", "ld_lookup_miss", "st", "st_lookup_miss")
    ),
    *(f"l1tex__t_sectors_pipe_lsu_mem_global_op_{what}.sum" for what in ("ld", "ld_lookup_miss", "st", "red")),
)

FABRIC = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
BALL = {"shape": {"kind": "sphere", "radius": 0.3, "centre": [0.0, 0.6, 0.0]}, "friction": 0.5}


def square(per_side: int, **more: Any) -> dict[str, Any]:
    """A square of cloth."""
    return {"kind": "square", "side": 1.0, "vertices_per_side": per_side, **more}


def hanging(per_side: int) -> dict[str, Any]:
    """A square that hangs from two corners."""
    pins = [{"box": [[x - 0.004, 0.996, -0.01], [x + 0.004, 1.004, 0.01]]} for x in (-0.5, 0.5)]
    shape = square(per_side, plane="vertical", height=1.0)
    return {"garment": {"shape": shape, "fabric": FABRIC, "pin": pins}}


def layers(per_side: int, count: int) -> dict[str, Any]:
    """Squares that lie on each other and over a ball."""
    heights = [0.91 + 0.004 * layer for layer in range(count)]
    sheets = [{"shape": square(per_side, height=height), "fabric": FABRIC} for height in heights]
    return {"garment": sheets, "avatar": BALL, "collision": {"cloth": True}}


def hammock(per_side: int) -> dict[str, Any]:
    """A square that hangs by its corners, and another one that lies in it."""
    pins = [
        {"box": [[x - 0.004, 0.996, z - 0.004], [x + 0.004, 1.004, z + 0.004]]}
        for x in (-0.5, 0.5)
        for z in (-0.5, 0.5)
    ]
    held = {"shape": square(per_side, height=1.0), "fabric": FABRIC, "pin": pins}
    upper = {"shape": square(per_side, side=0.7, height=1.004), "fabric": FABRIC}
    return {"garment": [held, upper], "collision": {"cloth": True}}


def shirt(data: Path, *, cloth: bool) -> dict[str, Any]:
    """The shared T-shirt on the shared body."""
    garment = {"mesh": str(data / "garmentcode" / "tshirt.obj"), "rest": "uv"}
    avatar = {"mesh": str(data / "garmentcode" / "mean_all.obj")}
    return {"garment": garment, "avatar": avatar, "collision": {"cloth": cloth}}


def scenes(data: Path) -> dict[str, dict[str, Any]]:
    """All that may be asked for."""
    return {
        "layers4k": layers(65, 2),
        "layers2k": layers(45, 2),
        "three": layers(45, 3),
        "hammock": hammock(65),
        "tshirt_cloth": shirt(data, cloth=True),
        "tshirt": shirt(data, cloth=False),
        "ball": {"garment": {"shape": square(65, height=0.91), "fabric": FABRIC}, "avatar": BALL},
        "hanging4k": hanging(65),
        "hanging65k": hanging(257),
        "hanging1m": hanging(1025),
    }


class Retraced(Way):
    """The way that a plan went, iteration for iteration."""

    def retrace(self, end: int, every: int = 0, samples: Samples | None = None) -> None:
        """Goes it up to an iteration, and takes samples in every so many of the rounds that the plan watched."""
        rounds = 0
        while self.iteration < end:
            warm = self.warm
            self._run(TIMED)
            if warm:
                rounds += 1
                if samples is not None and rounds % every == every // 2:
                    with samples.taken():
                        self.iterate_watched()
                else:
                    self._run(self.watched)
            self.check()

    def _run(self, count: int) -> None:
        for _ in range(count // CHUNK):
            self._made.relaxation.run(CHUNK)
        self.iteration += count


class Samples:
    """Launches of each kernel that the driver's profiler sees, and so what watches it."""

    def __init__(self, plan: dict[str, Any], iterations: int, count: int) -> None:
        """About so many of each in so many iterations, evenly."""
        launches = {each["name"]: each["launches"] * iterations for each in plan["kernels"]}
        self._every = {name: max(int(often / count), 1) for name, often in launches.items()}
        self._seen = defaultdict[str, int](int)
        self._driver = ctypes.CDLL("libcuda.so.1")

    @contextmanager
    def taken(self) -> Iterator[None]:
        """Takes those that come due."""
        launch = wp.launch

        def watch(kernel: wp.Kernel, *given: Any, **more: Any) -> Any:
            name = kernel.key.rpartition("__")[2]
            every = self._every.get(name, 0)
            self._seen[name] += 1
            if not every or self._seen[name] % every != every // 2:
                return launch(kernel, *given, **more)
            self._driver.cuProfilerStart()
            launch(kernel, *given, **more)
            self._driver.cuCtxSynchronize()
            self._driver.cuProfilerStop()
            return None

        wp.launch = watch
        try:
            yield
        finally:
            wp.launch = launch


def rounds_apart(plan: dict[str, Any], rounds: int, watched: int, samples: int) -> int:
    """Every how many of the rounds, of so many iterations, are enough for the samples, of the rarest kernel, too."""
    rarest = min(each["launches"] for each in plan["kernels"] if each["asked"])
    return max(int(rounds * min(watched * rarest, 1.0) / samples), 1)


def planned(tree: dict[str, Any], device: str) -> dict[str, Any]:
    """The plan of a scene, as figures."""
    cost = footprint_of(load_problem(load_scene(tree), device))
    kernels = [{**asdict(kernel), "share": cost.share(kernel)} for kernel in cost.kernels]
    return {"vertices": cost.vertices, "iterations": cost.iterations, "from_memory": cost.from_memory,
            "bytes": cost.bytes, "seconds": cost.seconds, "kernels": kernels}  # fmt: skip


def measured(name: str, plan: dict[str, Any], asked: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Sums of what ncu measures of a scene's kernels, by the plan's names, and of how many "launches" they are."""
    table, way = Path(asked.out) / f"{name}.csv", Path(asked.out) / f"{name}.plan.json"
    way.write_text(json.dumps(plan))
    metrics = [*level_of(plan)[0], DURATION, *(KINDS if asked.kinds else ())]
    command = [asked.ncu, "--profile-from-start", "off", "--cache-control", "none", "--clock-control", "none",
               "--csv", "--page", "raw", "--print-units", "base", "--metrics", ",".join(metrics),
               "--log-file", str(table), sys.executable, __file__, "--data", asked.data, "--device", asked.device,
               "--scene", name, "--out", asked.out, "--samples", str(asked.samples), "--retrace", str(way)]  # fmt: skip
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    lines = table.read_text().splitlines() if table.exists() else []
    if done.returncode:
        raise RuntimeError(f"{name} under ncu: " + "\n".join([done.stderr, *lines])[-4000:])
    found: dict[str, dict[str, float]] = {}
    for row in csv.DictReader(line for line in lines if line.startswith('"')):
        if not row["ID"]:  # units
            continue
        kernel = kernel_named(row["Kernel Name"], [each["name"] for each in plan["kernels"]])
        sums = found.setdefault(kernel, defaultdict(float))
        sums["launches"] += 1
        for metric in metrics:
            sums[metric] += float(row[metric].replace(",", "")) if row.get(metric) else 0.0
    return found


def level_of(plan: dict[str, Any]) -> tuple[tuple[str, ...], str]:
    """What ncu calls the bytes that matter, and what the plan does."""
    return (MEMORY, "bytes") if plan["from_memory"] else (ASKED, "asked")


def kernel_named(mangled: str, names: list[str]) -> str:
    """Which of the plan's kernels one is by the driver's name; else that name."""
    fitting = (name for name in names if f"__{name}_" in f"__{mangled}")
    return max(fitting, key=len, default=mangled)


@dataclass(frozen=True)
class Row:
    """A kernel's part of an iteration, planned and measured."""

    name: str
    launches: float  # per iteration
    planned: float  # bytes of a launch
    measured: float
    seconds: float  # of an iteration
    nanoseconds: float  # of a launch, by ncu


def compared(name: str, plan: dict[str, Any], found: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Prints plan against measurement; returns what is planned and measured of an iteration, and how shares differ."""
    level, which = level_of(plan)
    rows, missing = list[Row](), list[str]()
    for each in plan["kernels"]:
        sums = found.get(each["name"])
        if sums is None:
            missing.append(each["name"])
            continue
        count, moved = sums["launches"], sum(sums[metric] for metric in level)
        rows.append(Row(each["name"], each["launches"], each[which] / each["launches"], moved / count,
                        each["seconds"], sums[DURATION] / count))  # fmt: skip
    planned, measured = (sum(row.launches * getattr(row, which) for row in rows) for which in ("planned", "measured"))
    seconds, profile = sum(row.seconds for row in rows), sum(row.launches * row.nanoseconds for row in rows)
    apart = [abs(row.seconds / seconds - row.launches * row.nanoseconds / profile) for row in rows]
    begin, end = plan["iterations"]
    where = "to and from memory" if plan["from_memory"] else "between cache and cores"
    print(f"{name}: {plan['vertices']:,} vertices, iterations {begin:,} to {end:,}, {where}")
    heads = (("MB each", 8), ("ratio", 6), ("MB", 8), ("time", 6))
    columns = [f"{head:>{wide}}" + ("" if head == "ratio" else f" {'ncu':>{wide}}") for head, wide in heads]
    print(f"  {'kernel':<24} {'launches':>8} {' '.join(columns)}")
    for row in rows:
        here, there = row.launches * row.planned, row.launches * row.measured
        print(
            f"  {row.name:<24} {row.launches:>8.4f} {row.planned / 1e6:>8.4f} {row.measured / 1e6:>8.4f} "
            f"{here / max(there, 1.0):>6.2f} {1e-6 * here:>8.4f} {1e-6 * there:>8.4f} "
            f"{row.seconds / seconds:>6.1%} {row.launches * row.nanoseconds / profile:>6.1%}"
        )
    print(
        f"  {'all':<24} {'':>26} {planned / measured:>6.3f} {1e-6 * planned:>8.4f} {1e-6 * measured:>8.4f}"
        f"  shares within {100 * max(apart):.1f} points"
    )
    for what, names in (("not measured", missing), ("not planned", sorted(found.keys() - {row.name for row in rows}))):
        if names:
            print(f"  {what}: {', '.join(names)}")
    return {"planned": planned, "measured": measured, "ratio": planned / measured, "shares_apart": max(apart)}


def retrace(tree: dict[str, Any], plan: dict[str, Any], asked: argparse.Namespace) -> None:
    """Goes a plan's way, for ncu to see."""
    (begin, end), began = plan["iterations"], time.perf_counter()
    way = Retraced(load_problem(load_scene(tree), asked.device))
    way.retrace(begin)
    rounds = (end - begin) // (TIMED + way.watched)
    every = rounds_apart(plan, rounds, way.watched, asked.samples)
    print(f"  iteration {begin:,} in {time.perf_counter() - began:.0f} s; watches 1 of {every} rounds")
    way.retrace(end, every, Samples(plan, rounds // every * way.watched, asked.samples))
    print(f"  iteration {end:,} in {time.perf_counter() - began:.0f} s")


def main() -> None:
    """Plans and measures what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", default=[], help="of those in `scenes`; may be repeated; else all")
    parser.add_argument("--data", default=os.environ.get("WARP_CLOTH_DATA", "../shared/data"))
    parser.add_argument("--out", default="traffic", help="folder for what is kept")
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--ncu", default="ncu")
    parser.add_argument("--samples", type=int, default=16, help="launches of each kernel to measure; each takes 0.1 s")
    parser.add_argument("--kinds", action="store_true", help="measure by kind of access, too")
    parser.add_argument("--retrace", type=Path, help="used by itself: the plan whose way is to be gone")
    asked = parser.parse_args()
    folder = Path(asked.out)
    folder.mkdir(parents=True, exist_ok=True)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    start_warp(False)
    known, results = scenes(Path(asked.data)), {}
    for name in asked.scene or known:
        began = time.perf_counter()
        if asked.retrace:
            retrace(known[name], json.loads(asked.retrace.read_text()), asked)
            continue
        plan = planned(known[name], asked.device)
        seconds = time.perf_counter() - began
        print(f"{name}: planned in {seconds:.0f} s")
        found = measured(name, plan, asked)
        results[name] = {"plan": plan, "measured": found, **compared(name, plan, found)}
        print(f"  measured in {time.perf_counter() - began - seconds:.0f} s")
        (folder / "traffic.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
