"""Where a picture's kernels look round a pixel, for ambient occlusion and for soft shadows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.kernels.picture.shading import OCCLUSION_REACH

OCCLUSION_DIRECTIONS = 6
OCCLUSION_STEPS = 6
SHADOW_TAPS = 12
SHADOW_BLUR = 0.012  # [m], radius of the soft edge
GOLDEN_ANGLE = 2.39996  # [rad]
# Revolutions that a pixel's sampling pattern is turned by: one of four in a 2 x 2 block, averaged by supersampling.
PATTERNS = (0.0, 0.25, 0.5, 0.75)


def occlusion_taps(pixel: float) -> NDArray[np.int32]:
    """Where ambient occlusion looks: rows and columns from a pixel of size ``pixel`` [m], shape [patterns, taps, 2].

    A direction's steps follow one another, and widen quadratically: folds are near, hems far.
    """
    step = np.arange(1, OCCLUSION_STEPS + 1)
    away = np.maximum(float(OCCLUSION_REACH) * (step / OCCLUSION_STEPS) ** 2 / pixel, 1.5 * step)
    return _round_pixel(np.arange(OCCLUSION_DIRECTIONS) / OCCLUSION_DIRECTIONS, away, 1 / OCCLUSION_DIRECTIONS)


def shadow_taps(pixel: float) -> NDArray[np.float32]:
    """Where shadows look: columns and rows from a point in the key light's image, shape [patterns, taps, 2]."""
    tap = np.arange(SHADOW_TAPS)
    away = SHADOW_BLUR / pixel * np.sqrt((tap + 0.5) / SHADOW_TAPS)
    angle = tap * GOLDEN_ANGLE + 2.0 * np.pi * np.array(PATTERNS)[:, None]
    return (away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).astype(np.float32)


def _round_pixel(turns: NDArray[np.float64], away: NDArray[np.float64], whole: float) -> NDArray[np.int32]:
    """Rows and columns at distances ``away`` [px] in directions ``turns`` [revolutions], for each pattern.

    Patterns are turned by their share of ``whole`` [revolutions].
    """
    angle = 2.0 * np.pi * (turns + whole * np.array(PATTERNS)[:, None])
    places = away[:, None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)[:, :, None]
    return np.rint(places).astype(np.int32).reshape(len(PATTERNS), -1, 2)
