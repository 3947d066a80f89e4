"""Is the certificate true with friction in the cloth? 20 scenes, relaxed far beyond their certificates.

Hanging squares, strips, cloth over a ball (with friction on it and without), draped discs, T-shirts, all with 2HB and
2HG. When a certificate holds, ../certificates.py says.

python tests/benchmarks/validation/friction_certificate.py
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from certificates import METHODS, run_study
from measured import script_parser
from methods_scenes import KINDS, STIFFNESS, Case

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


def main() -> None:
    run_study(__file__, script_parser(__doc__, device="cpu"), lambda _: cases(), HYSTERESIS)


if __name__ == "__main__":
    main()
