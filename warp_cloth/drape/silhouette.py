"""Which pixels of a photograph are cloth: what differs from the background that the picture's border shows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from warp_cloth.base.errors import InputError
from warp_cloth.drape.photograph import Photograph

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

BORDER = 0.03  # of the picture's side: there is nothing but background
TINTS = 2  # of a checked background
SHADOW = 0.3  # weight of a difference that a shadow would make: darker, of the same hue
DARKEST = 0.5  # of the background's light; what is darker still has little colour to tell
UNEVEN_LIGHT = 0.15  # of the background's light, about the slope of it across the picture
LAB_BLACK = 16.0  # added to L, a colour's (L, a, b) is in proportion to the cube root of its light
FAINTEST = 7.0  # [CIELAB]; what differs less from the background is background
SECOND_DRAPE = 0.2  # of the largest patch; another one as large is another drape
SMALLEST = 0.02  # of the picture
BAND = 3  # [pixels] on both sides of an edge, which are mixtures
LEAST_TONES = 1.0 / 300.0  # between the tones of a silhouette: masks of 0 and 1 among 256 levels, too
TONE, TWO_TONED = 0.06, 0.96  # a silhouette's pixels within TONE of its two tones; edges have levels between
TOUCHING = 0.15  # of a side that a silhouette may touch: a tip does, and a disc of 300 pixels cut by 1
NEARBY = 5.0  # [pixels], over which the colours on both sides of an edge are averaged
GRAIN = 0.03  # of white; a background that varies less is plain: with 0.1 a check's shadow still passes for cloth
SAME_COLOUR = 4e-3  # squared distance of the colours on both sides, of white; closer, no edge is measured


def plain(photograph: Photograph) -> Photograph | None:
    """A drawn silhouette, of two tones, as black on white with a margin; None: it is a photograph of more tones.

    Drawn ones are often cropped to the cloth, which a photograph must not be.
    """
    grey = photograph.pixels.mean(axis=2)
    low, high = float(grey.min()), float(grey.max())
    if high - low < LEAST_TONES:
        return None
    level = (grey - low) / (high - low)
    if np.mean((level < TONE) | (level > 1.0 - TONE)) < TWO_TONED:
        return None
    frame = [level[0], level[-1], level[:, 0], level[:, -1]]
    ground = float(np.median(np.concatenate(frame))) > 0.5
    level = level if ground else 1.0 - level
    if any(float(np.mean(side < 0.5)) > TOUCHING for side in (level[0], level[-1], level[:, 0], level[:, -1])):
        return None  # it may be cut off
    margin = round(2.0 * BORDER * max(level.shape)) + 4
    whole = np.pad(level, margin, constant_values=1.0)
    return replace(photograph, pixels=np.repeat(whole[..., None], 3, axis=2))


def find_cloth(photograph: Photograph, plate: Mask | None = None) -> Mask:
    """The pixels that the cloth and the plate on it cover; ``plate``: those that are known to.

    Raises:
        InputError: there is none, more than one, or it is cut off.
    """
    place, away = photograph.path, _difference(photograph.pixels)
    skimage = skimage_module("filters")
    threshold = max(float(skimage.threshold_otsu(np.minimum(away, 60.0))), FAINTEST)
    clear = ndimage.gaussian_filter(away, 0.7) > threshold
    if plate is not None:
        clear |= plate
    # a plate of the background's colour is a hole, whose rim may be thinner than a pixel or two
    closed = np.pad(clear, 4)
    closed = ndimage.binary_closing(closed, iterations=3)[4:-4, 4:-4]
    holes = ndimage.binary_fill_holes(closed) & ~closed
    holes = ndimage.binary_dilation(ndimage.binary_opening(holes, iterations=3), iterations=4) & closed | holes
    clear = ndimage.binary_opening(ndimage.binary_fill_holes(clear | holes), iterations=2)
    patches, count = ndimage.label(clear)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)[1:]
    if count == 0 or sizes.max() < SMALLEST * clear.size:
        remedy = "photograph a drape from above, the whole of it, on a background of another colour"
        raise InputError(place, "no cloth stands out from the background", remedy)
    large = np.flatnonzero(sizes >= SECOND_DRAPE * sizes.max()) + 1
    cloth = patches == 1 + int(np.argmax(sizes))
    margin = 2
    inner = np.zeros_like(cloth)
    inner[margin:-margin, margin:-margin] = True
    if (cloth & ~inner).any():
        raise InputError(place, "the cloth is cut off by the picture's border", "show all of it and some background")
    if len(large) > 1:
        raise InputError(place, f"shows {len(large)} things of the size of a drape", "crop it to one drape")
    return cloth


def coverage(photograph: Photograph, cloth: Mask) -> Floats:
    """The fraction of each pixel that cloth covers: at an edge, where its colour is between those on both sides.

    It is measured along Fisher's linear discriminant of cloth and background (The use of multiple measurements in
    taxonomic problems, 1936), so that a checked background's own light and dark do not count.
    """
    pixels = photograph.pixels
    inside = ndimage.binary_erosion(cloth, iterations=BAND)
    outside = ~ndimage.binary_dilation(cloth, iterations=BAND)
    band = ~inside & ~outside
    near, far = _local_mean(pixels, inside)[band], _local_mean(pixels, outside)[band]
    way = near - far
    row, column = np.triu_indices(3)
    spread = np.empty((len(way), 3, 3))
    spread[:, row, column] = _local_mean(pixels[..., row] * pixels[..., column], outside)[band]
    spread[:, row, column] -= far[:, row] * far[:, column]
    spread[:, column, row] = spread[:, row, column]
    weights = np.linalg.solve(spread + GRAIN**2 * np.eye(3), way[..., None])[..., 0]
    apart = (way * weights).sum(axis=1)
    part = ((pixels[band] - far) * weights).sum(axis=1) / np.maximum(apart, 1e-9)
    cover = cloth.astype(np.float64)
    cover[band] = np.where((way**2).sum(axis=1) > SAME_COLOUR, np.clip(part, 0.0, 1.0), cover[band])
    return cover


def _difference(pixels: Floats) -> Floats:
    """Distance of every pixel from the background's colours in whatever light [CIELAB], shape [H, W].

    Light and shadow scale a colour (L + 16, a, b) as a whole, but for the darkest: what has another hue or chroma
    than a background that were as dark differs, however the light falls.
    """
    lab = np.asarray(skimage_module("color").rgb2lab(pixels))
    lab[..., 0] += LAB_BLACK
    height, width = lab.shape[:2]
    rim = max(round(BORDER * min(height, width)), 3)
    border = np.ones((height, width), dtype=bool)
    border[rim:-rim, rim:-rim] = False
    y, x = np.mgrid[0:height, 0:width]
    terms = np.stack([(x / width - 0.5), (y / height - 0.5)], axis=-1)
    tints, slope = _tints(lab[border], terms[border])
    level = lab / (1.0 + terms @ slope)[..., None]
    away = np.full((height, width), np.inf)
    for tint in tints:
        shade = level[..., 0] / tint[0]
        lighter = level[..., 0] - tint[0]
        lighter = np.where(lighter < 0.0, SHADOW * lighter, lighter)
        hue = (level[..., 1:] - shade[..., None] * tint[1:]) / np.clip(shade, DARKEST, 1.0)[..., None]
        away = np.minimum(away, np.sqrt(lighter**2 + (hue**2).sum(axis=2)))
    return away


def _tints(seen: Floats, where: Floats) -> tuple[Floats, Floats]:
    """The background's colours, and how the light grows along x and y (relative), from the border's pixels."""
    slope = np.zeros(2)
    low, high = np.quantile(seen[:, 0], [0.1, 0.9])
    middle = np.median(seen, axis=0)
    tints = np.stack([middle, middle])[:TINTS]
    tints[:, 0] = low, high
    for _ in range(8):
        level = seen / (1.0 + where @ slope)[:, None]
        nearest = np.argmin(((level[:, None] - tints) ** 2).sum(axis=2), axis=1)
        for index in range(TINTS):
            if (nearest == index).sum() >= 10:
                tints[index] = np.median(level[nearest == index], axis=0)
        off = seen[:, 0] / tints[nearest, 0] - 1.0
        usual = np.abs(off - where @ slope) < UNEVEN_LIGHT
        if usual.sum() > 10:
            slope = np.linalg.lstsq(where[usual], off[usual], rcond=None)[0]
    return tints, slope


def _local_mean(pixels: Floats, chosen: Mask) -> Floats:
    """Mean of the chosen pixels round every pixel, for each channel."""
    weight = ndimage.gaussian_filter(chosen.astype(np.float64), NEARBY) + 1e-9
    channels = range(pixels.shape[-1])
    sums = [ndimage.gaussian_filter(np.where(chosen, pixels[..., c], 0.0), NEARBY) for c in channels]
    return np.stack([each / weight for each in sums], axis=-1)


def skimage_module(name: str) -> Any:
    """A module of scikit-image, which is an extra.

    Raises:
        InputError: it is not installed.
    """
    import importlib

    try:
        return importlib.import_module(f"skimage.{name}")
    except ImportError:
        raise InputError("scikit-image", "is needed for photographs", "pip install 'warp-cloth[photo]'") from None
