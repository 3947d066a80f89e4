"""Processes that others start end with them, and not before."""

from __future__ import annotations

import subprocess
import sys
from multiprocessing import resource_tracker

from warp_cloth.batch.lifeline import sigint_blocked

ASK = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"


def hears_nothing() -> bool:
    """Whether a process that is started now would not be told of an interrupt."""
    told = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, check=True).stdout
    return told.strip() == "True"


def test_what_is_started_uninterrupted_hears_of_no_interrupt_and_what_comes_later_does() -> None:
    before = hears_nothing()
    with sigint_blocked():
        resource_tracker.ensure_running()  # as multiprocessing asks for before it starts a process
        assert hears_nothing()
    assert hears_nothing() == before
