"""A picture file as an array, in a size that its outline can be read in."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from warp_cloth.base.errors import InputError

MOST_PIXELS = 64_000_000  # a telephone's 48 megapixels, and some
FEWEST_SIDE = 100  # [pixels]
WORKING_SIDE = 1000  # [pixels]; a disc of 300 mm is then read to 0.1 mm
FOCAL_35MM = 41989  # EXIF's focal length on film of 43.3 mm across
FILM_DIAGONAL = 43.27  # [mm]
EXIF_DETAILS = 0x8769


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph reduced to at most WORKING_SIDE pixels."""

    path: Path
    pixels: NDArray[np.float64]  # sRGB from 0 to 1, shape [H, W, 3]
    reduced_by: float  # pixels of the file in one of these, along a side
    focal: float | None  # [pixels of these]; None: the file does not say


def read_photograph(path: Path) -> Photograph:
    """Reads a picture file, turned as its EXIF data says.

    Raises:
        InputError: there is no such file, it is no picture, cut short, too large or too small.
    """
    try:
        if not path.is_file():
            raise InputError(path, "is a folder" if path.is_dir() else "no such photograph", "check the path")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as file:
                width, height = file.size
                if width * height > MOST_PIXELS:
                    problem = f"has {width * height / 1e6:.0f} megapixels, more than {MOST_PIXELS / 1e6:.0f}"
                    raise InputError(path, problem, "reduce it; 4 megapixels are enough")
                if min(width, height) < FEWEST_SIDE:
                    problem = f"has only {width} x {height} pixels"
                    raise InputError(path, problem, f"give at least {FEWEST_SIDE} along each side")
                film = file.getexif().get_ifd(EXIF_DETAILS).get(FOCAL_35MM)
                picture = _upright(file)
    except InputError:
        raise
    except Image.DecompressionBombError:
        raise InputError(path, "has far too many megapixels", "reduce it; 4 megapixels are enough") from None
    except Exception as error:  # Pillow's decoders raise many kinds on broken files
        problem = f"cannot be read as a picture: {str(error)[:80]}"
        raise InputError(path, problem, "give a whole JPEG, PNG or WebP file") from None
    by = max(max(picture.size) / WORKING_SIDE, 1.0)
    if by > 1.0:
        small = (round(picture.width / by), round(picture.height / by))
        picture = picture.resize(small, Image.Resampling.BOX)
    diagonal = float(np.hypot(*picture.size))
    focal = float(film) / FILM_DIAGONAL * diagonal if isinstance(film, int | float) and film > 0 else None
    return Photograph(path, np.asarray(picture, dtype=np.float64) / 255.0, by, focal)


def _upright(file: Image.Image) -> Image.Image:
    """The picture in RGB, on white where it is transparent, turned as its EXIF data says."""
    upright = ImageOps.exif_transpose(file) or file
    if "A" in upright.getbands() or "transparency" in upright.info:
        clear = upright.convert("RGBA")
        white = Image.new("RGBA", clear.size, "white")
        return Image.alpha_composite(white, clear).convert("RGB")
    return upright.convert("RGB")
