"""Lets a resident process (``warp-cloth resident``) do the work of a command, where one is there; imports nothing slow.

It is found by its socket in the user's cache folder, whose name is a digest of all that a process is bound to: code,
Python, packages, and the variables of its environment that are read once. A resident of other code is never met.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import socket
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_cloth.base.clock import IMPORTED, seconds_before
from warp_cloth.base.first_run import cache_folder, warp_config

SERVED = "fit"  # the command
ALONE = ("--verbose", "--help")  # options that change the process, or need none
PREFIX, ENDING = "resident-", ".socket"
PATIENCE = 1.0  # [s] for a resident's greeting: one that has work to do gives none
READY = b"r"  # its greeting
LENGTH = 4  # bytes that state how long the request is
INTERRUPTED = 130  # exit status of a command that was interrupted, where its resident gives none
# Beginnings of the names of variables that libraries read when they are imported, or that processes share.
BOUND = (
    *("CUDA", "HOME", "LANG", "LC_", "LD_", "MALLOC", "MKL", "NVIDIA", "OMP", "OPENBLAS"),
    *("PXR", "PYTHON", "TZ", "USD", "WARP", "XDG_CACHE"),
)


def answered(arguments: Sequence[str]) -> int | None:
    """The exit status of a command that a resident has run here; None: it is to be run by this process.

    Args:
        arguments: ``sys.argv``.
    """
    if list(arguments[1:2]) != [SERVED] or set(ALONE) & set(arguments):
        return None
    folder = cache_folder()
    with contextlib.suppress(OSError):  # there is no folder, nobody listens there, or it was killed
        if folder is not None and any(name.endswith(ENDING) for name in os.listdir(folder)):
            place = resident_place()  # which takes some milliseconds
            return None if place is None else _asked(place, json.dumps(_request(arguments)).encode())
    return None


def resident_place() -> Path | None:
    """The socket of a resident like this process; None: the system or the user's cache has no place for one."""
    folder = cache_folder()
    if folder is None or sys.platform != "linux":
        return None
    own = Path(__file__).resolve().parent.parent
    sources = [own, *([] if (own / "kernels").is_dir() else [own.parent / "kernels", own.parent / "scenes"])]
    walks = [walk for each in sources for walk in os.walk(each) if not walk[0].endswith("__pycache__")]
    files = [json.__file__, *(place for place in sys.path if place.endswith("-packages") and os.path.isdir(place))]
    files += sorted(os.path.join(folder, name) for folder, _, names in walks for name in names)
    parts = [
        [sys.executable, sys.version, os.getuid(), sorted(os.sched_getaffinity(0))],
        os.stat("/proc/self/ns/mnt").st_ino,  # what it sees of the disk: a container sees its own
        sorted((name, value) for name, value in os.environ.items() if name.startswith(BOUND)),
        [(name, status.st_mtime_ns, status.st_size) for name in files for status in [os.stat(name)]],
    ]
    digest = hashlib.blake2b(repr(parts).encode() + warp_config(), digest_size=8).hexdigest()
    place = folder.absolute() / f"{PREFIX}{digest}{ENDING}"
    return place if len(os.fsencode(place)) < 108 else None  # sizeof sun_path, unix(7)


def is_ours(line: socket.socket) -> bool:
    """Whether a process of this user is at the other end."""
    credentials = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)  # three ints: process, user, group
    return int.from_bytes(credentials[4:8], sys.byteorder) == os.getuid()


def _request(arguments: Sequence[str]) -> Mapping[str, Any]:
    """What a resident needs to stand for this process."""
    mask = os.umask(0)
    os.umask(mask)
    return {
        "arguments": list(arguments),
        "folder": os.getcwd(),
        "environment": dict(os.environ),
        "mask": mask,
        "began": [IMPORTED, seconds_before(IMPORTED)],
    }


def _asked(place: Path, request: bytes) -> int | None:
    """The exit status that a resident answers a request with; None: it has other work, or was killed.

    It writes to this process's output itself. Where this process ends or is interrupted, so is the work.

    Raises:
        OSError: there is none.
    """
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(PATIENCE)
        line.connect(str(place))
        if not is_ours(line) or line.recv(1) != READY:
            return None
        socket.send_fds(line, [len(request).to_bytes(LENGTH, "big")], [1, 2])
        try:
            line.sendall(request)
            line.settimeout(None)
            status = line.recv(1)
        except KeyboardInterrupt:
            line.shutdown(socket.SHUT_WR)
            status = line.recv(1) or bytes([INTERRUPTED])
    return status[0] if status else None
