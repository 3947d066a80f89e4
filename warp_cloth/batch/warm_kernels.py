"""Warms up kernels while loader processes load meshes: by a small scene of the same kind."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.kernels.base.options import FEW
from warp_cloth.scene import Scene
from warp_cloth.scene.shapes import SphereShape, SquareShape
from warp_cloth.scene.wearables import AvatarSpec
from warp_cloth.solver.loop import BURST

log = logging.getLogger(__name__)

MANY = FEW + 1  # small garments of one patch each, which use the kernels of a large batch


def load_kernels(scene: Scene, device: str) -> None:
    """Loads the kernels that relax a batch of scenes like this one, and launches each once.

    A GPU's driver loads a kernel fully at its first launch. Errors are left to the fit itself to report.
    """
    try:
        small = _small(scene)
        outfit = load_outfit(small)
        problem = build_problem([small] * MANY, [outfit] * MANY, device)
        for balanced in (False, True):
            problem.relaxation.update_anisotropy(np.full(MANY, 0.0 if balanced else np.inf))
            problem.relaxation.run(BURST)
            problem.certifier.measure(BURST)
            problem.certifier.take_snapshot(BURST)
    except Exception as error:
        log.info("kernels are not warmed up: %s", error)


def _small(scene: Scene) -> Scene:
    """A few vertices in the scene's fabric over a small ball, of the same kind of collider."""
    nothing: dict[str, Any] = {
        "mesh": None,
        "prim": None,
        "pin": (),
        "grain_panels": {},
        "grain_texture": None,
        "rest_angles": "flat",
    }
    cloth = SquareShape(kind="square", side=0.05, vertices_per_side=3)
    garment = scene.garments[0].model_copy(update={**nothing, "rest": "mesh", "shape": cloth})
    ball = SphereShape(kind="sphere", radius=0.05, centre=(0.0, cloth.height - 0.06, 0.0))
    avatar = None if scene.avatar is None else AvatarSpec(shape=ball)
    collision = scene.collision.model_copy(update={"pixel_mm": max(scene.collision.pixel_mm, 5.0), "cloth": False})
    solver = scene.solver.model_copy(update={"method": "accelerated", "start": "placed"})
    return scene.model_copy(update={"garments": (garment,), "avatar": avatar, "collision": collision, "solver": solver})
