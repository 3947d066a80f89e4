"""Friction in bending: both ends of the band in which a strip rests, beside theory; and drapes of published fabrics.

python tests/benchmarks/validation/hysteresis.py --workers 2
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from cantilever import figures as angle_of
from elastica import LENGTH, Shape, Slider, Strip, solve
from strips import FABRIC, MESHES, C, Run, report, settled

sys.path.insert(0, str(Path(__file__).parents[1]))
from measured import Figures, add_write_option

from warp_cloth.material.hysteresis import CLINGING
from warp_cloth.material.laboratory import GRAVITY

FRICTION = 0.3  # moment, in weights of a square of l, times l
HUNG = 3.0  # times its weight under which a strip hangs before it is let down
UNIT = LENGTH * C  # l [m]
SLIDER = Slider(FRICTION, CLINGING * UNIT)
MOMENT = FRICTION * FABRIC.weight * GRAVITY * UNIT**2  # [N]
RUBBING = replace(FABRIC, bending_friction_warp=MOMENT, bending_friction_weft=MOMENT)
SPANS = (1.5, 2.0, 3.0)


def band(strip: Strip) -> dict[str, Shape]:
    """Theory's lines: elastic, laid from the flat, let down from the hang."""
    flat = solve(strip, slider=SLIDER)
    hung = solve(strip, slider=SLIDER, heavier=HUNG)
    bent = hung.curvature if hung.curvature is not None else np.zeros_like(hung.s)
    kept = bent - np.clip(bent, -SLIDER.clinging, SLIDER.clinging)
    down = solve(strip, slider=replace(SLIDER, laid=replace(hung, curvature=kept)))
    return {"elastic": solve(strip), "from_flat": flat, "let_down": down}


def runs_of(counts: Sequence[int], spans: Sequence[float], method: str) -> list[Run]:
    """Both ends of every strip's band, on all meshes."""
    return [
        Run(f"{end}.{span:g}", Strip(span, 0.0), mesh, count, method, fabric=RUBBING, let_down=hung)
        for span in spans
        for end, hung in (("from_flat", 0.0), ("let_down", HUNG))
        for mesh in MESHES
        for count in counts
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--per-length", type=int, nargs="+", default=(5, 10, 20), help="elements a bending length")
    parser.add_argument("--spans", type=float, nargs="+", default=SPANS)
    parser.add_argument("--method", default="multilevel")
    parser.add_argument("--workers", type=int, default=1)
    add_write_option(parser)
    chosen = parser.parse_args()
    runs = runs_of(chosen.per_length, chosen.spans, chosen.method)
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(settled, runs))
    with Figures(__file__, chosen, device="cpu", cores=chosen.workers) as figures:
        for span in chosen.spans:
            lines = band(Strip(span, 0.0))
            elastic = angle_of(lines["elastic"])["angle"]
            for end in ("from_flat", "let_down"):
                wanted, name = angle_of(lines[end])["angle"], f"{end}.{span:g}"
                figures.add(f"{name}.elastic", f"{elastic:.2f}", f"degrees; with friction {wanted:.2f}")
                for mesh in MESHES:
                    own = [each for each in found if (each.run.name, each.run.mesh) == (name, mesh)]
                    off = [100.0 * (angle_of(each.shape)["angle"] / wanted - 1.0) for each in own]
                    report(figures, f"{name}.{mesh}", off, [each.at_rest for each in own], wanted, chosen.per_length)
