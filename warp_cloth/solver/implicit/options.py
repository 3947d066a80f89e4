"""Options of the implicit step, and the paces at which it moves cloth on an avatar."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Pace(IntEnum):
    """How cloth on an avatar moves: it falls, its forces have balanced, it hardly moves, it comes to rest."""

    FALLING = 0
    BALANCED = 1
    STILL = 2
    RESTING = 3


@dataclass(frozen=True)
class ImplicitOptions:
    """How an implicit step moves the cloth. Every default with its unit and reason.

    free_fall: how far its own weight alone moves a vertex in the first step [m]: it sets the inertia, which resists
        where the cloth does not; while cloth falls or unfolds, too long a step overstretches it.
    free_fall_limit: the same in the end [m]; beyond, hanging cloth no longer settles.
    free_fall_limit_on_avatar: the same on an avatar, until forces have balanced.
    free_fall_limit_balanced: the same once they have: folds are soft.
    free_fall_growth: factor from step to step. With 1.05 stiff cloth on a ball was still moving when it was reached.
    reach: the stiffness allows for an edge changing its length by this many times its last change.
    momentum: fraction of the last displacement that the solution starts from; with more, strips swing on and on.
    momentum_on_avatar: the same on an avatar: folds slide over it slowly, and what slides does not swing.
    momentum_balanced: the same once its forces have balanced, and steps have half the iterations.
    least_momentum, most_momentum: bounds of Nesterov's momentum once it hardly moves, which grows from step to step and
        falls where a step does not repay it: slow folds slide far, and what swings comes to rest.
    restart_still, restart_resting: fraction of its steps that a restart of that momentum leaves, as long as folds snap,
        and at rest.
    step_fraction_still: once it hardly moves, forces are taken where momentum leads, not where it begins (Nesterov):
        what the solution resists, though the cloth as a whole hardly does (the sliding of a fold), keeps all its
        momentum, and what is stiff none. A step takes this fraction of the solution: what is up to twice as stiff as
        it looks (yarns that were slack) settles so, with all of it up to 4 / 3 times. Earlier it would oscillate.
    swing_on_avatar: fraction of the starting displacement that comes on top of the solution on an avatar, till then:
        the solution resists what the cloth hardly does (buckling), and would stop folds that have begun to form.
    iterations: of conjugate gradients in a step; 20 gain nothing.
    iterations_balanced: the same on an avatar, once forces have balanced. What is left are folds that snap over, and
        hardly resist: of such a displacement an iteration finds the more the earlier it is in its step, and momentum
        does the rest. While stiff cloth of many vertices still falls, so few let it oscillate.
    rigid_iteration: the iteration of a step, once forces have balanced, before which what is left is solved for on the
        coarse level with rigid modes. Of what a whole solution would do to free folds five iterations take a
        twentieth, with it from a fifth to two fifths. At the step's beginning what is left is too rough for it.
    renewal: steps after which the coarse levels' stiffness is summed again.
    """

    free_fall: float = 1e-3
    free_fall_limit: float = 15e-3
    free_fall_limit_on_avatar: float = 20e-3
    free_fall_limit_balanced: float = 0.1
    free_fall_growth: float = 1.02
    reach: float = 1.0
    momentum: float = 0.9
    momentum_on_avatar: float = 0.95
    momentum_balanced: float = 0.975
    least_momentum: float = 0.9
    most_momentum: float = 0.995
    restart_still: float = 0.85
    restart_resting: float = 0.75
    step_fraction_still: float = 0.7
    swing_on_avatar: float = 0.5
    iterations: int = 10
    iterations_balanced: int = 5
    rigid_iteration: int = 1
    renewal: int = 2
