"""Error handling of every command: bad input and interrupts end it with one line, and leave no empty folders."""

from __future__ import annotations

import _thread
import os
import re
import shlex
import shutil
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

import typer

from warp_cloth.base.errors import OVERRIDE, InputError
from warp_cloth.report.rows import folded

BAD_INPUT = 2  # exit status
NOT_WORN = 3  # exit status where something was written that is not worn
OPTIONS = ("device", "keep", "out", "ray", "shard", "sheet", "workers")  # have the names of arguments
NARROWEST = 40  # columns into which lines are folded
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


def can_plot(wanted: bool) -> bool:
    """Whether plots are wanted and can be drawn; says how to have them where the package for them is missing."""
    from warp_cloth.export.plots import figure_class

    try:
        return wanted and bool(figure_class())
    except InputError as error:
        print(f"no plots: {error}", file=sys.stderr)
        return False


def say(lines: Iterable[str]) -> None:
    """Prints lines: on a terminal no word is cut at its edge; files and other programs get each line as it is."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 0
    for line in lines:
        typer.echo("\n".join(folded(line, width)) if width >= NARROWEST else line)


def print_error(sentence: str) -> None:
    """One line: no markup, no wrapping, nothing that moves a terminal's cursor."""
    line = "".join(letter if letter.isprintable() else "?" for letter in " ".join(sentence.split()))
    print(f"error: {line}", file=sys.stderr)


def in_flags(error: InputError, arguments: Sequence[str] = ()) -> str:
    """The error in the command line's words: --set for an override, --NAME for these ``arguments`` of a function."""
    place = f"--{error.place}" if error.place in (*OPTIONS, *arguments) else error.place
    sentence = str(InputError(place, error.problem, error.remedy))
    for name in arguments:
        sentence = re.sub(rf'(?<![\w.-]){name}="([^"]*)"', rf"--{name} \1", sentence)
    return re.sub(rf"\b{OVERRIDE}(?=\S)", "--set ", sentence)


@contextmanager
def one_line_errors(*arguments: str) -> Iterator[None]:
    """Ends the command with one plain line on bad input and on an interrupt, never with a traceback.

    ``arguments`` of the functions called are options of the same name.
    """
    try:
        yield
    except InputError as error:
        print_error(in_flags(error, arguments))
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


def made() -> dict[str, str]:
    """The command that was typed, and date and time here, as reports state them."""
    date = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    return {"command": shlex.join(["warp-cloth", *sys.argv[1:]]), "date": date}
