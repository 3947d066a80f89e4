"""Step options of the explicit methods, with every default's unit and reason, and the Step struct made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from warp_cloth.kernels.base.types import cloth_types

Method = Literal["multilevel", "accelerated", "direct"]

# Largest displacement in an iteration [m]. Accelerated: under the thinnest limb's radius, so that nothing passes
# through a body in one step. Direct: what a force slightly larger than gravity moves a vertex by; the paper's rule
# chatters at this size where the cloth is stiff. Multilevel: ten steps' fall.
DEFAULT_CAP: dict[Method, float] = {"multilevel": 2e-2, "accelerated": 5e-3, "direct": 1e-4}

# Momentum while panels are sewn and untangled: drawn together with all of it, the panels of a T-shirt fold over and
# cross in 5,000 places, with this in 200.
CALM = 0.9


@dataclass(frozen=True)
class StepOptions:
    """How one iteration moves the cloth. Every default with its unit and reason."""

    method: Method = "accelerated"
    cap: float | None = None  # largest displacement in an iteration [m]; None: DEFAULT_CAP of the method
    # Share of the last displacement kept: soft folds need about 1 / (1 - momentum) iterations to swing over.
    momentum: float = 0.9995
    # The same for worn cloth once its forces have balanced, without the damping below. Of what is soft all then shrinks
    # by this share's root in an iteration, or slower where its swing takes longer.
    momentum_loose: float = 0.996
    # Factor on that share where it points against the force. Near 1, because in a soft fold the force of the next
    # vertex's trembling outweighs the fold's own: 0.9 made the last millimetre of a T-shirt 5 times slower.
    damping: float = 0.985
    viscosity: float = 0.02  # share of an edge's stiffness that resists its ends' moving apart; it stills the trembling
    # Share of that which acts across what is shorter than at rest, in worn cloth: all of it holds folds back.
    buckling: float = 0.1
    allowance: float = 1.0  # the stiffness bound allows for an edge changing by this multiple of its last change
    # Share of a vertex's stiffness bound kept from one iteration to the next; where the bound grows, momentum
    # (stiffness times displacement) is what is kept. Without it the changing steps feed the cloth's swinging.
    memory: float = 0.99
    memory_falling: float = 0.9  # for worn cloth until its forces first balance: it falls more than twice as fast
    # How many times the bound's step a vertex of worn cloth may go at most in directions that hardly resist, once
    # forces have balanced; 0: no more than once. With 200 no faster. In cloth that still falls buckling would outrun
    # what takes the crumples out.
    anisotropy_limit: float = 100.0
    # Forces have balanced where the relative residual's rms is below this; they have not where it is above TIGHTER
    # times that. Stiff light cloth that is still stretched far is torn apart by long steps: with 0.2, fine silk and
    # polyester that start dressed end crumpled, crossing in 10,000 places, and eight T-shirts took 1.7 times the
    # iterations; with 0.1 they took 0.9 times as many, but the tightest were torn.
    loose: float = 0.05
    renewal: int = 20  # iterations after which those directions are updated, which costs as much as two iterations
    threads: int = 1  # of the CPU that share the iterations of a single item, where they can; the bits are the same

    @property
    def largest_move(self) -> float:
        """The cap in force [m]."""
        return DEFAULT_CAP[self.method] if self.cap is None else self.cap


def build_step(options: StepOptions, precision: str) -> Any:
    """The kernels' Step of these options, in a scene whose y axis points up."""
    types = cloth_types(precision)
    step = types.Step()
    step.gravity = types.vec3(0.0, -1.0, 0.0)
    for name in (
        "allowance",
        "momentum",
        "momentum_loose",
        "damping",
        "viscosity",
        "buckling",
        "memory",
        "memory_falling",
    ):
        setattr(step, name, getattr(options, name))
    step.horizon = options.renewal
    return step
