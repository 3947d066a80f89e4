"""Starting Warp, and suppressing console output of Warp and USD."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, redirect_stderr

from warp_cloth.base.errors import OutputError
from warp_cloth.base.kernel_hashes import share_hashes


@contextmanager
def keeping_kernels() -> Iterator[None]:
    """For code that starts Warp or compiles kernels, which Warp caches on disk.

    Raises:
        OutputError: the cache folder cannot be written.
    """
    import warp

    try:
        yield
    except OSError as error:
        place = error.filename or warp.config.kernel_cache_dir or "Warp's folder"
        problem = f"compiled kernels cannot be stored there ({error.strerror or error})"
        raise OutputError(place, problem, "free some space, or set WARP_CACHE_PATH to a writable folder") from None


def init_warp() -> None:
    """Starts Warp, once per process; its messages about devices and modules are shown where Python logs at INFO.

    Raises:
        OutputError: Warp's folder of compiled kernels cannot be written.
    """
    import warp

    from warp_cloth.base.compilers import share_compilers

    heard = logging.getLogger("warp_cloth").isEnabledFor(logging.INFO) or warp.config.log_level != warp.LOG_INFO
    if not heard:
        warp.config.log_level = warp.LOG_WARNING
    with keeping_kernels(), nullcontext() if heard else _silenced_stderr():
        warp.init()
    share_hashes()
    share_compilers()


def start_warp(verbose: bool = False) -> None:
    """Starts Warp, without its messages unless ``verbose``."""
    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    init_warp()


@contextmanager
def quiet_usd() -> Iterator[None]:
    """Suppresses USD's warnings: those that matter become InputError or notes."""
    from pxr import UsdUtils

    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        delegate.TakeUncoalescedDiagnostics()


def usd_sentence(text: str) -> str:
    """The first sentence of a USD error, without the positions in USD's source."""
    said = re.findall(r" : '(.*?)'\s*(?:$|\n\s*Error in)", text, flags=re.DOTALL)
    return " ".join((said[0] if said else text).split())[:160]


@contextmanager
def _silenced_stderr() -> Iterator[None]:
    """Discards standard error, also of native code: Warp reports there that a machine has no GPU."""
    with open(os.devnull, "w") as nowhere, redirect_stderr(nowhere):
        try:
            saved = os.dup(2)
        except OSError:  # no standard error
            yield
            return
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)
