"""When the relaxation of an item is to end, and how it has ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Points
from warp_cloth.garment.rest import Floats
from warp_cloth.model.attempt import CutShort, Patience
from warp_cloth.model.result import Status
from warp_cloth.solver.certificate.certifier import Check, Tolerance

# Iterations after which items that pass through themselves end, where their goal says so, to be relaxed again with
# contact. Not before most cloth that touches nothing is at rest, since a search takes as long as some 20 iterations.
CROSSING_CHECKS = (2000, 8000)
# The same of panels, once they are sewn: they mostly cross in the next hundreds, if at all.
SEWN = 100
SEWING_CHECKS = (SEWN, 200, 400, 800, 1600, 3200, 6400)


@dataclass(frozen=True)
class Goal:
    """Tolerance that an item is to reach, its iteration limit, and when it ends before that."""

    tolerance: Tolerance
    limit: int  # iterations
    patience: Patience = Patience.NONE  # with an item that comes no nearer to rest
    ends_crossing: bool = False  # where its cloth passes through cloth, when that is looked for
    sews: bool = False  # whether it sews panels without contact of cloth with cloth, calmly
    # Iterations of a turn, after which the other kind of steps goes on where nothing crosses: after per-vertex steps if
    # cloth still falls, after implicit ones in any case. None: no turns.
    turn_after: int | None = None
    ends_misworn: bool = False  # where it is not worn as it should be when a turn is over

    def looks_for_crossings(self, iteration: int) -> bool:
        """Whether it ends after this iteration if it passes through itself."""
        return self.ends_crossing and iteration in (SEWING_CHECKS if self.sews else CROSSING_CHECKS)

    def looks_how_it_is_worn(self, iteration: int) -> bool:
        """Whether it ends after this iteration, at which it is checked, if it is not worn as it should be."""
        return self.ends_misworn and iteration == self.turn_after


@dataclass
class Outcome:
    """How an item's relaxation ended."""

    status: Status
    check: Check
    points: Points  # the last finite shape [m], shape [V, 3]
    iterations: int
    seconds: float  # in the loop, checks and new colliders included
    frames: list[tuple[int, NDArray[np.float32]]] = field(default_factory=list)  # iteration and shape
    moved: Floats | None = None  # of an item that is not at rest: its last motion from check to check [m], shape [V]
    cut_short: CutShort | None = None  # None: it is at rest, diverged, or used up its iterations
