"""The way of garments that meet themselves and each other: sewn, then untangled, then worn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warp_cloth.collide.cloth import ClothTouch
from warp_cloth.collide.cloth_arrays import OPEN_STRETCH
from warp_cloth.garment.rest import Floats
from warp_cloth.mesh import Points
from warp_cloth.solver.relax import Relaxation

# Sewing and untangling are no time to swing: drawn together with full momentum, the panels of a T-shirt fold over
# and cross in 5,000 places, with this in 200.
CALM_MOMENTUM = 0.9
MOST_SEWING = 1000  # iterations after which a seam that will not close is taken as it is
LAYER_LIFT = 8e-3  # [m]; while it is sewn, each layer keeps clear of the folds of the one inside it
LOOK_AGAIN = 500  # iterations after which it is looked whether nothing crosses still: a pose may have pushed through
ROOMY = 0.5  # share of the room for pairs; where less is taken the next chunk does not wait for a look
MOST_UNTANGLING = 2000  # iterations after which swinging may help where calm did not


class Course:
    """Wakes the contact of cloth with cloth once the seams have closed, and momentum once nothing crosses.

    ``outward`` says of each garment, at given points, whether its triangles face away from the body (1) or to it (-1).
    """

    def __init__(
        self, relaxation: Relaxation, touch: ClothTouch, lengths: Floats, outward: Callable[[Points], list[float]]
    ) -> None:
        self._relaxation = relaxation
        self._touch = touch
        self._lengths = lengths  # of the edges at rest [m], shape [E]
        self._outward = outward
        self._momentum = relaxation.step.momentum
        self._woken = 0
        self._roomy = False  # whether at the last look pairs had room to become many more
        self._crowded = False  # whether they are more than there is room for, all the same
        if touch.layered:
            touch.lift(LAYER_LIFT)
        self._set_momentum(min(CALM_MOMENTUM, self._momentum))

    @property
    def calm(self) -> bool:
        """Whether momentum is still held back."""
        return bool(self._relaxation.step.momentum < self._momentum)

    @property
    def _through(self) -> bool:
        """Whether nothing is left but to come to rest."""
        return self._touch.awake and not self._touch.untangles and not self.calm

    def hangs_on(self, iteration: int) -> bool:
        """Whether what comes next may hang on what is seen after so many iterations."""
        return not (self._through and self._roomy) or iteration % LOOK_AGAIN == 0

    def note(self, *, ahead: bool) -> None:
        """Asks what the next ``advance`` is to know, without waiting; ``ahead``: other iterations may come before."""
        if self._through:
            self._touch.note(whole=ahead)

    def put_back(self) -> None:
        """Makes contact again what it was when that was asked."""
        self._touch.put_back()

    def go_on(self) -> None:
        """Makes room for more pairs where nobody expected them, a chunk after that was seen on every device."""
        if self._crowded:
            self._crowded = False
            self._touch.grow()
            self._relaxation.forget_graphs()

    def _set_momentum(self, momentum: float) -> None:
        self._relaxation.step.momentum = momentum
        self._relaxation.forget_graphs()

    def advance(self, iteration: int) -> bool:
        """Goes on to what comes next where it is time; whether what is now may be the rest shape."""
        touch = self._touch
        if not touch.awake:
            points = self._relaxation.model.points()
            ends = touch.sheets.edges
            stretch = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1) / self._lengths
            if stretch.max() > OPEN_STRETCH and iteration < MOST_SEWING:
                return False
            touch.face(self._outward(points))
            touch.awaken()
            self._woken = iteration
            self._relaxation.forget_graphs()
            return False
        few = touch.few_pairs
        share = touch.share_noted() if self._through else 1.0
        if touch.few_pairs != few:  # other blocks press them
            self._relaxation.forget_graphs()
        self._crowded = self._roomy and share > 1.0
        self._roomy = share < ROOMY
        if self._crowded:
            return False
        if share >= 1.0 and touch.grow():
            self._relaxation.forget_graphs()
            return False
        crossings = touch.crossing_count() if touch.untangles or iteration % LOOK_AGAIN == 0 else 0
        if self.calm and iteration > self._woken and (not crossings or iteration - self._woken >= MOST_UNTANGLING):
            self._set_momentum(self._momentum)
            touch.lift(0.0)
            touch.layered = touch.layered and crossings > 0
            touch.untangles = crossings > 0  # what does not cross now never will
            return False
        if not self.calm and touch.untangles != (crossings > 0):
            touch.untangles = crossings > 0
            self._relaxation.forget_graphs()
        return not crossings and not self.calm
