"""Fits patterns drafted as DXF files in three sizes: seams found of the true ones, at which confidence, and worn.

    python tests/benchmarks/patterns/fit_drafts.py --out out --data ../shared/data

T-shirt and trousers on the mannequin of the same size, the hooded top on a woman with her arms down; nothing is set but
the pattern, its size, cotton and the body. The drafts, and which seams are true, are those of the tests
(`tests/dxf_patterns.py`, `tests/dxf_panelled.py`, `tests/dxf_darted.py`). A seam is false where it is sewn and not
among the true ones of its kind. Pictures: OUT/GARMENT_SIZE/preview.png. Results that are in --out already are not
computed again.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))

from dxf_darted import TRUE_DARTED_SEAMS, darted
from dxf_panelled import PANELLED, TRUE_PANELLED_SEAMS
from dxf_patterns import GARMENTS, GRADES, STYLES, TRUE_SEAMS, Style, write
from measured import Figures, script_parser

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.drafted import Draft

DRAFTS = GARMENTS | PANELLED | {"darted": darted}
TRUE = TRUE_SEAMS | TRUE_PANELLED_SEAMS | {"darted": TRUE_DARTED_SEAMS}
ARMS_DOWN = "anny/female_avg_arms_down.obj"
BODIES = {"hooded": ARMS_DOWN}  # of --data; others are worn by the mannequin


def seams_of(draft: Draft, true: dict[str, int]) -> tuple[int, int, int]:
    """True seams that are sewn, true ones in all, and false ones that are sewn."""
    sewn = Counter(joint.reason.split(",")[0] for joint in draft.joints)
    found = sum(min(count, true.get(kind, 0)) for kind, count in sewn.items())
    return found, sum(true.values()), sum(sewn.values()) - found


def fitted(pattern: Path, size: str, body: Path | None, out: Path, device: str) -> dict[str, Any]:
    """The report of a fit."""
    if not (out / "report.json").exists():
        scene = out.with_suffix(".toml")
        avatar = f'mesh = "{body.resolve()}"' if body else f'shape = {{kind = "mannequin", size = "{size}"}}'
        garment = f'pattern = "{pattern.resolve()}"\nsize = "{size}"\nfabric = "cotton"'
        scene.write_text(f"[garment]\n{garment}\n[avatar]\n{avatar}\n")
        words = [sys.executable, "-m", "warp_cloth", "fit", str(scene), "--out", str(out), "--device", device]
        done = subprocess.run(words, check=False, capture_output=True, text=True)
        if not (out / "report.json").exists():
            raise SystemExit(f"{out.name}: {done.stderr[-500:].strip()}")
    return dict(json.loads((out / "report.json").read_text()))


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--data", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=["tshirt", "trousers", "hooded"], choices=sorted(DRAFTS))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with Figures(__file__, args, device=args.device) as figures:
        for name in args.only:
            pieces = {size: DRAFTS[name](grade) for size, grade in GRADES.items()}
            pattern = write(args.out / f"{name}.dxf", pieces, STYLES.get(name, Style()))
            for size in GRADES:
                draft = read_drafted(pattern, DraftOptions(size=size))
                found, true, false = seams_of(draft, TRUE[name])
                confidence = [joint.confidence for joint in draft.joints]
                row = f"{name}.{size}"
                figures.add(f"{row}.seams_found", f"{found} of {true}", "seams")
                figures.add(f"{row}.seams_false", false, "seams")
                figures.add(f"{row}.confidence", f"{min(confidence):.2f} to {max(confidence):.2f}", "")
                body = args.data / BODIES[name] if name in BODIES else None
                report = fitted(pattern, size, body, args.out / f"{name}_{size}", args.device)
                figures.add(f"{row}.worn", "yes" if report["worn"] else "no", "")
                figures.add(f"{row}.iterations", report["iterations"], "")
                figures.add(f"{row}.strain_p50", 100.0 * report["strain"]["p50"], "%")
                figures.add(f"{row}.strain_max", 100.0 * report["strain"]["max"], "%")


if __name__ == "__main__":
    main()
