"""Colours of maps: perceptual colour tables (viridis, cool-warm)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.maps.kinds import MapKind

# viridis (Smith, van der Walt; CC0) and cool-warm (Moreland 2009), sRGB bytes at 17 even steps
_VIRIDIS = (
    (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141), (44, 114, 142),
    (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115), (94, 201, 98), (132, 212, 75),
    (173, 220, 48), (216, 226, 25), (253, 231, 37),
)  # fmt: skip
_COOL_WARM = (
    (59, 76, 192), (78, 104, 216), (98, 130, 234), (119, 154, 247), (141, 176, 254), (163, 194, 254), (185, 208, 249),
    (204, 217, 237), (221, 220, 220), (236, 211, 197), (245, 196, 172), (247, 176, 147), (244, 152, 122),
    (235, 125, 98), (221, 95, 75), (202, 59, 55), (180, 4, 38),
)  # fmt: skip


def colours(kind: MapKind, values: ArrayLike, bounds: tuple[float, float]) -> NDArray[np.float64]:
    """sRGB colours, 0..1, of a map's values, clipped to the range ``bounds``; shape [..., 3]."""
    table = np.array(_COOL_WARM if kind.signed else _VIRIDIS) / 255.0
    low, high = bounds
    place = np.clip((np.asarray(values, dtype=np.float64) - low) / (high - low), 0.0, 1.0)
    steps = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(place, steps, channel) for channel in table.T], axis=-1)


def shown_value(kind: MapKind, value: float) -> str:
    """A value as text: strains in per cent; lengths, pressures and angles in their unit."""
    if kind.unit == "1":
        return f"{100.0 * value:.3g} %"
    return f"{value:.3g} {'°' if kind.unit == 'degree' else kind.unit}"
