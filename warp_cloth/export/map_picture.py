"""Pictures of maps: the worn garments in the map's colours from three sides, with a legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from warp_cloth.base.mesh import Mesh
from warp_cloth.export.picture_head import FAINT_INK, INK
from warp_cloth.export.preview import (
    BACKGROUND,
    arrange_windows,
    compose_picture,
    render_views,
    save_picture,
    sides_of,
    text_height,
)
from warp_cloth.export.render import build_subject
from warp_cloth.export.surface import cloth_colour, require_sound
from warp_cloth.maps.colour import colours, shown_value
from warp_cloth.maps.kinds import MapKind
from warp_cloth.model.result import WornGarment

ON_PANELS = "_panels"  # at the end of the names of files that show a map on the flat panels
LEGEND_FRACTION = 0.13  # of the picture's width
BAR_WIDTH = 0.2  # of the legend's width
INTERVALS = (4, 5)  # number between the legend's values; a range about zero keeps its middle
MARGIN = 0.06  # shown around the garments, of their largest extent


class MapPictures:
    """Draws the maps of one fit; its views are rendered once for all of them."""

    def __init__(
        self,
        garments: Sequence[WornGarment],
        avatar: Mesh | None,
        *,
        device: str = "cpu",
        size: tuple[int, int] = (1500, 900),
        facing: int = 0,
    ) -> None:
        require_sound(garments, avatar)
        self._garments, self._size = garments, size
        self._legend_width = round(LEGEND_FRACTION * size[0])
        worn = np.concatenate([worn.points for worn in garments])
        low, high = worn.min(axis=0), worn.max(axis=0)
        margin = MARGIN * float((high - low).max())  # the body is there for orientation only
        self._subject = replace(build_subject(garments, avatar, device), low=low - margin, high=high + margin)
        gap = text_height(size)  # so that a limb cut off by the picture's edge does not touch the legend
        self._views_size = (size[0] - self._legend_width - gap, size[1])
        self._layout = arrange_windows(self._subject.extent, self._views_size, 1, sides_of(facing))
        self._views = render_views(self._subject, self._layout)

    def write(self, path: Path, kind: MapKind, bounds: tuple[float, float], sentence: str = "") -> None:
        """Writes a PNG of a map with colours for the range ``bounds``; garments without it keep their own colour."""
        subject = self._subject.painted(
            [
                colours(kind, worn.fields[kind.name], bounds)
                if kind.name in worn.fields
                else np.tile(cloth_colour(index), (len(worn.points), 1))
                for index, worn in enumerate(self._garments)
            ]
        )
        views = compose_picture(subject, self._layout, self._views, self._views_size, kind.label, sentence)
        ground = tuple(round(255 * channel) for channel in BACKGROUND)
        image = Image.new("RGB", self._size, ground)
        image.paste(views, (0, 0))
        draw_legend(image, kind, bounds, self._legend_width)
        save_picture(image, path)


def draw_legend(image: Image.Image, kind: MapKind, bounds: tuple[float, float], width: int) -> None:
    """A bar of the map's colours with values next to it, at the right of the picture."""
    draw = ImageDraw.Draw(image)
    text = text_height(image.size)
    font = ImageFont.load_default(text)
    left = image.width - width
    top, bottom = round(0.2 * image.height), round(0.8 * image.height)
    values = np.linspace(bounds[1], bounds[0], bottom - top)
    bar = np.round(255.0 * colours(kind, values, bounds)).astype(np.uint8)
    bar_width = max(round(BAR_WIDTH * width), 4)
    image.paste(Image.fromarray(np.repeat(bar[:, None, :], bar_width, axis=1), "RGB"), (left, top))
    for value in ticks(kind, bounds):
        row = top + (bounds[1] - value) / (bounds[1] - bounds[0]) * (bottom - top - 1)
        draw.line([(left + bar_width, row), (left + bar_width + text // 3, row)], fill=FAINT_INK)
        draw.text((left + bar_width + text // 2, row), shown_value(kind, value), fill=INK, font=font, anchor="lm")
    small = ImageFont.load_default(max(round(0.85 * text), 9))
    for line, words in enumerate(_wrapped(kind.label, small, width)):
        draw.text((left, top - 3 * text + 1.2 * text * line), words, fill=INK, font=small, anchor="lm")


def ticks(kind: MapKind, bounds: tuple[float, float]) -> list[float]:
    """The values on a legend, highest first: of two subdivisions the one with the shorter numbers."""
    choices = [np.linspace(bounds[1], bounds[0], count + 1).tolist() for count in INTERVALS[: 1 if kind.signed else 2]]
    return min(choices, key=lambda values: max(len(shown_value(kind, value)) for value in values))


def _wrapped(label: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: float) -> list[str]:
    """The label in lines no wider than ``width`` [px]."""
    lines = [""]
    for word in label.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
