"""What the command line says on terminals of 60, 80 and 120 columns: help in full, lines that fit, one-line errors."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from warp_cloth.cli.main import app
from warp_cloth.report.rows import INDENT, folded, row

WIDTHS = (60, 80, 120)
COMMANDS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
FRAME = re.compile(r"[│╭╮╰╯─]")
SHORT = 12  # letters of words that no column breaks


def shown(*words: str, width: int) -> str:
    result = CliRunner().invoke(app, words, env={"COLUMNS": str(width), "TERMINAL_WIDTH": str(width)})
    assert result.exit_code == 0, result.output
    return result.output


def told(command: str) -> Iterator[str]:
    """The words of all help texts of a command."""
    found = typer.main.get_command(app).commands[command]  # type: ignore[attr-defined]
    for text in (found.help, *(getattr(each, "help", "") for each in found.params)):
        yield from (text or "").replace("\b", "").split()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_shown_in_full_and_fits(command: str, width: int) -> None:
    """Among others a unit in square brackets would be swallowed, as markup of the terminal."""
    text = shown(command, "--help", width=width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    joined = "".join(FRAME.sub("", text).split())
    lost = [word for word in told(command) if len(word) <= SHORT and word not in joined]
    assert not lost


@pytest.mark.parametrize("width", WIDTHS)
def test_all_commands_are_listed(width: int) -> None:
    text = shown("--help", width=width)
    assert max(map(len, text.splitlines())) <= width
    assert all(re.search(rf"│ {command} ", text) for command in COMMANDS)


@pytest.mark.parametrize("width", WIDTHS)
def test_an_error_is_one_line_that_the_terminal_wraps(width: int, tmp_path: Path) -> None:
    """Not wrapped by the program: it can be copied and searched for."""
    words = ["fit", "tshirt", "--fabric", "denimm", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, words, env={"COLUMNS": str(width)})
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert 'did you mean "denim"' in result.stderr


def test_examples_in_help_stand_on_lines_of_their_own() -> None:
    lines = [line.strip() for line in shown("fit", "--help", width=80).splitlines()]
    assert "warp-cloth fit shirt.obj --on body.obj --fabric jersey" in lines


@pytest.mark.parametrize("width", WIDTHS)
def test_lines_on_a_terminal_go_on_below_their_text(width: int) -> None:
    text = "shirt: units not stated: centimetres assumed, as the largest extent is 74.02 (if it is in inches, say so)"
    first, *others = folded(row("note", text), width)
    assert all(len(line) <= width for line in (first, *others))
    assert all(line[:INDENT].isspace() for line in others)
    assert " ".join([first[INDENT:], *map(str.strip, others)]) == text


def test_names_of_files_can_be_copied_from_a_terminal() -> None:
    line = row("wrote", "a folder/" + 80 * "x" + ".usdc")
    assert folded(line, 60) == [line]
