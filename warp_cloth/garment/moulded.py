"""Whether a garment modelled on a body lies on its skin as it starts, or would if it were turned by half."""

from __future__ import annotations

from collections.abc import Sequence

from warp_cloth.base.mesh import Points
from warp_cloth.garment.skin import Skin

# Parts of the vertices within the body. Of twelve garments modelled on bodies 0 to 0.005 were, and 0.036 to 0.34 turned
# by half; one that was turned had 0.28, and none turned back.
ON_SKIN, OFF_SKIN, THROUGH_SKIN = 0.02, 0.03, 0.1
SAMPLED = 2000  # vertices of a garment


def faces_ahead(start: Points, turned: Sequence[Points], skin: Skin) -> int:
    """1: it lies on the skin, and would not if it were turned; -1: the other way round; 0: neither.

    Args:
        start: its vertices [m], shape [V, 3].
        turned: the same about other axes.
        skin: of the body that wears it.
    """
    now, other = within(start, skin), min(within(points, skin) for points in turned)
    if now < ON_SKIN and other > OFF_SKIN:
        return 1
    return -1 if other < ON_SKIN and now > THROUGH_SKIN else 0


def within(points: Points, skin: Skin) -> float:
    """The part of some points [m], shape [N, 3], that is within a body, by its nearest vertices."""
    heights, _ = skin.heights(points[:: max(1, len(points) // SAMPLED)])
    return float((heights < 0.0).mean())
