"""A shaded picture of the worn garments from front, side and back; needs no display."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.threads import map_in_threads
from warp_cloth.export.files import whole_file
from warp_cloth.export.lettering import font_for
from warp_cloth.export.picture_head import FAINT_INK, INK, LEADING, Head, draw_head, shorten
from warp_cloth.export.problem_marks import draw_rings, marked_subject, places_of
from warp_cloth.export.render import (
    RenderedView,
    Subject,
    build_subject,
    load_kernels,
    render_view,
    shaded,
    view_axes,
)
from warp_cloth.export.surface import in_bytes, linear, require_sound
from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import WornGarment

T = TypeVar("T")
R = TypeVar("R")

BACKGROUND = (0.94, 0.94, 0.945)  # sRGB
PLACED_WIDTH = 0.19  # of the picture's width, of the garments as placed
COMPRESSION = 3  # of PNG files: a fifth larger than at 6 in half of the time
MARGIN = 0.03  # of the picture's width, left and right of every view
SMALLEST_EXTENT = 1e-3  # [m], so that even a picture of a point has a scale
SIDES = {
    "front": (0.0, 0.0, 1.0),
    "side": (1.0, 0.0, 0.0),
    "back": (0.0, 0.0, -1.0),
}  # from the scene to the viewer; no view is exactly vertical


@dataclass(frozen=True)
class Window:
    """The rectangle of a view in the picture."""

    label: str
    toward: NDArray[np.float64]  # unit vector from the scene to the viewer
    left: int  # first column [px]
    width: int  # [px]


@dataclass(frozen=True)
class Layout:
    """Windows side by side under a title strip, all at one scale."""

    windows: tuple[Window, ...]
    top: int  # first row of the windows [px]
    height: int  # of the windows [px]
    pixel: float  # size of a pixel [m]


def sides_of(facing: int) -> dict[str, Sequence[float]]:
    """The sides of a wearer whose front is so many quarter turns about y from +z."""
    turn = np.linalg.matrix_power(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), facing)
    return {name: (turn @ toward).tolist() for name, toward in SIDES.items()}


def preview_image(
    *,
    garments: Sequence[WornGarment],
    avatar: Mesh | None,
    device: str = "cpu",
    size: tuple[int, int] = (1500, 900),
    head: Head | None = None,
    problems: Sequence[FitProblem] = (),
    placed: bool = False,
    facing: int = 0,
) -> Image.Image:
    """The picture, ``size`` wide and high [px], below its head, with marks where problems are.

    ``placed``: whether the garments as placed before the fit stand next to them, in a scale of their own. ``facing``:
    where the wearer's front is, as for ``sides_of``.

    Raises:
        ValueError: a point is not finite.
    """
    require_sound(garments, avatar)
    subject = marked_subject(build_subject(garments, avatar, device), garments, problems)
    margin, height = round(MARGIN * size[0]), text_height(size)
    lines = 0 if head is None else 1 + len(head.lines(height, size[0] - 2 * margin))
    image = Image.new("RGB", size)
    left = round(PLACED_WIDTH * size[0]) if placed else 0
    area = size[0] - left, size[1]
    sides = sides_of(facing)
    layout = arrange_windows(subject.extent, area, lines, sides)
    parts = [(subject, layout, area)]
    if placed:
        start = build_subject([replace(worn, points=worn.mesh.points) for worn in garments], avatar, device)
        area = left, size[1]
        parts.append((start, arrange_windows(start.extent, area, lines, {"as placed": sides["front"]}), area))
    for picture, place in zip(_pictures(parts), (left, 0), strict=False):
        image.paste(picture, (place, 0))
    if head is not None:
        draw_head(image, head, height, margin)
    places = places_of(garments, problems)
    for window in layout.windows:
        shown = left + window.left, layout.top, window.width, layout.height
        draw_rings(image, shown, window.toward, subject.centre, layout.pixel, places, height)
    return image


def draw_views(
    subject: Subject,
    size: tuple[int, int],
    title: str = "",
    sentence: str = "",
    sides: Mapping[str, Sequence[float]] = SIDES,
) -> Image.Image:
    """Views from several sides next to one another, ``size`` wide and high [px], headed by title and sentence."""
    layout = arrange_windows(subject.extent, size, int(bool(title or sentence)), sides)
    return compose_picture(subject, layout, render_views(subject, layout), size, title, sentence)


def render_views(subject: Subject, layout: Layout) -> list[RenderedView]:
    """The views of all windows."""
    return _rendered([(subject, layout, window) for window in layout.windows])


def _rendered(windows: Sequence[tuple[Subject, Layout, Window]]) -> list[RenderedView]:
    """The views of windows of several layouts, of subjects on one device, all at the same time."""

    def view(shown: tuple[Subject, Layout, Window]) -> RenderedView:
        subject, layout, window = shown
        return render_view(subject, window.toward, layout.pixel, window.width, layout.height)

    device = windows[0][0].device
    load_kernels(device)
    return _of_each(device, view, windows)


def _of_each(device: str, work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """``work`` of every item, on the CPU in threads: a launch there occupies one core, and releases Python's lock."""
    return map_in_threads(work, items) if wp.get_device(device).is_cpu else [work(item) for item in items]


def _shades(views: Sequence[tuple[Subject, RenderedView]]) -> list[NDArray[np.uint8]]:
    """Images of views, each of a subject in its own colours, before the background."""
    background = linear(BACKGROUND)
    return _of_each(views[0][0].device, lambda view: shaded(*view, background), views)


def _pictures(parts: Sequence[tuple[Subject, Layout, tuple[int, int]]]) -> list[Image.Image]:
    """A picture of each subject in a layout, of a size [px], without titles: their views are drawn at the same time."""
    windows = [(subject, layout, window) for subject, layout, _ in parts for window in layout.windows]
    views = zip((subject for subject, *_ in windows), _rendered(windows), strict=True)
    shades = iter(_shades(list(views)))
    return [_composed(layout, [next(shades) for _ in layout.windows], size, "", "") for _, layout, size in parts]


def compose_picture(
    subject: Subject, layout: Layout, views: Sequence[RenderedView], size: tuple[int, int], title: str, sentence: str
) -> Image.Image:
    """The picture with the subject in its own colours; arguments as in ``draw_views``."""
    return _composed(layout, _shades([(subject, view) for view in views]), size, title, sentence)


def _composed(
    layout: Layout, drawn: Sequence[NDArray[np.uint8]], size: tuple[int, int], title: str, sentence: str
) -> Image.Image:
    """The picture of a layout's windows."""
    shades = np.tile(in_bytes(linear(BACKGROUND)), (size[1], size[0], 1))
    for window, shade in zip(layout.windows, drawn, strict=True):
        shades[layout.top : layout.top + layout.height, window.left : window.left + window.width] = shade
    image = Image.fromarray(shades, "RGB")
    draw_labels(image, layout, title, sentence)
    return image


def save_picture(image: Image.Image, path: Path) -> None:
    """Writes a PNG, complete or not at all."""
    with whole_file(path) as place:
        image.save(place, format="PNG", compress_level=COMPRESSION)


def arrange_windows(
    extent: NDArray[np.float64], size: tuple[int, int], lines: int, sides: Mapping[str, Sequence[float]] = SIDES
) -> Layout:
    """Windows as wide as their views need, spare width divided evenly; one scale for all; ``lines`` of text above."""
    width, height = size
    text = text_height(size)
    top = round((3.4 + LEADING * (lines - 1)) * text) if lines else text
    shown = np.maximum(extent, SMALLEST_EXTENT)
    frames = [view_axes(np.array(toward)) for toward in sides.values()]
    needs = [float(shown @ np.abs(right)) for right, _ in frames]
    tallest = max(float(shown @ np.abs(up)) for _, up in frames)
    available = max(width - 2 * round(MARGIN * width) * len(sides), 1)
    below = 5 * text // 2  # for the labels
    pixel = max(sum(needs) / available, tallest / max(height - top - below - 3 * text, 1))
    spare = (width - sum(needs) / pixel) / len(sides)
    edges = np.round(np.cumsum([0.0, *(need / pixel + spare for need in needs)])).astype(int).tolist()
    windows = tuple(
        Window(label, np.array(toward), left, right - left)
        for (label, toward), left, right in zip(sides.items(), edges[:-1], edges[1:], strict=True)
    )
    return Layout(windows, top, height - top - below, pixel)


def text_height(size: tuple[int, int]) -> int:
    """Height of the labels [px], legible in a small picture."""
    return max(round(0.02 * size[1]), 10)


def draw_labels(image: Image.Image, layout: Layout, title: str, sentence: str) -> None:
    """Title and sentence above the views, a label below each."""
    draw = ImageDraw.Draw(image)
    height = text_height(image.size)
    font = font_for(height)
    for window in layout.windows:
        place = (window.left + window.width / 2, image.height - 1.5 * height)
        draw.text(place, window.label, fill=FAINT_INK, font=font, anchor="mm")
    margin = round(MARGIN * image.width)
    left = margin
    for text, ink, scale in ((title, INK, 1.3), (sentence, FAINT_INK, 1.0)):
        if text:
            font = font_for(round(scale * height), text)
            line = shorten(text, font, image.width - left - margin)
            draw.text((left, 2 * height), line, fill=ink, font=font, anchor="ls")
            left += round(font.getlength(line)) + height
