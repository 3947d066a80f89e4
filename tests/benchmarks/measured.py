"""Measured figures: rows `name value unit hardware commit source` in measured.csv, shown as the tables of README.md.

    python tests/benchmarks/measured.py            # renders the tables of README.md from measured.csv
    python tests/benchmarks/measured.py --check    # fails if they differ

A benchmark script prints its figures through ``Figures``, which with ``--write`` also puts them into measured.csv (a
row of the same name and hardware is replaced) and renders README.md. The first part of a name, up to the first dot, is
the script, and the table that shows it.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

HERE = Path(__file__).parent
TABLE, PAGE = HERE / "measured.csv", HERE / "README.md"
CARRIED = "README at c1fa2d8"  # source of figures that were measured before this table existed
_MARKED = re.compile(r"(<!-- measured (\w+) -->\n).*?(<!-- /measured -->)", re.DOTALL)


@dataclass(frozen=True)
class Row:
    """One measured figure."""

    name: str  # script.case.metric
    value: str
    unit: str
    hardware: str
    commit: str
    source: str  # the command, or CARRIED

    @property
    def key(self) -> tuple[str, str]:
        return self.name, self.hardware


class Figures:
    """The figures of one run of a script: printed as `name value unit`, kept where the script was called with --write.

    Use as a context manager: rows are written when the block ends without an error.
    """

    def __init__(self, script: str, options: argparse.Namespace, *, device: str = "cpu", cores: int = 0) -> None:
        """``script``: its ``__file__``. ``cores``: CPU cores in use where the device is "cpu"; 0: all."""
        self._script, self._write = Path(script).stem, bool(getattr(options, "write", False))
        path = Path(script).resolve()
        self._path = path.relative_to(HERE) if HERE in path.parents else Path(path.name)
        self._device, self._cores, self._rows = device, cores, list[Row]()

    def __enter__(self) -> Figures:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if self._write and kind is None:
            write(self._rows)

    def add(self, name: str, value: float | str, unit: str, *, cores: int | None = None) -> None:
        """Prints a figure and keeps it; ``name`` without the script."""
        shown = value if isinstance(value, str) else f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}"
        print(f"{self._script}.{name} {shown} {unit}", flush=True)
        if self._write:
            used = self._cores if cores is None else cores
            source = " ".join(["python", f"tests/benchmarks/{self._path}", *_arguments()])
            place = hardware(self._device, used)
            self._rows.append(Row(f"{self._script}.{name}", shown, unit, place, commit(), source))


def script_parser(about: str | None, *, device: str | None = None) -> argparse.ArgumentParser:
    """Options of a script: ``--write`` and, where a default is named, ``--device``; ``about``: its ``__doc__``."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    if device is not None:
        parser.add_argument("--device", default=device)
    parser.add_argument("--write", action="store_true", help="put the figures into measured.csv and README.md")
    return parser


def _arguments() -> list[str]:
    return [argument for argument in sys.argv[1:] if argument != "--write"]


def hardware(device: str, cores: int = 0) -> str:
    """The GPU's name, or the processor's and how many of its cores are used."""
    import warp as wp

    if wp.get_device(device).is_cuda:
        return str(wp.get_device(device).name)
    model = "CPU"
    if Path("/proc/cpuinfo").exists():
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
        model = found[1].strip() if found else model
    cores = cores or len(os.sched_getaffinity(0))
    return f"{model}, {cores} core{'s' if cores > 1 else ''}"


def commit() -> str:
    """The commit that is checked out, with "+" where files differ from it."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=HERE, capture_output=True, text=True, check=False).stdout.strip()

    edited = git("status", "--porcelain", "--untracked-files=no", "--", "../../warp_cloth", "../../kernels")
    return git("rev-parse", "--short=7", "HEAD") + ("+" if edited else "")


def read() -> list[Row]:
    """All rows of measured.csv."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        return [Row(**row) for row in csv.DictReader(file)]


def write(new: Sequence[Row]) -> None:
    """Puts rows into measured.csv, in the place of those of the same name and hardware, and renders README.md."""
    rows = {row.key: row for row in read()}
    for row in new:
        rows[row.key] = row
    order = {script: place for place, script in enumerate(dict.fromkeys(_script_of(row) for row in rows.values()))}
    ordered = sorted(rows.values(), key=lambda row: order[_script_of(row)])
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([field.name for field in fields(Row)])
        table.writerows(astuple(row) for row in ordered)
    PAGE.write_text(rendered(PAGE.read_text(encoding="utf-8"), ordered), encoding="utf-8")


def rendered(page: str, rows: Iterable[Row]) -> str:
    """The page with the rows of each script between its markers."""
    tables: dict[str, list[Row]] = {}
    for row in rows:
        tables.setdefault(_script_of(row), []).append(row)

    def table(found: re.Match[str]) -> str:
        return found[1] + table_of(tables.pop(found[2], [])) + found[3]

    page = _MARKED.sub(table, page)
    if tables:
        raise ValueError(f"{PAGE.name} has no table for {', '.join(tables)}: add <!-- measured {min(tables)} -->")
    return page


def table_of(rows: Sequence[Row]) -> str:
    """Rows as Markdown: a table for each command, under a line that says where it ran and at which commit."""
    tables: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        name = row.name.partition(".")[2]
        tables.setdefault((row.hardware, row.commit, row.source), []).append(f"| {name} | {row.value} | {row.unit} |\n")
    return "\n".join(
        _caption(*run) + "| name | value | unit |\n| --- | --: | --- |\n" + "".join(lines)
        for run, lines in tables.items()
    )


def _caption(hardware: str, commit: str, source: str) -> str:
    return f"{hardware}, {source if source == CARRIED else f'{commit}: `{source}`'}\n\n"


def _script_of(row: Row) -> str:
    return row.name.partition(".")[0]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="fail if README.md differs from measured.csv")
    options = parser.parse_args()
    page = PAGE.read_text(encoding="utf-8")
    new = rendered(page, read())
    if options.check:
        return int(new != page)
    PAGE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
