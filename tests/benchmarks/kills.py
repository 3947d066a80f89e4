"""Kills a batch at random moments, again and again, and compares its results with those of one that ran through.

python tests/benchmarks/kills.py --items 200 --kills 20 --workers 2
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from batch_rate import Row, command, compare, run, write_jobs

FABRICS = ("silk", "cotton", "denim")


def jobs(count: int) -> list[Row]:
    """Hanging squares of 25 to 81 vertices."""
    return [
        {
            "name": f"item-{number:04d}",
            "scene": "hanging",
            "garment.shape.vertices_per_side": 5 + number % 5,
            "garment.fabric": FABRICS[number % len(FABRICS)],
            "solver.iterations": 1000 + 500 * (number % 4),
        }
        for number in range(count)
    ]


def written(out: Path) -> int:
    """How many shards are done."""
    return len(list((out / "shards").glob("*.parquet")))


def killed_after(shards: int, seconds: float, words: list[str], out: Path) -> bool:
    """Starts a batch and kills all its processes so long after that many more shards are written.

    Returns whether it was still running.
    """
    wanted = written(out) + shards
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True) as batch:
        while written(out) < wanted and batch.poll() is None:
            time.sleep(0.002)
        try:
            batch.wait(seconds)
        except subprocess.TimeoutExpired:
            os.killpg(batch.pid, signal.SIGKILL)
            return True
    return False


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--items", type=int, default=200)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--workers", default="1")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    chance, more = random.Random(options.seed), ("--workers", options.workers, "--shard", "4")
    with TemporaryDirectory() as folder:
        place = Path(folder)
        file = write_jobs(place / "jobs.csv", jobs(options.items))
        whole = run(file, place / "whole", options.device, *more)
        (start, _), (end, _), count = whole.shards[0], whole.shards[-1], len(whole.shards)
        print(f"{options.items} items, {count} shards in {end:.1f} s, the first after {start:.1f} s", flush=True)
        out, kills = place / "killed", 0
        while kills < options.kills:
            shards = chance.randint(0, 3 * count // (2 * options.kills))  # so that some are left to do at the last kill
            moment = chance.uniform(0.0, (end - start) / count if shards else start)
            if not killed_after(shards, moment, command(file, out, options.device, *more), out):
                break
            kills += 1
            print(f"kill {kills}, {moment:.2f} s after {shards} shards: {written(out)} are written", flush=True)
        resumed = run(file, out, options.device, *more)
        same = compare(f"after {kills} kills", resumed.rows, whole.rows)
        for path in sorted((place / "whole" / "shards").glob("*.npz")):
            with np.load(path) as one, np.load(out / "shards" / path.name) as other:
                same &= all(np.array_equal(one[name], other[name]) for name in one.files)
        print(f"rows and packed shapes {'equal' if same else 'DIFFER'}")
    return 0 if same and kills == options.kills else 1


if __name__ == "__main__":
    sys.exit(main())
