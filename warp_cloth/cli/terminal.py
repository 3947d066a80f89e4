"""What every command does alike: bad input and an interrupt end it with one line, and leave no empty folders."""

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
SENT_AGAIN = 0.01  # [s] after an interrupt that would be lost: by then the object is freed
INTERRUPTED = 130  # exit status of a shell's Ctrl-C


def keep_interrupts() -> None:
    """An interrupt that comes while Python frees an object would only be told of and lost: it is sent again."""
    usual = sys.unraisablehook

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            threading.Timer(SENT_AGAIN, _thread.interrupt_main).start()
        else:
            usual(lost)

    sys.unraisablehook = hook


def tell_error(sentence: str) -> None:
    """One line: no markup, no wrapping, nothing that moves a terminal's cursor."""
    told = "".join(letter if letter.isprintable() else "?" for letter in " ".join(sentence.split()))
    print(f"error: {told}", file=sys.stderr)


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Bad input and an interrupt end the command with one plain line, never with a traceback."""
    try:
        yield
    except InputError as error:
        tell_error(str(error))
        raise typer.Exit(BAD_INPUT) from None
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


@contextmanager
def output_folder(folder: Path, name: str) -> Iterator[None]:
    """Know before the work that its result can be written; take new folders back if nothing comes of it."""
    from warp_cloth.export.report import check_writable

    made = [place for place in (folder, *folder.parents) if not os.path.exists(place)]  # innermost first
    check_writable(folder, name)
    try:
        yield
    except BaseException:
        for place in made:
            if place.is_dir() and not any(place.iterdir()):
                place.rmdir()
        raise
