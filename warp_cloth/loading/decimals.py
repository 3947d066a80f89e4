"""Shortest decimals of stored coordinates, so that a garment has the same bits from files in any unit and axis."""

from __future__ import annotations

import numpy as np

from warp_cloth.loading.raw import Floats

MOST_DECIMALS = 16  # of a metre: float64 near 1 has no more
FLOAT64_STEPS = 4.0  # rounding of a product with a unit and a transform, in steps of the result


def half_step(values: Floats) -> Floats:
    """Half the spacing of float32 at each value: the largest error of storing it."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(0.5 * np.spacing(np.abs(values).astype(np.float32)).astype(np.float64))


def float32_doubt(values: Floats) -> Floats:
    """Largest error of values stored as float32; 0 for values that float32 cannot represent."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.where(values == values.astype(np.float32), half_step(values), 0.0))


def shortest_decimals(values: Floats, doubt: Floats | float = 0.0) -> Floats:
    """The number with the fewest decimals within each value's error; the value itself if none is shorter.

    Files in metres and centimetres, or under a rotated parent, round a coordinate of 0.123456 m to different bits; the
    shortest decimal within the error is 0.123456 m for both.

    Args:
        values: lengths [m].
        doubt: largest error of each [m], besides the last bits of float64.
    """
    found = values.copy().reshape(-1)
    limit = np.broadcast_to(doubt, values.shape).reshape(-1) + FLOAT64_STEPS * np.spacing(np.abs(found))
    left = np.flatnonzero(np.isfinite(found) & np.isfinite(limit))
    for decimals in range(MOST_DECIMALS + 1):
        if not len(left):
            break
        scale = 10.0**decimals
        with np.errstate(over="ignore", invalid="ignore"):
            short = np.rint(found[left] * scale) / scale
        near = np.abs(short - found[left]) <= limit[left]
        found[left[near]] = short[near]
        left = left[~near]
    return found.reshape(values.shape)
