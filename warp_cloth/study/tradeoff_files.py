"""The trade-off as text, CSV, JSON, settings to paste, and plot."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from warp_cloth.export.files import whole_file
from warp_cloth.export.plots import figure_class
from warp_cloth.export.report import write_report
from warp_cloth.study.tradeoff import Measured, Trade

COLUMNS = ("knob", "label", "status", "seconds", "iterations", "rms_mm", "max_mm", "penetration_mm", "strain_off")
COLOURS = {
    "scene": "black", "iterations": "tab:blue", "together": "tab:cyan", "tolerance": "tab:green", "mesh": "tab:brown",
    "pixel": "tab:orange", "collider": "tab:red", "precision": "tab:purple", "method": "tab:olive",
    "cloth contact": "tab:pink",
}  # fmt: skip
LEAST_MM = 1e-3  # lowest error of the plot: below it shapes are the same
CROWDED = 0.10  # decades between two labels on the plot


def trade_lines(trade: Trade) -> list[str]:
    """The trade-off in lines of text."""
    lines = [
        f"{trade.scene} on {trade.device}: {len(trade.measured)} settings tried.",
        f"  reference    {trade.reference}",
        f"  scatter      {trade.scatter_mm:.2g} mm rms between two references of equal tolerance: "
        "errors below that mean nothing",
        f"  {'seconds':>8} {'rms mm':>8} {'max mm':>8}  Pareto front of time and error",
    ]
    for trial in trade.front:
        lines.append(f"  {trial.seconds:>8.3g} {trial.rms_mm:>8.3g} {trial.max_mm:>8.3g}  {trial.label}")
    return [*lines, *advice(trade)]


def advice(trade: Trade) -> list[str]:
    """The cheapest settings within the wanted error, or how close the trials came."""
    found = trade.cheapest
    if found is None:
        closest = min((trial.rms_mm for trial in trade.measured if trial.known), default=float("nan"))
        lines = [f"  Nothing tried comes within {trade.within_mm:g} mm; the closest is {closest:.3g} mm."]
    else:
        lines = [
            f"  Within {trade.within_mm:g} mm: {found.label}, {found.rms_mm:.3g} mm rms in {found.seconds:.3g} s "
            "(in a second run).",
            f"  {set_line(found)}".rstrip(),
        ]
    if trade.scatter_mm > trade.within_mm:
        lines.append(
            f"  Rest shapes of this scene lie {trade.scatter_mm:.2g} mm apart by themselves (with friction there "
            "are many): the error shows how settings change its folds, not which folds are right."
        )
        if found is None:
            digit = 10.0 ** math.floor(math.log10(trade.scatter_mm))
            lines.append(f"  Choose no less than that: --within {math.ceil(trade.scatter_mm / digit) * digit:g}mm.")
    if not trade.reference_rests:
        lines.append("  The reference is not at rest: errors show how settings change an unfinished fit.")
    return lines


def set_line(found: Measured) -> str:
    """The settings as options of ``warp-cloth fit``."""
    return " ".join(f"--set {key}={value}" for key, value in found.settings.items())


def snippet(trade: Trade) -> str:
    """The recommended settings as lines of a scene file, table by table."""
    found = trade.cheapest
    if found is None:
        return f"# nothing tried comes within {trade.within_mm:g} mm\n"
    text = f"# within {trade.within_mm:g} mm of the reference: {found.rms_mm:.3g} mm rms, {found.seconds:.3g} s\n"
    text += f"# {set_line(found) or 'the scene as it is'}\n"
    tables: dict[str, list[str]] = {}
    for key, value in found.settings.items():
        table, _, name = key.rpartition(".")
        tables.setdefault(table, []).append(f"{name} = {_toml(value)}\n")
    for table, rows in tables.items():
        inner = "" if not table.startswith("garment") else "# in the garment's shape: "
        text += "".join(inner + row for row in rows) if inner else f"[{table}]\n" + "".join(rows)
    return text


def _toml(value: str) -> str:
    try:
        json.loads(value)
    except ValueError:
        return json.dumps(value)
    return value


def save_trade(trade: Trade, folder: Path, *, plots: bool = True) -> list[Path]:
    """Writes NAME_tradeoff.json, .csv, .toml and, where matplotlib is there, .png into a folder.

    Raises:
        InputError: the folder cannot be written, or ``plots`` are wanted and cannot be drawn.
    """
    paths = [folder / f"{trade.scene}_tradeoff{end}" for end in (".json", ".csv", ".toml")]
    write_report(paths[0], asdict(trade))
    for path, text in ((paths[1], _csv(trade.measured)), (paths[2], snippet(trade))):
        with whole_file(path) as place:
            place.write_text(text, encoding="utf-8")
    if plots:
        paths.append(folder / f"{trade.scene}_tradeoff.png")
        _plot(paths[-1], trade)
    return paths


def _csv(measured: Sequence[Measured]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*COLUMNS, "settings"])
    for trial in measured:
        rows.writerow([*(getattr(trial, column) for column in COLUMNS), set_line(trial)])
    return text.getvalue()


def _plot(path: Path, trade: Trade) -> None:
    """Error against seconds, a point for each setting, a line along the Pareto front."""
    from matplotlib.ticker import LogLocator

    figure = figure_class()(figsize=(9, 5.5), layout="constrained")
    axes = figure.subplots()
    known = [trial for trial in trade.measured if trial.known]
    for knob, colour in COLOURS.items():
        own = [trial for trial in known if trial.knob == knob]
        if own:
            x, y = [t.seconds for t in own], [max(t.rms_mm, LEAST_MM) for t in own]
            axes.scatter(x, y, s=36, color=colour, label=knob, zorder=3)
    axes.plot(
        [t.seconds for t in trade.front], [max(t.rms_mm, LEAST_MM) for t in trade.front], color="0.6", linewidth=1
    )
    axes.set(xscale="log", yscale="log", xlabel="seconds", ylabel="distance from the reference [mm, rms]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    first, last = axes.get_xlim()
    axes.xaxis.set_minor_locator(LogLocator(subs=(2, 3, 5) if last > 10.0 * first else (1.2, 1.5, 2, 2.5, 3, 4, 5, 7)))
    axes.xaxis.set_minor_formatter("{x:g}")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.6 * trade.within_mm), max(high, 1.7 * trade.within_mm))
    if trade.scatter_mm > LEAST_MM:
        axes.set_ylim(bottom=min(axes.get_ylim()[0], 0.5 * trade.scatter_mm))
        axes.axhspan(axes.get_ylim()[0], trade.scatter_mm, color="0.92", zorder=0)
        note = "below: closer than two references of equal tolerance"
        axes.annotate(note, (0.005, 0.01), xycoords="axes fraction", va="bottom", fontsize=8, color="0.4")
    axes.axhline(trade.within_mm, color="tab:green", linewidth=1, linestyle="--")
    axes.annotate(
        f"wanted: {trade.within_mm:g} mm", (0.005, trade.within_mm), xycoords=("axes fraction", "data"), va="bottom",
        fontsize=8, color="tab:green",
    )  # fmt: skip
    _name_points(axes, trade)
    title = f"{trade.scene} on {trade.device}: "
    best = trade.cheapest
    title += f"within {trade.within_mm:g} mm in {best.seconds:.2g} s" if best else f"none within {trade.within_mm:g} mm"
    axes.set_title(title, loc="left")
    axes.grid(True, which="both", linewidth=0.3, alpha=0.5)
    figure.legend(fontsize=8, loc="outside right upper")
    with whole_file(path) as place:
        figure.savefig(place, dpi=110)


def _name_points(axes: Any, trade: Trade) -> None:
    """A star on the recommended setting; labels on it and on points with room for one."""
    best = trade.cheapest
    if best is not None:
        axes.scatter(
            [best.seconds], [max(best.rms_mm, LEAST_MM)], s=260, marker="*", color="gold", edgecolor="black", zorder=5
        )
    first_x, last_x = axes.get_xlim()
    taken: list[tuple[float, float]] = []
    first = [best] if best is not None else []
    for trial in [*first, *(t for t in trade.front if t is not best), *(t for t in trade.measured if t.known)]:
        place = (math.log10(max(trial.seconds, 1e-6)), math.log10(max(trial.rms_mm, LEAST_MM)))
        if any(abs(place[0] - x) < 3.0 * CROWDED and abs(place[1] - y) < CROWDED for x, y in taken):
            continue
        taken.append(place)
        right = trial.seconds > first_x**0.4 * last_x**0.6  # the label goes to the left of its point
        name = axes.annotate(
            trial.label, (trial.seconds, max(trial.rms_mm, LEAST_MM)), xytext=(-6 if right else 6, 4),
            textcoords="offset points", ha="right" if right else "left", fontsize=7,
            weight="bold" if trial is best else "normal",
        )  # fmt: skip
        name.set_in_layout(False)  # a long one must not squeeze the plot
