"""Coarse to fine: simplified garments come to rest first, and each finer one starts from the shape of the last.

What is left to the finest garment is what only it can show. A fine garment that starts from far off loses itself in
folds, and takes many times as many iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Points, vertex_normals
from warp_cloth.garment.part import GarmentPart
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.implicit.coarse_garments import Ladder, carried
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation
from warp_cloth.solver.loop import Boxes, Follow, relax_to_rest

if TYPE_CHECKING:
    from warp_cloth.avatar.contact import AvatarContact

FEWEST = 250  # vertices of all garments together; fewer come to rest in no time at all as they are
# Where there is an avatar, mean edge of the coarsest garment [m]: triangles that an arm fits through hold nothing.
LONGEST_EDGE = 0.04
# Times the rest error that is allowed: rest shapes of simplified garments are further than that from the finer ones'.
LOOSER = 4.0
# Of the mean edge, standard deviation. A shape carried over is smooth: it balances between the folds that only the
# finer garment has, and would stand there for thousands of iterations until rounding tells it which way to fold.
NUDGE = 0.02


def start_from_coarse(
    relaxation: MultilevelRelaxation,
    contact: AvatarContact | None,
    *,
    tolerance: Tolerance,
    limit: int,
    load: Callable[[Sequence[wp.Kernel]], None],
) -> tuple[LevelRun, ...]:
    """Relaxes simplified garments, coarsest first, and puts the relaxation's own where the last of them leaves off.

    Args:
        relaxation: of the garments as they are; its collider covers where they start.
        contact: builds colliders where garments leave the region of the last; None without avatar.
        tolerance: what counts as rest; of the simplified garments the rest error may be larger.
        limit: most iterations of each.
        load: compiles kernels for the device.
    """
    levels = _levels(relaxation.ladders, contact is not None)
    if not levels:
        return ()
    looser = replace(tolerance, rest_error=LOOSER * tolerance.rest_error, growing=LOOSER * tolerance.growing)
    runs: list[LevelRun] = []
    meeting = _Meeting(contact, relaxation.collider) if contact is not None else None
    points = np.concatenate([ladder.part.points for ladder in levels[-1]])
    for number in range(len(levels) - 1, -1, -1):
        ladders = levels[number]
        model = build_model(
            [ladder.part for ladder in ladders],
            device=relaxation.model.device,
            precision=relaxation.model.precision,
        )
        model.set_points(points)
        met = relaxation.collider if meeting is None else meeting.collider
        level = MultilevelRelaxation(model, met, relaxation.options, ladders, relaxation.implicit_options)
        certifier = Certifier(level)
        load(level.kernels() + certifier.kernels())
        follow = None if meeting is None else meeting.following(model)
        if runs and runs[-1].status is not Status.DIVERGED:
            level.start_near_rest()
        outcome = relax_to_rest(level, certifier, looser, limit, follow=follow)
        runs.append(LevelRun(model.vertex_count, outcome.iterations, outcome.status))
        finer = levels[number - 1] if number else relaxation.ladders
        if outcome.status is not Status.DIVERGED:
            points = _carried(finer, ladders, outcome.points)
        else:
            points = np.concatenate([ladder.part.points for ladder in finer])
    relaxation.model.set_points(points)
    if runs[-1].status is not Status.DIVERGED:
        relaxation.start_near_rest()
    if meeting is not None and meeting.collider is not relaxation.collider:
        relaxation.meet(0, meeting.collider)
    return tuple(runs)


def _levels(ladders: Sequence[Ladder], met: bool) -> list[tuple[Ladder, ...]]:
    """Ever simpler versions of all garments; one that cannot be simplified further stays as it is."""
    levels: list[tuple[Ladder, ...]] = []
    now = tuple(ladders)
    while True:
        below = [ladder.below(limp=met) for ladder in now]
        coarser = tuple(one if one is not None else ladder for one, ladder in zip(below, now, strict=True))
        too_coarse = met and max(_mean_edge(ladder) for ladder in coarser) > LONGEST_EDGE
        if all(one is None for one in below) or too_coarse or _size(coarser) < FEWEST:
            return levels
        levels.append(coarser)
        now = coarser


def _size(ladders: Sequence[Ladder]) -> int:
    return sum(len(ladder.part.points) for ladder in ladders)


def _mean_edge(ladder: Ladder) -> float:
    return float(ladder.part.rest.edge_length.mean())


def _carried(finer: Sequence[Ladder], coarser: Sequence[Ladder], points: Points) -> Points:
    """Where the finer garments' vertices are [m] if the coarser ones' are at ``points``."""
    parts, first = [], 0
    for fine, coarse in zip(finer, coarser, strict=True):
        own = points[first : first + len(coarse.part.points)]
        first += len(own)
        parts.append(own if fine is coarse else _nudged(carried(fine.rungs[0], own, fine.part), fine.part))
    return np.concatenate(parts)


def _nudged(points: Points, part: GarmentPart) -> Points:
    """The shape [m] with every free vertex a little off along its normal, always the same way."""
    size = NUDGE * float(part.rest.edge_length.mean()) * np.random.default_rng(0).standard_normal(len(points))
    size[part.pins] = 0.0
    return points + size[:, None] * vertex_normals(points, part.triangles)


class _Meeting:
    """Keeps the latest collider of garments that leave the region of the one before."""

    def __init__(self, contact: AvatarContact, collider: Collider) -> None:
        self._contact = contact
        self.collider = collider

    def following(self, model: ClothModel) -> Follow:
        """What gives a lone item a new collider where it leaves the old one's region."""

        def follow(items: Sequence[int], boxes: Boxes) -> dict[int, Collider]:
            if self._contact.covers(boxes[0]):
                return {}
            self.collider = self._contact.collider(model.points())
            return {0: self.collider}

        return follow
