"""Which attempt at a fit is made first.

What a scene leaves to the program ("auto", no limit of iterations) is decided from its garments.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warp_cloth.base.choice import Choice
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import Attempt, Patience
from warp_cloth.scene import Scene
from warp_cloth.scene.predrape import predrape_fabric

# Iterations of an attempt at most, the same on every machine. Of 81 random designs that came to rest with cloth on
# cloth the slowest took 75,000; wide skirts whose folds lie on each other take longer.
MOST_ITERATIONS = 200_000
# The same of the multilevel method between others: of 20 designs those that it brought to rest took 9,200 at most.
LEVELS_ITERATIONS = 10_000
# Iterations after which cloth that still falls goes on by implicit steps. Most garments that meet themselves rest by
# per-vertex ones within FALLING, which cost less (an iteration a tenth on a GPU, half on the CPU).
FALLING = 6000
# The same of cloth that touches nothing: a strip of 4,000 vertices that swings down from a clamp rests in a fourteenth
# of the time.
FREE_FALLING = 4000
UNSEWN = 0.05  # strain of an edge that is to be sewn, at least
LEVEL = 0.1  # height of a sheet that lies level over its width, at most
NEARLY_SEWN = 0.05  # [m] between two sides of a seam at most, where cloth begins as good as sewn
METHOD_KEY = "solver.method"
WHY_DRESSED = "folds of its own fabric cross as it falls, or take long to open"


def first_attempt(scene: Scene, outfit: Outfit, *, may_pose: bool = True) -> Attempt:
    """What a scene is fitted with first; ``may_pose``: with the avatar posed, where the garments start badly on it."""
    if may_pose and may_begin_posed(scene, outfit):
        fault = next((each.start_fault for each in outfit.wearing if each is not None and each.start_fault), "")
        if fault:
            return posed_first(scene, outfit, fault)
    touches, why = _first_contact(scene, outfit)
    stated = scene.solver.method
    method = "accelerated" if stated == "auto" else stated
    attempt = decided_attempt(
        scene, method, touches, why, "its iterations are the cheapest", None, last=not may_have_levels(scene)
    )
    is_open = touches and attempt.turn_after is not None and may_pose and may_be_posed(scene, outfit)
    return replace(attempt, ends_misworn=is_open)


def trial_attempt(usual: Attempt, outfit: Outfit) -> Attempt | None:
    """What is tried before the usual first attempt at a lone garment: to sew it without contact of cloth with cloth.

    Where nothing crosses on the way, contact costs more than half of the time for nothing: the shipped T-shirt rests
    after 2,100 iterations in place of 3,700, in silk after 6,100 in place of 18,400. Most random designs cross, nearly
    all within 200 iterations. None: contact is stated or not needed, or the avatar moves within the garment.
    """
    scene = usual.stated
    if usual.posed or not usual.touches or scene.collision.cloth != "auto":
        return None
    if len(outfit.garments) > 1 or not may_have_levels(scene) or _falls_in_folds(outfit):
        return None
    why = "nothing crosses as it is sewn", "its iterations are the cheapest"
    return replace(decided_attempt(scene, "accelerated", False, *why, None, last=False), trial=True)


def dressed_trial(trial: Attempt, outfit: Outfit) -> Attempt | None:
    """A second trial, of what began sewn and yet crossed itself or fell slowly: from its rest shape in a knit.

    There it is the fabric, limp and not stretchy, whose folds cross, or take long to open. The shipped T-shirt in
    silk, and in three other fabrics of nine, takes a third of the time so, or less. Other garments cross in any fabric,
    as their panels are drawn together. None: it is of those, or is a knit, or the scene states where it starts.
    """
    (spec,), (garment,) = trial.stated.garments, outfit.garments
    is_free = trial.stated.solver.start == "auto" and spec.fabric != predrape_fabric()
    if not is_free or garment.rest.sheet is None or _widest_gap(garment) > NEARLY_SEWN:
        return None
    dressed = updated(trial.scene, solver=updated(trial.scene.solver, start="dressed"))
    return replace(trial, scene=dressed, choices=(*trial.choices, Choice("solver.start", "dressed", WHY_DRESSED)))


def may_begin_posed(scene: Scene, outfit: Outfit) -> bool:
    """Whether the first attempt may be with the avatar posed: within panels."""
    return all(garment.rest.source.kind == "uv" for garment in outfit.garments) and may_be_posed(scene, outfit)


def posed_first(scene: Scene, outfit: Outfit, why: str) -> Attempt:
    """The first attempt with the avatar posed within the garments."""
    return posed_attempt(scene, outfit, why, last=not may_have_levels(scene))


def may_have_levels(stated: Scene) -> bool:
    """Whether the program may choose the multilevel method."""
    has_poses = stated.avatar is not None and bool(stated.avatar.poses)
    is_open = stated.solver.method == "auto" and stated.solver.iterations is None
    return is_open and stated.solver.start != "dressed" and not has_poses


def may_be_posed(stated: Scene, outfit: Outfit) -> bool:
    """Whether the avatar may be posed within the garments: all free of pins, and with openings for limbs."""
    if stated.solver.start != "auto" or stated.solver.method == "direct" or not outfit.wearing:
        return False
    pairs = zip(outfit.garments, outfit.wearing, strict=True)
    return all(wearing is not None and not len(garment.pins) for garment, wearing in pairs)


def _first_contact(scene: Scene, outfit: Outfit) -> tuple[bool, str]:
    """Whether cloth meets cloth from the start, and why."""
    stated = scene.collision.cloth
    if stated != "auto":
        return bool(stated), ""
    if scene.solver.start == "dressed":
        return False, "a dressed start has none"
    if scene.solver.method in ("multilevel", "direct"):
        return False, f'solver.method = "{scene.solver.method}" begins without it'
    if len(outfit.garments) > 1:
        return True, f"{len(outfit.garments)} garments touch each other"
    if _falls_in_folds(outfit):
        return True, "its rim falls in folds"
    if outfit.garments[0].rest.source.kind == "uv" and not (scene.avatar is None and _lies_as_cut(outfit.garments[0])):
        return True, "panels touch as they are sewn"
    return False, "nothing crosses"


def _widest_gap(garment: Garment) -> float:
    """How far the ends of an edge are to be drawn together [m], at most."""
    ends = garment.points[garment.rest.topology.edges]
    return float((np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - garment.rest.edge_length).max(initial=0.0))


def _lies_as_cut(garment: Garment) -> bool:
    """Whether a garment starts as its panels are cut, so that nothing is to be sewn."""
    ends = garment.points[garment.rest.topology.edges]
    placed = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return bool(np.allclose(placed, garment.rest.edge_length, rtol=UNSEWN, atol=0.0))


def _falls_in_folds(outfit: Outfit) -> bool:
    """Whether a sheet lies level over the avatar and beyond its sides: of twelve such on a ball eleven cross."""
    garment, avatar = outfit.garments[0], outfit.avatar
    lower, upper = garment.points.min(axis=0), garment.points.max(axis=0)
    width = (upper - lower)[[0, 2]].max()
    if avatar is None or (upper - lower)[1] > LEVEL * width or not _lies_as_cut(garment):
        return False
    low, high = avatar.bounds()
    meets = ((lower < high) & (low < upper))[[0, 2]].all() and lower[1] > low[1]
    return bool(meets and ((lower < low) | (high < upper))[[0, 2]].any())


def posed_attempt(stated: Scene, outfit: Outfit, why: str, *, last: bool) -> Attempt:
    touches, why_contact = _first_contact(stated, outfit)
    if stated.collision.cloth == "auto" and not touches:
        touches, why_contact = True, "the avatar moves within the garment"
    method = "accelerated" if stated.solver.method == "auto" else stated.solver.method
    attempt = decided_attempt(stated, method, touches, why_contact, "its iterations are the cheapest", None, last=last)
    return replace(attempt, posed=True, choices=(*attempt.choices, Choice("solver.start", "posed", why)))


def decided_attempt(
    stated: Scene,
    method: str,
    touches: bool,
    why_contact: str,
    why_method: str,
    begins_after: int | None,
    *,
    last: bool,
) -> Attempt:
    """An attempt with these decisions; those that the scene states are no choices."""
    collision, solver = stated.collision, stated.solver
    choices = []
    if collision.cloth == "auto":
        choices.append(Choice("collision.cloth", touches, why_contact))
    if solver.method == "auto":
        choices.append(Choice(METHOD_KEY, method, why_method))
    limit = solver.iterations
    if limit is None:
        limit = LEVELS_ITERATIONS if method == "multilevel" and solver.method == "auto" else MOST_ITERATIONS
    scene = updated(
        stated, collision=updated(collision, cloth=touches), solver=updated(solver, method=method, iterations=limit)
    )
    patience = Patience.NONE
    if solver.iterations is None:
        patience = Patience.LONG if last else Patience.SHORT
    may_turn = (touches or not last) and method == "accelerated" and may_have_levels(stated)
    turn_after = (FALLING if touches else FREE_FALLING) if may_turn else None
    watches = collision.cloth == "auto" and not touches and method == "accelerated" and solver.start != "dressed"
    return Attempt(scene, stated, tuple(choices), begins_after, patience, watches, turn_after)


def updated(table: Any, **values: Any) -> Any:
    """The table itself where nothing changes, since caches may know it by identity."""
    if all(getattr(table, name) == value for name, value in values.items()):
        return table
    return table.model_copy(update=values)
