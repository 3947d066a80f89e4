"""Friction in bending: both ends of the band in which a strip rests, and theory; drapes of published fabrics.

python tests/benchmarks/validation/hysteresis.py --discs 2 --rings 24
"""

from __future__ import annotations

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
from measured import Figures, script_parser

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.trials import DRAPED, drape, let_down
from warp_cloth.garment.laid import HUNG
from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.material.hysteresis import CLINGING
from warp_cloth.material.laboratory import GRAVITY

FRICTION = 0.3  # moment, in weights of a square of l, times l
UNIT = LENGTH * C  # l [m]
SLIDER = Slider(FRICTION, CLINGING * UNIT)
MOMENT = FRICTION * FABRIC.weight * GRAVITY * UNIT**2  # [N]
RUBBING = replace(FABRIC, bending_friction_warp=MOMENT, bending_friction_weft=MOMENT)
SPANS = (1.5, 2.0, 3.0)
# B [gf cm2/cm], 2HB [gf cm/cm], weight [g/m2], thickness [mm], drape coefficient [%] and folds of four samples:
# Matsudaira, Masuda, Wada, Yokura, J. Textile Engineering 61(6) 69-73 (2015), tables 1 and 2, as quoted by the
# repository antonbj3/3fold-motion-engine. Stretch and shear are those of the shipped fabric, typical of such cloth.
PUBLISHED = {
    "cotton_broad": ("cotton", 0.118, 0.124, 123.8, 0.497, 82.9, 2),
    "wool_tropical": ("wool", 0.067, 0.033, 162.9, 0.407, 49.8, 5),
    "polyester_tropical": ("polyester", 0.077, 0.029, 116.5, 0.340, 50.7, 5),
    "polyester_faille": ("faille", 0.019, 0.007, 104.3, 0.226, 28.3, 7),
}


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


def drapes(figures: Figures, name: str, rings: int, discs: int) -> None:
    """Drape coefficient of a published fabric: measured, elastic, and at both ends of its band."""
    base, rigidity, width, weight, thickness, measured, folds = PUBLISHED[name]
    own = {"base": base, "bending_B": rigidity, "weight_gsm": weight, "thickness_mm": thickness}
    elastic = drape(rings, resolve_fabric(own), discs=discs)
    rubbing = resolve_fabric({**own, "bending_hysteresis_2HB": width})
    flat = drape(rings, rubbing, discs=discs)
    ends = {"elastic": elastic, "from_flat": flat, "let_down": let_down(flat, rubbing)}
    unit = f"%, {folds} folds; 2HB {width} gf cm/cm, HB / B {0.5 * width / rigidity:.2f} per cm"
    figures.add(f"{name}.measured", f"{measured}", unit)
    for end, found in ends.items():
        rests = sum(each.settled.check.within(DRAPED) for each in found)
        coefficients = [each.coefficient for each in found]
        unit = f"%, {min(coefficients):.1f} to {max(coefficients):.1f}; {rests} of {len(found)} discs at rest"
        figures.add(f"{name}.{end}", f"{np.mean(coefficients):.1f}", unit)


if __name__ == "__main__":
    parser = script_parser(__doc__)
    parser.add_argument("--per-length", type=int, nargs="+", default=(5, 10, 20), help="elements a bending length")
    parser.add_argument("--spans", type=float, nargs="+", default=SPANS)
    parser.add_argument("--method", default="multilevel")
    parser.add_argument("--fabrics", nargs="*", default=list(PUBLISHED), choices=list(PUBLISHED))
    parser.add_argument("--rings", type=int, default=24)
    parser.add_argument("--discs", type=int, default=2)
    parser.add_argument("--workers", type=int, default=1)
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
        start_warp(False)
        for fabric in chosen.fabrics:
            drapes(figures, fabric, chosen.rings, chosen.discs)
