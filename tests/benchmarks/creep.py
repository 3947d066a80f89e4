"""Whether worn T-shirts stay on the shoulders: how far they move there in 1,000 iterations after the certificate.

    python tests/benchmarks/creep.py --device cuda:0 --out creep.json --processes 8

Eight fabrics in four cuts on six bodies, the shared T-shirt on its own and the shipped one. The fits continue after
their certificates, with the steps and momentum of a fit, for rest errors of 1 mm (the default) and 0.1 mm. Printed are
the largest displacements in the top fifth: of vertices that lie on the body, and of all, free folds included.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from measured import Figures, script_parser
from wearing import NEVER, SHARED_SHIRT, dressed, keep, several, shirt, side_by_side

from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import Problem, collider_updates, problem_kind, tolerance_of
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.certifier import Measurement
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items

FURTHER = 1000  # iterations
SHOULDERS = 0.8  # share of a garment's vertices below its top fifth
STAYS = 0.1  # [mm]
FABRICS = ("cotton", "denim", "faille", "jersey", "linen", "polyester", "silk", "wool")  # felt has no folds
CUTS = (("S", 12.0), ("M", 12.0), ("L", 12.0), ("M", 16.0))  # size and edge [mm]
BODIES = ("mannequin S", "mannequin M", "mannequin L", "mannequin, arms at 70", "mean_all", "A_pose")
GIVEN = "as given"  # instead of a body: the shared T-shirt, or the shipped one, in its own scene


def scenes_of(body: str, fabrics: Sequence[str]) -> list[tuple[str, Scene]]:
    """Names and scenes of all that one body wears."""
    if body == GIVEN:
        return [
            ("shared T-shirt", dressed(SHARED_SHIRT, "mean_all")),
            ("shipped T-shirt", load_scene("tshirt", ["collision.cloth=false"])),
        ]
    return [
        (f"{fabric} {size} {edge:g} mm on {body}", dressed(shirt(size, edge, fabric), body))
        for fabric in fabrics
        for size, edge in CUTS
    ]


def crept(body: str, errors: Sequence[float], fabrics: Sequence[str], limit: int, device: str) -> list[dict[str, Any]]:
    """Everything on one body: iterations to each rest error [mm], and how far the top fifth goes after that [mm]."""
    named = scenes_of(body, fabrics)
    mesh_cache = MeshCache()
    outfits = [load_outfit(scene, mesh_cache) for _, scene in named]
    kinds = collections.defaultdict[Any, list[int]](list)
    for at, (_, scene) in enumerate(named):
        kinds[problem_kind(scene, outfits[at])].append(at)
    rows: list[dict[str, Any]] = []
    for group in kinds.values():
        problem = several([named[at][1] for at in group], [outfits[at] for at in group], device)
        rows += _creep(problem, [named[at][0] for at in group], errors, limit)
    return rows


def _creep(problem: Problem, names: Sequence[str], errors: Sequence[float], limit: int) -> list[dict[str, Any]]:
    """Those that relax together."""
    tolerances_by_error = {
        error: [replace(tolerance_of(scene), rest_error=1e-3 * error) for scene in problem.scenes] for error in errors
    }
    rest: dict[tuple[int, float], tuple[int, Points, Points]] = {}  # by item and rest error: iteration, shape, push
    rows = {
        (item, error): {"name": name, "error_mm": error, "iterations": None}
        for item, name in enumerate(names)
        for error in errors
    }

    def record(look: Measurement, _: float) -> None:
        for error, tolerances in tolerances_by_error.items():
            for item in np.flatnonzero(look.nearly_within(tolerances)).tolist():
                within = (item, error) not in rest and problem.certifier.check(look, item).within(tolerances[item])
                if within and look.iteration <= limit:
                    push = problem.certifier.normal_forces()
                    rest[item, error] = look.iteration, problem.model.points(item), push[problem.model.of_item(item)]
        for key, (iteration, points, push) in rest.items():
            if look.iteration == iteration + FURTHER:
                top = points[:, 1] >= np.quantile(points[:, 1], SHOULDERS)
                displacement = 1e3 * (problem.model.points(key[0])[top] - points[top])
                far, in_contact = np.linalg.norm(displacement, axis=1), push[top] > 0.0
                rows[key] |= {
                    "iterations": iteration,
                    "in_contact": int(in_contact.sum()),
                    "moved_mm": float(far[in_contact].max()),
                }
                rows[key] |= {"moved_free_mm": float(far.max()), "fell_mm": -float(displacement[:, 1].mean())}

    goals = [Goal(NEVER, limit + FURTHER)] * len(names)
    # not ahead: the stored shape is the one that was checked
    relax_items(problem.certifier, goals, follow=collider_updates(problem), on_check=record, ahead=False)
    return list(rows.values())


def add_figures(figures: Figures, rows: Sequence[dict[str, Any]]) -> None:
    """Prints the fits that move most, and adds the figures of all."""
    rested = sorted((row for row in rows if row["iterations"] is not None), key=lambda row: row["moved_mm"])
    for row in rested[-10:] + [row for row in rested if "T-shirt" in row["name"]]:
        moves = f"moved {row['moved_mm']:.4f}, free folds {row['moved_free_mm']:.4f}, fell {row['fell_mm']:.4f}"
        print(f"creep {row['error_mm']:g} mm {row['name']:50} rest {row['iterations']:6} {moves}")
    for row in rows:
        if row["iterations"] is None:
            print(f"creep {row['error_mm']:g} mm {row['name']:50} not at rest")
    label = f"at_rest_{rows[0]['error_mm']:g}mm"
    figures.add(f"{label}.fits", len(rested), f"fits of {len(rows)}")
    if not rested:
        return
    figures.add(f"{label}.shoulders_within_{STAYS:g}mm", sum(row["moved_mm"] <= STAYS for row in rested), "fits")
    figures.add(f"{label}.largest_shoulder_move", max(row["moved_mm"] for row in rested), "mm")
    figures.add(f"{label}.largest_fold_move", max(row["moved_free_mm"] for row in rested), "mm")
    figures.add(f"{label}.iterations", float(np.mean([row["iterations"] for row in rested])), "iterations, mean")


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--out", type=Path, default=None)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--errors", nargs="+", type=float, default=[1.0, 0.1], help="rest errors [mm]")
    parser.add_argument("--limit", type=int, default=20_000, help="iterations to rest")
    parser.add_argument("--bodies", nargs="+", default=[GIVEN, *BODIES])
    parser.add_argument("--fabrics", nargs="+", default=list(FABRICS))
    options = parser.parse_args()
    work = partial(crept, errors=options.errors, fabrics=options.fabrics, limit=options.limit, device=options.device)
    rows = [row for part in side_by_side(work, options.bodies, options.processes) for row in part]
    with Figures(__file__, options, device=options.device) as figures:
        for error in options.errors:
            add_figures(figures, [row for row in rows if row["error_mm"] == error])
    if options.out is not None:
        keep(options.out, rows)


if __name__ == "__main__":
    start_warp()
    main()
