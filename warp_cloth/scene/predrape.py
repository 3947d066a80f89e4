"""Dressing: what garments come down in first, whatever their fabric, where a scene's start is "dressed".

On its way from flat panels limp cloth folds in a thousand small ways, each of which takes long to open again. A knit
comes down smoothly and rests soon, and from where it lies all fabrics have but a short way left. What is dressed alike
is dressed once: a batch shares it among the fabrics of a garment on a body.
"""

from __future__ import annotations

from pathlib import Path

from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.scene.schema import Scene, SolverSpec

FABRIC = "jersey"  # it stretches, and so finds its rest sooner than what is woven
FRICTION = 0.5  # that of cloth on skin
ITERATIONS = 8000  # limit; what starts from a shape that is not at rest goes its long way on


def dressing_of(scene: Scene) -> Scene | None:
    """The scene in which a scene's garments are dressed; None where they start as they are placed."""
    if scene.solver.start == "placed":
        return None
    fabric = resolve_fabric(FABRIC, Path())
    avatar = scene.avatar
    return scene.model_copy(
        update={
            "name": "dressing",
            "garments": tuple(spec.model_copy(update={"fabric": fabric}) for spec in scene.garments),
            "avatar": None if avatar is None else avatar.model_copy(update={"friction": FRICTION}),
            "solver": SolverSpec(
                iterations=ITERATIONS,
                precision=scene.solver.precision,
                cap=scene.solver.cap,
                threads=scene.solver.threads,
            ),
        }
    )
