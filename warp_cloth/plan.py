"""The plan: which terms a scene needs, and why. What is left out has no array and no launch."""

from __future__ import annotations

from dataclasses import dataclass

from warp_cloth.scene import Scene
from warp_cloth.wardrobe import Wardrobe


@dataclass(frozen=True)
class Term:
    """One term of the model."""

    name: str
    used: bool
    reason: str


def make_plan(scene: Scene, wardrobe: Wardrobe) -> tuple[Term, ...]:
    """The terms of a scene, in the order in which an iteration meets them."""
    bends = any(bool((part.rest.hinge_stiffness > 0.0).any()) for part in wardrobe.parts)
    pins = sum(len(part.pins) for part in wardrobe.parts)
    kind = scene.collision.avatar
    if scene.avatar is None:
        contact = Term("avatar contact", False, "the scene has no avatar")
    elif kind == "none":
        contact = Term("avatar contact", False, 'collision.avatar = "none"')
    else:
        contact = Term("avatar contact", True, f'collision.avatar = "{kind}"')
    return (
        Term("tension", True, "every garment has edges"),
        Term(
            "bending",
            bends,
            "the fabric resists bending" if bends else "no hinge has a stiffness: the fabric's bending is 0",
        ),
        Term("pins", pins > 0, f"{pins} vertices are pinned" if pins else "nothing is pinned"),
        contact,
        Term("cloth contact", False, "collision.cloth = false"),
    )
