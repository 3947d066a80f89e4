"""Traffic and time of each kernel on an NVIDIA GPU: compulsory bytes and seconds of a plan, and what ncu measures.

    python tests/benchmarks/traffic.py --data ../shared/data --out traffic --scene layers4k --scene ball

Each scene is planned as `warp-cloth plan` does it. The same iterations then run under ncu, and some launches of each
kernel, evenly spread, are measured: of the iterations that the plan recorded launch by launch some rounds run launch by
launch again, all others as captured graphs, into which ncu does not see. How often a kernel is launched is taken from
the plan; bytes and time of a launch are the mean of those measured. Plans and measured launches are kept in the folder.

Columns: compulsory bytes (the sizes of the arrays that a launch takes), bytes between the L2 cache and the cores, bytes
to and from memory, and the kernel's fraction of the time by the plan and by ncu.
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
from warp_cloth.solver.loop import BURST
from warp_cloth.study.footprint import footprint_of
from warp_cloth.study.timing import TIMED, TimedFit

CACHE = ("l1tex__m_xbar2l1tex_read_bytes.sum", "l1tex__m_l1tex2xbar_write_bytes.sum")  # between L2 and the cores
MEMORY = ("dram__bytes_read.sum", "dram__bytes_write.sum")
DURATION = "gpu__time_duration.sum"
# Where these come from: loads, stores, atomics, and spilled registers.
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
    """All scenes, by name."""
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


class Replay(TimedFit):
    """The iterations of a plan once more."""

    def replay(self, end: int, every: int = 0, samples: Samples | None = None) -> None:
        """Runs up to an iteration, and samples every so many of the rounds that the plan recorded."""
        rounds = 0
        while self.iteration < end:
            warm = self.warm
            self._run(TIMED)
            if warm:
                rounds += 1
                if samples is not None and rounds % every == every // 2:
                    with samples.taken():
                        self.iterate_recorded()
                else:
                    self._run(self.recorded)
            self.check()

    def _run(self, count: int) -> None:
        for _ in range(count // BURST):
            self._problem.relaxation.run(BURST)
        self.iteration += count


class Samples:
    """Launches of each kernel that are shown to the driver's profiler, and so to ncu."""

    def __init__(self, plan: dict[str, Any], iterations: int, count: int) -> None:
        """About so many of each in so many iterations, evenly."""
        launches = {each["name"]: each["launches"] * iterations for each in plan["kernels"]}
        self._every = {name: max(int(often / count), 1) for name, often in launches.items()}
        self._seen = defaultdict[str, int](int)
        self._driver = ctypes.CDLL("libcuda.so.1")

    @contextmanager
    def taken(self) -> Iterator[None]:
        """Shows those that are due."""
        launch = wp.launch

        def launch_sampled(kernel: wp.Kernel, *arguments: Any, **more: Any) -> Any:
            name = kernel.key.rpartition("__")[2]
            every = self._every.get(name, 0)
            self._seen[name] += 1
            if not every or self._seen[name] % every != every // 2:
                return launch(kernel, *arguments, **more)
            self._driver.cuProfilerStart()
            launch(kernel, *arguments, **more)
            self._driver.cuCtxSynchronize()
            self._driver.cuProfilerStop()
            return None

        wp.launch = launch_sampled
        try:
            yield
        finally:
            wp.launch = launch


def rounds_apart(plan: dict[str, Any], rounds: int, recorded: int, samples: int) -> int:
    """Every how many of the rounds, of so many iterations, are enough for the samples, of the rarest kernel, too."""
    rarest = min(each["launches"] for each in plan["kernels"] if each["bytes"])
    return max(int(rounds * min(recorded * rarest, 1.0) / samples), 1)


def planned(tree: dict[str, Any], device: str) -> dict[str, Any]:
    """The plan of a scene, as numbers."""
    cost = footprint_of(load_problem(load_scene(tree), device))
    kernels = [{**asdict(kernel), "share": cost.fraction(kernel)} for kernel in cost.kernels]
    return {"vertices": cost.vertices, "iterations": cost.iterations, "bytes": cost.bytes, "seconds": cost.seconds,
            "kernels": kernels}  # fmt: skip


def measured(name: str, plan: dict[str, Any], options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Sums of what ncu measures of a scene's kernels, by the plan's names, and the number of "launches" summed."""
    table, replayed = Path(options.out) / f"{name}.csv", Path(options.out) / f"{name}.plan.json"
    replayed.write_text(json.dumps(plan))
    metrics = [*CACHE, *MEMORY, DURATION, *(KINDS if options.kinds else ())]
    command = [options.ncu, "--profile-from-start", "off", "--cache-control", "none", "--clock-control", "none",
               "--csv", "--page", "raw", "--print-units", "base", "--metrics", ",".join(metrics),
               "--log-file", str(table), sys.executable, __file__, "--data", options.data, "--device", options.device,
               "--scene", name, "--out", options.out, "--samples", str(options.samples),
               "--replay", str(replayed)]  # fmt: skip
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


def kernel_named(mangled: str, names: list[str]) -> str:
    """Which of the plan's kernels one is by the driver's name; else that name."""
    fitting = (name for name in names if f"__{name}_" in f"__{mangled}")
    return max(fitting, key=len, default=mangled)


@dataclass(frozen=True)
class Row:
    """A kernel's part of an iteration, planned and measured."""

    name: str
    launches: float  # per iteration
    compulsory: float  # bytes of a launch
    cache: float  # bytes of a launch between L2 and the cores
    memory: float  # bytes of a launch to and from memory
    seconds: float  # of an iteration
    nanoseconds: float  # of a launch, by ncu


def row_of(kernel: dict[str, Any], sums: dict[str, float]) -> Row:
    """Mean of the measured launches of a kernel."""
    count = sums["launches"]
    cache, memory = (sum(sums[metric] for metric in metrics) / count for metrics in (CACHE, MEMORY))
    launches = kernel["launches"]
    return Row(kernel["name"], launches, kernel["bytes"] / launches, cache, memory, kernel["seconds"],
               sums[DURATION] / count)  # fmt: skip


def compared(name: str, plan: dict[str, Any], found: dict[str, dict[str, float]]) -> dict[str, float]:
    """Prints compulsory bytes and measured traffic; returns those of an iteration, and how time fractions differ."""
    rows = [row_of(kernel, found[kernel["name"]]) for kernel in plan["kernels"] if kernel["name"] in found]
    missing = [kernel["name"] for kernel in plan["kernels"] if kernel["name"] not in found]
    unplanned = sorted(found.keys() - {row.name for row in rows})
    levels = ("compulsory", "cache", "memory")
    total = {level: sum(row.launches * getattr(row, level) for row in rows) for level in levels}
    seconds, profile = sum(row.seconds for row in rows), sum(row.launches * row.nanoseconds for row in rows)
    apart = max(abs(row.seconds / seconds - row.launches * row.nanoseconds / profile) for row in rows)
    begin, end = plan["iterations"]
    print(f"{name}: {plan['vertices']:,} vertices, iterations {begin:,} to {end:,}, MB of an iteration")
    heads = " ".join(f"{head:>10}" for head in (*levels, "time", "by ncu"))
    print(f"  {'kernel':<24} {'launches':>8} {heads}")
    for row in rows:
        moved = " ".join(f"{1e-6 * row.launches * getattr(row, level):>10.4f}" for level in levels)
        by_ncu = row.launches * row.nanoseconds / profile
        print(f"  {row.name:<24} {row.launches:>8.4f} {moved} {row.seconds / seconds:>10.1%} {by_ncu:>10.1%}")
    moved = " ".join(f"{1e-6 * total[level]:>10.4f}" for level in levels)
    print(f"  {'all':<24} {'':>8} {moved}  time fractions within {100 * apart:.1f} points")
    for what, names in (("not measured", missing), ("not planned", unplanned)):
        if names:
            print(f"  {what}: {', '.join(names)}")
    return {**total, "time_fractions_apart": apart}


def replay(tree: dict[str, Any], plan: dict[str, Any], options: argparse.Namespace) -> None:
    """Runs the iterations of a plan once more, under ncu."""
    (begin, end), began = plan["iterations"], time.perf_counter()
    run = Replay(load_problem(load_scene(tree), options.device))
    run.replay(begin)
    rounds = (end - begin) // (TIMED + run.recorded)
    every = rounds_apart(plan, rounds, run.recorded, options.samples)
    print(f"  iteration {begin:,} in {time.perf_counter() - began:.0f} s; samples 1 of {every} rounds")
    run.replay(end, every, Samples(plan, rounds // every * run.recorded, options.samples))
    print(f"  iteration {end:,} in {time.perf_counter() - began:.0f} s")


def main() -> None:
    """Plans and measures the chosen scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", default=[], help="name of a scene; may be repeated; default: all")
    parser.add_argument("--data", default=os.environ.get("WARP_CLOTH_DATA", "../shared/data"))
    parser.add_argument("--out", default="traffic", help="folder for plans and measured launches")
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--ncu", default="ncu")
    parser.add_argument("--samples", type=int, default=16, help="launches of each kernel to measure; each takes 0.1 s")
    parser.add_argument("--kinds", action="store_true", help="measure by kind of access, too")
    parser.add_argument("--replay", type=Path, help="internal: the plan to run once more, under ncu")
    options = parser.parse_args()
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    start_warp(False)
    known, results = scenes(Path(options.data)), {}
    for name in options.scene or known:
        began = time.perf_counter()
        if options.replay:
            replay(known[name], json.loads(options.replay.read_text()), options)
            continue
        plan = planned(known[name], options.device)
        seconds = time.perf_counter() - began
        print(f"{name}: planned in {seconds:.0f} s")
        found = measured(name, plan, options)
        results[name] = {"plan": plan, "measured": found, **compared(name, plan, found)}
        print(f"  measured in {time.perf_counter() - began - seconds:.0f} s")
        (folder / "traffic.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
