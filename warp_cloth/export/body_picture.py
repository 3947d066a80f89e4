"""Picture of a body as it was understood: limbs coloured, the skeleton, and the lines along which it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from warp_cloth.anatomy.measures import Measure
from warp_cloth.anatomy.person import Person
from warp_cloth.base.mesh import Points
from warp_cloth.export.preview import Layout, Window, arrange_windows, compose_picture, render_views, save_picture
from warp_cloth.export.render import build_subject, view_axes
from warp_cloth.export.surface import AVATAR_COLOUR, Colour, linear

LIMB_COLOURS: tuple[Colour, ...] = (  # sRGB, of LIMBS and of the trunk: the wearer's right is red, the left green
    (0.86, 0.78, 0.55),
    (0.86, 0.62, 0.58),
    (0.63, 0.79, 0.62),
    (0.80, 0.54, 0.50),
    (0.52, 0.70, 0.53),
    AVATAR_COLOUR,
)
BONE, TAPE, INK, LEADER = (40, 70, 150), (150, 20, 40), (50, 52, 56), (150, 152, 156)  # sRGB bytes
SIZE = (1500, 1000)  # [px]
SIDES = {"front": (0.0, 0.0, 1.0), "side": (1.0, 0.0, 0.0)}
LEFT_LABELS = {
    "thigh",
    "knee",
    "calf",
    "ankle",
    "upper_arm",
    "elbow",
    "wrist",
    "arm_length",
}  # the right limbs'
LINE_GAP = 1.5  # between labels, in heights of the text


def write_body_picture(path: Path, person: Person, *, title: str, sentence: str, device: str = "cpu") -> None:
    """Writes a PNG of the body from front and side, upright; one without limbs is drawn as it lies."""
    skeleton, stance, measures = person.skeleton, person.stance, person.measures
    frame = np.eye(3) if stance is None else np.stack([stance.left, stance.vertical, stance.forward])
    subject = build_subject([], replace(person.body, points=person.body.points @ frame.T), device)
    if skeleton is not None:
        colours = linear(np.array(LIMB_COLOURS)[skeleton.limb]).astype(np.float32)
        subject = replace(subject, colours=wp.array(colours, dtype=wp.vec3f, device=device))
    layout = arrange_windows(subject.extent, SIZE, True, SIDES)
    image = compose_picture(subject, layout, render_views(subject, layout), SIZE, title, sentence)
    drawing = _Drawing(image, layout, subject.centre)
    bones = [] if skeleton is None else [c for n, c in enumerate(skeleton.curves) if n not in skeleton.lacks]
    for window in layout.windows:
        for curve in bones:
            drawing.line(window, curve @ frame.T, BONE)
        for measure in measures:
            if len(measure.line):
                drawing.line(window, measure.line @ frame.T, TAPE)
    drawing.labels(layout.windows[0], [replace(each, line=each.line @ frame.T) for each in measures if len(each.line)])
    save_picture(image, path)


class _Drawing:
    """Lines and labels over a picture of a body."""

    def __init__(self, image: Image.Image, layout: Layout, centre: NDArray[np.float64]) -> None:
        self.draw, self.layout, self.centre = ImageDraw.Draw(image), layout, centre
        self.text_height = max(round(0.016 * image.height), 10)
        self.font = ImageFont.load_default(self.text_height)

    def pixels(self, window: Window, points: Points) -> list[tuple[float, float]]:
        """Where points, shape [N, 3], are in the picture."""
        right, up = view_axes(window.toward)
        off = (points - self.centre) / self.layout.pixel
        x = window.left + window.width / 2 + off @ right
        y = self.layout.top + self.layout.height / 2 - off @ up
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def line(self, window: Window, points: Points, colour: tuple[int, int, int]) -> None:
        self.draw.line(self.pixels(window, points), fill=colour, width=2, joint="curve")

    def labels(self, window: Window, measures: Sequence[Measure]) -> None:
        """Name and centimetres of each measure, in two columns beside the body, with a line to it."""
        for left in (True, False):
            column = [each for each in measures if (each.name in LEFT_LABELS) == left]
            ends = [self._outermost(window, each.line, left) for each in column]
            order = sorted(range(len(column)), key=lambda n: ends[n][1])
            lowest = 0.0
            for place, number in enumerate(order):
                x, y = ends[number]
                room = (len(order) - 1 - place) * LINE_GAP * self.text_height
                bottom = self.layout.top + self.layout.height - room
                height = min(max(y, lowest), bottom)
                lowest = height + LINE_GAP * self.text_height
                edge = window.left + (0.02 if left else 0.98) * window.width
                measure = column[number]
                text = f"{measure.name.replace('_', ' ')} {100.0 * (measure.value or 0.0):.1f}"
                start = edge + (1 if left else -1) * (self.font.getlength(text) + 6)
                self.draw.line([(start, height), (x, y)], fill=LEADER, width=1)
                self.draw.text((edge, height), text, fill=INK, font=self.font, anchor="lm" if left else "rm")

    def _outermost(self, window: Window, line: Points, left: bool) -> tuple[float, float]:
        """The pixel of a line that is farthest to the side; of several the highest."""
        side = -1.0 if left else 1.0
        return max(self.pixels(window, line), key=lambda place: (side * place[0], -place[1]))
