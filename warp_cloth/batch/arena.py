"""Shared memory of a process and those forked from it: large arrays are written there once and read in place.

A pipe would copy them four times, in threads that block all others of the process.
"""

from __future__ import annotations

import mmap
import multiprocessing
import pickle
from dataclasses import dataclass
from typing import Any

ALIGNED = 64  # bytes


@dataclass(frozen=True)
class Parcel:
    """An object that was put into an arena: small enough to be sent through a pipe."""

    pickled: bytes  # without the arrays
    places: tuple[tuple[int, int], ...]  # first byte and length of each array


class Arena:
    """``size`` bytes, of which only those in use take memory; freed with the last process that maps them.

    Objects are never removed: arrays that are taken are views. An object that no longer fits is pickled whole.
    """

    def __init__(self, size: int) -> None:
        self._memory = memoryview(mmap.mmap(-1, size))
        self._used = multiprocessing.get_context("fork").Value("Q", 0)

    def put(self, thing: Any) -> Parcel:
        """Writes an object, in any of the processes."""
        buffers: list[pickle.PickleBuffer] = []
        pickled = pickle.dumps(thing, protocol=5, buffer_callback=buffers.append)
        raws = [buffer.raw() for buffer in buffers]
        places = self._places([raw.nbytes for raw in raws])
        if places is None:
            return Parcel(pickle.dumps(thing, protocol=5), ())
        for raw, (first, length) in zip(raws, places, strict=True):
            self._memory[first : first + length] = raw
        return Parcel(pickled, places)

    def take(self, parcel: Parcel) -> Any:
        """The object of a parcel; all processes share its arrays, which must not be changed."""
        return pickle.loads(parcel.pickled, buffers=[self._memory[first : first + n] for first, n in parcel.places])

    def _places(self, lengths: list[int]) -> tuple[tuple[int, int], ...] | None:
        """Offset and size of blocks of these ``lengths`` [bytes]; None if they do not fit."""
        with self._used.get_lock():
            place, places = self._used.value, []
            for length in lengths:
                places.append((place, length))
                place += -(-length // ALIGNED) * ALIGNED
            if place > len(self._memory):
                return None
            self._used.value = place
        return tuple(places)
