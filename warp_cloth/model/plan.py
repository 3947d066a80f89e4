"""The plan: which terms a scene needs, and why. What is left out has no array and no launch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.garment.outfit import Outfit
from warp_cloth.garment.part import terms_of
from warp_cloth.garment.reach import reach_box
from warp_cloth.scene import Scene


@dataclass(frozen=True)
class Term:
    """One term of the model."""

    name: str
    used: bool
    reason: str


def make_plan(scene: Scene, outfit: Outfit) -> tuple[Term, ...]:
    """The terms of a scene, in the order in which an iteration meets them."""
    pulls = any(bool((part.rest.edge_pull > 0.0).any()) for part in outfit.parts)
    _, bends, woven, folded, _ = terms_of(outfit.parts)
    pins = sum(len(part.pins) for part in outfit.parts)
    accelerated = scene.solver.method == "accelerated"
    return (
        Term("tension", pulls, "edges pull" if pulls else "woven triangles pull in place of the edges"),
        Term("weave", woven, "threads run through every triangle" if woven else "no fabric is woven: edges pull"),
        Term(
            "bending",
            bends,
            "the fabric resists bending" if bends else "no hinge has a stiffness: the fabric's bending is 0",
        ),
        Term("rest angles", folded, "garment.rest_angles, of a mesh with folds" if folded else "cloth is flat at rest"),
        Term("pins", pins > 0, f"{pins} vertices are pinned" if pins else "nothing is pinned"),
        Term("momentum", accelerated, f'solver.method = "{scene.solver.method}"'),
        *_avatar_terms(scene, outfit),
        Term("cloth contact", scene.collision.cloth, f"collision.cloth = {str(scene.collision.cloth).lower()}"),
    )


def contact_kind(scene: Scene, outfit: Outfit) -> str:
    """How the avatar is met: as the scene says, or "none" where no garment can come near it."""
    return scene.collision.avatar if _may_meet(scene, outfit) else "none"


def _avatar_terms(scene: Scene, outfit: Outfit) -> tuple[Term, ...]:
    kind = scene.collision.avatar
    if scene.avatar is None:
        why = "the scene has no avatar"
    elif kind == "none":
        why = 'collision.avatar = "none"'
    elif not _may_meet(scene, outfit):
        why = "no pinned garment can reach the avatar, however its weight stretches it"
    else:
        rubs = scene.avatar.friction > 0.0
        return (
            Term("avatar contact", True, f'collision.avatar = "{kind}"'),
            Term("avatar friction", rubs, f"avatar.friction = {scene.avatar.friction:g}"),
        )
    return (Term("avatar contact", False, why), Term("avatar friction", False, why))


def _may_meet(scene: Scene, outfit: Outfit) -> bool:
    """Whether a garment may come within the offset of the avatar; false only where that is proved."""
    if outfit.avatar is None:
        return False
    if scene.collision.cloth:  # layers push one another apart, and no energy bounds how far
        return True
    gap = scene.collision.offset
    boxes = [outfit.avatar.bounds(), *((pose.min(axis=0), pose.max(axis=0)) for pose in outfit.poses)]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    for part in outfit.parts:
        apart = (part.box[0] > high + gap) | (part.box[1] < low - gap)
        box = reach_box(part) if apart.any() else None
        if box is None or not ((box[0] > high + gap) | (box[1] < low - gap)).any():
            return True
    return False
