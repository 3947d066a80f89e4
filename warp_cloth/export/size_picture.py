"""One picture of all sizes of a garment: each from the front, with its verdict and its ease."""

from __future__ import annotations

from collections.abc import Mapping

from PIL import Image, ImageDraw

from warp_cloth.export.lettering import font_for
from warp_cloth.export.picture_head import INK, LEADING, Head, draw_head, wrapped
from warp_cloth.export.preview import BACKGROUND, arrange_windows, compose_picture, render_views, sides_of, text_height
from warp_cloth.export.render import build_subject
from warp_cloth.model.result import FitResult
from warp_cloth.report.shown import shown_ease, shown_verdict

COLUMN = (440, 700)  # width and height of a size [px]
LEFT = 14  # of the words of a size [px]
MOST_LINES = 3  # of the title


def size_picture(title: str, fits: Mapping[str, FitResult], recommended: str | None) -> Image.Image:
    """The picture of these fits by size, next to one another, headed by the title.

    Raises:
        ValueError: a point is not finite.
    """
    width, height = COLUMN[0] * len(fits), text_height(COLUMN)
    font = font_for(round(1.2 * height), title)
    lines = wrapped(title, font, width - 2 * LEFT, MOST_LINES)
    top = round((1.0 + LEADING * 1.2 * len(lines)) * height)
    image = Image.new("RGB", (width, top + COLUMN[1]), tuple(round(255 * part) for part in BACKGROUND))
    draw = ImageDraw.Draw(image)
    for number, line in enumerate(lines, start=1):
        draw.text((LEFT, LEADING * 1.2 * number * height), line, fill=INK, font=font, anchor="ls")
    for number, (size, fit) in enumerate(fits.items()):
        image.paste(_column(size, fit, size == recommended), (number * COLUMN[0], top))
    return image


def _column(size: str, fit: FitResult, is_recommended: bool) -> Image.Image:
    """One size from the front, below its name, its verdict and its ease."""
    levels = next(iter(shown_ease(fit.report).values()), {})
    ease = [f"{level} {text}" for level, text in levels.items()]
    head = Head(f"{size}, recommended" if is_recommended else size, shown_verdict(fit.report), ease, "")
    height = text_height(COLUMN)
    subject = build_subject(fit.garments, fit.avatar, fit.device)
    front = {"": sides_of(fit.facing)["front"]}
    layout = arrange_windows(subject.extent, COLUMN, 1 + len(head.lines(height, COLUMN[0])), front)
    image = compose_picture(subject, layout, render_views(subject, layout), COLUMN, "", "")
    draw_head(image, head, height, LEFT)
    return image
