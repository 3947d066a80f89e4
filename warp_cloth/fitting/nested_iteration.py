"""Nested iteration, coarse to fine: coarse garments come to rest first, each finer one starts from the last shape.

The finest garment is left with what only it can show. Started from far off, it would fall into folds that take many
times as many iterations to undo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Points, vertex_normals
from warp_cloth.garment.garment import Garment
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.implicit.coarse_garments import Hierarchy, prolong_shape
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import Boxes, Follow, relax_items

if TYPE_CHECKING:
    from warp_cloth.avatar.contact import AvatarContact

FEWEST = 250  # vertices of all garments together; fewer come to rest at once as they are
# Mean edge of the coarsest garment on an avatar [m]: a mesh that an arm fits through holds nothing.
LONGEST_EDGE = 0.04
# Factor on the allowed rest error: rest shapes of coarse garments are further than that from the finer ones' anyway.
LOOSER = 4.0
# Standard deviation of the nudge, in mean edges. A prolonged shape is smooth: it balances between folds that only the
# finer garment has, and would stand there for thousands of iterations until rounding decides which way it folds.
NUDGE = 0.02


def start_from_coarse(
    relaxation: MultilevelRelaxation,
    contact: AvatarContact | None,
    *,
    tolerance: Tolerance,
    limit: int,
    load: Callable[[Sequence[wp.Kernel]], None],
) -> tuple[LevelRun, ...]:
    """Relaxes coarse garments, coarsest first, and starts the relaxation's own garments from the last shape.

    Args:
        relaxation: of the garments themselves; its collider covers where they start.
        contact: builds a collider when garments leave the region of the last one; None without avatar.
        tolerance: what counts as rest; for coarse garments it is LOOSER.
        limit: most iterations of each.
        load: compiles kernels for the device.
    """
    levels = _levels(relaxation.hierarchies, contact is not None)
    if not levels:
        return ()
    looser = replace(tolerance, rest_error=LOOSER * tolerance.rest_error, growing=LOOSER * tolerance.growing)
    runs: list[LevelRun] = []
    tracker = _ColliderTracker(contact, relaxation.collider) if contact is not None else None
    points = np.concatenate([hierarchy.garment.points for hierarchy in levels[-1]])
    for number in range(len(levels) - 1, -1, -1):
        hierarchies = levels[number]
        model = build_model(
            [hierarchy.garment for hierarchy in hierarchies],
            device=relaxation.model.device,
            precision=relaxation.model.precision,
            avatars=relaxation.model.avatars,
        )
        model.set_points(points)
        collider = relaxation.collider if tracker is None else tracker.collider
        level = MultilevelRelaxation(model, collider, relaxation.options, hierarchies, relaxation.implicit_options)
        certifier = Certifier(level)
        load(level.kernels() + certifier.kernels())
        follow = None if tracker is None else tracker.callback(model)
        if runs and runs[-1].status is not Status.DIVERGED:
            level.start_near_rest()
        (outcome,) = relax_items(certifier, [Goal(looser, limit)], follow=follow)
        runs.append(LevelRun(model.vertex_count, outcome.iterations, outcome.status))
        finer = levels[number - 1] if number else relaxation.hierarchies
        if outcome.status is not Status.DIVERGED:
            points = _prolonged(finer, hierarchies, outcome.points)
        else:
            points = np.concatenate([hierarchy.garment.points for hierarchy in finer])
    relaxation.model.set_points(points)
    if runs[-1].status is not Status.DIVERGED:
        relaxation.start_near_rest()
    if tracker is not None and tracker.collider is not relaxation.collider:
        relaxation.set_collider(0, tracker.collider)
    return tuple(runs)


def _levels(hierarchies: Sequence[Hierarchy], on_avatar: bool) -> list[tuple[Hierarchy, ...]]:
    """Coarser and coarser versions of all garments, finest first; one that is the coarsest stays as it is."""
    levels: list[tuple[Hierarchy, ...]] = []
    now = tuple(hierarchies)
    while True:
        below = [hierarchy.coarser(limp=on_avatar) for hierarchy in now]
        coarser = tuple(one if one is not None else hierarchy for one, hierarchy in zip(below, now, strict=True))
        too_coarse = on_avatar and max(each.garment.rest.edge_length.mean() for each in coarser) > LONGEST_EDGE
        if all(one is None for one in below) or too_coarse or _size(coarser) < FEWEST:
            return levels
        levels.append(coarser)
        now = coarser


def _size(hierarchies: Sequence[Hierarchy]) -> int:
    return sum(len(hierarchy.garment.points) for hierarchy in hierarchies)


def _prolonged(finer: Sequence[Hierarchy], coarser: Sequence[Hierarchy], points: Points) -> Points:
    """The finer garments' points [m], nudged, from the coarser ones'."""
    shapes, first = [], 0
    for fine, coarse in zip(finer, coarser, strict=True):
        own = points[first : first + len(coarse.garment.points)]
        first += len(own)
        if fine is not coarse:
            own = _nudged(prolong_shape(fine.coarsenings[0], own, fine.garment), fine.garment)
        shapes.append(own)
    return np.concatenate(shapes)


def _nudged(points: Points, garment: Garment) -> Points:
    """The points [m] with every free vertex displaced a little along its normal, always by the same amount."""
    size = NUDGE * float(garment.rest.edge_length.mean()) * np.random.default_rng(0).standard_normal(len(points))
    size[garment.pins] = 0.0
    return points + size[:, None] * vertex_normals(points, garment.triangles)


class _ColliderTracker:
    """The latest collider of garments that leave the region of the one before."""

    def __init__(self, contact: AvatarContact, collider: Collider) -> None:
        self._contact = contact
        self.collider = collider

    def callback(self, model: ClothModel) -> Follow:
        """The callback that gives a single item a new collider when it leaves the old one's region."""

        def follow(items: Sequence[int], boxes: Boxes) -> dict[int, Collider]:
            if self._contact.covers(boxes[0]):
                return {}
            self.collider = self._contact.collider(model.points())
            return {0: self.collider}

        return follow
