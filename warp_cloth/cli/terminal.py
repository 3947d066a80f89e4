"""Error handling of every command: bad input and interrupts end it with one line, and leave no empty folders."""

from __future__ import annotations

import _thread
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from warp_cloth.base.errors import InputError

BAD_INPUT = 2  # exit status
RESEND_DELAY = 0.01  # [s] after an interrupt that would be lost: by then the object is freed
INTERRUPTED = 130  # exit status of a shell's Ctrl-C


def keep_interrupts() -> None:
    """Sends an interrupt again that comes while Python frees an object: Python would only print it."""
    usual = sys.unraisablehook

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            threading.Timer(RESEND_DELAY, _thread.interrupt_main).start()
        else:
            usual(lost)

    sys.unraisablehook = hook


def print_error(sentence: str) -> None:
    """One line: no markup, no wrapping, nothing that moves a terminal's cursor."""
    line = "".join(letter if letter.isprintable() else "?" for letter in " ".join(sentence.split()))
    print(f"error: {line}", file=sys.stderr)


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Ends the command with one plain line on bad input and on an interrupt, never with a traceback."""
    try:
        yield
    except InputError as error:
        print_error(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@contextmanager
def output_folder(folder: Path, name: str) -> Iterator[None]:
    """Checks before the work that its result can be written; removes new folders if nothing was written."""
    from warp_cloth.export.report import check_writable

    created = [place for place in (folder, *folder.parents) if not os.path.exists(place)]  # innermost first
    check_writable(folder, name)
    try:
        yield
    except BaseException:
        for place in created:
            if place.is_dir() and not any(place.iterdir()):
                place.rmdir()
        raise
