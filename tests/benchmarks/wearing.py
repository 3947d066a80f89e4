"""Who wears what where contact is measured: bodies, shirts, and how several are set up and fitted side by side."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.fitting.problem import Problem, build_problem
from warp_cloth.garment.outfit import Outfit
from warp_cloth.scene import Scene, load_scene
from warp_cloth.shapes.measures import SIZE_BODIES
from warp_cloth.solver.certificate.certifier import Tolerance

SHARED = Path(os.environ.get("WARP_CLOTH_DATA", Path(__file__).parents[3] / "shared" / "data"))
NEVER = Tolerance(0.0, 0.0, 0.0)

Tree = dict[str, Any]
Job = TypeVar("Job")
Row = TypeVar("Row")


def mannequin(size: str, arms: float = 45.0) -> Tree:
    """The standard body of a size, whatever the garment's; ``arms`` [degrees] from hanging straight down."""
    body = SIZE_BODIES[size]
    shape = {"stature": body.stature, "chest": body.chest, "waist": body.waist, "hip": body.hip}
    return {"shape": {"kind": "mannequin", **shape, "arm_angle_degrees": arms}}


BODIES: dict[str, Tree] = {
    "mean_all": {"mesh": str(SHARED / "garmentcode" / "mean_all.obj")},
    **{pose: {"mesh": str(SHARED / "anny" / f"female_avg_{pose}.obj")} for pose in ("A_pose", "T_pose", "arms_down")},
    **{f"mannequin {size}": mannequin(size) for size in "SML"},
    "mannequin, arms at 70": mannequin("M", 70.0),
}
SHARED_SHIRT: Tree = {"mesh": str(SHARED / "garmentcode" / "tshirt.obj"), "rest": "uv"}


def shirt(size: str = "M", edge_mm: float = 12.0, fabric: str = "jersey") -> Tree:
    """The generated T-shirt."""
    return {"shape": {"kind": "tshirt", "size": size, "edge_mm": edge_mm}, "rest": "uv", "fabric": fabric}


def dressed(garment: Tree | Sequence[Tree], body: str, collision: Tree | None = None, **solver: Any) -> Scene:
    """A scene of one of the bodies, without contact of cloth with cloth unless ``collision`` states it."""
    own = {"cloth": False, **(collision or {})}
    return load_scene({"garment": garment, "avatar": BODIES[body], "collision": own, "solver": solver})


def several(
    scenes: Sequence[Scene],
    outfits: Sequence[Outfit],
    device: str,
    starts: Sequence[Points | None] = (),
    cache: Cache | None = None,
) -> Problem:
    """Scenes that relax together, those with ``starts`` [m] from there."""
    problem = build_problem(scenes, outfits, device, cache=cache)
    for item, points in enumerate(starts):
        if points is not None:
            problem.model.set_points(points, item)
            if not problem.contacts[item].covers(points):
                problem.relaxation.set_collider(item, problem.contacts[item].collider(points))
    return problem


def moved_starts(points: Points, count: int, by: float = 1e-5) -> list[Points]:
    """A shape, and others from it whose coordinates differ by ``by`` [m], normally distributed."""
    random = np.random.default_rng(1)
    return [points, *(points + random.normal(scale=by, size=points.shape) for _ in range(count - 1))]


def side_by_side(work: Callable[[Job], Row], jobs: Iterable[Job], processes: int) -> Iterator[Row]:
    """Rows of the jobs in their order, each computed in a process of its own."""
    listed = list(jobs)
    if processes <= 1:
        yield from map(work, listed)
        return
    with get_context("spawn").Pool(min(processes, len(listed)), start_warp, maxtasksperchild=1) as pool:
        yield from pool.imap(work, listed, chunksize=1)


def keep(path: Path, found: Any) -> None:
    """Writes what was found as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=1, default=float), encoding="utf-8")
