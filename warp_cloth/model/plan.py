"""The plan: which terms of the model a scene needs, and why. A term left out has no arrays and no launches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.garment.confines import confining_box
from warp_cloth.garment.garment import terms_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.scene import Scene


@dataclass(frozen=True)
class Term:
    """One term of the model."""

    name: str
    used: bool
    reason: str


def make_plan(scene: Scene, outfit: Outfit) -> tuple[Term, ...]:
    """The terms of a scene with nothing left to decide, in the order of an iteration."""
    pulls = any(bool((garment.rest.edge_pull > 0.0).any()) for garment in outfit.garments)
    terms = terms_of(outfit.garments)
    pins = sum(len(garment.pins) for garment in outfit.garments)
    accelerated = scene.solver.method == "accelerated"
    return (
        _term("tension", pulls, "edges resist stretching", "woven fabric: yarns resist stretching, not edges"),
        _term("weave", terms.yarns, "yarns run through every triangle", "no fabric is woven: edges resist stretching"),
        _term("bending", terms.folds, "the fabric resists bending", "the fabric's bending stiffness is 0"),
        _term("rest angles", terms.angles, "folds of the mesh, by garment.rest_angles", "cloth is flat at rest"),
        _term(
            "bending friction",
            terms.hysteresis,
            "the fabric's bending_hysteresis_2HB",
            "no fabric states bending_hysteresis_2HB",
        ),
        _term(
            "shear friction",
            terms.shear_hysteresis,
            "the fabric's shear_hysteresis_2HG",
            "no woven fabric states shear_hysteresis_2HG",
        ),
        _term("pins", pins > 0, f"{pins} vertices are pinned", "no vertex is pinned"),
        Term("momentum", accelerated, f'solver.method = "{scene.solver.method}"'),
        *_avatar_terms(scene, outfit),
        Term("cloth contact", scene.collision.cloth is True, f"collision.cloth = {str(scene.collision.cloth).lower()}"),
    )


def _term(name: str, used: bool, why: str, why_not: str) -> Term:
    return Term(name, used, why if used else why_not)


def contact_kind(scene: Scene, outfit: Outfit) -> str:
    """The collider of the avatar: collision.avatar of the scene, or "none" where no garment can come near it."""
    return scene.collision.avatar if _may_touch(scene, outfit) else "none"


def _avatar_terms(scene: Scene, outfit: Outfit) -> tuple[Term, ...]:
    kind = scene.collision.avatar
    if scene.avatar is None:
        why = "the scene has no avatar"
    elif kind == "none":
        why = 'collision.avatar = "none"'
    elif not _may_touch(scene, outfit):
        why = "the garments are pinned, and cannot reach the avatar even if their weight stretches them"
    else:
        has_friction = scene.avatar.friction > 0.0
        return (
            Term("avatar contact", True, f'collision.avatar = "{kind}"'),
            Term("avatar friction", has_friction, f"avatar.friction = {scene.avatar.friction:g}"),
        )
    return (Term("avatar contact", False, why), Term("avatar friction", False, why))


def _may_touch(scene: Scene, outfit: Outfit) -> bool:
    """Whether a garment may come within the offset of the avatar; False only where that is proved impossible."""
    if outfit.avatar is None:
        return False
    if scene.collision.cloth is True:  # layers push one another apart, by a distance that no energy bounds
        return True
    offset = scene.collision.offset
    boxes = [outfit.avatar.bounds(), *((pose.min(axis=0), pose.max(axis=0)) for pose in outfit.poses)]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    for garment in outfit.garments:
        apart = (garment.box[0] > high + offset) | (garment.box[1] < low - offset)
        box = confining_box(garment) if apart.any() else None
        if box is None or not ((box[0] > high + offset) | (box[1] < low - offset)).any():
            return True
    return False
