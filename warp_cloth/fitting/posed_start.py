"""Posed starts: the avatar comes to the garment, posed and thin within it; there it is sewn, then carried home.

A garment that was drafted for another body starts with panels on the wrong side of limbs, and no force undoes that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Points
from warp_cloth.fitting.dresser import GROWING_STEPS, STEPS, Dresser, PosedStart
from warp_cloth.fitting.film import Dressing
from warp_cloth.fitting.problem import Problem
from warp_cloth.garment.garment import garments_in
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.result import LevelRun
from warp_cloth.scene import Scene
from warp_cloth.scene.sewing import FABRIC, SLOW_MOMENTUM

OFFSET = 0.003  # [m] of the innermost garment
LAYER = 0.006  # [m] that each further garment is farther out
CACHE_NAME = "posed"


class _Lone(NamedTuple):
    """A lone scene, or one garment of it by itself, and how it is dressed."""

    scene: Scene
    outfit: Outfit  # with its garments in the fabric that is sewn
    device: str
    offset: float  # [m]
    clock: StageClock


def start_posed(
    problem: Problem, cache: Cache, clock: StageClock, watched: list[Dressing] | None = None
) -> tuple[LevelRun, ...]:
    """Moves a lone scene's garments to where they are sewn and worn by the avatar; returns the relaxations of each.

    Each by itself, the same for all fabrics and frictions, so it is made once for each garment and avatar. Garments
    that lie on each other are parted by the fit, inner to outer. ``watched`` takes the shapes of each on its way.
    """
    (scene,), (outfit,), (attempt,) = problem.scenes, problem.loaded, problem.attempts
    watching, lifted = watched is not None, attempt.lifted
    how = scene.solver.precision, scene.collision.cloth, problem.model.device, watching, lifted
    starts = []
    for index, garment in enumerate(outfit.garments):
        sources = outfit.avatar, garment.points, garment.rest.topology
        make = partial(_sewn_and_carried, _lone(problem, index, cache, clock), watching=watching, lifted=lifted)
        starts.append(cache.get_or_make(CACHE_NAME, sources, make, index, *how))
    if watched is not None:
        watched[:] = [start.shapes for start in starts]
    return _placed(problem, starts, clock)


def start_thinned(problem: Problem, cache: Cache, clock: StageClock) -> tuple[LevelRun, ...]:
    """Untangles a lone scene's garments where they lie on the body, all together; returns what that relaxed.

    What lies on a body is drawn over it, and folds that pass through each other stay, of one garment or of two. So the
    body is thinned within the garments, the cloth untangles as the light sheet that is sewn, and the body grows again.
    """
    (scene,), (outfit,), worn = problem.scenes, problem.loaded, problem.model.points()
    sewn = replace(outfit, garments=garments_in(FABRIC, outfit.garments, cache), predrape_garments=())
    whole = _Lone(scene, sewn, str(problem.model.device), OFFSET, clock)
    start = _untangled(whole, worn)
    return _placed(problem, [start if start.points is not None else replace(start, points=worn)], clock)


def _lone(problem: Problem, index: int, cache: Cache, clock: StageClock) -> _Lone:
    """A lone scene's garment of this number, by itself."""
    (scene,), (outfit,) = problem.scenes, problem.loaded
    one = slice(index, index + 1)
    lone = replace(
        outfit,
        meshes=outfit.meshes[one],
        garments=garments_in(FABRIC, outfit.garments[one], cache),
        wearing=outfit.wearing[one],
        predrape_garments=(),
        layers=(),
    )
    alone = scene.model_copy(update={"garments": scene.garments[one]})
    layer = outfit.layers[index] if outfit.layers else index
    return _Lone(alone, lone, str(problem.model.device), OFFSET + layer * LAYER, clock)


def _placed(problem: Problem, starts: Sequence[PosedStart], clock: StageClock) -> tuple[LevelRun, ...]:
    """The garments moved to where they were dressed, unless one diverged."""
    parts = [start.points for start in starts if start.points is not None]
    if len(parts) == len(starts):
        problem.place(np.concatenate(parts))
    clock.lap("dress")
    return tuple(start.run for start in starts)


def _sewn_and_carried(lone: _Lone, *, watching: bool, lifted: bool) -> PosedStart:
    dresser = _sewn(lone, partial(Dresser, lifted=lifted, watching=watching))
    if dresser.wearing.is_trousers and not lifted:
        dresser.pull_on()
    elif dresser.wearing.is_round_head and not lifted:
        dresser.lower()
    else:
        _carry(dresser, lifted)
    dresser.lay_straps()
    dresser.come_home()
    return dresser.ended()


def _sewn(lone: _Lone, make: Callable[..., Dresser]) -> Dresser:
    """The garment sewn round the posed body: as usual, slowly, or below the arms; whichever leaves no tangle."""
    dresser = make(*lone)
    dresser.sew()
    if dresser.is_tangled:
        dresser = make(*lone)
        dresser.sew(SLOW_MOMENTUM)
    (wearing,) = lone.outfit.wearing
    if dresser.is_tangled and wearing is not None and wearing.hangs_from_bust:
        dresser = make(*lone._replace(outfit=replace(lone.outfit, wearing=(wearing.below_arms(),))))
        dresser.sew()
    return dresser


def _carry(dresser: Dresser, lifted: bool) -> None:
    wearing = dresser.wearing
    if lifted or wearing.hangs_from_waist:
        if wearing.hangs_from_waist:
            dresser.hang()
        dresser.lift()
    grows_first = wearing.is_skirt or dresser.could_slide
    if grows_first:
        dresser.grow(GROWING_STEPS, posed=1.0)
    if wearing.is_skirt or dresser.in_the_way:
        dresser.fall()
    dresser.carry_home(STEPS - GROWING_STEPS if grows_first else STEPS, is_grown=grows_first)


def _untangled(lone: _Lone, worn: Points) -> PosedStart:
    dresser = Dresser(*lone, lifted=False, watching=False, worn=worn)
    dresser.untangle()
    thin = dresser.points
    dresser.grow(GROWING_STEPS, posed=0.0)
    dresser.come_home()
    if dresser.crosses and np.isfinite(thin).all():
        dresser.press_out(thin)
    return dresser.ended()
