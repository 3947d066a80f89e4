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
from warp_cloth.verdict import falls_as_a_whole, figure

DEEP = 2.0  # [mm]; deeper than half the usual offset, a garment is in the body
STRETCHED = 0.5  # strain beyond which a seam is not closed, or a unit is wrong


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
        notes=_notes(report),
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


def _notes(report: Mapping[str, Any]) -> list[str]:
    """What was guessed or mended, each with whose it is."""
    notes = [f"{garment['name']}: {note}" for garment in report["garments"] for note in garment["notes"]]
    notes += [f"avatar: {note}" for note in (report.get("avatar") or {}).get("notes", ())]
    return [*notes, *report.get("map_notes", ())]


def certificate_rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The figures that prove rest, beside what the scene wants of them."""
    solver, residual = report["settings"]["solver"], report["residual"]
    rest = report["rest_error_mm"]
    wanted = (
        ("relative residual, rms", residual["relative_rms"], solver["residual"], "force left, of all that meet"),
        ("its 99th percentile", residual["relative_p99"], solver["residual_p99"], "no region far from rest"),
        ("rest error [mm]", rest, solver["tolerance_mm"], "how far the shape may still be from its rest shape"),
    )
    rows = [
        {"name": name, "value": figure(value), "wanted": f"{limit:g}", "met": value <= limit, "meaning": meaning}
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
        {"name": name, "value": figure(value), "wanted": "", "met": True, "meaning": meaning}
        for name, value, meaning in told
    ]


def advice(report: Mapping[str, Any]) -> list[str]:
    """What to change where a fit did not come to rest, or came to rest wrongly; the likeliest first."""
    lines: list[str] = []
    strain, depth, solver = report["strain"], report.get("penetration_mm"), report["settings"]["solver"]
    if report["status"] == "diverged":
        lines.append('Use a smaller solver.cap, solver.precision = "float64", or a softer fabric.')
    if depth is not None and depth["edges"]:
        lines.append(
            f"{depth['edges']:,} edges are drawn through the body: begin with it in the pose that the garment is "
            "placed round, and give the wanted pose as avatar.poses."
        )
    if strain["p99"] is not None and not strain["p99"] <= STRETCHED:
        lines.append(
            "Parts of the garment are stretched by more than half: check garment.rest and garment.uv_units, "
            "the garment's size against the body's, and that it starts round the body."
        )
    if depth is not None and not depth["max"] <= DEEP:
        lines.append('The garment lies in the body: start it further out, or set collision.avatar = "mesh".')
    if report["status"] == "iteration_limit":
        error = report["rest_error_mm"]
        cloth = report["settings"]["collision"]["cloth"]
        if falls_as_a_whole(solver["method"], cloth, None if error is None else 1e-3 * error):
            lines.append('Use solver.method = "multilevel": the garment is far from rest, and falls as a whole by it.')
        lines.append(f"Raise solver.iterations (now {solver['iterations']:,}): forces may only need longer.")
        if solver["method"] == "direct":
            lines.append('Use solver.method = "accelerated": the direct rule chatters where cloth is stiff.')
        lines.append("Take a coarser mesh or a softer fabric first, to see whether the scene is sound.")
    return lines
