"""How fast GarmentCode specifications are loaded, meshed and made ready, each process from its start.

    taskset -c 0 python tests/benchmarks/patterns/load_designs.py --designs designs

Every process is started anew, imports the program, and takes its share of ``--count`` specifications, from the first of
FOLDER/specs on, each with a process's single core. ``meshed``: read, meshed, sewn. ``ready``: a scene's garment in
cotton, with its rest shape and stiffness. Times are of the CPU, so that others on the machine count little. Rates are
of one core, the start included; ``times_16`` is that of 16 such cores for 1,000 specifications, computed from the start
and the time of a specification, not measured; ``by_the_clock`` is what several processes reach together. Nothing is
kept on disk: each is new to the program, also where designs repeat.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from measured import Figures, script_parser

CORES, SPECIFICATIONS = 16, 1000
MESHED = """
import sys, time
from pathlib import Path
from warp_cloth.pattern import load_pattern
load_pattern(Path(sys.argv[1]), edge=0.015)
start = time.process_time()
for path in sys.argv[2:]:
    load_pattern(Path(path), edge=0.015)
print(time.process_time() - start)
"""
READY = """
import sys, time
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene
def load(path):
    load_outfit(load_scene({"garment": {"pattern": path, "fabric": "cotton"}}))
load(sys.argv[1])
start = time.process_time()
for path in sys.argv[2:]:
    load(path)
print(time.process_time() - start)
"""


def run(code: str, shares: list[list[str]]) -> tuple[float, float, float]:
    """CPU seconds of all processes, and of their specifications but the first alone; seconds by the clock."""
    one = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "WARP_CLOTH_ONE_THREAD")  # as processes that load for a batch
    environment = os.environ | dict.fromkeys(one, "1")
    before, began = os.times(), time.perf_counter()
    environment["WARP_CLOTH_CACHE"] = "off"
    running = [
        subprocess.Popen([sys.executable, "-c", code, *share], stdout=subprocess.PIPE, text=True, env=environment)
        for share in shares
    ]
    said = [process.communicate()[0] for process in running]
    if any(process.returncode for process in running):
        raise SystemExit("a process failed")
    after, wall = os.times(), time.perf_counter() - began
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return spent, sum(float(text.split()[-1]) for text in said), wall


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--designs", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--count", type=int, default=60, metavar="N")
    parser.add_argument("--processes", type=int, default=1, metavar="N")
    args = parser.parse_args()
    paths = sorted(map(str, (args.designs / "specs").glob("*_specification.json")))
    wanted = [paths[k % len(paths)] for k in range(args.count)]
    shares = [wanted[k :: args.processes] for k in range(args.processes)]
    with Figures(__file__, args, cores=args.processes) as figures:
        figures.add("specifications", len(wanted), "specifications")
        for name, code in (("meshed", MESHED), ("ready", READY)):
            seconds, own, wall = run(code, shares)
            each = own / (len(wanted) - args.processes)
            start = (seconds - own) / args.processes
            figures.add(f"{name}.start", start, "s, with the first specification")
            figures.add(f"{name}.each", 1e3 * each, "ms")
            figures.add(f"{name}.rate", len(wanted) / seconds, "specifications/s")
            if args.processes > 1:
                figures.add(f"{name}.by_the_clock", len(wanted) / wall, "specifications/s")
            else:
                share = SPECIFICATIONS / CORES
                figures.add(f"{name}.times_16", SPECIFICATIONS / (start + (share - 1) * each), "specifications/s")


if __name__ == "__main__":
    main()
