"""What a stored number stands for: files in other units, axes and places tell of the same garment by the same bits."""

from __future__ import annotations

import numpy as np

from warp_cloth.loading.raw import Floats

MOST_DECIMALS = 16  # of a metre: no float64 near 1 tells more
FLOAT64_STEPS = 4.0  # roundings of a product with a unit and a place, in steps of the result


def half_step(values: Floats) -> Floats:
    """Half a float32's step at a value: by how much storing it may have moved it."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(0.5 * np.spacing(np.abs(values).astype(np.float32)).astype(np.float64))


def float32_doubt(values: Floats) -> Floats:
    """By how much numbers may be off for having been stored as float32; those that float32 cannot hold were not."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.where(values == values.astype(np.float32), half_step(values), 0.0))


def shortest_decimals(values: Floats, doubt: Floats | float = 0.0) -> Floats:
    """Of all numbers that a value may stand for the one with the fewest decimals; itself where none is shorter.

    Metres and centimetres, or a turned parent, round a coordinate of 0.123456 m to different bits; what both may
    stand for is 0.123456 m again. Nothing moves by more than it is in doubt.

    Args:
        values: lengths [m].
        doubt: by how much each may be off [m], beside the last bits of float64.
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
