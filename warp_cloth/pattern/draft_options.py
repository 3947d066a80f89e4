"""What a scene states of a DXF file; apart from what reads one, so that other patterns need none of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warp_cloth.pattern.draft import Stated
    from warp_cloth.pattern.joints import StatedSeam


@dataclass(frozen=True)
class DraftOptions:
    """What a scene states of a pattern that does not state it itself."""

    size: str | None = None
    seam_allowance: float = 0.0  # [m], of pieces without a sew line
    seams: tuple[StatedSeam, ...] = ()  # empty: as proposed
    pieces: Mapping[str, Stated] = field(default_factory=dict)
