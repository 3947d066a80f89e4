"""Results of the extremes: a table of outcomes, CSV, and the stability map."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from extremes_study import CAPS, LIMIT, METHODS, SIZES, STIFFNESS, Outcome, theory_cap

from warp_cloth.export.files import whole_file
from warp_cloth.export.plots import figure_class

COLOURS = {"at rest": "#4c9f70", "not at rest": "#f2c14e", "diverged": "#d1495b", "refused": "#9a9a9a"}
ODD = "#000000"  # of what must not happen
PRECISIONS = {"both": "#4c9f70", "mixed": "#5b8fd9", "float32": "#b07cc6", "": "#f2c14e"}  # which come to rest
COLUMNS = (
    "group",
    "name",
    "method",
    "precision",
    "verdict",
    "iterations",
    "seconds",
    "residual",
    "furthest",
    "message",
)


def extremes_lines(found: Sequence[Outcome]) -> list[str]:
    """Counts of verdicts by group and method, then whatever must not happen."""
    lines = []
    for group in dict.fromkeys(outcome.group for outcome in found):
        for method in dict.fromkeys((o.method, o.precision) for o in found if o.group == group):
            own = [o for o in found if o.group == group and (o.method, o.precision) == method]
            counts = Counter(o.verdict for o in own)
            words = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
            lines.append(f"  {group:<20} {' '.join(method):<20} {words}")
    broken = [o for o in found if not o.kept]
    slowest = max(found, key=lambda o: o.seconds)
    words = f"{len(broken)} broke their promise; the slowest took {slowest.seconds:.1f} s ({slowest.name})"
    lines.append(f"{len(found)} runs: {words}.")
    below, resting, above, still = theory_holds(found)
    if below:
        words = f"{resting} of {below} at rest with a cap up to the theory's, {still} of {above} with a larger one"
        lines.append(f"direct: {words}.")
    return lines + [f"  BROKEN {o.name}, {o.method}, {o.precision}: {o.verdict}. {o.message}" for o in broken]


def theory_holds(found: Sequence[Outcome]) -> tuple[int, int, int, int]:
    """Of the direct runs of the map: below the theory's line in all, at rest of them; above it, and at rest of them."""
    runs = [o for o in found if o.group == "map" and o.method == "direct"]
    below = [o for o in runs if o.values["cap"] <= theory_cap(o.values["stiffness"])]
    above = [o for o in runs if o.values["cap"] > theory_cap(o.values["stiffness"])]
    return len(below), _resting(below), len(above), _resting(above)


def _resting(runs: Sequence[Outcome]) -> int:
    return sum(o.verdict == "at rest" for o in runs)


def save_extremes(found: Sequence[Outcome], folder: Path, *, plots: bool = True) -> list[Path]:
    """Writes extremes.csv and, where matplotlib is there and both maps were run, extremes.png.

    Raises:
        InputError: the folder cannot be written, or ``plots`` are wanted and cannot be drawn.
    """
    paths = [folder / "extremes.csv"]
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows([getattr(outcome, column) for column in COLUMNS] for outcome in found)
    with whole_file(paths[0]) as place:
        place.write_text(text.getvalue(), encoding="utf-8")
    if plots and {"map", "precision"} <= {outcome.group for outcome in found}:
        paths.append(folder / "extremes.png")
        _plot(paths[-1], found)
    return paths


def _plot(path: Path, found: Sequence[Outcome]) -> None:
    """Three maps side by side: direct and accelerated over stiffness and cap, precision over stiffness and size."""
    figure = figure_class()(figsize=(13, 4.2), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, method in zip(panels[:2], METHODS, strict=True):
        own = {(o.values["stiffness"], o.values["cap"]): o for o in found if o.group == "map" and o.method == method}
        _squares(axes, own, STIFFNESS, CAPS)
        axes.set(yscale="log", ylabel="cap: largest move an iteration [m]", title=method)
        if method == "direct":
            line = np.array(STIFFNESS)
            axes.plot(line, [theory_cap(k) for k in line], color="black", linewidth=2)
            axes.annotate(
                "theory: rest only below this line", (1e8, 0.3), ha="right", va="center", fontsize=9, weight="bold",
                bbox={"color": "white", "alpha": 0.8},
            )  # fmt: skip
            axes.annotate(
                f"too slow for {LIMIT:,} iterations", (0.6, 2e-7), va="center", fontsize=9,
                bbox={"color": "white", "alpha": 0.8},
            )  # fmt: skip
    axes = panels[2]
    for size in SIZES:
        for stiffness in STIFFNESS:
            runs = {
                o.precision: o.verdict == "at rest"
                for o in found
                if o.group == "precision" and o.values == {"stiffness": stiffness, "size": float(size)}
            }
            kind = "both" if all(runs.values()) else "mixed" if runs["mixed"] else "float32" if runs["float32"] else ""
            axes.scatter([stiffness], [size], marker="s", s=330, color=PRECISIONS[kind])
            axes.annotate(kind or "none", (stiffness, size), ha="center", va="center", fontsize=6)
    axes.set(ylabel="vertices a side of 0.5 m", title="which precision comes to rest (accelerated)", yticks=SIZES)
    axes.margins(y=0.25)
    for axes in panels:
        axes.set(xscale="log", xlabel="stretch stiffness K [N/m]")
    handles = [
        panels[0].scatter([], [], marker="s", s=90, color=colour, label=verdict) for verdict, colour in COLOURS.items()
    ]
    handles.append(
        panels[0].scatter([], [], marker="s", s=90, color=PRECISIONS["mixed"], label="at rest only in mixed")
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9)
    with whole_file(path) as place:
        figure.savefig(place, dpi=90)


def _squares(
    axes: Any, own: Mapping[tuple[float, float], Outcome], columns: Sequence[float], rows: Sequence[float]
) -> None:
    """A coloured square for every run, with thousands of iterations where it came to rest."""
    for x in columns:
        for y in rows:
            outcome = own[x, y]
            axes.scatter([x], [y], marker="s", s=330, color=COLOURS.get(outcome.verdict, ODD))
            if outcome.verdict == "at rest":
                axes.annotate(f"{outcome.iterations / 1000:.2g}k", (x, y), ha="center", va="center", fontsize=6)
