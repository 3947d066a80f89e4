"""The way of garments that meet themselves and each other: sewn, then untangled, then worn."""

from __future__ import annotations

from collections.abc import Callable

import warp as wp

from warp_cloth.contact.cloth import ClothContact
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

    ``face`` tells garments, as they lie, whether their triangles face away from the body.
    """

    def __init__(self, relaxation: Relaxation, cloth_contact: ClothContact, face: Callable[[], None]) -> None:
        self._relaxation = relaxation
        self._cloth_contact = cloth_contact
        self._face = face
        self._momentum = relaxation.step.momentum
        self._woken = 0
        self._noted = False  # whether what the next ``advance`` is to know has been asked
        self._roomy = False  # whether at the last look pairs had room to become many more
        self._crowded = False  # whether they are more than there is room for, all the same
        self._crossed = False  # whether something crosses that did not before
        if cloth_contact.layered:
            cloth_contact.lift(LAYER_LIFT)
        self._set_momentum(min(CALM_MOMENTUM, self._momentum))

    @property
    def calm(self) -> bool:
        """Whether momentum is still held back."""
        return bool(self._relaxation.step.momentum < self._momentum)

    @property
    def _through(self) -> bool:
        """Whether nothing is left but to come to rest."""
        return self._cloth_contact.awake and not self._cloth_contact.untangles and not self.calm

    @property
    def hangs(self) -> bool:
        """Whether what comes next hangs on what is seen now."""
        return not (self._through and self._roomy)

    def note(self, iteration: int, *, ahead: bool) -> None:
        """Asks what the next ``advance`` is to know, without waiting; ``ahead``: other iterations may come before."""
        cloth_contact = self._cloth_contact
        self._noted = True
        if not cloth_contact.awake:
            cloth_contact.note_open()
            return
        cloth_contact.note(whole=ahead and self._through)
        if cloth_contact.untangles or iteration % LOOK_AGAIN == 0:
            cloth_contact.note_crossings()

    def put_back(self) -> None:
        """Makes contact again what it was when that was asked."""
        self._cloth_contact.put_back()

    def go_on(self) -> None:
        """Makes room for more pairs where nobody expected them, and untangles what crosses again.

        That is a chunk after it was seen on every device.
        """
        if self._crowded:
            self._cloth_contact.grow()
        if self._crossed:
            self._cloth_contact.untangles = True
        if self._crowded or self._crossed:
            self._crowded = self._crossed = False
            self._relaxation.forget_graphs()

    def _set_momentum(self, momentum: float) -> None:
        self._relaxation.step.momentum = momentum
        self._relaxation.forget_graphs()

    def advance(self, iteration: int) -> bool:
        """Goes on to what comes next where it is time; whether what is now may be the rest shape.

        By what was noted, once that has come to the host; else by what is now.
        """
        if self._noted:
            self._noted = False
            return self._advance(iteration)
        self.note(iteration, ahead=False)
        wp.synchronize_device(self._relaxation.model.device)
        self._noted = False
        settled = self._advance(iteration)
        self.go_on()
        return settled

    def _advance(self, iteration: int) -> bool:
        cloth_contact = self._cloth_contact
        if not cloth_contact.awake:
            if cloth_contact.open_noted() and iteration < MOST_SEWING:
                return False
            self._face()
            cloth_contact.awaken()
            self._woken = iteration
            self._relaxation.forget_graphs()
            return False
        few = cloth_contact.few_pairs
        share = cloth_contact.share_noted()
        if cloth_contact.few_pairs != few:  # other blocks press them
            self._relaxation.forget_graphs()
        self._crowded = self._roomy and share > 1.0
        self._roomy = self._through and share < ROOMY
        if self._crowded:
            return False
        if share > 1.0:
            cloth_contact.grow()
            self._relaxation.forget_graphs()
            return False
        crossings = cloth_contact.crossings_noted() if cloth_contact.untangles or iteration % LOOK_AGAIN == 0 else 0
        if self.calm and iteration > self._woken and (not crossings or iteration - self._woken >= MOST_UNTANGLING):
            self._set_momentum(self._momentum)
            cloth_contact.lift(0.0)
            cloth_contact.layered = cloth_contact.layered and crossings > 0
            cloth_contact.untangles = crossings > 0  # what does not cross now never will
            return False
        if not self.calm and cloth_contact.untangles and not crossings:
            cloth_contact.untangles = False
            self._relaxation.forget_graphs()
        self._crossed = not self.calm and not cloth_contact.untangles and crossings > 0
        return not crossings and not self.calm
