"""Warp and USD without their messages on the screen."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr

from warp_cloth.base.errors import OutputError


@contextmanager
def keeping_kernels() -> Iterator[None]:
    """While Warp is started, or compiles: it keeps compiled kernels in a folder, on disk.

    Raises:
        OutputError: that folder cannot be written.
    """
    import warp

    try:
        yield
    except OSError as error:
        place = error.filename or warp.config.kernel_cache_dir or "Warp's folder"
        problem = f"compiled kernels cannot be kept there ({error.strerror or error})"
        raise OutputError(place, problem, "make room, or set WARP_CACHE_PATH to a folder that can be written") from None


def init_warp() -> None:
    """Starts Warp, unless it is started.

    Raises:
        OutputError: the folder in which it keeps compiled kernels cannot be written.
    """
    import warp

    with keeping_kernels():
        warp.init()


def start_warp(verbose: bool = False) -> None:
    """Start Warp, its messages of start-up and of modules kept off the screen unless they are wanted."""
    import warp

    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
        init_warp()
        return
    warp.config.log_level = warp.LOG_WARNING
    with _silenced_stderr():
        init_warp()


@contextmanager
def quiet_usd() -> Iterator[None]:
    """Keeps USD's warnings off the screen: what counts of them is told as bad input, or noted."""
    from pxr import UsdUtils

    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        delegate.TakeUncoalescedDiagnostics()


def usd_sentence(text: str) -> str:
    """The first sentence in USD's error, which wraps it in the places of its own source."""
    said = re.findall(r" : '(.*?)'\s*(?:$|\n\s*Error in)", text, flags=re.DOTALL)
    return " ".join((said[0] if said else text).split())[:160]


@contextmanager
def _silenced_stderr() -> Iterator[None]:
    """Drop what is written to the error stream, by native code too: Warp says there that a machine has no GPU."""
    with open(os.devnull, "w") as nowhere, redirect_stderr(nowhere):
        try:
            kept = os.dup(2)
        except OSError:  # there is no error stream
            yield
            return
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
