"""A fit as notebooks show it: verdict, ease, and the picture."""

from __future__ import annotations

import base64
import io
from html import escape

from warp_cloth.export.preview import preview_image
from warp_cloth.maps.measure import add_girths
from warp_cloth.model.result import FitResult
from warp_cloth.report.shown import ease_lines, shown_verdict

SIZE = (1000, 560)  # [px]


def fit_html(fit: FitResult) -> str:
    """A piece of HTML that needs no other file; of a shape that is not finite without a picture."""
    add_girths(fit)
    verdict, data = shown_verdict(fit.report), io.BytesIO()
    chip = f'<b style="color: {verdict.colour}">{verdict.words}</b>'
    lines = [f"<b>{escape(fit.scene.name)}</b>: {chip}. {escape(fit.message)}"]
    lines += [f"ease: {escape(line)}" for line in ease_lines(fit.report)]
    text = "".join(f"<div>{line}</div>" for line in lines)
    try:
        shown = [problem for problem in fit.problems if not problem.code.is_note]
        image = preview_image(
            garments=fit.garments,
            avatar=fit.avatar,
            device=fit.device,
            size=SIZE,
            problems=shown,
            facing=fit.facing,
        )
    except ValueError:
        return text
    image.save(data, format="PNG")
    picture = base64.b64encode(data.getvalue()).decode("ascii")
    narrow = "max-width: 100%; height: auto"  # in a cell narrower than the picture
    size = f'width="{SIZE[0]}" style="{narrow}"'
    return f'{text}<img alt="front, side and back" {size} src="data:image/png;base64,{picture}">'
