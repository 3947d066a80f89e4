"""A comparison of two fits as files: a stage, pictures, and a report."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.export.map_picture import MapPictures
from warp_cloth.export.report import write_report
from warp_cloth.export.stage import write_stage
from warp_cloth.maps.compare import Comparison
from warp_cloth.maps.kinds import MAPS, SHOWN_PERCENTILE, kind_named
from warp_cloth.maps.measure import percentiles
from warp_cloth.maps.read import WrittenFit
from warp_cloth.report.shown import fitted_lines, shown_verdict


def save_comparison(found: Comparison, fits: tuple[WrittenFit, WrittenFit], folder: Path) -> list[Path]:
    """Writes compare.usdc and a picture of each difference, of fits with maps, and compare.json last."""
    first, second = fits
    stage, report = folder / "compare.usdc", folder / "compare.json"
    report.unlink(missing_ok=True)  # an earlier run's
    stage.unlink(missing_ok=True)
    paths = _maps(found, fits, stage) if found.garments else []
    write_report(
        report,
        {
            "first": _summary(first),
            "second": _summary(second),
            "differences": {
                name: {
                    "unit": kind.unit if (kind := kind_named(name)) else "",
                    "garments": {w.name: percentiles(w.fields[name]) for w in found.garments if name in w.fields},
                }
                for name in found.ranges
            },
            "figures": [asdict(figure) for figure in figures_of(found, fits)],
            "girths_mm": list(found.girths),
            "notes": list(found.notes),
        },
    )
    return [*paths, report]


def _maps(found: Comparison, fits: tuple[WrittenFit, WrittenFit], stage: Path) -> list[Path]:
    """Writes the differences of maps: a stage, and a picture of each."""
    first, ranges = fits[0], found.ranges
    colour = next(iter(ranges))
    write_stage(stage, garments=found.garments, avatar=first.avatar, name="compare", ranges=ranges, colour=colour)
    paths = [stage]
    drawer = MapPictures(found.garments, first.avatar)
    sentence = "B ({1}) minus A ({0})".format(*names_apart(fits))
    for name, bounds in ranges.items():
        kind = kind_named(name)
        if kind is None:
            continue
        paths.append(stage.parent / f"{name}.png")
        drawer.write(paths[-1], kind, bounds, sentence)
    return paths


def _summary(fit: WrittenFit) -> dict[str, Any]:
    return {"name": fit.name, "status": fit.report.get("status"), "maps": fit.report.get("maps")}


@dataclass(frozen=True)
class Figure:
    """One figure of both fits."""

    what: str
    unit: str
    first: float | None
    second: float | None

    @property
    def change(self) -> float | None:
        return None if self.first is None or self.second is None else self.second - self.first


def figures_of(found: Comparison, fits: tuple[WrittenFit, WrittenFit]) -> list[Figure]:
    """Ease at each level [cm], strain [%] and the 98th percentile of each map, of both fits."""
    figures = []
    for row in found.girths:
        eases = [None if row[place] is None else row[place]["ease"] for place in ("first", "second")]
        first, second = (None if ease is None else 0.1 * ease for ease in eases)
        figures.append(Figure(f"{row['garment']}: ease at the {row['level']}", "cm", first, second))
    strains = [(fit.report.get("strain") or {}).get("p99") for fit in fits]
    if any(strain is not None for strain in strains):
        first, second = (None if strain is None else 100.0 * strain for strain in strains)
        figures.append(Figure("strain of edges, 99th percentile", "%", first, second))
    for one, other in found.pairs:
        for kind in (kind for name, kind in MAPS.items() if name in one.fields and name in other.fields):
            factor, unit = (100.0, "%") if kind.unit == "1" else (1.0, kind.unit)
            ends = [factor * float(np.percentile(each.fields[kind.name], SHOWN_PERCENTILE)) for each in (one, other)]
            figures.append(Figure(f"{one.name}: {kind.label}, 98th percentile", unit, *ends))
    return figures


def comparison_lines(found: Comparison, fits: tuple[WrittenFit, WrittenFit]) -> list[str]:
    """Both fits by name, then each figure of both with its change."""
    labels = names_apart(fits)
    lines = [f"{letter} = {label}{_verdict(fit)}" for letter, label, fit in zip("AB", labels, fits, strict=True)]
    figures = figures_of(found, fits)
    width = max((len(figure.what) for figure in figures), default=0)
    for figure in figures:
        first, second, change = _shown(figure)
        lines.append(f"  {figure.what:<{width}}  A {first:>10}  B {second:>10}{change}")
    return lines


def names_apart(fits: tuple[WrittenFit, WrittenFit]) -> tuple[str, str]:
    """The fits' names, or their paths where the names are the same."""
    first, second = fits
    return (first.name, second.name) if first.name != second.name else (str(first.place), str(second.place))


def _verdict(fit: WrittenFit) -> str:
    """Whether it is worn, and what was fitted: what a comparison changes, as a rule."""
    if "worn" not in fit.report:
        return ""
    return ": " + "; ".join([shown_verdict(fit.report).words, *fitted_lines(fit.report)])


def _shown(figure: Figure) -> tuple[str, str, str]:
    """Both figures and the change, all to the decimals that give the larger figure three digits."""
    values = [abs(value) for value in (figure.first, figure.second) if value]
    decimals = max(0, 2 - math.floor(math.log10(max(values)))) if values else 0
    first, second = (
        "none" if value is None else f"{value:.{decimals}f} {figure.unit}" for value in (figure.first, figure.second)
    )
    change = "" if figure.change is None else f"  change {figure.change:+.{decimals}f} {figure.unit}"
    return first, second, change
