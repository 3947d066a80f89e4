"""Marks where the problems of a fit are: their vertices painted on the garments, a ring and its words next to one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from warp_cloth.export.render import Subject, view_axes
from warp_cloth.export.surface import cloth_colour
from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import WornGarment

MARK = (0.86, 0.12, 0.10)  # sRGB of what is concerned
RING = (190, 20, 16)  # sRGB bytes
HALO = (255, 255, 255)  # round the words, which may stand on cloth that is painted
MOST_MARKED = 4  # problems with a ring; more would hide the garment


def concerned(problem: FitProblem, garment: WornGarment) -> NDArray[np.int64]:
    """The garment's vertices that a problem concerns; none where it concerns all, so that nothing stands out."""
    if problem.garment != garment.name:
        return np.zeros(0, dtype=np.int64)
    corners = garment.mesh.triangles[list(problem.faces)].ravel()
    found = np.unique(np.concatenate([np.array(problem.vertices, dtype=np.int64), corners]))
    return found if len(found) < len(garment.points) else found[:0]


def marked_subject(subject: Subject, garments: Sequence[WornGarment], problems: Sequence[FitProblem]) -> Subject:
    """The subject with the vertices that problems concern painted."""
    if not problems:
        return subject
    colours = []
    for index, garment in enumerate(garments):
        own = np.tile(np.asarray(cloth_colour(index), dtype=np.float64), (len(garment.points), 1))
        for problem in problems:
            own[concerned(problem, garment)] = MARK
        colours.append(own)
    return subject.painted(colours)


def places_of(garments: Sequence[WornGarment], problems: Sequence[FitProblem]) -> list[tuple[str, NDArray[np.float64]]]:
    """What each problem is called, with a vertex in the midst of those that it concerns [m]; the first few."""
    places = []
    for problem in problems:
        for garment in garments:
            points = garment.points[concerned(problem, garment)]
            if len(points):
                middle = np.median(points, axis=0)
                places.append((problem.code.words, points[np.argmin(((points - middle) ** 2).sum(axis=1))]))
    return places[:MOST_MARKED]


def draw_rings(
    image: Image.Image,
    window: tuple[int, int, int, int],
    toward: NDArray[np.float64],
    centre: NDArray[np.float64],
    pixel: float,
    places: Sequence[tuple[str, NDArray[np.float64]]],
    height: int,
) -> None:
    """Draws a ring around each place in a view, and its words next to it.

    Args:
        image: the picture.
        window: left column, top row, width and height of the view [px].
        toward: unit vector from the scene to the viewer.
        centre: what is in the middle of the view [m], shape [3].
        pixel: size of a pixel [m].
        places: words and points [m].
        height: of the text [px].
    """
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(height)
    (right, up), (left, top, width, depth) = view_axes(toward), window
    taken: list[float] = []
    for words, place in places:
        x = left + width / 2 + float((place - centre) @ right) / pixel
        y = top + depth / 2 - float((place - centre) @ up) / pixel
        draw.ellipse((x - height, y - height, x + height, y + height), outline=RING, width=max(height // 8, 2))
        line = y
        while any(abs(line - other) < height for other in taken):  # below words that stand there
            line += height
        taken.append(line)
        fits = x + 1.5 * height + font.getlength(words) < left + width
        beside, anchor = x + (1.5 if fits else -1.5) * height, "lm" if fits else "rm"
        draw.text((beside, line), words, RING, font, anchor, stroke_width=max(height // 8, 2), stroke_fill=HALO)
