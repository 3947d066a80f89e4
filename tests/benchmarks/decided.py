"""What the program decides, and what is best set by hand: seconds of relaxing, over the best setting that ends right.

    python tests/benchmarks/decided.py --device cuda:0
    python tests/benchmarks/decided.py --designs designs --data ../shared/data --every 4 --device cuda:0

Scenes are those of the methods study, or every so many-th random design. By hand the method and contact of cloth with
cloth are set; a setting ends right at rest, free of crossings where the decided fit is, and with as many problems at
most. Every fit runs twice (``--runs``), and the last run counts: the first one compiles.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from measured import Figures, script_parser

sys.path.insert(0, str(Path(__file__).parent))

from designs.fit_designs import designs_of
from methods_scenes import all_cases, case_tree

import warp_cloth
from warp_cloth.model.result import Status

SETTINGS = tuple(product(("accelerated", "multilevel"), (False, True)))
LIMIT = 60_000  # iterations of what is set by hand
SEEN = 4_000  # vertices of the study's cases that are fitted, at most


def scenes(given: argparse.Namespace, folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and scene of each, with nothing set that can be decided."""
    if given.designs:
        for job in designs_of(given.designs, given.data, [])[:: given.every]:
            garment = {"mesh": job["garment.mesh"], "fabric": job["garment.fabric"]}
            yield job["name"], {"garment": garment, "avatar": {"mesh": job["avatar.mesh"]}}
        return
    for case in dict.fromkeys(case for _, case, _ in all_cases() if case.vertices <= SEEN):
        if given.only and case.kind not in given.only:
            continue
        own = folder / case.name.replace(" ", "_")
        own.mkdir()
        yield case.name, case_tree(case, own)


def fitted(scene: dict[str, Any], given: argparse.Namespace, **by_hand: Any) -> tuple[float, int, int]:
    """Seconds of relaxing (infinite where it did not come to rest), crossings and problems."""
    for _ in range(given.runs):
        fit = warp_cloth.fit({**scene, **by_hand}, device=given.device)
    rests, relaxed = fit.status is Status.AT_REST, fit.report["seconds"]["relax"]
    runs = [f"{run['iterations']:,} {run['method']}" for run in fit.report["attempts"]]
    crossed = fit.report["crossings"]["pairs"]
    print(f"    {by_hand.get('solver', {}).get('method', 'decided')}, "
          f"contact {by_hand.get('collision', {}).get('cloth', 'auto')}: {relaxed:.3f} s, {fit.status.value}, "
          f"{crossed} crossings, {len(fit.problems)} problems; {', '.join(runs)}", flush=True)  # fmt: skip
    return relaxed if rests else math.inf, crossed, len(fit.problems)


def main() -> None:
    parse = script_parser(__doc__, device="cpu")
    parse.add_argument("--designs", type=Path, help="folder of index.csv")
    parse.add_argument("--data", type=Path, help="folder of garmentcode/ and bodies/")
    parse.add_argument("--every", type=int, default=4, help="with --designs")
    parse.add_argument("--only", nargs="+", default=[], metavar="KIND", help="of the study's scenes: ball, disc, ...")
    parse.add_argument("--runs", type=int, default=2, help="of each fit; the last one counts")
    given = parse.parse_args()
    group, ratios = "designs" if given.designs else "study", list[float]()
    with TemporaryDirectory() as folder, Figures(__file__, given, device=given.device) as figures:
        for name, scene in scenes(given, Path(folder)):
            own, crossings, problems = fitted(scene, given)
            best = math.inf
            for method, cloth in SETTINGS:
                solver = {"method": method, "iterations": LIMIT}
                seconds, crossed, wrong = fitted(scene, given, solver=solver, collision={"cloth": cloth})
                if crossed <= crossings and wrong <= problems:
                    best = min(best, seconds)
            print(f"{name}: {own:.3f} s decided, {best:.3f} s best by hand", flush=True)
            if math.isfinite(own) or math.isfinite(best):
                ratios.append(own / best if math.isfinite(best) else 0.0)
        figures.add(f"{group}.scenes", len(ratios), "scenes")
        figures.add(f"{group}.median", float(np.median(ratios)), "of the best by hand")
        figures.add(f"{group}.worst", max(ratios), "of the best by hand")


if __name__ == "__main__":
    main()
