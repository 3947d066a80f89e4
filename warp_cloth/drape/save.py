"""A fabric made from drapes as files: NAME.toml, and a picture of the photographs with both outlines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from warp_cloth.base.toml_file import toml_text
from warp_cloth.drape.made import MadeFabric, apart, rigidities
from warp_cloth.drape.outline import ANGLES, Outline
from warp_cloth.drape.reading import DrapeReading, Setting
from warp_cloth.export.files import whole_file
from warp_cloth.material.laboratory import KES_FORCE, KES_SHEAR, MATCHED_SHEAR_ANGLE

FOUND, SIMULATED, PLATE = (220, 30, 30), (20, 90, 230), (20, 160, 60)
TILE = 800  # [pixels], height of a photograph in the picture


def fabric_toml(made: MadeFabric, setting: Setting, source: str) -> str:
    """A fabric file's text."""
    fabric, support = made.fabric, setting.support
    warp, weft = rigidities(fabric, made.estimate, support)
    mean_error, error = (100.0 * value for value in made.rigidity_errors)
    lines = [
        f"# Made by warp-cloth fabric from a drape coefficient of {made.coefficient:.1f} %, disc "
        f"{2e3 * setting.disc:g} mm, support {2e3 * support:g} mm.",
        f"source = {toml_text(source)}",
        f"weight_gsm = {1e3 * fabric.weight:.6g} # as stated",
        f"bending_B_warp = {warp:.4g} # gf cm2/cm, +- {error:.0f} % (one standard deviation)",
        f"bending_B_weft = {weft:.4g} # +- {error:.0f} %; the mean of both: +- {mean_error:.0f} %",
        f"# Real fabrics draped again differ by {made.again:.1f} points (typical standard deviation), which is "
        f"{100.0 * made.again_error:.0f} % of B more.",
        "# A drape hardly tells what follows: it is typical, and the base's.",
        f"emt_warp_percent = {100.0 * (KES_FORCE / fabric.stretch_warp) ** 0.5:.4g} # % at 500 gf/cm",
        f"emt_weft_percent = {100.0 * (KES_FORCE / fabric.stretch_weft) ** 0.5:.4g}",
    ]
    if fabric.shear is not None:
        lines.append(f"shear_G = {fabric.shear * MATCHED_SHEAR_ANGLE / KES_SHEAR:.4g} # gf/(cm degree)")
    lines += [
        f"compression = {fabric.compression:g}",
        f"thickness_mm = {1e3 * fabric.thickness:.4g}",
        f"friction = {fabric.friction:g}",
    ]
    return "\n".join(lines) + "\n"


def save_fabric(
    made: MadeFabric, readings: Sequence[DrapeReading], setting: Setting, source: str, out: Path
) -> list[Path]:
    """Writes the fabric file and, of photographs, its picture next to it; returns what was written."""
    paths = [out]
    with whole_file(out) as place:
        place.write_text(fabric_toml(made, setting, source), encoding="utf-8")
    if readings:
        paths.append(out.with_name(f"{out.stem}_drape.png"))
        picture = overlay(made, readings, setting)
        with whole_file(paths[1]) as place:
            picture.save(place, format="PNG")
    return paths


def overlay(made: MadeFabric, readings: Sequence[DrapeReading], setting: Setting) -> Image.Image:
    """The photographs side by side, with the found outline, the simulated one and the plate's edge."""
    tiles = []
    for number, reading in enumerate(readings):
        image = Image.fromarray(np.round(255.0 * reading.photograph.pixels).astype(np.uint8))
        scale = TILE / image.height
        image = image.resize((max(round(image.width * scale), 1), TILE))
        draw = ImageDraw.Draw(image)
        _line(draw, scale * reading.contour, FOUND)
        if reading.plate is not None:
            _line(draw, scale * _on_picture(Outline(np.ones(ANGLES)), reading, setting, np.zeros(2)), PLATE)
        text = f"drape coefficient {reading.coefficient:.1f} %, {reading.outline.folds} folds (red)"
        if number in made.simulated:
            simulated = made.simulated[number].outline
            middle = reading.contour.mean(axis=0) - _on_picture(reading.outline, reading, setting, np.zeros(2)).mean(
                axis=0
            )
            _line(draw, scale * _on_picture(simulated, reading, setting, middle), SIMULATED)
            far = 1e3 * setting.support * apart(reading.outline, simulated)
            text += f"; simulated {simulated.coefficient(setting.ratio):.1f} % (blue), {far:.1f} mm apart (rms)"
        draw.rectangle([0, 0, image.width, 22], fill="white")
        draw.text((6, 5), text, fill="black")
        tiles.append(image)
    whole = Image.new("RGB", (sum(tile.width for tile in tiles), TILE), "white")
    at = 0
    for tile in tiles:
        whole.paste(tile, (at, 0))
        at += tile.width
    return whole


def _on_picture(outline: Outline, reading: DrapeReading, setting: Setting, shift: np.ndarray) -> np.ndarray:
    """Points of an outline in the working picture, shape [ANGLES, 2]."""
    turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES + np.radians(setting.warp_degrees - 90.0)
    flat = outline.radius * np.stack([np.cos(turn), np.sin(turn)])
    return np.asarray((reading.to_picture[:, :2] @ flat + reading.to_picture[:, 2:]).T + shift)


def _line(draw: ImageDraw.ImageDraw, points: np.ndarray, colour: tuple[int, int, int]) -> None:
    closed = [tuple(point) for point in points.tolist()]
    draw.line([*closed, closed[0]], fill=colour, width=2)
