"""report.html: a fit on one page that needs no other file."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from warp_cloth.export.files import whole_file
from warp_cloth.export.report import plain
from warp_cloth.maps.colour import shown_value
from warp_cloth.maps.kinds import MAPS
from warp_cloth.report.advice import advice, notes_of
from warp_cloth.report.numbers import short_number
from warp_cloth.solver.certificate.rest_error import GROWING


def write_report_page(path: Path, name: str, report: Mapping[str, Any], pictures: Mapping[str, Path]) -> None:
    """Writes the page; ``pictures`` are files by name: "preview", and maps by theirs."""
    from jinja2 import Environment, StrictUndefined

    text = (files("warp_cloth.export") / "report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined)
    environment.filters["millimetres"] = lambda value: f"{value:.0f} mm"
    told = plain({key: value for key, value in report.items() if key != "settings"})
    embedded = {key: _embedded(file) for key, file in pictures.items()}
    page = environment.from_string(text).render(
        name=name,
        report=told,
        advice=advice(report),
        preview=embedded.get("preview"),
        certificate=certificate_rows(report),
        girths=report.get("girths_mm") or (),
        maps=[_map_card(key, told, embedded[key]) for key in report.get("maps") or {} if key in embedded],
        notes=notes_of(report),
        settings=json.dumps(report["settings"], indent=2, ensure_ascii=False),
        version=version("warp-cloth"),
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
    """The figures that prove rest, beside what the scene wants of them."""
    solver, residual = report["settings"]["solver"], report["residual"]
    rest = report["rest_error_mm"]
    wanted = [
        ("relative residual, rms", residual["relative_rms"], solver["residual"], "force left, of all that meet"),
        ("its 99th percentile", residual["relative_p99"], solver["residual_p99"], "no region far from rest"),
        ("rest error [mm]", rest, solver["tolerance_mm"], "how far the shape may still be from its rest shape"),
    ]
    if solver["method"] != "direct":
        wanted.append(("growing motion [mm]", report["growing_mm"], 1e3 * GROWING, "of a fold that may snap"))
    rows = [
        {"name": name, "value": short_number(value), "wanted": f"{limit:g}", "met": value <= limit, "meaning": meaning}
        for name, value, limit, meaning in wanted
    ]
    strain, depth = report["strain"], report.get("penetration_mm")
    told = [
        ("residual, rms [vertex weights]", residual["rms"], "force left on a vertex"),
        ("strain, median", strain["p50"], "of edges against their rest length"),
        ("strain, 99th percentile", strain["p99"], ""),
        ("strain, largest", strain["max"], ""),
    ]
    if depth is not None:
        told.append(("penetration, deepest [mm]", depth["max"], "under the exact body mesh"))
    return rows + [
        {"name": name, "value": short_number(value), "wanted": "", "met": True, "meaning": meaning}
        for name, value, meaning in told
    ]
