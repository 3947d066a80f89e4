"""What a report says first, in words: the verdict, what was fitted, and the ease that a tailor reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LEVELS = ("chest", "waist", "hip")
NOT_REACHED, NOT_AROUND = "not reached", "not closed round the body"


@dataclass(frozen=True)
class ShownVerdict:
    """A verdict in two or three words, and its colour."""

    words: str
    colour: str  # sRGB, as in "#3c7d4b"


WORN = ShownVerdict("worn", "#3c7d4b")
DOUBTFUL = ShownVerdict("worn, with notes", "#a8691a")
NOT_WORN = ShownVerdict("not worn", "#a83a32")


def shown_verdict(report: Mapping[str, Any]) -> ShownVerdict:
    """Green where all garments are worn, amber where a problem is noted all the same, red where one is not worn."""
    if not report.get("worn"):
        return NOT_WORN
    return DOUBTFUL if report.get("problems") else WORN


def shown_ease(report: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Ease of each garment at chest, waist and hip, in centimetres, or why there is none there; {} without girths."""
    found: dict[str, dict[str, str]] = {}
    for row in report.get("girths_mm") or ():
        at = found.setdefault(row["garment"], dict.fromkeys(LEVELS, NOT_REACHED))
        at[row["level"]] = NOT_AROUND if row["ease"] is None else f"{row['ease'] / 10:+.1f} cm"
    return found


def ease_lines(report: Mapping[str, Any]) -> list[str]:
    """One line for each garment, such as "chest +11.0 cm, waist +22.5 cm, hip not reached"; or why there is none."""
    eases = shown_ease(report)
    lines = []
    for garment, levels in eases.items():
        name = f"{garment}: " if len(eases) > 1 else ""
        lines.append(name + ", ".join(f"{level} {text}" for level, text in levels.items()))
    return lines or ([f"not measured: {report['no_girths']}"] if report.get("no_girths") else [])


def fitted_lines(report: Mapping[str, Any]) -> list[str]:
    """One line for each garment, such as "shirt.obj, in jersey of 160 g/m2, on body.obj"."""
    settings = report.get("settings") or {}
    body = _source(settings.get("avatar") or {})
    lines = []
    for garment in settings.get("garment") or ():
        fabric = garment["fabric"]
        cloth = "the default fabric" if fabric["name"] == "default" else fabric["name"]
        parts = [_source(garment), f"in {cloth} of {1e3 * fabric['weight']:.0f} g/m2", body and f"on {body}"]
        lines.append(", ".join(filter(None, parts)))
    return lines


def _source(table: Mapping[str, Any]) -> str:
    """Where a garment or a body comes from, in a word or two: its file's name, or its kind of shape, and its size."""
    file, shape = table.get("mesh") or table.get("pattern"), table.get("shape") or {}
    if file:
        return " ".join(filter(None, (Path(file).name, table.get("size") or "")))
    if table.get("measures"):
        return "a mannequin of these measures"
    return " ".join(filter(None, (shape.get("kind", ""), str(shape.get("size") or ""))))


def percent(strain: float) -> str:
    """A strain in per cent of the length at rest, as people read it."""
    return f"{100 * strain:.2g} %" if abs(strain) < 0.1 else f"{100 * strain:.0f} %"
