"""Lines that a command prints below its first one: a label, and what it says."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path

LABEL = 12  # letters
INDENT = LABEL + 3  # of texts [columns]
WROTE = "wrote"


def row(label: str, text: object) -> str:
    """One such line; the texts of all of them line up."""
    return f"  {label:<{LABEL}} {text}"


def wrote_rows(paths: Iterable[Path]) -> list[str]:
    """Which files were written."""
    return [row(WROTE, path) for path in paths]


def note_rows(notes: Iterable[str]) -> list[str]:
    """What is to be known of a result."""
    return [row("note", note) for note in notes]


def folded(line: str, width: int) -> list[str]:
    """The line on a terminal so wide: no word is broken, and what goes on does so below its text; files as they are."""
    if len(line) <= width or line.startswith(row(WROTE, "")):
        return [line]
    indent = len(line) - len(line.lstrip()) + 2
    if re.match(rf"  \S.{{{LABEL - 1}}} \S", line):
        indent = INDENT
    return textwrap.wrap(
        line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False, expand_tabs=False
    )
