"""Test results of a fabric as files: table, JSON, CSV, plots, and a picture of the drape."""

from __future__ import annotations

import csv
import io
import textwrap
from dataclasses import asdict
from pathlib import Path

from warp_cloth.bench.bench import Bench, Curve
from warp_cloth.export.files import whole_file
from warp_cloth.export.plots import figure_class
from warp_cloth.export.preview import draw_views, save_picture
from warp_cloth.export.render import build_subject
from warp_cloth.export.report import check_writable, write_report
from warp_cloth.loading.raw import counted

DRAPE_SIDES = {"front": (0.0, 0.0, 1.0), "from above": (0.0, 0.9998, 0.02)}
QUANTITIES = {  # of the plot's axes, by kind of test
    "tension": ("strain", "force per width"),
    "shear": ("shear angle", "shear force per width"),
    "bending": ("curvature", "moment per width"),
}
TABLE_WIDTH = 100  # characters, of the text above the table


def table(bench: Bench) -> list[str]:
    """Lines of a table: each measured value, the fabric's own, and the deviation."""
    rows = [("", "unit", "measured", "stated", "deviation")]
    for found in bench.findings:
        stated = "" if found.stated is None else f"{found.stated:.3g}"
        deviation = "" if found.deviation is None else f"{100 * found.deviation:+.1f} %"
        rows.append((found.name, found.unit, f"{found.measured:.3g}", stated, deviation))
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    lines = textwrap.wrap(f"{bench.fabric.name}: {bench.fabric.source}", TABLE_WIDTH)
    for name, unit, *figures in rows:
        cells = [figure.rjust(width) for figure, width in zip(figures, widths[2:], strict=True)]
        lines.append("  ".join(["", name.ljust(widths[0]), unit.ljust(widths[1]), *cells]).rstrip())
    return lines


def save_bench(bench: Bench, folder: Path, device: str = "cpu", *, plots: bool = True) -> list[Path]:
    """Writes NAME.json, NAME.csv, NAME_drape.png and, with ``plots``, NAME.png into a folder.

    Raises:
        InputError: the folder cannot be written, or matplotlib is missing.
    """
    name = bench.fabric.name
    check_writable(folder, name)
    paths = [folder / f"{name}{end}" for end in (".json", ".csv", "_drape.png")]
    findings = [{**asdict(found), "deviation": found.deviation} for found in bench.findings]
    curves = [asdict(curve) for curve in bench.curves]
    write_report(paths[0], {"fabric": asdict(bench.fabric), "findings": findings, "curves": curves})
    with whole_file(paths[1]) as place:
        place.write_text(_csv(bench.curves), encoding="utf-8")
    draped = next(found for found in bench.findings if found.name == "drape coefficient")
    count = sum(found.name.startswith("drape coefficient of disc") for found in bench.findings)
    sentence = f"30 cm disc on an 18 cm support, drape coefficient {draped.measured:.0f} % ({counted(count, 'disc')})"
    picture = draw_views(build_subject([bench.disc], None, device), (1500, 600), name, sentence, DRAPE_SIDES)
    save_picture(picture, paths[2])
    if plots:
        paths.append(folder / f"{name}.png")
        _plot(paths[-1], bench)
    return paths


def _csv(curves: tuple[Curve, ...]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["test", "x", "x unit", "measured", "fabric", "unit"])
    for curve in curves:
        stated = curve.stated or ("",) * len(curve.x)
        for x, measured, own in zip(curve.x, curve.measured, stated, strict=True):
            rows.writerow([curve.name, x, curve.x_unit, measured, own, curve.y_unit])
    return text.getvalue()


def _plot(path: Path, bench: Bench) -> None:
    """Plots the curves by kind of test: measured values as marks, the fabric's own as lines."""
    kinds = list(dict.fromkeys(curve.name.split()[0] for curve in bench.curves))
    figure = figure_class()(figsize=(4.5 * len(kinds), 4.0), layout="constrained")
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        for index, curve in enumerate(curve for curve in bench.curves if curve.name.startswith(kind)):
            axes.plot(curve.x, curve.measured, "os^"[index % 3], color=f"C{index}", label=curve.name, markersize=4)
            if curve.stated is not None:
                axes.plot(curve.x, curve.stated, color=f"C{index}", linewidth=1)
            x_name, y_name = QUANTITIES[kind]
            axes.set_xlabel(f"{x_name} [{curve.x_unit}]")
            axes.set_ylabel(f"{y_name} [{curve.y_unit}]")
        axes.legend()
    figure.suptitle(f"{bench.fabric.name}: measured (marks) and stated (lines)")
    with whole_file(path) as place:
        figure.savefig(place, dpi=120)
