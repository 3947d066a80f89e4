"""Attempts at a fit: scenes with nothing left to decide, and how one has ended.

An attempt is a plain scene, so that nothing else knows of "auto".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from warp_cloth.base.choice import Choice
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene

TORN = 0.5  # strain of an edge: twice what any worn knit reaches, so it is a seam that did not close


class Patience(Enum):
    """How long an attempt goes on that comes no nearer to rest (solver.stall)."""

    NONE = "none"  # up to its limit of iterations, which the scene states
    SHORT = "short"  # another attempt may do better
    LONG = "long"


class CutShort(Enum):
    """Why a relaxation ended before its limit without being at rest."""

    STALLED = "stalled"
    CROSSING = "crossing"
    SLOW = "slow"
    FALLING = "falling"  # past all that could catch it
    MISWORN = "misworn"  # off a shoulder or the waist, or through a limb


@dataclass(frozen=True, eq=False)
class Attempt:
    """A scene with nothing left to decide."""

    scene: Scene
    stated: Scene  # as its author wrote it
    choices: tuple[Choice, ...] = ()  # what was decided, and why
    begins_after: int | None = None  # number of the attempt whose shape it starts from; None: as garments are placed
    patience: Patience = Patience.NONE
    ends_crossing: bool = False  # whether it ends where cloth passes through cloth
    turn_after: int | None = None  # iterations after which the other kind of steps goes on; None: never
    posed: bool = False  # whether it starts sewn round the avatar as it is posed within the garments
    paddings: int = 0  # how often the avatar has been padded where it showed through
    slides: int = 0  # which of SLIDES without friction over the avatar this is, from 1; 0: none
    thins: bool = False  # whether the avatar is thinned within what it begins after, which is untangled there
    lifted: bool = False  # whether a posed start moves what is sewn to where it started at once, not pulled on
    trial: bool = False  # whether it sews without contact; unless it ends well, the others begin as if it had not been
    ends_misworn: bool = False  # whether it ends where cloth is not worn as it should be when a turn is over

    @property
    def touches(self) -> bool:
        """Whether cloth meets cloth."""
        return self.scene.collision.cloth is True

    @property
    def starts_dressed(self) -> bool:
        """Whether it starts from the rest shape in the fabric of a predrape."""
        return self.scene.solver.start == "dressed" and self.begins_after is None

    @property
    def start(self) -> str:
        """Where it starts, for the report."""
        if self.posed:
            return "posed"
        if self.starts_dressed:
            return "dressed"
        return "placed" if self.begins_after is None else "earlier attempt"

    @property
    def has_levels(self) -> bool:
        """Whether it relaxes coarse garments first, which do not meet cloth."""
        return self.scene.solver.method == "multilevel" and not self.touches

    @property
    def levels_contact(self) -> bool:
        """Whether implicit steps were chosen for cloth that meets cloth."""
        return self.scene.solver.method == "multilevel" and self.touches and self.stated.solver.method == "auto"


@dataclass(frozen=True, eq=False)
class Ended:
    """An attempt, and how it ended."""

    attempt: Attempt
    status: Status
    crossings: int  # pairs of triangles that pass through each other
    vertices: int  # of all garments
    torn: int = 0  # edges that are stretched as no worn cloth is
    misplaced: bool = False  # whether a limb is outside its opening, or cloth runs through one
    caught: bool = False  # whether all limbs are in their openings then, and only edges pass through the avatar
    sunk: bool = False  # whether a garment has slid down from the waist
    slipped: bool = False  # whether a garment has slipped off a shoulder
    shown: bool = False  # whether the avatar shows through faces whose corners are outside
    cut_short: CutShort | None = None

    @property
    def apart(self) -> bool:
        """Whether cloth keeps out of cloth, as far as the scene wants that."""
        wanted = self.attempt.stated.collision.cloth
        return wanted is False or (not self.crossings and (self.attempt.touches or wanted is not True))

    @property
    def rests_apart(self) -> bool:
        """Whether it is at rest and keeps out of cloth."""
        return self.status is Status.AT_REST and self.apart

    @property
    def ended_placed(self) -> bool:
        """Whether it is at rest with every limb in its opening."""
        return self.rests_apart and not self.misplaced

    @property
    def hangs_in_openings(self) -> bool:
        """Whether it is at rest with every limb in its opening, though cloth may be caught on one."""
        return self.rests_apart and (self.caught or not self.misplaced)

    @property
    def well(self) -> bool:
        """Whether nothing is left to mend."""
        return self.ended_placed and not self.torn

    @property
    def good(self) -> bool:
        """Whether it is worn, as far as attempts tell."""
        return self.well and not (self.sunk or self.slipped or self.shown)

    @property
    def whole_but_short(self) -> bool:
        """Whether it rests on its limbs, torn or off the shoulders, as what is too short does."""
        return self.ended_placed and (self.torn > 0 or self.slipped)

    @property
    def rests_torn(self) -> bool:
        """Whether it is at rest, though torn, as what is too narrow is wherever it lies."""
        return self.status is Status.AT_REST and self.torn > 0

    @property
    def came_off(self) -> bool:
        """Whether it has slid down from the waist whole, and rests there: the limbs may be out of its openings then."""
        return self.sunk and not self.torn and self.rests_apart

    @property
    def rank(self) -> tuple[bool, bool, bool, bool, bool, bool, bool, bool, int, int]:
        """Larger is better; what slid without friction is none of the scene's shapes.

        What came off tells more than the same on its way there, with the legs still in it.
        """
        finite = self.status is not Status.DIVERGED and not self.attempt.slides
        placed, held = not self.misplaced or self.came_off, not (self.sunk or self.slipped)
        covers = not self.shown or self.came_off
        worst = -self.torn, -self.crossings
        return finite, self.well, placed, placed or self.caught, held, covers, self.rests_apart, self.apart, *worst


def best_of(history: Sequence[Ended]) -> int:
    """The number of the best attempt, the last of equals.

    One that is not at rest is held no better than what went on from it: it was on its way down.
    """
    own = list(history)
    for number in reversed(range(len(own))):
        after = own[number]
        before = after.attempt.begins_after
        if before is None or after.attempt.slides or own[before].status is Status.AT_REST:
            continue
        sunk, slipped = own[before].sunk or after.sunk, own[before].slipped or after.slipped
        own[before] = replace(own[before], sunk=sunk, slipped=slipped)
    return max(range(len(own)), key=lambda number: (*own[number].rank, number))
