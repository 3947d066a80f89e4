"""What is read off a body again and again: its skeleton, and the levels of its girths; kept on disk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.levels import GIRTHS, Level, body_levels
from warp_cloth.anatomy.skeleton import Skeleton, skeleton_of
from warp_cloth.anatomy.yielding import yielded
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.stored_value import stored_value

PACKAGES = ("anatomy", "kernels/anatomy", "base")  # on whose code it depends
UP, STANDS = np.array([0.0, 1.0, 0.0]), 0.999  # along the body, and the cosine of the angle between both


def stored_skeleton(body: Mesh) -> Skeleton | None:
    """``skeleton_of`` a body, from the disk where it is known."""
    return stored_value("skeleton", PACKAGES, skeleton_of, body)


def stored_levels(body: Mesh) -> tuple[Level, ...] | None:
    """``levels_of`` a body, from the disk where they are known."""
    return stored_value("levels", PACKAGES, lambda mesh: levels_of(mesh, stored_skeleton(mesh)), body)


def stored_yielding(body: Mesh, skeleton: Skeleton) -> Points | None:
    """``yielded`` of a body with its skeleton, from the disk where it is known."""
    return stored_value("yielding", PACKAGES, lambda mesh: yielded(mesh, skeleton), body)


def levels_of(body: Mesh, skeleton: Skeleton | None) -> tuple[Level, ...] | None:
    """Chest, waist and hip of a body that stands along y, by the ends of its trunk where its limbs are known.

    Of one that lacks limbs, or sits, those that it has. None for anything else.
    """
    figure = None if skeleton is None else Figure.of(body, skeleton)
    if figure is None or not figure.frame[1] @ UP > STANDS:
        return body_levels(body)
    found = body_levels(body, figure.trunk_ends) or _by_limbs(figure)
    return tuple(level for level in found if level.name != "hip" or figure.shows_hip) or None


def _by_limbs(figure: Figure) -> tuple[Level, ...]:
    """The levels of a trunk along y, as far as the limbs tell where they are, without arms that are joined to it."""
    to_xz = figure.frame[[0, 2]][:, [0, 2]]
    found = (figure.levels.get(name) for name in ("chest", "waist", "hip"))
    return tuple(
        replace(level, section=replace(level.section, ends=level.section.ends @ to_xz))
        for level in found
        if level is not None and GIRTHS[0] <= level.girth <= GIRTHS[1]
    )
