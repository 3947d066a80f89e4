"""Shows a running batch on a terminal, or as lines of a log file, and its summary."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from warp_cloth.base.progress_line import ProgressLine
from warp_cloth.batch.run import BatchProgress, BatchReport
from warp_cloth.loading.raw import counted
from warp_cloth.report.rows import row

MOST_REASONS = 3  # shown of the items without result, the most frequent


class BatchDisplay(ProgressLine):
    """The progress of a batch."""

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

    def __call__(self, progress: BatchProgress) -> None:
        shown = figures(progress)
        if self._console.is_terminal:
            self._bar.update(self._task, total=progress.items, completed=progress.done, figures=shown)
            return
        if self._line_due(at_once=progress.done == progress.items):
            line = f"fitted {progress.done}/{progress.items} {shown}".rstrip()
            left = time_left(progress)
            if left:
                line += f"  {left} left"
            self._write(line)


def figures(progress: BatchProgress) -> str:
    """Items per second and items without a result; what is not known yet is left out."""
    parts = []
    if progress.items_per_second is not None:
        parts.append(f"{progress.items_per_second:.3g}/s")
    if progress.problems:
        parts.append(f"{progress.problems} failed")
    return "  ".join(parts)


def time_left(progress: BatchProgress) -> str:
    """Estimated time for the remaining items, at the speed so far."""
    if progress.items_per_second is None or progress.done == progress.items:
        return ""
    seconds = round((progress.items - progress.done) / progress.items_per_second)
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def summary(report: BatchReport) -> list[str]:
    """The last lines of a batch."""
    counts = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in sorted(report.statuses.items()))
    items = report.progress.items
    lines = [f"{items} item{'s' * (items != 1)} in {report.progress.seconds:.3g} s: {counts}"]
    if report.worn < items:
        found = ", ".join(f"{count} {code}" for code, count in report.problems.items())
        lines.append(row("worn", f"{report.worn} of {items}" + (f"; problems: {found}" if found else "")))
    for reason, names in list(report.reasons.items())[:MOST_REASONS]:
        more = f" and {len(names) - 1:,} more" if len(names) > 1 else ""
        said = reason.removeprefix(f"{names[0]}: ")
        lines.append(row("no result", f"{names[0]}{more}: {said}"))
    if len(report.reasons) > MOST_REASONS:
        others = len(report.reasons) - MOST_REASONS
        lines.append(f"  and {counted(others, 'more reason')}, in the column message")
    sheet = f", {report.sheet.name}" if report.sheet is not None else ""
    lines.append(row("wrote", f"{report.folder / 'results.parquet'}, results.csv{sheet}"))
    for reason, count in report.unwritten.items():
        lines.append(f"  {counted(count, 'item')} not done: {reason}; run the same command again to continue")
    return lines
