"""Is the certificate true with friction in the cloth? 20 scenes, relaxed far beyond their certificates.

Hanging squares, strips, cloth over a ball (with friction on it and without), draped discs, T-shirts, all with 2HB and
2HG. A certificate holds if its rest error is at least the rms distance from where the run ended, together with what
the end may still be from rest. It is judged where the end is known to a fifth of it.

python tests/benchmarks/validation/friction_certificate.py
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from measured import Figures, script_parser
from methods_files import END_KNOWN
from methods_scenes import KINDS, STIFFNESS, Case
from methods_study import Run, run_case

from warp_cloth.base.warp_setup import start_warp

HYSTERESIS = {"bending_hysteresis_2HB": 0.05, "shear_hysteresis_2HG": 0.5}  # gf cm/cm, gf/cm: a shirting's
SHEETS, DISC = 1_000, 2_000  # vertices
EDGE = 20.0  # of T-shirts [mm]
METHODS = ("multilevel", "accelerated")


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
    certified = judged = held = 0
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, device=chosen.device, cores=chosen.workers) as figures,
    ):
        for run in pool.map(partial(relaxed, chosen.device), some):
            name, look = run.case.name.replace(" ", "_").replace(".", "p"), run.certified()
            if look is None:
                figures.add(name, "-", f"{run.method}, no certificate; the end may be {run.end_mm:.2g} mm from rest")
                continue
            known = run.end_mm <= END_KNOWN * look.rest_error_mm
            true = look.rest_error_mm >= look.true_mm + run.end_mm
            certified, judged, held = certified + 1, judged + known, held + (known and true)
            words = ("holds" if true else "does not hold") if known else "not judged"
            unit = f"mm from its end, {look.rest_error_mm:.3g} stated after {run.rest:,} iterations ({run.method}); "
            figures.add(name, f"{look.true_mm:.3g}", f"{unit}end known to {run.end_mm:.2g} mm: {words}")
        figures.add("certified", f"{certified} of {len(some)}", "scenes")
        figures.add("held", f"{held} of {judged}", "certificates whose end is known")


if __name__ == "__main__":
    main()
