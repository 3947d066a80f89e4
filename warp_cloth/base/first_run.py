"""Whether this machine has the kernels already. Imports nothing slow: a command asks before all else.

A file in the user's cache folder says so, for this package's kernels and this Warp; the first fit puts it there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import sys
from importlib.util import find_spec
from pathlib import Path

FOLDER = "WARP_CLOTH_CACHE"  # environment variable: another cache folder, or "off"
OFF = ("off", "0", "no", "none", "false")
GPU_FILES = ("/dev/nvidiactl", "/dev/dxg")  # one is there if the system has a GPU for CUDA: under Linux, or in WSL
FIRST_RUN = "compiling kernels: first run on this machine, about half a minute"


def cache_folder() -> Path | None:
    """Where this user's caches are; None: nowhere."""
    named = os.environ.get(FOLDER, "")
    if named:
        return None if named.lower() in OFF else Path(named)
    try:
        if sys.platform == "win32":
            base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
        elif sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:  # a user without a home
        return None
    return base / "warp_cloth" if base.is_absolute() else None


def kernels_known(device: str | None) -> bool:
    """Whether a fit on this device ("cpu", "cuda:0"; None: the one that Warp prefers) has left its kernels here."""
    mark = _mark(device)
    try:
        return mark is not None and any(Path(mark.read_text(encoding="utf-8")).iterdir())
    except (OSError, ValueError):
        return False


def note_kernels(device: str, folder: str) -> None:
    """Notes that Warp's ``folder`` has the kernels of a device, if that can be written."""
    mark = _mark(device)
    if mark is not None and not kernels_known(device):
        with contextlib.suppress(OSError):
            mark.parent.mkdir(parents=True, exist_ok=True)
            mark.write_text(folder, encoding="utf-8")


def is_first_run(device: str | None) -> bool:
    """Whether kernels are surely still to be compiled: they are not known, and would be if they were there."""
    mark = _mark(device)
    if mark is None or kernels_known(device):
        return False
    there = next((place for place in (mark.parent, *mark.parents) if place.exists()), None)
    return there is not None and there.is_dir() and os.access(there, os.W_OK)


def _mark(device: str | None) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    has_gpu = any(map(os.path.exists, GPU_FILES))
    kind = device.partition(":")[0] if device else "cuda" if has_gpu else "cpu"
    if kind not in ("cpu", "cuda") or (kind == "cuda" and not has_gpu):  # no device, as a command will say
        return None
    return folder / f"kernels-{kind}-{_kernels_version(os.environ.get('WARP_CACHE_PATH', ''))}"


@functools.cache
def warp_config() -> bytes:
    """The file of Warp's settings as it is installed, which states its version; Warp is not imported."""
    warp = find_spec("warp")
    if warp is not None and warp.origin is not None:
        with contextlib.suppress(OSError):
            return Path(warp.origin).with_name("config.py").read_bytes()
    return b""


@functools.cache
def _kernels_version(warp_folder: str) -> str:
    """A digest of the kernels' source, of Warp's version and of where it keeps what it compiles."""
    digest = hashlib.blake2b(repr([warp_folder, sys.version]).encode(), digest_size=16)
    digest.update(warp_config())
    own = Path(__file__).resolve().parent.parent
    kernels = own / "kernels"
    for path in sorted((kernels if kernels.is_dir() else own.parent / "kernels").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
