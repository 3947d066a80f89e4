"""Seconds from Enter to the answer, and where they went: the command and the library, cold and warm.

    python tests/benchmarks/answer_time.py --scene tshirt --device cpu --runs 5
    python tests/benchmarks/answer_time.py --only command_warm,fitter

Wall time of the whole process, and report.json's "seconds"; ``told`` is the share of the wall time that they
add up to. Cold: no compiled kernels, no bytecode and an empty cache; one run, of the command alone, also to its first
word. Resident: beside ``warp-cloth resident``. ``--against`` names another checkout, whose command runs in turn with
this one's. The fitter answers on one core, in turn with a plain fit of the same scene in the same process, which must
give the same bits. Medians.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from measured import Figures, script_parser

CASES = ("command_cold", "command_warm", "command_resident", "library", "fitter")
LEAST = 0.005  # [s]; stages that take less are not printed
FITTER_CHANGES = {"fabric": {"garment.fabric": "denim"}, "size": {"garment.shape.size": "L"}}
FITTER = """
import hashlib, json, os, sys, time
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
import warp_cloth
scene, device, runs, changes = json.loads(sys.argv[1])

def timed(answer):
    began = time.perf_counter()
    fit = answer()
    wall = time.perf_counter() - began
    return [wall, fit.report["seconds"]], [hashlib.sha256(worn.points.tobytes()).hexdigest() for worn in fit.garments]

plain, again = [], []
warp_cloth.fit(scene, device=device, overrides=changes)
for _ in range(runs):
    fitter = warp_cloth.Fitter(scene, device=device)
    fitter.fit()
    of_fit, bits = timed(lambda: warp_cloth.fit(scene, device=device, overrides=changes))
    of_fitter, same = timed(lambda: fitter.fit(overrides=changes))
    if bits != same:
        sys.exit(f"other bits: {bits} {same}")
    plain.append(of_fit)
    again.append(of_fitter)
print(json.dumps([plain, again]))
"""
LIBRARY = """
import sys, time, json
began = time.perf_counter()
import warp_cloth
scene, device, runs = json.loads(sys.argv[1])
walls = []
for _ in range(runs + 1):
    fit = warp_cloth.fit(scene, device=device)
    walls.append([time.perf_counter() - began, fit.report["seconds"]])
    began = time.perf_counter()
print(json.dumps(walls))
"""


def command(scene: str, device: str, environment: Mapping[str, str]) -> tuple[float, dict[str, float], float]:
    """Wall time of one run of the command [s], the seconds of its report, and when it says its first word [s]."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "warp_cloth", "fit", scene, "--device", device, "--out", folder]
        began = time.perf_counter()
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(
            words, env={**os.environ, **environment}, stdout=quiet, stderr=subprocess.PIPE, cwd=folder, text=True
        )
        said = process.stderr.readline()
        first = time.perf_counter() - began
        said += process.stderr.read()
        status, wall = process.wait(), time.perf_counter() - began
        if status not in (0, 3):  # 3: not worn
            raise SystemExit(said)
        report: dict[str, Any] = json.loads((Path(folder) / "report.json").read_text(encoding="utf-8"))
    return wall, report["seconds"], first


@contextmanager
def staying(device: str, environment: Mapping[str, str]) -> Iterator[None]:
    """A resident for commands of this environment."""
    words = [sys.executable, "-m", "warp_cloth", "resident", "--device", device]
    with subprocess.Popen(words, env={**os.environ, **environment}, stderr=subprocess.PIPE, text=True) as process:
        try:
            if "ready" not in (said := process.stderr.readline()):
                raise SystemExit(said)
            yield
        finally:
            process.kill()


def run_script(script: str, *arguments: Any) -> Any:
    """What a script prints as JSON, in a process of its own."""
    words = [sys.executable, "-c", script, json.dumps(arguments)]
    ended = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(ended.stdout)


def add(figures: Figures, name: str, runs: Sequence[Sequence[Any]], cores: int | None = None) -> None:
    """Adds the medians of a case's runs: wall time, the seconds of its report, and when it said its first word."""
    figures.add(f"{name}.wall", statistics.median(run[0] for run in runs), "s", cores=cores)
    figures.add(
        f"{name}.told", 100.0 * statistics.median(sum(run[1].values()) / run[0] for run in runs), "%", cores=cores
    )
    if len(runs[0]) > 2:
        figures.add(f"{name}.first_word", statistics.median(run[2] for run in runs), "s", cores=cores)
    for stage in runs[0][1]:
        spent = statistics.median(run[1].get(stage, 0.0) for run in runs)
        if spent >= LEAST:
            figures.add(f"{name}.{stage}", spent, "s", cores=cores)


def main() -> None:
    reader = script_parser(__doc__, device="cpu")
    reader.add_argument("--scene", default="tshirt")
    reader.add_argument("--runs", type=int, default=5)
    reader.add_argument("--only", default=",".join(CASES), help="cases, separated by commas")
    reader.add_argument("--against", type=Path, help="another checkout, whose command runs in turn with this one's")
    options = reader.parse_args()
    scene, device, cases = options.scene, options.device, options.only.split(",")
    if unknown := set(cases) - set(CASES):
        reader.error(f"no such case: {', '.join(sorted(unknown))}")
    with Figures(__file__, options, device=device) as figures:
        own = str(Path(__file__).resolve().parents[2])
        trees = {"": own} if options.against is None else {"before_": str(options.against.resolve()), "": own}
        for before, tree in trees.items() if "command_cold" in cases else ():
            with tempfile.TemporaryDirectory() as folder:
                places = {"WARP_CACHE_PATH": "kernels", "PYTHONPYCACHEPREFIX": "bytecode", "WARP_CLOTH_CACHE": "cache"}
                fresh = {name: f"{folder}/{place}" for name, place in places.items()}
                add(figures, f"{before}command_cold", [command(scene, device, {**fresh, "PYTHONPATH": tree})])
        if "command_warm" in cases:
            with tempfile.TemporaryDirectory() as folder:  # bytecode, also where the environment wants none
                here = {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": ""}
                runs = [
                    {before: command(scene, device, {**here, "PYTHONPATH": tree}) for before, tree in trees.items()}
                    for _ in range(1 + options.runs)
                ]
            for before in trees:
                add(figures, f"{before}command_warm", [run[before] for run in runs[1:]])  # the first one compiles
        if "command_resident" in cases:
            with tempfile.TemporaryDirectory() as folder:
                here = {"WARP_CLOTH_CACHE": folder, "PYTHONPATH": own}  # with its socket
                with staying(device, here):
                    answers = [command(scene, device, here) for _ in range(1 + options.runs)]
            add(figures, "command_resident", answers[1:])
        if "library" in cases:
            first, *again = run_script(LIBRARY, scene, device, options.runs)
            add(figures, "library_first", [first])
            add(figures, "library_again", again)
        for name, changes in FITTER_CHANGES.items() if "fitter" in cases else ():
            plain, again = run_script(FITTER, scene, device, options.runs, changes)
            add(figures, f"plain_{name}", plain, cores=1)
            add(figures, f"fitter_{name}", again, cores=1)
            ratio = statistics.median(a[0] / b[0] for a, b in zip(again, plain, strict=True))
            figures.add(f"fitter_{name}.over_plain", ratio, "times", cores=1)


if __name__ == "__main__":
    main()
