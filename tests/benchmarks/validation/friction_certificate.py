"""Is the certificate true with friction in the cloth? 20 scenes, relaxed far beyond their certificates.

Hanging squares, strips, cloth over a ball (with friction on it and without), draped discs, T-shirts, all with 2HB and
2HG. When a certificate holds, ../certificates.py says.

python tests/benchmarks/validation/friction_certificate.py
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from certificates import METHODS, add_certificates
from measured import Figures, script_parser
from methods_scenes import KINDS, STIFFNESS, Case
from methods_study import Run, run_case

from warp_cloth.base.warp_setup import start_warp

HYSTERESIS = {"bending_hysteresis_2HB": 0.05, "shear_hysteresis_2HG": 0.5}  # gf cm/cm, gf/cm: a shirting's
SHEETS, DISC = 1_000, 2_000  # vertices
EDGE = 20.0  # of T-shirts [mm]


def cases() -> list[tuple[Case, str]]:
    """Scenes, and by which method each is relaxed: both in turn."""
    kinds = [*((kind, 0.5) for kind in KINDS), ("ball", 0.0)]
    found = [Case(kind, SHEETS, stretch, friction) for kind, friction in kinds for stretch in STIFFNESS]
    found += [Case("disc", DISC, fabric=fabric) for fabric in ("jersey", "cotton", "wool", "denim")]
    found += [Case("tshirt", fabric=fabric, edge_mm=EDGE) for fabric in ("jersey", "cotton", "wool", "denim")]
    return [(case, METHODS[number % 2]) for number, case in enumerate(found)]


def relaxed(device: str, case: tuple[Case, str]) -> Run:
    start_warp(False)
    return run_case(case[0], case[1], device, more=HYSTERESIS)


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--only", default="", help="scenes whose names contain this")
    chosen = parser.parse_args()
    some = [case for case in cases() if chosen.only in case[0].name]
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, device=chosen.device, cores=chosen.workers) as figures,
    ):
        add_certificates(figures, pool.map(partial(relaxed, chosen.device), some))


if __name__ == "__main__":
    main()
