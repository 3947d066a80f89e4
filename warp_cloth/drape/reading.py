"""A drape test read off a photograph: outline, drape coefficient, how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.drape.outline import Outline, outline_of_points
from warp_cloth.drape.photograph import Photograph, read_photograph
from warp_cloth.drape.plate import Plate, find_plate
from warp_cloth.drape.silhouette import Mask, coverage, find_cloth, plain, skimage_module
from warp_cloth.drape.table import drapes_of_ratio

Floats = NDArray[np.float64]

EDGE_ERROR = 0.15  # [pixels], systematic, of the silhouette's edge
LIMP = 30.0  # [%]; below, folds hang over one another, and tilt and a near camera show their sides
LIMP_ERROR = 2.0  # [points]
PLAIN_ERROR = 0.3  # [points] of the coefficient, on the best of photographs
STEEPEST_TILT = 12.0  # [degrees]; the documented 10 and what the reading may err
SHARP_DROP = 0.95  # of the drop of a rim that would hang from the support's edge on a straight line
REACH_ERROR = 0.02  # of the reach of folds: measured fabrics lie within 1 % of one line, other discs may not
PLAUSIBLE = (0.9, 1.06)  # of the support's radius at least, of the disc's at most
SHORTEST = 0.75  # of the rim's length, seen from above: 0.93 to 0.98 in 68 drapes of 26 to 95 %, cloth shrinks little


@dataclass(frozen=True)
class Setting:
    """What is known of how a drape was photographed."""

    support: float = 0.09  # radius [m]
    disc: float = 0.15  # radius [m]
    warp_degrees: float = 90.0  # of the warp in the picture, from right, counter-clockwise
    metres_per_pixel: float | None = None  # of the file; None: from the plate's edge
    camera: float | None = None  # from the plate [m]; None: from the file's focal length, else far away

    @property
    def ratio(self) -> float:
        return self.disc / self.support


@dataclass(frozen=True, eq=False)
class DrapeReading:
    """What one photograph shows."""

    photograph: Photograph
    plate: Plate | None
    contour: Floats  # the silhouette's edge in the working picture, x, y [pixels], shape [N, 2]
    to_picture: Floats  # from support radii, x right, y up, to working pixels, shape [2, 3]
    outline: Outline  # angle 90 along the warp
    coefficient: float  # [%]
    error: float  # of the coefficient, one standard deviation [points]
    notes: tuple[str, ...]


def read_drape(path: Path, setting: Setting) -> DrapeReading:
    """Reads a drape off a photograph taken from above.

    Raises:
        InputError: no single whole drape is seen, or nothing gives its scale.
    """
    photograph = read_photograph(path)
    drawn = plain(photograph)
    photograph = drawn or photograph
    cloth = find_cloth(photograph)
    plate = None
    if not drawn:
        plate, cloth = _plate_and_cloth(photograph, cloth)
    contour = _contour(coverage(photograph, cloth), path)
    notes: list[str] = []
    if drawn and setting.metres_per_pixel is None:
        to_picture, radius_pixels, radius_error = _scale_of_reach(contour, setting)
        notes.append("nothing gives a silhouette's scale: it is guessed from its folds' reach; give --mm-per-pixel")
    else:
        to_picture, radius_pixels, radius_error = _scale(photograph, plate, contour, setting)
    x, y = _plane(contour, to_picture)
    camera = _camera(photograph, setting, radius_pixels)
    if camera is None:
        notes.append(
            "the camera's distance is unknown and taken as large: from 1 m the coefficient reads "
            f"{_nearness(x, y, setting):.0f} points low; give --camera-mm"
        )
    else:
        x, y = _undo_perspective(x, y, camera, setting.ratio)
    x, y = x - _middle(x, y)[0], y - _middle(x, y)[1]
    turn = np.radians(90.0 - setting.warp_degrees)
    outline = outline_of_points(x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn))
    _check(outline, path, setting, plate)
    if plate is not None and np.degrees(plate.tilt) > 6.0:
        notes.append(f"the camera is tilted by about {np.degrees(plate.tilt):.0f} degrees")
    coefficient = outline.coefficient(setting.ratio)
    return DrapeReading(
        photograph,
        plate,
        contour,
        to_picture,
        outline,
        coefficient,
        _error(outline, setting, radius_pixels, radius_error),
        tuple(notes),
    )


def _plate_and_cloth(photograph: Photograph, cloth: Mask) -> tuple[Plate | None, Mask]:
    """The plate, and the cloth with it: a plate of the background's colour that a notch reaches is no hole in it."""
    plate = find_plate(photograph, cloth)
    if plate is not None:
        return plate, cloth
    plate = find_plate(photograph, np.asarray(skimage_module("morphology").convex_hull_image(cloth)))
    return plate, cloth if plate is None else find_cloth(photograph, plate.covers(cloth.shape))


def _contour(cover: Floats, path: Path) -> Floats:
    found = skimage_module("measure").find_contours(np.pad(cover, 1), 0.5)
    if not found:
        raise InputError(path, "the cloth has no clear edge", "photograph it on a background of another colour")
    longest = max(found, key=len)
    return np.asarray(longest[:, ::-1] - 1.0)


def _scale(
    photograph: Photograph, plate: Plate | None, contour: Floats, setting: Setting
) -> tuple[Floats, float, float]:
    """Map from support radii to pixels, the support's radius [pixels] and its error."""
    if setting.metres_per_pixel is not None:
        radius = setting.support / (setting.metres_per_pixel * photograph.reduced_by)
        middle = np.array(_middle(contour[:, 0], contour[:, 1]) if plate is None else plate.center)
        return np.array([[radius, 0.0, middle[0]], [0.0, -radius, middle[1]]]), radius, 0.0
    if plate is None:
        problem = "no plate's edge is seen on the cloth all round, so that nothing gives the scale"
        raise InputError(photograph.path, problem, "lay a plate of the support's size on it, or give --mm-per-pixel")
    # along the short axis the picture is shortened by the tilt: the map is symmetric, it turns nothing
    c, s = np.cos(plate.turn), np.sin(plate.turn)
    turn = np.array([[c, -s], [s, c]])
    shape = turn @ np.diag(plate.axes) @ turn.T
    to_picture = np.column_stack([shape @ np.diag([1.0, -1.0]), plate.center])
    return to_picture, float(np.sqrt(plate.axes[0] * plate.axes[1])), plate.error


def _scale_of_reach(contour: Floats, setting: Setting) -> tuple[Floats, float, float]:
    """The same of a silhouette alone: tips of folds that fill so much of the circle round them reach so far."""
    middle = np.array(_middle(contour[:, 0], contour[:, 1]))
    seen = outline_of_points(*(contour - middle).T)
    reach, error = drapes_of_ratio(setting.ratio).reach_of(float(np.mean(seen.radius**2)) / seen.reach**2)
    radius = seen.reach / reach
    to_picture = np.array([[radius, 0.0, middle[0]], [0.0, -radius, middle[1]]])
    return to_picture, radius, radius * float(np.hypot(error / reach, REACH_ERROR))


def _plane(contour: Floats, to_picture: Floats) -> tuple[Floats, Floats]:
    """A contour's points in support radii."""
    x, y = np.linalg.solve(to_picture[:, :2], (contour - to_picture[:, 2]).T)
    return x, y


def _camera(photograph: Photograph, setting: Setting, radius_pixels: float) -> float | None:
    """Distance of the camera from the plate, in support radii."""
    if setting.camera is not None:
        return setting.camera / setting.support
    return None if photograph.focal is None else photograph.focal / radius_pixels


def _undo_perspective(x: Floats, y: Floats, camera: float, ratio: float) -> tuple[Floats, Floats]:
    """Points of the rim as seen from afar: the rim hangs below the plate, so that it is farther and looks smaller."""
    seen = np.hypot(x, y)
    true = seen
    for _ in range(20):
        drop = SHARP_DROP * np.sqrt(np.maximum((ratio - 1.0) ** 2 - np.maximum(true - 1.0, 0.0) ** 2, 0.0))
        true = 0.5 * (true + seen * (1.0 + drop / camera))
    grown = true / np.maximum(seen, 1e-9)
    return x * grown, y * grown


def _nearness(x: Floats, y: Floats, setting: Setting) -> float:
    far_x, far_y = _undo_perspective(x, y, 1.0 / setting.support, setting.ratio)
    near, far = (outline_of_points(*each).coefficient(setting.ratio) for each in ((x, y), (far_x, far_y)))
    return far - near


def _middle(x: Floats, y: Floats) -> tuple[float, float]:
    """Centroid of a polygon: with tilt it is beside the plate's, since the rim hangs lower."""
    following_x, following_y = np.roll(x, -1), np.roll(y, -1)
    cross = x * following_y - following_x * y
    area = 3.0 * cross.sum()
    return float(((x + following_x) * cross).sum() / area), float(((y + following_y) * cross).sum() / area)


def _check(outline: Outline, path: Path, setting: Setting, plate: Plate | None) -> None:
    least, most = float(outline.radius.min()), float(outline.radius.max())
    if not (least > PLAUSIBLE[0] and most < PLAUSIBLE[1] * setting.ratio):
        size = 1e3 * setting.support
        problem = (
            f"the outline, {size * least:.0f} to {size * most:.0f} mm from its middle, cannot be a disc of "
            f"{2e3 * setting.disc:.0f} mm on a support of {2 * size:.0f} mm"
        )
        raise InputError(path, problem, "check --disc-mm, --support-mm, --mm-per-pixel, and what the picture shows")
    shown = outline.length / (2.0 * np.pi * setting.ratio)
    if shown < SHORTEST:
        problem = f"the outline is {100.0 * shown:.0f} % as long as the disc's rim, and cloth does not shrink so"
        raise InputError(path, problem, "photograph the drape on a plain background of another colour")
    if plate is not None and np.degrees(plate.tilt) > STEEPEST_TILT:
        problem = f"the camera is tilted by {np.degrees(plate.tilt):.0f} degrees"
        raise InputError(path, problem, "hold it straight above the drape: 10 degrees at most")


def _error(outline: Outline, setting: Setting, radius_pixels: float, radius_error: float) -> float:
    """One standard deviation of the coefficient [points]: edges of the silhouette and of the plate."""
    ring = setting.ratio**2 - 1.0
    edge = 100.0 * 2.0 * float(outline.radius.mean()) * EDGE_ERROR / radius_pixels / ring
    plate = 100.0 * 2.0 * float(np.mean(outline.radius**2)) * radius_error / radius_pixels / ring
    limp = LIMP_ERROR if outline.coefficient(setting.ratio) < LIMP else 0.0
    return float(np.sqrt(PLAIN_ERROR**2 + edge**2 + plate**2 + limp**2))
