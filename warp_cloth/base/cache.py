"""A cache of derived data, keyed by the objects that it was derived from, for problems built one after another."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from warp_cloth.base.threads import map_in_threads

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class _Entry:
    value: Any
    sources: Sequence[Any]  # referenced here, so that no other object can get the same id() and thus the same key
    size: int  # of its device memory [bytes]


class Cache:
    """Values derived from immutable objects and hashable parameters, each derived once.

    Values in host memory stay as long as the cache. Values in device memory are evicted, least recently used first,
    beyond ``limit`` [bytes]; see ``evict_except``.
    """

    def __init__(self, limit: int = 0) -> None:
        self.limit = limit
        self._entries: dict[Hashable, _Entry] = {}

    @staticmethod
    def key(name: str, sources: Sequence[Any], *parameters: Hashable) -> Hashable:
        """The key of a value called ``name``: sources count by identity, parameters by value."""
        return name, *map(id, sources), *parameters

    def get_or_make(
        self,
        name: str,
        sources: Sequence[Any],
        make: Callable[[], T],
        *parameters: Hashable,
        size: Callable[[T], int] = lambda _: 0,
    ) -> T:
        """The cached value, or that of ``make()``, which is then cached; ``size`` is its device memory [bytes]."""
        key = self.key(name, sources, *parameters)
        entry = self._entries.pop(key, None)
        if entry is None:
            new = self._derive(name, sources, make, parameters)
            entry = _Entry(new, tuple(sources), size(new))
        self._entries[key] = entry  # at the end: most recently used
        value: T = entry.value
        return value

    def _derive(self, name: str, sources: Sequence[Any], make: Callable[[], T], parameters: tuple[Hashable, ...]) -> T:
        """A value that is not cached yet; a subclass may look for it elsewhere first."""
        return make()

    def get_or_make_each(
        self, name: str, sources: Sequence[tuple[Any, ...]], make: Callable[..., T], *parameters: Hashable
    ) -> list[T]:
        """``get_or_make`` for each tuple of sources, in order; missing values are ``make(*sources)``, in threads."""
        missing = {self.key(name, own, *parameters): own for own in sources}
        missing = {key: own for key, own in missing.items() if key not in self._entries}
        values = map_in_threads(lambda own: make(*own), missing.values())
        for key, own, value in zip(missing, missing.values(), values, strict=True):
            self._entries[key] = _Entry(value, own, 0)
        return [self._entries[self.key(name, own, *parameters)].value for own in sources]

    def portable_entries(self) -> dict[Hashable, Any]:
        """Values without source objects, by key: those that another process can cache, too."""
        return {key: entry.value for key, entry in self._entries.items() if not entry.sources}

    def add_entries(self, portable: Mapping[Any, Any]) -> None:
        """Adds another process's ``portable_entries``; an entry that is here already stays."""
        self._entries = {**{key: _Entry(value, (), 0) for key, value in portable.items()}, **self._entries}

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self._entries)

    def __contains__(self, key: Hashable) -> bool:
        return key in self._entries

    def evict_except(self, needed: set[Hashable]) -> None:
        """Frees device memory beyond the limit, least recently used first; ``needed`` keys stay and do not count."""
        spare = [key for key, entry in self._entries.items() if entry.size and key not in needed]
        total = sum(self._entries[key].size for key in spare)
        for key in spare:
            if total <= self.limit:
                return
            total -= self._entries.pop(key).size
