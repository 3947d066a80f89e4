"""Carries worn garments along with an avatar that moves: in small steps, the collider built anew at each.

In each step cloth near the skin first goes with it, as friction has it do; then it relaxes.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from warp_cloth.avatar.contact import AvatarContact
from warp_cloth.base.mesh import Points
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.contact_schedule import Course
from warp_cloth.solver.loop import CHUNK, Follow, relax_to_rest
from warp_cloth.solver.relax import Relaxation

# Largest way of the surface near the garment in one step [m]: what the cloth can catch up with in a step's iterations
# at the default cap, several times over.
STEP = 0.01
ROUND_GARMENT = 0.1  # [m] round the garment's box, what counts as near it
WORN = 10.0  # times the tolerance at which a garment is worn well enough to be carried


@dataclass(frozen=True)
class Carried:
    """What it took."""

    poses: int
    steps: int
    iterations: int  # before the last pose, till the garment was worn and in the steps


def carry(
    relaxation: Relaxation,
    certifier: Certifier,
    contact: AvatarContact,
    poses: tuple[Points, ...],
    *,
    tolerance: Tolerance,
    limit: int,
    follow: Follow,
    course: Course | None,
) -> Carried:
    """Puts the garments on in the first pose, takes them through the others, and leaves them in the last.

    Between two poses the avatar's vertices go straight. The relaxation then meets the last pose's collider.

    Args:
        relaxation: what iterates; its collider is the first pose's.
        certifier: measures it until the garments are worn.
        contact: the avatar, in its first pose; left in its last.
        poses: the avatar's vertices [m], each shape [V, 3].
        tolerance: what counts as rest; a multiple of it counts as worn.
        limit: most iterations until worn.
        follow: as of relax_to_rest.
        course: likewise.
    """
    worn = Tolerance(
        min(WORN * tolerance.relative_rms, 1.0),
        min(WORN * tolerance.relative_p99, 1.0),
        WORN * tolerance.rest_error,
        WORN * tolerance.growing,
    )
    outcome = relax_to_rest(
        relaxation,
        certifier,
        worn,
        limit,
        follow=follow,
        course=course,
        ahead=False,
    )
    iterations, steps = outcome.iterations, 0
    for start, end in itertools.pairwise(poses):
        count = _steps(relaxation.model.points(), start, end)
        for step in range(1, count + 1):
            cloth = contact.move(start + step / count * (end - start), relaxation.model.points())
            _place(relaxation.model, cloth)
            relaxation.meet(0, contact.collider(cloth, audited=False))
            relaxation.run(CHUNK)
            iterations += CHUNK
        steps += count
    relaxation.meet(0, contact.collider(relaxation.model.points()))
    return Carried(len(poses), steps, iterations)


def _place(model: ClothModel, points: Points) -> None:
    """Puts the cloth's free vertices at these positions [m]."""
    if model.terms.pins:
        points = np.where(model.vertices.pinned.numpy()[:, None] != 0, model.points(), points)
    model.set_points(points)


def _steps(cloth: Points, start: Points, end: Points) -> int:
    """How many steps take the avatar from one pose to the next, by what moves near the garment; at least 1."""
    lower, upper = cloth.min(axis=0) - ROUND_GARMENT, cloth.max(axis=0) + ROUND_GARMENT
    near = ((start > lower) & (start < upper)).all(axis=1) | ((end > lower) & (end < upper)).all(axis=1)
    way = np.linalg.norm(end - start, axis=1)[near]
    return max(math.ceil(float(way.max(initial=0.0)) / STEP), 1)
