"""Lines that a command prints below its first one: a label, and what it says."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def row(label: str, text: object) -> str:
    """One such line; the texts of all of them line up."""
    return f"  {label:<12} {text}"


def wrote_rows(paths: Iterable[Path]) -> list[str]:
    """Which files were written."""
    return [row("wrote", path) for path in paths]


def note_rows(notes: Iterable[str]) -> list[str]:
    """What is to be known of a result."""
    return [row("note", note) for note in notes]
