"""Garments that lie on themselves and on each other: how soon they rest, what crosses then, and whether forces are all.

    python tests/benchmarks/rests.py --device cuda:0 --out rests.json --processes 8

Crossings are counted by testing every edge against every triangle. Of what has one fabric the forces are held against
those of every pair of vertices and triangles, and of edges, found and summed in NumPy.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1]))

from folds import BALL, HANGING, Folded, folded_sheet, pleated_skirt, turned_sleeve
from meshfiles import write_obj
from touching import FORCE_ROUNDING, RELATIVE_ROUNDING, brute_forces, touching_pairs
from wearing import BODIES, SHARED_SHIRT, Tree, keep, side_by_side

from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.contact.crossing import find_crossings
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem, tolerance_of
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.scene import load_scene
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items

FOLDED: dict[str, tuple[Callable[[], Folded], Tree, Tree]] = {
    "folded sheet": (partial(folded_sheet, 61, 0.4, 0.306), {}, {"avatar": BALL}),
    "sleeve pushed through": (partial(turned_sleeve, 60, 60, 0.05, 0.3, 0.12), HANGING, {}),
    "large cuff": (partial(turned_sleeve, 96, 96, 0.08, 0.5, 0.2), HANGING, {}),
    "skirt with deep folds": (partial(pleated_skirt, 8, 6, 30, 0.1, 0.4, 0.05), HANGING, {}),
    "pressed pleats": (partial(pleated_skirt, 16, 4, 30, 0.1, 0.4, 0.03), {**HANGING, "rest_angles": "mesh"}, {}),
}
JACKET: Tree = {**SHARED_SHIRT, "name": "jacket", "fabric": "denim", "uv_units": 1.1}
WORN: dict[str, list[Tree]] = {
    "shared T-shirt": [SHARED_SHIRT],
    "jacket over shirt": [{**SHARED_SHIRT, "fabric": "jersey"}, JACKET],
}


def scene_of(name: str, folder: Path) -> Tree:
    """One of the scenes; its mesh is written into the folder."""
    if name in WORN:
        return {"garment": WORN[name], "avatar": BODIES["mean_all"]}
    build, of_garment, of_scene = FOLDED[name]
    write_obj(folder / "cloth.obj", *build())
    garment = {"mesh": str(folder / "cloth.obj"), "rest": "uv", "units": "m", "fabric": "jersey", **of_garment}
    return {"garment": garment, **of_scene}


def rested(name: str, tolerance: float, limit: int, device: str) -> dict[str, Any]:
    """A scene, relaxed until its certificate holds, and what is found then."""
    with TemporaryDirectory() as folder:
        solver = {"tolerance_mm": tolerance, "iterations": limit}
        scene = load_scene({**scene_of(name, Path(folder)), "collision": {"cloth": True}, "solver": solver})
        made = load_problem(scene, device)
    began = time.perf_counter()
    goal = Goal(tolerance_of(scene), scene.solver.iterations)
    (outcome,) = relax_items(made.certifier, [goal], follow=collider_updates(made), schedule=made.schedule)
    seconds = time.perf_counter() - began
    cloth_contact = made.relaxation.cloth_contact
    pairs = find_crossings(outcome.points, cloth_contact.sheets, device).pairs
    between = int((cloth_contact.sheets.garment[pairs[:, 0]] != cloth_contact.sheets.garment[pairs[:, 1]]).sum())
    row: dict[str, Any] = {
        "name": name, "vertices": made.model.vertex_count, "status": outcome.status.value,
        "iterations": outcome.iterations, "seconds": seconds, "crossing_pairs": len(pairs), "between_layers": between,
    }  # fmt: skip
    if len(scene.garments) == 1:
        row |= forces(made, outcome.points)
    return row


def forces(made: Problem, points: Points) -> dict[str, Any]:
    """Pairs in contact, the largest difference of a force from that of every pair, and what rounding allows [N]."""
    cloth_contact, device = made.relaxation.cloth_contact, made.model.device
    pairs = touching_pairs(points, cloth_contact)
    types = cloth_types(made.model.precision)
    load = wp.zeros(made.model.vertex_count, dtype=types.vec4, device=device)
    cloth_contact.data.pairs.stick.zero_()  # what pushes, without friction
    cloth_contact.measure(made.relaxation.contact_state(), types.Step(), load)
    expected = brute_forces(points, pairs, cloth_contact)
    bound = FORCE_ROUNDING + RELATIVE_ROUNDING * float(np.abs(expected).max(initial=0.0))
    error = float(np.abs(load.numpy()[:, :3] - expected).max())
    return {"pairs": len(pairs), "force_error": error, "rounding": bound}


def main() -> None:
    parse = argparse.ArgumentParser()
    parse.add_argument("--device", default="cpu")
    parse.add_argument("--out", type=Path, default=None)
    parse.add_argument("--processes", type=int, default=1)
    parse.add_argument("--tolerance", type=float, default=1.0, help="rest error [mm]")
    parse.add_argument("--limit", type=int, default=40_000, help="iterations")
    parse.add_argument("--scenes", nargs="+", default=[*FOLDED, *WORN])
    given = parse.parse_args()
    work = partial(rested, tolerance=given.tolerance, limit=given.limit, device=given.device)
    rows = []
    for row in side_by_side(work, given.scenes, given.processes):
        rows.append(row)
        print("rest", " ".join(f"{key}={value}" for key, value in row.items()), flush=True)
    if given.out is not None:
        keep(given.out, rows)


if __name__ == "__main__":
    start_warp()
    main()
