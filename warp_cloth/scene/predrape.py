"""The predrape: with solver.start = "dressed", garments first come to rest in one fabric, whatever their own.

On the way from flat panels, limp cloth forms many small folds, each of which takes long to open. A knit falls smoothly
and comes to rest soon, and all other fabrics are then near their own rest shapes. A batch computes each predrape once
for all fabrics of a garment on a body, and untangles it once where it crosses: else each fabric would cross there.
"""

from __future__ import annotations

from pathlib import Path

from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.scene.schema import Scene, SolverSpec

FABRIC_NAME = "jersey"  # it stretches, and so comes to rest sooner than woven fabrics
FRICTION = 0.5  # of cloth on skin
ITERATIONS = 8000  # limit; a start from a shape that is not at rest saves less


def predrape_fabric() -> Fabric:
    return resolve_fabric(FABRIC_NAME, Path())


def predrape_scene_of(scene: Scene) -> Scene | None:
    """The scene of the predrape; None if the garments start as placed."""
    if scene.solver.start != "dressed":
        return None
    fabric = predrape_fabric()
    avatar = scene.avatar
    return scene.model_copy(
        update={
            "name": "predrape",
            "garments": tuple(spec.model_copy(update={"fabric": fabric}) for spec in scene.garments),
            "avatar": None if avatar is None else avatar.model_copy(update={"friction": FRICTION}),
            "collision": scene.collision.model_copy(update={"cloth": False}),
            "solver": SolverSpec(
                method="accelerated",
                start="placed",
                iterations=ITERATIONS,
                precision=scene.solver.precision,
                cap=scene.solver.cap,
                threads=scene.solver.threads,
            ),
        }
    )
