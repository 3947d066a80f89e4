"""Problems of a fit as data: a stable code, what was measured where, and what to change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class ProblemCode(str, Enum):
    """What can be wrong with a fit, the likeliest cause first; explained in ``warp_cloth/report/README.md``."""

    DIVERGED = "diverged"
    WRONG_SCALE = "wrong_scale"
    TOO_SMALL = "too_small"
    TOO_LARGE = "too_large"
    UNSUPPORTED = "unsupported"
    FELL_OFF = "fell_off"
    SLID_OFF = "slid_off"
    DETACHED_PIECE = "detached_piece"
    WRONG_OPENING = "wrong_opening"
    EMPTY_OPENING = "empty_opening"
    BUNCHED_UP = "bunched_up"
    THROUGH_BODY = "through_body"
    INSIDE_BODY = "inside_body"
    SHOWN_THROUGH = "shown_through"
    SEAM_OPEN = "seam_open"
    CROSSING = "crossing"
    NOT_AT_REST = "not_at_rest"
    VIEWS_INSUFFICIENT = "views_insufficient"

    @property
    def words(self) -> str:
        """As people read it on pictures and pages."""
        return self.value.replace("_", " ")

    @property
    def is_note(self) -> bool:
        """Whether a garment can be worn in spite of it."""
        return self in NOTES

    @property
    def rank(self) -> int:
        """Its place in the order of causes."""
        return list(ProblemCode).index(self)


# The collider's error is no fault of the shape: where cloth is inside the body, that is a problem of its own.
NOTES = frozenset({ProblemCode.VIEWS_INSUFFICIENT})


@dataclass(frozen=True)
class FitProblem:
    """One problem of one garment. Indices are those of the garment as loaded."""

    code: ProblemCode
    message: str  # one sentence: what is wrong, where, by how much
    remedy: str  # one sentence: what to change
    garment: str = ""  # its name; empty: the problem is not one garment's
    figures: Mapping[str, float] = field(default_factory=dict)  # measured values, units in the names
    vertices: tuple[int, ...] = ()
    faces: tuple[int, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """The entry of ``problems`` in report.json."""
        return {
            "code": self.code.value,
            "note": self.code.is_note,
            "message": self.message,
            "remedy": self.remedy,
            "garment": self.garment,
            "figures": dict(self.figures),
            "vertices": list(self.vertices),
            "faces": list(self.faces),
        }
