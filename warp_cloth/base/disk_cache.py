"""A cache on disk of arrays that take long to derive, keyed by the content of what they are derived from.

It never fails: an entry that cannot be read is derived again, one that cannot be written is not kept. Every process may
read and write at any time. ``WARP_CLOTH_CACHE`` names another folder, or is "off".
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import platform
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.first_run import cache_folder, warp_config
from warp_cloth.base.threads import ONE_THREAD

LIMIT = 1 << 29  # [bytes] of all entries: about 50 bodies with their contact fields
LARGEST = 1 / 8  # of that, which an entry may take
LEAST = 1 << 12  # [bytes] that an entry counts at least: what a file takes on most disks
STALE = 3600.0  # [s] after which a file that a killed process left half-written is removed
UNUSED = 30 * 86400.0  # [s] after which an entry that nobody reads is removed
BATCH_SHARE = 0.5  # of the limit
MAGIC = b"warp_cloth cache 1\n"
ENDING, HALF = ".arrays", ".half"
ALIGNED = 64  # [bytes] at a multiple of which each array begins

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Entry:
    """What an entry holds: arrays, and values that JSON knows."""

    arrays: Arrays
    values: Mapping[str, Any]


@dataclass(frozen=True)
class DiskCache:
    """A folder of entries, of ``limit`` bytes at most: beyond, those not used for longest go. No folder: no entries."""

    folder: Path | None
    limit: int = LIMIT
    share: float = 1.0  # of the limit: where entries take more, nothing more is written

    def entry(self, key: str, make: Callable[[], Entry]) -> Entry:
        """The entry of a key, or what ``make`` returns, which is kept."""
        found = self.read(key)
        if found is None:
            found = make()
            self.write(key, found)
        return found

    def read(self, key: str) -> Entry | None:
        """The entry of a key; None: there is none that is whole."""
        if self.folder is None:
            return None
        path = self.folder / f"{key}{ENDING}"
        try:
            data = path.read_bytes()
        except OSError:
            return None
        found = _unpacked(data)
        with contextlib.suppress(OSError):
            if found is None:
                path.unlink()  # else it would be read, and found damaged, every time
            else:
                os.utime(path)  # used now
        return found

    def write(self, key: str, entry: Entry) -> None:
        """Keeps an entry, in one step; nothing happens where that is not possible."""
        if self.folder is None:
            return
        with contextlib.suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            data = _packed(entry)
            if len(data) > LARGEST * self.limit:
                return
            if self.share < 1.0 and len(data) + _bytes_of(_files(self.folder)) > self.share * self.limit:
                return
            handle, half = tempfile.mkstemp(prefix=key[:16], suffix=HALF, dir=self.folder)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                os.replace(half, self.folder / f"{key}{ENDING}")
            except BaseException:
                with contextlib.suppress(OSError):
                    os.unlink(half)
                raise
            self._remove_oldest(self.folder)

    def _remove_oldest(self, folder: Path) -> None:
        """Removes entries beyond the limit, those that nobody uses, and what killed processes left."""
        found, now = list(_files(folder)), time.time()
        total = _bytes_of(found)
        for path, size, used in sorted(found, key=lambda file: file[2]):
            left_over = path.endswith(HALF) and used < now - STALE
            spare = path.endswith(ENDING) and (total > self.limit or used < now - UNUSED)
            if left_over or spare:
                with contextlib.suppress(OSError):
                    os.unlink(path)
                total -= size * path.endswith(ENDING)


def disk_cache() -> DiskCache:
    """The user's cache. Processes of a batch write while there is room: what many bodies need removes nothing."""
    return DiskCache(cache_folder(), share=BATCH_SHARE if ONE_THREAD in os.environ else 1.0)


def key_of(name: str, packages: tuple[str, ...], *parts: Any) -> str:
    """The key of what code of these packages (folders of ``warp_cloth``) derives from these parts.

    Parts are arrays, dataclasses, tuples, and values whose ``repr`` tells all of them.
    """
    digest = hashlib.blake2b(name.encode(), digest_size=20)
    digest.update(code_version(packages).encode())
    _add(digest, parts)
    return f"{name}-{digest.hexdigest()}"


def _add(digest: Any, part: Any) -> None:
    """Feeds a part to the digest, so that different parts never feed the same."""
    if isinstance(part, np.ndarray):
        digest.update(f"array {part.dtype.str} {part.shape} ".encode())
        digest.update(np.ascontiguousarray(part).data)
    elif isinstance(part, tuple | list):
        digest.update(f"tuple {len(part)} ".encode())
        for each in part:
            _add(digest, each)
    elif is_dataclass(part) and not isinstance(part, type):
        digest.update(f"{type(part).__name__} ".encode())
        for each in fields(part):
            _add(digest, getattr(part, each.name))
    else:
        text = repr(part)
        digest.update(f"{type(part).__name__} {len(text)} {text}".encode())


@functools.cache
def code_version(packages: tuple[str, ...]) -> str:
    """A digest of these packages' source, and of what else the bits of their results depend on."""
    machine = [np.__version__, sys.version, platform.machine(), _cpu_features()]
    digest = hashlib.blake2b(repr(machine).encode(), digest_size=20)
    digest.update(warp_config())  # Warp's kernels derive some of them
    for package in packages:
        digest.update(_package_version(package))
    return digest.hexdigest()


@functools.cache
def _package_version(package: str) -> bytes:
    """A digest of a package's source."""
    digest = hashlib.blake2b(package.encode(), digest_size=20)
    own = Path(__file__).resolve().parent.parent
    folder = own / package
    for path in sorted((folder if folder.is_dir() else own.parent / package).glob("*.py")):
        digest.update(f" {path.name} ".encode() + path.read_bytes())
    return digest.digest()


def _cpu_features() -> list[str]:
    """What this processor can do: NumPy chooses its loops by that, and a home folder may serve several machines."""
    try:
        features = import_module("numpy._core._multiarray_umath").__cpu_features__
    except (ImportError, AttributeError):  # an older NumPy, or a newer one
        return []
    return sorted(name for name, there in features.items() if there)


def _files(folder: Path) -> Iterator[tuple[str, int, float]]:
    """Path, size [bytes] and time of last use of every file of the cache."""
    with os.scandir(folder) as found:
        for file in found:
            if file.name.endswith((ENDING, HALF)):
                with contextlib.suppress(OSError):  # another process has removed it
                    status = file.stat()
                    yield file.path, max(status.st_size, LEAST), status.st_mtime


def _bytes_of(files: Iterable[tuple[str, int, float]]) -> int:
    """Bytes of the entries among files."""
    return sum(size for path, size, _ in files if path.endswith(ENDING))


def _packed(entry: Entry) -> bytes:
    """An entry as bytes: what it is, the length of its head, a check sum of all that follows; head; arrays."""
    arrays = {name: np.ascontiguousarray(array) for name, array in entry.arrays.items()}
    layout = {name: [array.dtype.str, array.shape] for name, array in arrays.items()}
    head = json.dumps({"arrays": layout, "values": entry.values}).encode()
    pieces = [_filled_up(head), *(_filled_up(array.tobytes()) for array in arrays.values())]
    body = b"".join(pieces)
    return _filled_up(MAGIC + f"{len(head)} {zlib.crc32(body)}\n".encode()) + body


def _filled_up(data: bytes) -> bytes:
    return data + bytes(-len(data) % ALIGNED)


def _unpacked(data: bytes) -> Entry | None:
    """The entry that bytes hold; None where they are damaged, or of another version."""
    try:
        if not data.startswith(MAGIC):
            return None
        length, check = map(int, data[len(MAGIC) : ALIGNED].split(b"\n")[0].split())
        if zlib.crc32(memoryview(data)[ALIGNED:]) != check:
            return None
        head = json.loads(data[ALIGNED : ALIGNED + length])
        place, arrays = ALIGNED + length + -length % ALIGNED, {}
        for name, (dtype, shape) in head["arrays"].items():
            found = np.frombuffer(data, np.dtype(dtype), int(np.prod(shape)), place).reshape(shape)
            arrays[name] = found.copy()  # which may be written to, as what is derived may
            place += found.nbytes + -found.nbytes % ALIGNED
        return Entry(arrays, head["values"])
    except (ValueError, KeyError, TypeError, UnicodeDecodeError):
        return None
