"""Photographs of drapes, rendered: cloth, plate, background, shadow, tilt, JPEG."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter


@dataclass(frozen=True)
class View:
    """How a drape is photographed."""

    side: int = 500  # [pixels]
    fills: float = 0.75  # of the picture's side, by the flat disc
    tilt: float = 0.0  # [degrees]
    toward: float = 0.0  # direction of the tilt [degrees]
    camera: float | None = None  # [m] from the plate; None: far away
    cloth: tuple[int, int, int] = (60, 90, 150)
    plate: tuple[int, int, int] = (200, 190, 170)
    background: tuple[int, int, int] = (235, 235, 230)
    check: int = 0  # pixels of a check at 1,000 pixels a side; 0: plain
    shadow: float = 0.0  # darkness of the shadow beside the drape
    light: float = 0.0  # fall of the light across the picture
    quality: int = 85  # of the JPEG
    noise: float = 1.0


def random_view(seed: int) -> View:
    """Any photograph within the documented limits."""
    rng = np.random.default_rng(seed)
    colours = [(60, 90, 150), (150, 40, 50), (40, 45, 50), (90, 120, 70), (170, 140, 90), (120, 60, 130)]
    return View(
        side=int(np.exp(rng.uniform(np.log(256), np.log(4000)))),
        fills=rng.uniform(0.6, 0.85),
        tilt=rng.uniform(0.0, 10.0),
        toward=rng.uniform(0.0, 360.0),
        cloth=colours[rng.integers(len(colours))],
        plate=[(205, 195, 175), (225, 225, 230), (20, 20, 20)][rng.integers(2)],
        background=[(235, 235, 230), (210, 220, 225), (240, 225, 190)][rng.integers(3)],
        check=int(rng.choice([0, 0, 40])),
        shadow=rng.uniform(0.0, 0.35),
        light=rng.uniform(0.0, 0.25),
        quality=int(rng.integers(55, 95)),
        noise=rng.uniform(0.0, 3.0),
    )


def photograph(points: np.ndarray, triangles: np.ndarray, view: View, support: float, disc: float, path: Path) -> Path:
    """Renders a draped disc [m], lying at y = 0 on its support, seen from above; writes a JPEG or PNG."""
    fine = 2 if view.side < 1600 else 1
    side = view.side * fine
    scale = view.fills * side / (2.0 * disc)
    turn, lean = np.radians(view.toward), np.radians(view.tilt)
    along = np.array([np.cos(turn), np.sin(turn)])

    def project(p: np.ndarray) -> np.ndarray:
        flat = np.column_stack([p[:, 0], -p[:, 2]])
        part = flat @ along
        moved = flat + np.outer(part * (np.cos(lean) - 1.0) + p[:, 1] * np.sin(lean), along)
        depth = p[:, 1] * np.cos(lean) - part * np.sin(lean)
        if view.camera is not None:
            moved = moved * (view.camera / (view.camera - depth))[:, None]
        return np.column_stack([0.5 * side + scale * moved[:, 0], 0.5 * side - scale * moved[:, 1]])

    circle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    ring = support * np.column_stack([np.cos(circle), np.zeros(720), np.sin(circle)])
    mask = Image.new("L", (side, side))
    lit = Image.new("L", (side, side))
    fill, shade = ImageDraw.Draw(mask), ImageDraw.Draw(lit)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    normals *= np.where(normals[:, 1:2] < 0.0, -1.0, 1.0)
    bright = 150 + 100 * np.clip(normals @ np.array([0.35, 0.9, 0.2]), 0.0, 1.0)
    order = np.argsort(corners[:, :, 1].mean(axis=1))
    flat = project(points)[triangles].reshape(-1, 6)
    for polygon, value in zip(flat[order].tolist(), bright[order].tolist(), strict=True):
        fill.polygon(polygon, fill=255)
        shade.polygon(polygon, fill=int(value), outline=int(value))
    plate_mask = Image.new("L", (side, side))
    edge = [tuple(p) for p in project(ring).tolist()]
    ImageDraw.Draw(plate_mask).polygon(edge, fill=255)
    fill.polygon(edge, fill=255)
    picture = _lay(view, side, mask, lit, plate_mask)
    if fine > 1:
        picture = picture.resize((view.side, view.side), Image.Resampling.BOX)
    picture.save(path, **({"quality": view.quality} if path.suffix == ".jpg" else {}))
    return path


def _lay(view: View, side: int, mask: Image.Image, lit: Image.Image, plate: Image.Image) -> Image.Image:
    rng = np.random.default_rng(view.side)
    image = np.empty((side, side, 3), dtype=np.float32)
    image[:] = view.background
    y, x = np.mgrid[0:side, 0:side].astype(np.float32) / side
    if view.check:
        squares = (np.floor(x * 1000 / view.check) + np.floor(y * 1000 / view.check)) % 2
        image *= (1.0 - 0.3 * squares)[..., None]
    if view.shadow:
        beside = mask.filter(ImageFilter.GaussianBlur(0.012 * side))
        moved = Image.new("L", (side, side))
        moved.paste(beside, (round(0.02 * side), round(0.015 * side)))
        image *= (1.0 - view.shadow * np.asarray(moved, dtype=np.float32) / 255.0)[..., None]
    cover = np.asarray(mask) > 127
    tone = np.asarray(lit, dtype=np.float32)[..., None] / 255.0 * np.array(view.cloth, dtype=np.float32)
    image = np.where(cover[..., None], np.where(tone > 0, tone, view.cloth), image)
    image[np.asarray(plate) > 127] = view.plate
    image *= (1.0 - view.light * x)[..., None]
    image += view.noise * rng.standard_normal(image.shape, dtype=np.float32)
    return Image.fromarray(np.clip(image, 0, 255).astype(np.uint8))
