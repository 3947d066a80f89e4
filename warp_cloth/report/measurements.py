"""Measurements of one relaxed scene, from which its problems are found and its report is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from warp_cloth.base.choice import Choice
from warp_cloth.model.result import LevelRun, Strain

if TYPE_CHECKING:
    from warp_cloth.anatomy.linking import Misplaced
    from warp_cloth.anatomy.openings import Limbs
    from warp_cloth.avatar.penetration import Overlap
    from warp_cloth.contact.garments import GarmentCrossings


@dataclass(frozen=True, eq=False)
class Measurements:
    """What was measured of a scene's garments as worn."""

    strain: Strain  # of edges
    yarn_strains: Mapping[str, Strain]  # along "warp", "weft" and "bias"; of woven garments only
    edge_strains: NDArray[Any]  # of all garments, shape [E]
    overlap: Overlap | None  # with the avatar; None: there is none
    crossings: GarmentCrossings
    contact: dict[str, Any] | None  # the collider and its error; None: no avatar
    misplaced: Sequence[Sequence[Misplaced]] = ()  # openings of each garment that the wrong limbs pass through
    off_shoulders: Sequence[Limbs] = ()  # arms whose shoulder each garment has slipped off
    modelled: Sequence[GarmentCrossings] = ()  # of each garment by itself in its file; asked where any cross now
    levels: Sequence[LevelRun] = ()  # relaxations that came before
    choices: Sequence[Choice] = ()  # what the program chose where the scene says "auto"
