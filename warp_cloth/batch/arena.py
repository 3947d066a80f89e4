"""Memory that a process shares with those forked from it: what is large is put there once, and read where it lies.

Through a pipe it would be copied four times, by threads that hold up all others of the process.
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
    """Something that was put into an arena: small enough to be sent."""

    pickled: bytes  # all but the arrays
    places: tuple[tuple[int, int], ...]  # first byte and length of each array


class Arena:
    """``size`` bytes, of which the machine gives those that are used; they go with the last process that has them.

    What is put there stays: arrays that are taken out lie there. What finds no room any more goes into its parcel.
    """

    def __init__(self, size: int) -> None:
        self._memory = memoryview(mmap.mmap(-1, size))
        self._used = multiprocessing.get_context("fork").Value("Q", 0)

    def put(self, thing: Any) -> Parcel:
        """Puts something there, in any of the processes."""
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
        """What was put there; its arrays are those of everyone who takes it, and are not to be changed."""
        return pickle.loads(parcel.pickled, buffers=[self._memory[first : first + n] for first, n in parcel.places])

    def _places(self, lengths: list[int]) -> tuple[tuple[int, int], ...] | None:
        """Room for so many bytes each; None where there is not enough."""
        with self._used.get_lock():
            place, places = self._used.value, []
            for length in lengths:
                places.append((place, length))
                place += -(-length // ALIGNED) * ALIGNED
            if place > len(self._memory):
                return None
            self._used.value = place
        return tuple(places)
