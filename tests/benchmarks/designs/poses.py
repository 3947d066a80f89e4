"""T-shirt and trousers worn together, inner to outer, on one body in many poses, with nothing else set.

    python tests/benchmarks/designs/poses.py --bodies bodies --out out [--designs designs] [--keep]

--bodies holds NAME.obj of ``bodies/make.py``. The shipped T-shirt and trousers go on each pose in ``POSES``; with
--designs so do a shirt and trousers out of the random designs, box meshes both. Prints for each fit whether it is
worn, and its problems; with --keep its pictures and report stay in --out/NAME.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from measured import Figures, script_parser

import warp_cloth

SCENES = Path(warp_cloth.__file__).parents[1] / "scenes"
POSES = (
    "f_avg",  # A-pose
    "f_t_pose",
    "f_i_pose",
    "f_arms_touch",
    "f_feet_together",
    "f_arms_up",
    "f_one_arm_up",
    "f_walk",
    "f_stride",
    "f_sit",
    "f_bow",
    "f_hands_on_hips",
)

Table = dict[str, object]


def pairs_of(given: argparse.Namespace) -> Iterator[tuple[str, list[Table]]]:
    """Name and garments, inner to outer, of each pair; ``tucked``: the shirt within the trousers."""
    tshirt = {"kind": "tshirt", "size": "S", "edge_mm": given.edge_mm}
    trousers = {"pattern": str(SCENES / "trousers.json"), "edge_mm": given.edge_mm}
    pairs: dict[str, list[Table]] = {
        "shipped": [
            {"name": "trousers", "fabric": "denim", **trousers},
            {"name": "tshirt", "fabric": "jersey", "shape": tshirt},
        ]
    }
    if given.designs is not None:
        meshes = [str((given.designs / f"{name}.obj").resolve()) for name in given.pair]
        pairs["designs"] = [
            {"name": "trousers", "mesh": meshes[1], "fabric": "cotton"},
            {"name": "shirt", "mesh": meshes[0], "fabric": "jersey"},
        ]
    for name, garments in pairs.items():
        for order in given.orders:
            yield f"{name}.{order}", garments if order == "over" else garments[::-1]


def main() -> None:
    parse = script_parser(__doc__)
    parse.add_argument("--bodies", type=Path, required=True, help="folder of the poses")
    parse.add_argument("--only", nargs="+", default=list(POSES), metavar="NAME")
    parse.add_argument("--designs", type=Path, help="folder of index.csv; the designs' pair, too")
    parse.add_argument("--pair", nargs=2, default=["g11_031", "g11_063"], metavar=("SHIRT", "TROUSERS"))
    parse.add_argument("--without-shipped", action="store_true", help="the designs' pair alone")
    parse.add_argument("--orders", nargs="+", choices=("over", "tucked"), default=["over"], help="of the shirt")
    parse.add_argument("--edge-mm", type=float, default=12.0, help="of the shipped garments' meshes")
    parse.add_argument("--out", type=Path, default=Path("poses_out"))
    parse.add_argument("--keep", action="store_true", help="pictures and reports of every fit")
    parse.add_argument("--device")
    given = parse.parse_args()
    counts: dict[str, list[bool]] = {}
    with Figures(__file__, given, device=given.device or "cpu") as figures:
        for pose in given.only:
            for name, garments in pairs_of(given):
                if given.without_shipped and name.startswith("shipped"):
                    continue
                scene = {"garment": garments, "avatar": {"mesh": str((given.bodies / f"{pose}.obj").resolve())}}
                fit = warp_cloth.fit(scene, device=given.device)
                if given.keep:
                    fit.save(given.out / f"{name}.{pose}")
                counts.setdefault(name, []).append(fit.worn)
                told = ", ".join(each.code.value for each in fit.problems if not each.code.is_note)
                print(f"{name}.{pose}: {'worn' if fit.worn else told or fit.message}", flush=True)
        for name, worn in counts.items():
            figures.add(f"{name}.worn", f"{sum(worn)} of {len(worn)}", "fits")


if __name__ == "__main__":
    main()
