"""The exception for bad input, and its one-line sentence."""

from __future__ import annotations

from pathlib import Path


class InputError(Exception):
    """Bad input, told in one line: where it is, what is wrong, what to do.

    The command line prints the sentence and exits with 2. ``place`` is the file, with a line number, a prim path or
    a scene key where that is known.
    """

    def __init__(self, place: str | Path, problem: str, remedy: str = "") -> None:
        self.place = str(place)
        self.problem = problem
        self.remedy = remedy
        sentence = f"{self.place}: {problem}" + (f"; {remedy}" if remedy else "")
        super().__init__(" ".join(sentence.split()))


class OutputError(InputError):
    """A place that cannot be written, whatever was to be written there."""
