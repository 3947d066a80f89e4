"""What is read off a body again and again: its skeleton, and the levels of its girths; kept on disk."""

from __future__ import annotations

import numpy as np

from warp_cloth.anatomy.levels import Level, body_levels
from warp_cloth.anatomy.measures import Figure
from warp_cloth.anatomy.skeleton import Skeleton, skeleton_of
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.stored_value import stored_value

PACKAGES = ("anatomy", "kernels/anatomy", "base")  # on whose code it depends
UP, STANDS = np.array([0.0, 1.0, 0.0]), 0.999  # along the body, and the cosine of the angle between both


def stored_skeleton(body: Mesh) -> Skeleton | None:
    """``skeleton_of`` a body, from the disk where it is known."""
    return stored_value("skeleton", PACKAGES, skeleton_of, body)


def stored_levels(body: Mesh) -> tuple[Level, ...] | None:
    """``levels_of`` a body, from the disk where they are known."""
    return stored_value("levels", PACKAGES, lambda mesh: levels_of(mesh, stored_skeleton(mesh)), body)


def levels_of(body: Mesh, skeleton: Skeleton | None) -> tuple[Level, ...] | None:
    """Chest, waist and hip of a body that stands along y, by the ends of its trunk where its limbs are known.

    None for anything else.
    """
    figure = None if skeleton is None else Figure.of(body, skeleton)
    stands = figure is not None and figure.frame[1] @ UP > STANDS
    return body_levels(body, figure.trunk_ends if figure is not None and stands else None)
