"""Words for what blocks of threads ask for of arrays, whether lists, meshes or patches lead them there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import warp as wp
from numpy.typing import NDArray

Numbers = NDArray[np.int64]
Part = tuple[Numbers, Numbers]  # blocks of threads, and elements of an array that each of them asks for
Arrays = Mapping[str, wp.array]

SECTOR = 32  # bytes that are moved together
THREADS = 256  # of a block, where Warp chooses
STORED = "stored "  # before an array's name: what single instructions put there, of each of which the cache is told


def integers(array: wp.array) -> Numbers:
    """What an array of whole numbers holds."""
    return np.asarray(array.numpy(), dtype=np.int64)


def joined(*parts: Part) -> Part:
    """What several parts ask for together."""
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def ranges(first: Numbers, count: Numbers) -> Part:
    """Which range, and the numbers that it goes over from its first one on."""
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) + (first - np.cumsum(count) + count)[which]
