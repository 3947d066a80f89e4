"""Options of the implicit step, and the paces (phases) of cloth on an avatar."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Pace(IntEnum):
    """Phases of cloth on an avatar: it falls, its forces balance, it hardly moves, it comes to rest."""

    FALLING = 0
    BALANCED = 1
    STILL = 2
    RESTING = 3


@dataclass(frozen=True)
class ImplicitOptions:
    """How an implicit step moves the cloth. Every default with its unit and reason."""

    # How far its own weight alone moves a vertex in the first step [m]: it sets the inertia, which resists where the
    # cloth does not. While cloth falls or unfolds, too long a step would overstretch it.
    free_fall: float = 1e-3
    free_fall_limit: float = 15e-3  # the same in the end [m]; beyond, hanging cloth no longer settles
    free_fall_limit_on_avatar: float = 20e-3  # the same on an avatar, until forces have balanced [m]
    free_fall_limit_balanced: float = 0.1  # the same once they have [m]: folds are soft
    free_fall_growth: float = 1.02  # from step to step; with 1.05 stiff cloth on a ball still moved as it was reached
    allowance: float = 1.0  # the stiffness allows for an edge changing its length by this many times its last change
    # Fraction of the last displacement that the solution starts from; with more, strips keep swinging. On an avatar
    # folds slide over it slowly, and what slides does not swing; once its forces have balanced, steps have half the
    # iterations.
    momentum: float = 0.9
    momentum_on_avatar: float = 0.95
    momentum_balanced: float = 0.975
    # Bounds of Nesterov's momentum once it hardly moves, which grows from step to step and falls where a step does not
    # repay it: slow folds slide far, and what swings comes to rest.
    least_momentum: float = 0.9
    most_momentum: float = 0.995
    # Fraction of its steps that a restart of that momentum leaves, as long as folds snap, and at rest.
    restart_still: float = 0.85
    restart_resting: float = 0.75
    # Once it hardly moves, forces are taken where momentum leads, not where it begins (Nesterov): what the solution
    # resists, though the cloth as a whole hardly does (the sliding of a fold), keeps all its momentum, and what is
    # stiff none. A step takes this fraction of the solution: it converges where the true stiffness is up to twice the
    # linearised one (yarns that were slack); with all of it, up to 4 / 3 times. Before the cloth is still it would
    # oscillate.
    step_fraction_still: float = 0.7
    # Fraction of the starting displacement that is added to the solution on an avatar, until then: the linearised
    # cloth resists buckling, which real cloth hardly does, and would stop folds that begin to form.
    swing_on_avatar: float = 0.5
    iterations: int = 10  # of conjugate gradients in a step; 20 gain nothing
    # The same on an avatar, once forces have balanced. Then only folds still move, which hardly resist: the first
    # iterations of a step find most of such a displacement, and momentum does the rest. While stiff cloth of many
    # vertices still falls, so few iterations would let it oscillate.
    iterations_balanced: int = 5
    # The iteration of a step, once forces have balanced, before which the coarse level with rigid modes corrects the
    # residual. Five iterations find a twentieth of the full displacement of free folds, with this level a fifth to two
    # fifths. At the beginning of a step the residual is too rough for it.
    rigid_iteration: int = 1
    renewal: int = 2  # steps after which the coarse levels' stiffness is assembled again
