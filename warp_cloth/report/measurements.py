"""Measurements of one relaxed scene, from which its status sentence and its report are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from warp_cloth.model.result import LevelRun, Penetration, Strain

if TYPE_CHECKING:
    from warp_cloth.contact.garments import GarmentCrossings


@dataclass(frozen=True, eq=False)
class Measurements:
    """What was measured of a scene's garments as worn."""

    strain: Strain  # of edges
    yarn_strains: Mapping[str, Strain]  # along "warp", "weft" and "bias"; of woven garments only
    penetration: Penetration | None  # None: no avatar
    crossings: GarmentCrossings
    contact: dict[str, Any] | None  # the collider and its error; None: no avatar
    levels: Sequence[LevelRun] = ()  # relaxations that came before
