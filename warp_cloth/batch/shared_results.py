"""Results that loader processes share, of all workers of a batch: files that are complete or absent."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import pickle
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from warp_cloth.base.cache import Cache

T = TypeVar("T")

LOOKS, LOOK = 50, 0.002  # times, and seconds apart, that a lock's holder is asked for its priority
MOST_BYTES = 1 << 30  # in a folder, or a little more: results for the same panels are needed soon, or never


def write_shared(file: Path, result: Any) -> None:
    """Writes a result; where that fails, or the folder is full, others compute it themselves."""
    part = file.with_name(f"{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        if _bytes_in(file.parent) > MOST_BYTES:
            return
        with part.open("wb") as out:
            pickle.dump(result, out, protocol=5)
        part.replace(file)


def read_shared(file: Path) -> Any:
    """The result written there; None: none yet, or none that can be read."""
    with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError), file.open("rb") as stored:
        return pickle.load(stored)
    return None


def get_or_make_shared(file: Path, make: Callable[[], T]) -> T:
    """The result written there, or made now and written; waits while another process makes it.

    It does not wait for a process of lower priority (os.nice), which may wait for a core itself, but makes it too.
    """
    found: T | None = read_shared(file)
    if found is None:
        with _locked(file):
            found = read_shared(file)
            if found is None:
                found = make()
                write_shared(file, found)
    return found


@contextlib.contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Holds the lock to make a file; it ends with the process at the latest."""
    try:
        lock = os.open(file.with_name(f"{file.name}.lock"), os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:  # no locks can be made there
        yield
        return
    try:
        _take_lock(lock)
        yield
    finally:
        os.close(lock)


def _take_lock(lock: int) -> None:
    """Waits for a lock; returns without it where a process of lower priority holds it."""
    own = os.nice(0)
    with contextlib.suppress(OSError):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = _holders_priority(lock)
            if holder is None or holder > own:
                return
            fcntl.flock(lock, fcntl.LOCK_EX)
        os.pwrite(lock, b"%4d" % own, 0)


def _holders_priority(lock: int) -> int | None:
    """The priority (os.nice) that a lock's holder writes as soon as it has it; None: it does not."""
    for _ in range(LOOKS):
        if written := os.pread(lock, 4, 0):
            return int(written)
        time.sleep(LOOK)
    return None


class SharedCache(Cache):
    """A cache whose values without source objects (what shapes are drafted from) are shared by files in a folder.

    A file's name is the hash of the parameters' repr, which for dataclasses of numbers is exact to the last bit.
    """

    def __init__(self, folder: Path | None) -> None:
        super().__init__()
        self._folder = folder

    def _derive(self, name: str, sources: Sequence[Any], make: Callable[[], T], parameters: tuple[Hashable, ...]) -> T:
        if sources or self._folder is None:
            return make()
        file = self._folder / hashlib.sha256(repr((name, parameters)).encode()).hexdigest()
        return get_or_make_shared(file, make)


def _bytes_in(folder: Path) -> int:
    """Bytes of a folder's files, except those renamed at this moment."""
    total = 0
    for each in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            total += each.stat().st_size
    return total
