"""report.html: a fit on one self-contained page."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from warp_cloth.base.version import package_version
from warp_cloth.export.files import whole_file
from warp_cloth.export.report import plain
from warp_cloth.maps.colour import shown_value
from warp_cloth.maps.kinds import MAPS
from warp_cloth.report.notes import notes_of
from warp_cloth.report.numbers import short_number, shown_choice
from warp_cloth.report.shown import NOT_REACHED, ease_lines, fitted_lines, percent, shown_ease, shown_verdict
from warp_cloth.solver.certificate.rest_error import GROWING


def write_report_page(path: Path, name: str, report: Mapping[str, Any], pictures: Mapping[str, Path]) -> None:
    """Writes the page; ``pictures`` are files by name: "preview", and the names of maps."""
    from jinja2 import Environment, StrictUndefined

    text = (files("warp_cloth.export") / "report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined)
    environment.filters["centimetres"] = lambda value: f"{value / 10:.1f} cm"
    values = plain({key: value for key, value in report.items() if key != "settings"})
    embedded = {key: _embedded(file) for key, file in pictures.items()}
    page = environment.from_string(text).render(
        name=name,
        report=values,
        preview=embedded.get("preview"),
        certificate=certificate_rows(report),
        verdict=shown_verdict(report),
        ease=shown_ease(report),
        ease_lines=ease_lines(report),
        fitted=fitted_lines(report),
        not_reached=NOT_REACHED,
        girths=report.get("girths_mm") or (),
        strains=strain_rows(report),
        maps=[_map_card(key, values, embedded[key]) for key in report.get("maps") or {} if key in embedded],
        choices=[(each["key"], shown_choice(each["value"]), each["reason"]) for each in report.get("choices") or ()],
        notes=notes_of(report),
        settings=json.dumps(report["settings"], indent=2, ensure_ascii=False),
        version=package_version(),
    )
    with whole_file(path) as place:
        place.write_text(page, encoding="utf-8")


def _embedded(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")


def _map_card(name: str, report: Mapping[str, Any], picture: str) -> dict[str, Any]:
    kind = MAPS[name]
    garments = report["maps"][name]["garments"]
    rows = [
        (garment, *(shown_value(kind, values[key]) for key in ("p2", "p50", "p98", "max")))
        for garment, values in garments.items()
    ]
    return {"label": kind.label, "picture": picture, "rows": rows}


def certificate_rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The figures of the certificate, with the scene's limits."""
    solver, residual = report["settings"]["solver"], report["residual"]
    rest = report["rest_error_mm"]
    limited = [
        (
            "relative residual, rms",
            residual["relative_rms"],
            solver["residual"],
            "net force left on a vertex, relative to the forces that act on it",
        ),
        (
            "relative residual, 99th percentile",
            residual["relative_p99"],
            solver["residual_p99"],
            "no region is far from rest",
        ),
        ("rest error [mm]", rest, solver["tolerance_mm"], "estimated distance from the rest shape"),
    ]
    if solver["method"] != "direct":
        growing = report["growing_mm"], 1e3 * GROWING, "accelerating motion of a fold that may still snap"
        limited.append(("growing motion [mm]", *growing))
    rows = [
        {"name": name, "value": short_number(value), "limit": f"{limit:g}", "met": value <= limit, "meaning": meaning}
        for name, value, limit, meaning in limited
    ]
    depth = report.get("penetration_mm")
    others = [
        ("residual, rms [vertex weights]", residual["rms"], "net force left on a vertex"),
    ]
    if depth is not None:
        others.append(("penetration, maximum [mm]", depth["max"], "below the surface of the body mesh"))
    return rows + [
        {"name": name, "value": short_number(value), "limit": "", "met": True, "meaning": meaning}
        for name, value, meaning in others
    ]


def strain_rows(report: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Median, 99th percentile, greatest and least of strains, in per cent of the length as cut."""
    strain = report["strain"]
    yarns = [(f"along the {name}", strain[name]) for name in ("warp", "weft", "bias") if name in strain]
    columns = ("p50", "p99", "max", "min")
    return [
        (name, *(percent(values[key]) if math.isfinite(values[key]) else "unknown" for key in columns))
        for name, values in (("in all directions", strain), *yarns)
    ]
