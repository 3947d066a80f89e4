"""All that is understood of a body from its mesh alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.measures import Measure, measures_of
from warp_cloth.anatomy.skeleton import LIMBS, Skeleton, skeleton_or_reason
from warp_cloth.anatomy.stance import Stance, stance_of
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.mesh import Mesh

LARGE, OUT = 0.2, 0.05  # of the span: extent of a part that is no eye or shoe, and how far it reaches out of the body


@dataclass(frozen=True, eq=False)
class Person:
    """A body, and its limbs, pose and measures, where it is a person's."""

    body: Mesh
    skeleton: Skeleton | None
    stance: Stance | None
    measures: tuple[Measure, ...]  # empty where there are no limbs
    reason: str  # why no limbs can be identified: a clause; else empty
    notes: tuple[str, ...] = ()  # of what is left out, or uncertain


def understand(body: Mesh) -> Person:
    """What a body's mesh shows: limbs, pose and measures."""
    found = skeleton_or_reason(body)
    if isinstance(found, str):
        return Person(body, None, None, (), found)
    return Person(
        body, found, stance_of(found), measures_of(body, found), "", (*_wrapped(found), *_left_out(body, found))
    )


def _wrapped(skeleton: Skeleton) -> tuple[str, ...]:
    """Notes where the limbs were not found on the body's own surface, or on part of it."""
    notes = []
    if skeleton.lacks:
        notes.append(
            f"{', '.join(LIMBS[limb] for limb in skeleton.lacks)}: not there, or cut short. Where the others' measures "
            "are taken was found with plain limbs in their place: they may be off by some centimetres"
        )
    elif skeleton.is_of_wrap:
        notes.append(
            "its own surface does not show its limbs (rough, torn, in pieces, or folded): they were found on one "
            "wrapped round it, and measures may be off by some centimetres"
        )
    if skeleton.is_on_ground:
        notes.append(
            "its feet are grown together with a floor or a plinth, which is left out with the soles: lengths down to "
            "the floor are some centimetres too short"
        )
    if skeleton.is_holding:
        notes.append(
            "it is grown together with something large and flat, which is left out with what that touches, such as a "
            "hand: a limb may be too short by that"
        )
    return tuple(notes)


def _left_out(body: Mesh, skeleton: Skeleton) -> tuple[str, ...]:
    """A note where large parts reach out of the one that has the limbs: another person, a floor, a third arm."""
    if skeleton.own.all():
        return ()
    own = body.points[skeleton.own]
    low, high = own.min(axis=0) - OUT * skeleton.span, own.max(axis=0) + OUT * skeleton.span
    part = mesh_parts(body.vertex_count, body.triangles)
    lower, upper = body.points.copy(), body.points.copy()
    np.minimum.at(lower, part, body.points)
    np.maximum.at(upper, part, body.points)
    extent = (upper - lower).max(axis=1)
    is_apart = np.bincount(part, skeleton.own, len(part)) == 0  # else it is grown together with what is left out
    further = np.flatnonzero((part == np.arange(len(part))) & is_apart & (extent > LARGE * skeleton.span))
    sizes = [float(extent[n]) for n in further if (lower[n] < low).any() or (upper[n] > high).any()]
    if not sizes:
        return ()
    parts = "a further part" if len(sizes) == 1 else f"{len(sizes)} further parts"
    return (f"{parts}, {max(sizes):.2f} m long at most, left out: measures are of the part that has the limbs",)
