"""What one helper has worked out, for others and those of other workers: files that are whole or not there."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from warp_cloth.base.cache import Cache

T = TypeVar("T")

MOST = 1 << 30  # [bytes] that a folder holds, or a little more: what has the same panels comes soon, or not at all


def keep_in(file: Path, thing: Any) -> None:
    """Keeps something there; where that cannot be, or the folder is full, others work it out for themselves."""
    part = file.with_name(f"{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        if _held(file.parent) > MOST:
            return
        with part.open("wb") as out:
            pickle.dump(thing, out, protocol=5)
        part.replace(file)


def kept_in(file: Path) -> Any:
    """What was kept there; None: nothing yet, or nothing that can be read."""
    with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError), file.open("rb") as kept:
        return pickle.load(kept)
    return None


def once_for_all(file: Path, make: Callable[[], T]) -> T:
    """What was kept there, or is made now, and kept; who comes while another one makes it waits for that.

    Unless that one gives way to it (os.nice): then it makes it, too, rather than wait for who waits for it.
    """
    found: T | None = kept_in(file)
    if found is None:
        with _claimed(file):
            found = kept_in(file)
            if found is None:
                found = make()
                keep_in(file, found)
    return found


@contextlib.contextmanager
def _claimed(file: Path) -> Iterator[None]:
    """Has a claim to make a file, if nobody else has, or once that one's has ended, with its process at the latest."""
    try:
        claim = os.open(file.with_name(f"{file.name}.claim"), os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:  # no claims can be made there
        yield
        return
    try:
        _claim(claim)
        yield
    finally:
        os.close(claim)


def _claim(claim: int) -> None:
    """Waits for a claim, or goes without."""
    own = os.nice(0)
    with contextlib.suppress(OSError):
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            told = os.pread(claim, 4, 0)
            if not told or int(told) > own:
                return
            fcntl.flock(claim, fcntl.LOCK_EX)
        os.pwrite(claim, b"%4d" % own, 0)


class Drafts(Cache):
    """A cache of what shapes are drafted from; values without source objects are shared through files in a folder.

    A file's name is the hash of the parameters' repr, which for dataclasses of numbers is exact to the last bit.
    """

    def __init__(self, folder: Path | None) -> None:
        super().__init__()
        self._folder = folder

    def get_or_make(
        self,
        name: str,
        sources: Sequence[Any],
        make: Callable[[], T],
        *parameters: Hashable,
        size: Callable[[T], int] = lambda _: 0,
    ) -> T:
        folder = self._folder
        if sources or folder is None:
            return super().get_or_make(name, sources, make, *parameters, size=size)

        file = folder / hashlib.sha256(repr((name, parameters)).encode()).hexdigest()
        return super().get_or_make(name, sources, partial(once_for_all, file, make), *parameters, size=size)


def _held(folder: Path) -> int:
    """Bytes of a folder's files, but for those that are renamed at this moment."""
    total = 0
    for each in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            total += each.stat().st_size
    return total
