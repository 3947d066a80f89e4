"""What stands above the picture of a fit: its name, the verdict in its colour, the ease, and the sentence in full."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw

from warp_cloth.export.lettering import Font, font_for, spelt
from warp_cloth.loading.raw import counted
from warp_cloth.report.shown import ShownVerdict

INK = (70, 72, 76)  # sRGB bytes, of the title
FAINT_INK = (120, 122, 126)  # of less important text
CHIP_INK = (255, 255, 255)
MOST_LINES = 8  # of the sentence: what to change stands at its end
MOST_EASES = 4  # garments
LEADING = 1.5  # from line to line, in text heights
FIRST = 2.4  # the foot of the first line, which is larger, likewise


@dataclass(frozen=True)
class Head:
    """The words above a picture."""

    name: str
    verdict: ShownVerdict
    ease: Sequence[str]  # a line for each garment
    message: str

    @property
    def ease_shown(self) -> list[str]:
        """Lines of the ease, for the first few garments."""
        more = len(self.ease) - MOST_EASES
        lines = [f"ease: {line}" for line in self.ease[:MOST_EASES]]
        return [*lines, f"and of {counted(more, 'more garment')}, in the report"] if more > 0 else lines

    def font(self, height: int) -> Font:
        """Of everything below the first line."""
        return font_for(height, *self.ease_shown, self.message)

    def lines(self, height: int, width: float) -> list[str]:
        """Everything below the first line, in lines no wider than ``width`` [px], of text ``height`` [px] high."""
        font = self.font(height)
        ease = [shorten(line, font, width) for line in self.ease_shown]
        return [*ease, *wrapped(self.message, font, width, MOST_LINES)]


def draw_head(image: Image.Image, head: Head, height: int, margin: int) -> None:
    """Draws the words at the top of a picture; ``height`` of the text, ``margin`` left and right [px]."""
    draw, width = ImageDraw.Draw(image), image.width - 2 * margin
    big, font = font_for(round(1.3 * height), head.name), head.font(height)
    chip = font.getlength(head.verdict.words) + 1.2 * height
    name = shorten(head.name, big, width - chip - height)
    draw.text((margin, 2 * height), name, fill=INK, font=big, anchor="ls")
    left = margin + big.getlength(name) + height
    box = (left, 0.8 * height, left + chip, 2.4 * height)
    draw.rounded_rectangle(box, radius=0.8 * height, fill=head.verdict.colour)
    draw.text((left + chip / 2, 1.6 * height), head.verdict.words, fill=CHIP_INK, font=font, anchor="mm")
    for number, line in enumerate(head.lines(height, width), start=1):
        ink = INK if number <= len(head.ease_shown) else FAINT_INK
        draw.text((margin, (FIRST + LEADING * number) * height), line, fill=ink, font=font, anchor="ls")


def shorten(text: str, font: Font, width: float) -> str:
    """The text in one line no wider than ``width`` [px], with an ellipsis where it was cut."""
    line = " ".join(spelt(text, font).split())
    if font.getlength(line) <= width:
        return line
    while line and font.getlength(line + "…") > width:
        line = line[:-1]
    return line.rstrip() + "…" if line else ""


def wrapped(text: str, font: Font, width: float, most: int) -> list[str]:
    """The text in at most so many lines, no wider than ``width`` [px]; an ellipsis ends it where it was cut."""
    words = spelt(text, font).split()
    lines: list[str] = []
    while words and len(lines) < most - 1:
        count = 1
        while count < len(words) and font.getlength(" ".join(words[: count + 1])) <= width:
            count += 1
        lines.append(shorten(" ".join(words[:count]), font, width))
        words = words[count:]
    return [*lines, shorten(" ".join(words), font, width)] if words else lines
