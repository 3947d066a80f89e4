"""Warp and USD without their messages on the screen."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr


def start_warp(verbose: bool = False) -> None:
    """Start Warp, its messages of start-up and of modules kept off the screen unless they are wanted."""
    import warp

    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
        warp.init()
        return
    warp.config.log_level = warp.LOG_WARNING
    with _silenced_stderr():
        warp.init()


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
