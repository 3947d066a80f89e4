"""What one helper has worked out, for others and those of other workers: files that are whole or not there."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from warp_cloth.kept import Kept

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


class Drafts(Kept):
    """Keeps what shapes are drafted from; what is made of values alone is looked for, and kept, in a common folder.

    Its files are told apart by how those values are written, which dataclasses of numbers do to the last bit.
    """

    def __init__(self, folder: Path | None) -> None:
        super().__init__()
        self._folder = folder

    def once(
        self,
        name: str,
        of: Sequence[Any],
        make: Callable[[], T],
        *more: Hashable,
        size: Callable[[T], int] = lambda _: 0,
    ) -> T:
        folder = self._folder
        if of or folder is None:
            return super().once(name, of, make, *more, size=size)

        def found() -> T:
            file = folder / hashlib.sha256(repr((name, more)).encode()).hexdigest()
            there: T | None = kept_in(file)
            if there is None:
                there = make()
                keep_in(file, there)
            return there

        return super().once(name, of, found, *more, size=size)


def _held(folder: Path) -> int:
    """Bytes of a folder's files, but for those that are renamed at this moment."""
    total = 0
    for each in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            total += each.stat().st_size
    return total
