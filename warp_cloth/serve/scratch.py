"""The folder for the files of requests. Nothing is left of it, even where a service is killed with its workers."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

MEMORY = Path("/dev/shm")  # files there are never on a disk
LEAST_MEMORY = 1 << 30  # [bytes] free there; containers often have less
PREFIX = "warp_cloth_service_"  # of folders that are locked while their services live


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder in memory where there is room, readable by this user alone; what dead services have left is removed.

    A service holds a lock on its folder, which ends with its process. Process ids would not do: services in several
    containers may share the memory, and not their ids.
    """
    on_disk = Path(tempfile.gettempdir())
    for place in {MEMORY, on_disk}:
        _remove_dead(place)
    roomy = MEMORY.is_dir() and shutil.disk_usage(MEMORY).free >= LEAST_MEMORY
    folder, lock = _locked_folder(MEMORY if roomy else on_disk)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _locked_folder(place: Path) -> tuple[Path, int]:
    """A new folder there, and its lock."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=place))
        with contextlib.suppress(FileNotFoundError):
            lock = os.open(folder, os.O_RDONLY)
            with contextlib.suppress(OSError):  # a file system without locks: nothing is removed there, either
                fcntl.flock(lock, fcntl.LOCK_EX)
            if folder.is_dir():  # no other service has taken it for a dead one's before it was locked
                return folder, lock
            os.close(lock)


def _remove_dead(place: Path) -> None:
    """Removes folders there that no process holds."""
    for folder in place.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # another user's, or gone meanwhile
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)
