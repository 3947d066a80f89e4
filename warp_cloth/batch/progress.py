"""How a running batch looks on a terminal, and in a log file."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from warp_cloth.base.progress_line import ProgressLine
from warp_cloth.batch.drive import BatchReport, Standing
from warp_cloth.loading.raw import counted

MOST_REASONS = 3  # told of the items without result, the commonest


class BatchDisplay(ProgressLine):
    """Shows where a batch stands."""

    def __init__(self, console: Console) -> None:
        columns = (
            TextColumn("fitting"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        super().__init__(console, columns, "fitting")

    def __call__(self, standing: Standing) -> None:
        told = figures(standing)
        if self._console.is_terminal:
            self._bar.update(self._task, total=standing.items, completed=standing.done, figures=told)
            return
        if self._line_due(at_once=standing.done == standing.items):
            line = f"fitted {standing.done}/{standing.items} {told}".rstrip()
            left = time_left(standing)
            if left:
                line += f"  {left} left"
            self._write(line)


def figures(standing: Standing) -> str:
    """Items per second and items without a result; what is not known yet is left out."""
    parts = []
    if standing.items_per_second is not None:
        parts.append(f"{standing.items_per_second:.3g}/s")
    if standing.problems:
        parts.append(f"{standing.problems} failed")
    return "  ".join(parts)


def time_left(standing: Standing) -> str:
    """How long the rest takes at the speed so far."""
    if standing.items_per_second is None or standing.done == standing.items:
        return ""
    seconds = round((standing.items - standing.done) / standing.items_per_second)
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def summary(report: BatchReport) -> list[str]:
    """How a batch ended, in lines."""
    counts = ", ".join(f"{count} {status}" for status, count in sorted(report.statuses.items()))
    items = report.standing.items
    lines = [f"{items} item{'s' * (items != 1)} in {report.standing.seconds:.3g} s: {counts}"]
    lines += [f"  {count} without result: {reason}" for reason, count in list(report.reasons.items())[:MOST_REASONS]]
    if len(report.reasons) > MOST_REASONS:
        more = len(report.reasons) - MOST_REASONS
        lines.append(f"  and {counted(more, 'more reason')}, in the column message")
    lines.append(f"  wrote        {report.folder / 'results.parquet'}, results.csv")
    for reason, count in report.unwritten.items():
        lines.append(f"  {count} items not done: {reason}; start the same command again to do them")
    return lines
