"""The exceptions for bad input and for output that cannot be written, each with a one-line message."""

from __future__ import annotations

from pathlib import Path

OVERRIDE = "override "  # begins a place that is one; the command line says --set, a batch the column


class InputError(Exception):
    """Bad input, described in one line: "place: problem; remedy".

    ``place`` is a file, with a line number, prim path or scene key where known. The command line prints the line and
    exits with status 2.
    """

    def __init__(self, place: str | Path, problem: str, remedy: str = "") -> None:
        self.place = str(place)
        self.problem = problem
        self.remedy = remedy
        sentence = f"{self.place}: {problem}" + (f"; {remedy}" if remedy else "")
        super().__init__(" ".join(sentence.split()))


class OutputError(InputError):
    """A file or folder that cannot be written."""
