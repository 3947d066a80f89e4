"""Contact schedule: cloth that collides with cloth is first sewn, then untangled, then worn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Points
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.sheets import LAYER_LIFT
from warp_cloth.garment.garment import Garment
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import CALM

MOST_SEWING = 1000  # iterations after which a seam that will not close is left as it is
# The same where few edges are left, per vertex: the sharp tips of panels, whose edges of 1 mm close the most slowly.
# Eight such tips (g11_039: 6 edges at 1,000 iterations, none at 1,400) stayed drawn out by 10 cm once contact began.
MOST_CLOSING, FEW_OPEN = 2000, 2e-3
CHECK_EVERY = 500  # iterations between checks for new crossings: a pose may have pushed cloth through
ROOMY = 0.5  # fraction of the memory for pairs; below it the next burst does not wait for the measurement
MOST_UNTANGLING = 2000  # iterations after which momentum may help where calm did not
# The same after which layers that are apart are let down, though their cloth still crosses itself: a shirt and a jacket
# had come apart and undone within 500.
MOST_LIFTED = 1000


class ContactSchedule:
    """Enables contact of cloth with cloth once the seams have closed, and momentum once nothing crosses.

    ``face`` decides for garments, as they lie, whether their triangles face away from the body.
    """

    def __init__(self, relaxation: Relaxation, cloth_contact: ClothContact, face: Callable[[], None]) -> None:
        self._relaxation = relaxation
        self._cloth_contact = cloth_contact
        self._face = face
        self._momentum = relaxation.step.momentum
        self._enabled_at = 0  # iteration
        self._requested = False  # whether what the next ``advance`` needs has been requested
        self._roomy = False  # whether pairs used little of their memory at the last measurement
        self._overflows = False  # whether there are more pairs than fit, all the same
        self._crosses_again = False
        self.tangled_for = 0  # iterations for which cloth has crossed since contact began; 0: nothing crosses
        if cloth_contact.layered:
            cloth_contact.lift(LAYER_LIFT)
        self.hold_back(CALM)

    @property
    def calm(self) -> bool:
        """Whether momentum is still held back."""
        return bool(self._relaxation.step.momentum < self._momentum)

    @property
    def worn(self) -> bool:
        """Whether nothing is left to do but to come to rest."""
        return self._cloth_contact.awake and not self._cloth_contact.untangles and not self.calm

    @property
    def must_wait(self) -> bool:
        """Whether the next iterations depend on the measurement that is under way."""
        return not (self.worn and self._roomy)

    def request(self, iteration: int, *, ahead: bool) -> None:
        """Requests what the next ``advance`` needs, without waiting; ``ahead``: other iterations may come before."""
        cloth_contact = self._cloth_contact
        self._requested = True
        if not cloth_contact.awake:
            cloth_contact.read_open_seams(self._relaxation.contact_state())
            return
        cloth_contact.read_pairs(save=ahead and self.worn)
        if cloth_contact.untangles or iteration % CHECK_EVERY == 0:
            cloth_contact.read_crossings(self._relaxation.contact_state())

    def untangle(self) -> None:
        """Undoes crossings from now on, until there are none: something has moved cloth through cloth."""
        if self._cloth_contact.awake and not self._cloth_contact.untangles:
            self._cloth_contact.untangles = True
            self._relaxation.drop_graphs()

    def restore(self) -> None:
        """Restores contact as it was at the last request."""
        self._cloth_contact.restore_pairs()

    def react(self) -> None:
        """Enlarges the memory for pairs if they overflowed unexpectedly, and untangles what crosses again.

        On every device that happens one burst after it was measured.
        """
        if self._overflows:
            self._cloth_contact.grow()
            self._relaxation.drop_graphs()
        if self._crosses_again:
            self.untangle()
        self._overflows = self._crosses_again = False

    def hold_back(self, momentum: float) -> None:
        """Holds momentum back to this until nothing crosses."""
        self._relaxation.set_momentum(min(momentum, self._momentum))

    def advance(self, iteration: int) -> bool:
        """Takes the next stage when it is time; returns whether the present shape may be the rest shape.

        Decides by what was requested; by the present shape if nothing was.
        """
        if self._requested:
            self._requested = False
            return self._advance(iteration)
        self.request(iteration, ahead=False)
        wp.synchronize_device(self._relaxation.model.device)
        self._requested = False
        settled = self._advance(iteration)
        self.react()
        return settled

    def _advance(self, iteration: int) -> bool:
        cloth_contact = self._cloth_contact
        if not cloth_contact.awake:
            if self._goes_on_sewing(iteration):
                return False
            self._face()
            cloth_contact.awaken(self._relaxation.contact_state())
            self._enabled_at = iteration
            self._relaxation.drop_graphs()
            return False
        few = cloth_contact.few_pairs
        fraction = cloth_contact.pair_fill()
        if cloth_contact.few_pairs != few:  # other blocks compute their forces
            self._relaxation.drop_graphs()
        self._overflows = self._roomy and fraction > 1.0
        self._roomy = self.worn and fraction < ROOMY
        if self._overflows:
            return False
        if fraction > 1.0:
            cloth_contact.grow()
            self._relaxation.drop_graphs()
            return False
        return self._end_untangling(iteration)

    def _lift_is_over(self) -> bool:
        """Whether layers with nothing to sew are apart: their lift would hold a hem between the thighs tangled."""
        cloth_contact = self._cloth_contact
        return cloth_contact.layered and not cloth_contact.sews and cloth_contact.layers_apart()

    def _goes_on_sewing(self, iteration: int) -> bool:
        """Whether seams have yet to close, and are given more iterations for that."""
        count = self._cloth_contact.open_seams()
        few = count <= FEW_OPEN * self._cloth_contact.sheets.vertex_count
        return count > 0 and iteration < (MOST_CLOSING if few else MOST_SEWING)

    def _end_untangling(self, iteration: int) -> bool:
        """Ends untangling once nothing crosses; returns whether the present shape may be the rest shape."""
        cloth_contact, since = self._cloth_contact, iteration - self._enabled_at
        crossings = cloth_contact.crossings() if cloth_contact.untangles or iteration % CHECK_EVERY == 0 else 0
        self.tangled_for = since if cloth_contact.untangles and crossings > 0 else 0
        if self.calm and since >= MOST_LIFTED and crossings > 0 and self._lift_is_over():
            cloth_contact.lift(0.0)
        if self.calm and since > 0 and (not crossings or since >= MOST_UNTANGLING):
            self._relaxation.set_momentum(self._momentum)
            cloth_contact.lift(0.0)
            cloth_contact.layered = cloth_contact.layered and crossings > 0
            cloth_contact.untangles = crossings > 0  # what does not cross now never will
            return False
        if not self.calm and cloth_contact.untangles and not crossings:
            cloth_contact.untangles = False
            self._relaxation.drop_graphs()
        self._crosses_again = not self.calm and not cloth_contact.untangles and crossings > 0
        return not crossings and not self.calm


def build_contact_schedule(
    garments: Sequence[Garment], relaxation: Relaxation, cloth_contact: ClothContact
) -> ContactSchedule:
    """The contact schedule of a scene's garments; without a body they are oriented by their own middles."""

    def face() -> None:
        if cloth_contact.facing is not None:
            cloth_contact.face_from_body(relaxation.contact_state())
        else:
            cloth_contact.face(signs_from_middle(garments, relaxation.model.points()))

    return ContactSchedule(relaxation, cloth_contact, face)


def signs_from_middle(garments: Sequence[Garment], points: Points) -> list[float]:
    """Whether most of each garment's area faces away from its own middle, 1, or towards it, -1, at these points [m]."""
    signs, start = [], 0
    for garment in garments:
        own = points[start : start + len(garment.points)]
        a, b, c = (own[garment.triangles[:, corner]] for corner in range(3))
        away = np.einsum("ij,ij->", np.cross(b - a, c - a), (a + b + c) / 3.0 - own.mean(axis=0))
        signs.append(1.0 if float(away) >= 0.0 else -1.0)
        start += len(own)
    return signs
