"""Measured figures: rows of the benchmarks in a table, rendered as they stand in it."""

from __future__ import annotations

import argparse
from pathlib import Path

import measured
import pytest


@pytest.fixture
def table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A table and a page of their own."""
    monkeypatch.setattr(measured, "TABLE", tmp_path / "measured.csv")
    monkeypatch.setattr(measured, "PAGE", tmp_path / "README.md")
    monkeypatch.setattr(measured, "hardware", lambda device, cores=0: f"{device} {cores}")
    (tmp_path / "measured.csv").write_text(
        "name,value,unit,hardware,commit,source\nlatency.old,1,s,cpu 0,c1fa2d8,README at c1fa2d8\n"
    )
    (tmp_path / "README.md").write_text("a\n<!-- measured latency -->\n<!-- /measured -->\nb\n")
    return tmp_path


def test_the_page_shows_what_the_table_holds() -> None:
    page = measured.PAGE.read_text(encoding="utf-8")
    assert measured.rendered(page, measured.read()) == page


def test_no_two_rows_have_the_same_name_and_hardware() -> None:
    keys = [row.key for row in measured.read()]
    assert len(set(keys)) == len(keys)


def test_a_script_replaces_its_rows_of_the_same_hardware(table: Path) -> None:
    with measured.Figures("tests/benchmarks/latency.py", argparse.Namespace(write=True)) as figures:
        figures.add("old", 2.0, "s")
        figures.add("new", 123456.0, "us", cores=2)
    rows = {row.name: row for row in measured.read()}
    assert (rows["latency.old"].value, rows["latency.new"].value) == ("2", "123,456")
    assert rows["latency.old"].source.startswith("python tests/benchmarks/latency.py")
    page = (table / "README.md").read_text()
    assert "| old | 2 | s |" in page
    assert "cpu 0, " in page
    assert page.startswith("a\n")
    assert page.endswith("b\n")


def test_nothing_is_written_without_the_option_or_after_an_error(table: Path) -> None:
    before = measured.read()
    with measured.Figures("latency.py", argparse.Namespace(write=False)) as figures:
        figures.add("old", 2.0, "s")
    with pytest.raises(ZeroDivisionError), measured.Figures("latency.py", argparse.Namespace(write=True)) as figures:
        figures.add("old", 1 / 0, "s")
    assert measured.read() == before


def test_rows_without_a_table_on_the_page_are_refused(table: Path) -> None:
    with pytest.raises(ValueError, match="no table for creep"):
        measured.rendered(measured.PAGE.read_text(), [measured.Row("creep.a", "1", "s", "x", "y", "z")])
