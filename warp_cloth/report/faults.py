"""Faults of a worn shape, each with its remedy: lost garments, wrong sizes, penetration, self-intersection.

Each function returns one clause for the status sentence; an empty string where there is no such fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_cloth.base.connected import connected_components
from warp_cloth.loading.raw import counted
from warp_cloth.model.result import Penetration, Strain
from warp_cloth.report.numbers import short_number

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Points
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.scene import Scene

VISIBLE = 1.0  # [mm]; a smaller part of the avatar that shows through is not noticed
UNSEEN = 5.0  # [mm]; where a hundredth of the surface has a larger error, cloth rests on what is not there
BELOW_FEET = 0.15  # fraction of a garment that has come down below the avatar; less is a train, or a long hem
HANGING = (
    0.5  # of the avatar's height: a garment that reaches higher is held there, like a gown, or a cloth over a ball
)
DETACHED = 0.1  # [m]; a piece of a garment that falls farther than the largest piece has come off
CROSSED = 0.05  # fraction of faces that pass through others; of a T-shirt's, creased at the armpits, 0.03 do
WRONG_SIZE = 0.3  # strain of half the edges: the tightest of worn cloth has less


def unheld(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """A garment that falls because nothing holds it; ``worn`` are the garments' points [m], each shape [V, 3]."""
    for spec, garment, points in zip(scene.garments, outfit.garments, worn, strict=True):
        if len(garment.pins):
            continue
        if outfit.avatar is None or scene.collision.avatar == "none":
            return f'nothing holds "{spec.name}": pin some of its vertices, or put it on an avatar'
        low, high = outfit.avatar.bounds()
        apart = (points.min(axis=0) > high) | (points.max(axis=0) < low)
        if apart[0] or apart[2]:
            return f'"{spec.name}" is beside the avatar, which cannot hold it: place it around or above the avatar'
        if points[:, 1].max() < low[1]:
            return (
                f'"{spec.name}" has fallen past the avatar: place it around or above the avatar, or pin some of its '
                "vertices"
            )
    return ""


def slid_off(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """A garment that has slid down to the avatar's feet; ``worn`` as in ``unheld``."""
    if outfit.avatar is None:
        return ""
    floor, top = outfit.avatar.points[:, 1].min(), outfit.avatar.points[:, 1].max()
    for spec, garment, points in zip(scene.garments, outfit.garments, worn, strict=True):
        if len(garment.pins) or points[:, 1].max() > floor + HANGING * (top - floor):
            continue
        below, before = ((place[:, 1] < floor).mean() for place in (points, garment.points))
        if below - before > BELOW_FEET:
            return (
                f'"{spec.name}" has slid down to the avatar\'s feet, and {100 * below:.0f} % of it hangs below them '
                "(there is no floor): it is too wide to stay up; use a smaller one, or pin some of its vertices"
            )
    return ""


def detached_pieces(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """Pieces that fall off a garment because nothing connects them to the rest; ``worn`` as in ``unheld``."""
    for spec, garment, points in zip(scene.garments, outfit.garments, worn, strict=True):
        a, b, c = garment.triangles.T
        piece = connected_components(len(points), np.concatenate([a, b]), np.concatenate([b, c]))
        kinds, number, count = np.unique(piece, return_inverse=True, return_counts=True)
        if len(kinds) == 1 or not np.isfinite(points).all():
            continue
        fall = garment.points[:, 1] - points[:, 1]
        least = np.full(len(kinds), np.inf)
        np.minimum.at(least, number, fall)
        fallen = int((least > np.median(fall[number == np.argmax(count)]) + DETACHED).sum())
        if fallen:
            return (
                f'{fallen} of the {len(kinds)} pieces of "{spec.name}" fall off, because nothing connects them to the '
                "others: leave out buttons and other loose parts, or weld them to the garment"
            )
    return ""


def edges_through(edges: int, what: str) -> str:
    """The number of edges that pass through a body, as a clause."""
    return f"{counted(edges, 'edge')} {'passes' if edges == 1 else 'pass'} through the {what}"


def pierced_avatar(depth: Penetration | None) -> str:
    """A garment that passes through a limb of the avatar."""
    if depth is None or not depth.edges:
        return ""
    return (
        f"{edges_through(depth.edges, 'avatar')}, up to {short_number(depth.edge_max, 2)} mm deep, probably because "
        "part of the garment started on the wrong side of a limb: set avatar.mesh to the body in the pose that the "
        "garment was placed around, and avatar.poses to this one; or move panels that reach past another limb (wide "
        "trouser legs, for example) clear of it"
    )


def coarse_faces(depth: Penetration | None) -> str:
    """Large faces that the avatar shows through; not reported where edges pass through it, which says more."""
    if depth is None or depth.edges or not depth.face_max > VISIBLE:
        return ""
    return (
        f"the avatar shows through {counted(depth.faces, 'large face')} by up to {short_number(depth.face_max, 2)} mm: "
        "subdivide them to edges of 15 mm, or raise collision.offset_mm"
    )


def crossing_faces(fraction: float, cloth_contact: bool) -> str:
    """Cloth that passes through itself, by the fraction of its faces that do: its folds are not those of cloth."""
    if cloth_contact or not fraction > CROSSED:
        return ""
    return (
        f"{100 * fraction:.0f} % of the faces pass through others: set collision.cloth = true, which takes about "
        "three times as many iterations"
    )


def unseen_avatar(contact: Mapping[str, Any] | None, kind: str) -> str:
    """A depth-buffer collider that misses much of the avatar.

    ``contact`` is the report's entry of that name, ``kind`` the scene's collision.avatar.
    """
    error = (contact or {}).get("error_mm")
    if kind not in ("depth", "auto") or error is None or not error["p99"] > UNSEEN:
        return ""
    views = "the front, back and top views" if kind == "depth" else "the depth buffers"
    return (
        f"{views} miss part of the avatar near the garment (99th percentile of the collider's error: "
        f'{short_number(error["p99"], 2)} mm): use collision.avatar = "{"auto" if kind == "depth" else "mesh"}"'
    )


def wrong_size(strain: Strain) -> str:
    """A rest shape far from the worn one."""
    if not strain.p50 > WRONG_SIZE:
        return ""
    return (
        f"half of the edges differ from their rest length by {100 * strain.p50:.0f} % or more: check garment.rest, "
        "garment.uv_units, and the garment's size relative to the avatar"
    )
