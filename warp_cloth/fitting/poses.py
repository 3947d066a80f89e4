"""Worn garments follow an avatar through its poses, in small steps with a new collider each.

In each step, cloth near the avatar first moves along with its surface, as friction would move it; then it relaxes.
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
from warp_cloth.solver.contact_schedule import ContactSchedule
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import BURST, Follow, relax_items
from warp_cloth.solver.relax import Relaxation

# Largest displacement of the surface near the garment in one step [m]: a fraction of what the cloth can move in a
# step's iterations at the default cap.
STEP = 0.01
NEAR_GARMENT = 0.1  # [m] around the garment's box
WORN = 10.0  # times the tolerance, at which a garment is worn well enough to follow


@dataclass(frozen=True)
class PoseRun:
    """How the garments followed the avatar."""

    poses: int
    steps: int
    iterations: int  # until the garment was worn, and in all steps


def follow_poses(
    relaxation: Relaxation,
    certifier: Certifier,
    contact: AvatarContact,
    poses: tuple[Points, ...],
    *,
    tolerance: Tolerance,
    limit: int,
    follow: Follow,
    schedule: ContactSchedule | None,
) -> PoseRun:
    """Drapes the garments in the first pose, moves them through the others, and leaves them in the last.

    Between two poses the avatar's vertices move along straight lines. At the end the relaxation has the collider of
    the last pose.

    Args:
        relaxation: of the garments; its collider is that of the first pose.
        certifier: of the relaxation, until the garments are worn.
        contact: the avatar in its first pose; left in its last.
        poses: the avatar's vertices [m], each shape [V, 3].
        tolerance: what counts as rest; a multiple of it counts as worn.
        limit: of the iterations until worn.
        follow: see ``relax_items``.
        schedule: see ``relax_items``.
    """
    worn = Tolerance(
        min(WORN * tolerance.relative_rms, 1.0),
        min(WORN * tolerance.relative_p99, 1.0),
        WORN * tolerance.rest_error,
        WORN * tolerance.growing,
    )
    (outcome,) = relax_items(certifier, [Goal(worn, limit)], follow=follow, schedule=schedule, ahead=False)
    iterations, steps = outcome.iterations, 0
    for start, end in itertools.pairwise(poses):
        count = _steps(relaxation.model.points(), start, end)
        for step in range(1, count + 1):
            cloth = contact.move(start + step / count * (end - start), relaxation.model.points())
            _place(relaxation.model, cloth)
            relaxation.set_collider(0, contact.collider(cloth, audited=False))
            relaxation.run(BURST)
            iterations += BURST
        steps += count
    relaxation.set_collider(0, contact.collider(relaxation.model.points()))
    return PoseRun(len(poses), steps, iterations)


def _place(model: ClothModel, points: Points) -> None:
    """Moves the cloth's free vertices to these positions [m]."""
    if model.terms.pins:
        points = np.where(model.vertices.pinned.numpy()[:, None] != 0, model.points(), points)
    model.set_points(points)


def _steps(cloth: Points, start: Points, end: Points) -> int:
    """Number of steps from one pose to the next, by the largest displacement near the garment; at least 1."""
    lower, upper = cloth.min(axis=0) - NEAR_GARMENT, cloth.max(axis=0) + NEAR_GARMENT
    near = ((start > lower) & (start < upper)).all(axis=1) | ((end > lower) & (end < upper)).all(axis=1)
    displacement = np.linalg.norm(end - start, axis=1)[near]
    return max(math.ceil(float(displacement.max(initial=0.0)) / STEP), 1)
