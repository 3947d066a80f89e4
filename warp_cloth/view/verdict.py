"""What the page says of a shape: worn or not, ease, problems; and what its plain colours mean."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from pydantic import BaseModel

from warp_cloth.export.surface import AVATAR_COLOUR, Colour, cloth_colour
from warp_cloth.model.result import FitResult
from warp_cloth.report.shown import ease_lines, shown_verdict

UNJUDGED = "verdict and ease: once it is at rest"


def schema_limits(table: type[BaseModel], key: str) -> tuple[float, float]:
    """The lowest and highest value that a scene may state for a key."""
    found = {
        name: getattr(each, name)
        for each in table.model_fields[key].metadata
        for name in ("ge", "le")
        if hasattr(each, name)
    }
    return float(found["ge"]), float(found["le"])


def verdict_html(result: FitResult | None, note: str) -> str:
    """Verdict, ease and problems of a shape, and a ``note`` on how it was found; without a result, that it moves."""
    if result is None:
        return _block(f"<i>{UNJUDGED}</i>")
    verdict = shown_verdict(result.report)
    head = (
        f'<b style="color:#fff;background:{verdict.colour};border-radius:3px;padding:0.1em 0.5em" id="verdict">'
        f"{escape(verdict.words)}</b>"
    )
    lines = [f"<div>ease: {escape(line)}</div>" for line in ease_lines(result.report)]
    lines += [
        f"<div><b>{escape(each.code.words)}</b>: {escape(each.message)} {escape(each.remedy)}</div>"
        for each in result.problems
    ]
    return _block(f'{head}{"".join(lines)}<div style="color:#777">{escape(note)}</div>')


def swatches_html(garments: Sequence[str], with_body: bool) -> str:
    """The legend of the plain colours: one for each garment, and the body's."""
    shown = [(name, cloth_colour(index)) for index, name in enumerate(garments)]
    shown += [("body", AVATAR_COLOUR)] * with_body
    return _block("".join(f"<div>{_swatch(colour)} {escape(name)}</div>" for name, colour in shown))


def saved_note(name: str, size: int, settings: dict[str, Any], state: str, map_name: str) -> str:
    """What was saved: the file, what it shows, and where it is."""
    said = ", ".join(f"{key} {value}" for key, value in settings.items() if value)
    colours = f", coloured by {map_name}" if map_name else ""
    return f"{name} ({size / 1e6:.1f} MB, in your browser's downloads): {said}{colours}; {state}"


def _swatch(colour: Colour) -> str:
    code = "".join(f"{round(255 * channel):02x}" for channel in colour)
    return f'<span style="display:inline-block;width:0.9em;height:0.9em;border-radius:2px;background:#{code}"></span>'


def _block(content: str) -> str:
    return f'<div style="padding:0 1em 0.5em;font-size:0.85em;line-height:1.5">{content}</div>'
