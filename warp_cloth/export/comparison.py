"""A comparison of two fits as files: a stage, pictures, and a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from warp_cloth.export.map_picture import MapPictures
from warp_cloth.export.report import write_report
from warp_cloth.export.stage import write_stage
from warp_cloth.maps.compare import Comparison
from warp_cloth.maps.kinds import kind_named
from warp_cloth.maps.measure import percentiles
from warp_cloth.maps.read import WrittenFit


def save_comparison(found: Comparison, fits: tuple[WrittenFit, WrittenFit], folder: Path) -> list[Path]:
    """Writes compare.usdc, a picture of each difference, and compare.json last."""
    first, second = fits
    stage, report = folder / "compare.usdc", folder / "compare.json"
    report.unlink(missing_ok=True)  # an earlier run's
    colour = next(iter(found.ranges))
    write_stage(stage, garments=found.garments, avatar=first.avatar, name="compare", ranges=found.ranges, colour=colour)
    paths = [stage]
    drawer = MapPictures(found.garments, first.avatar)
    for name, bounds in found.ranges.items():
        kind = kind_named(name)
        if kind is None:
            continue
        path = folder / f"{name}.png"
        sentence = f"{second.name} minus {first.name}"
        drawer.write(path, kind, bounds, sentence)
        paths.append(path)
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
            "girths_mm": list(found.girths),
            "notes": list(found.notes),
        },
    )
    return [*paths, report]


def _summary(fit: WrittenFit) -> dict[str, Any]:
    return {"name": fit.name, "status": fit.report.get("status"), "maps": fit.report.get("maps")}


def girth_lines(found: Comparison) -> list[str]:
    """Ease of both fits, a line for each garment and level."""
    lines = []
    for row in found.girths:
        eases = [None if row[place] is None else row[place]["ease"] for place in ("first", "second")]
        first, second = ("none" if ease is None else f"{ease:+.0f} mm" for ease in eases)
        lines.append(f"{row['garment']} {row['level']}: ease {first} in the first, {second} in the second")
    return lines
