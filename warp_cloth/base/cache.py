"""What set-ups that follow one another share: worked out once, as long as what it was made of is there."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from warp_cloth.base.threads import map_in_threads

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class _Entry:
    made: Any
    of: Sequence[Any]  # kept alive, so that no other object takes its place in the key
    size: int  # of the device's memory [bytes]


class Kept:
    """Keeps what was made of some objects, which never change, for whoever asks for the same again.

    What is of the host stays as long as this; of the device's memory no more than ``limit`` [bytes] is kept beyond
    what is asked for at a time, the latest used.
    """

    def __init__(self, limit: int = 0) -> None:
        self.limit = limit
        self._entries: dict[Hashable, _Entry] = {}

    @staticmethod
    def key(name: str, of: Sequence[Any], *more: Hashable) -> Hashable:
        """Under which something of that name is kept that is made of these objects, and of values besides."""
        return name, *map(id, of), *more

    def once(
        self,
        name: str,
        of: Sequence[Any],
        make: Callable[[], T],
        *more: Hashable,
        size: Callable[[T], int] = lambda _: 0,
    ) -> T:
        """What was made of these objects before, or is made now; ``size`` is what it takes on the device [bytes]."""
        key = self.key(name, of, *more)
        entry = self._entries.pop(key, None)
        if entry is None:
            made = make()
            entry = _Entry(made, tuple(of), size(made))
        self._entries[key] = entry  # last, as the latest used
        found: T = entry.made
        return found

    def each(self, name: str, of: Sequence[tuple[Any, ...]], make: Callable[..., T], *more: Hashable) -> list[T]:
        """What was made of each of these, as ``once``; ``make`` is given the objects, of several ones in threads."""
        missing = {self.key(name, given, *more): given for given in of}
        missing = {key: given for key, given in missing.items() if key not in self._entries}
        made = map_in_threads(lambda given: make(*given), missing.values())
        for key, given, one in zip(missing, missing.values(), made, strict=True):
            self._entries[key] = _Entry(one, given, 0)
        return [self._entries[self.key(name, given, *more)].made for given in of]

    def of_values(self) -> dict[Hashable, Any]:
        """What was made of no object, but of values: what another process may keep, too."""
        return {key: entry.made for key, entry in self._entries.items() if not entry.of}

    def put(self, made: Mapping[Hashable, Any]) -> None:
        """Keeps what was made elsewhere, of values alone, and is not here."""
        self._entries = {**{key: _Entry(each, (), 0) for key, each in made.items()}, **self._entries}

    def __contains__(self, key: Hashable) -> bool:
        return key in self._entries

    def make_room(self, wanted: set[Hashable]) -> None:
        """Lets go of device memory that is not wanted now, the longest unused first, beyond the limit."""
        spare = [key for key, entry in self._entries.items() if entry.size and key not in wanted]
        total = sum(self._entries[key].size for key in spare)
        for key in spare:
            if total <= self.limit:
                return
            total -= self._entries.pop(key).size
