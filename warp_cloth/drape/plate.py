"""The plate that lies on the cloth over the support: the ellipse of its edge in a photograph, which gives the scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from warp_cloth.drape.photograph import Photograph
from warp_cloth.drape.silhouette import Mask, skimage_module

Floats = NDArray[np.float64]

SEARCH_SIDE = 220  # [pixels] of the reduced picture in which the plate is searched
DIRECTIONS = 72
EDGE_DIRECTIONS = 360
RADII = (0.46, 0.985)  # of the plate, in radii of a circle of the silhouette's area
SURE_PART = 0.3  # of the directions may show no edge
INSIDE = 1.0  # [pixels of the search] from the silhouette's own edge
LEAST_CONTRAST = 3.0  # of the edge over what other circles show
LEAST_EDGE = 0.6  # of the directions must agree on the ellipse
BORDERING = 2.0  # [pixels] from the silhouette's edge, whose own gradient must not count
FEWEST_POINTS = 100  # of an ellipse, where limp cloth hides the rest of its edge
FLATTEST = 0.95  # short over long axis; 10 degrees of tilt make 0.985


@dataclass(frozen=True)
class Plate:
    """An ellipse in a photograph."""

    center: tuple[float, float]  # x, y [pixels]
    axes: tuple[float, float]  # long and short half axis [pixels]
    turn: float  # of the long axis from x [rad]
    error: float  # of the radius, one standard deviation [pixels]

    @property
    def tilt(self) -> float:
        """Angle between the line of sight and the plate's normal [rad]."""
        return float(np.arccos(min(self.axes[1] / self.axes[0], 1.0)))

    def covers(self, shape: tuple[int, ...]) -> Mask:
        """The pixels inside."""
        y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
        c, s = np.cos(self.turn), np.sin(self.turn)
        dx, dy = x - self.center[0], y - self.center[1]
        along, across = (c * dx + s * dy) / self.axes[0], (c * dy - s * dx) / self.axes[1]
        return np.asarray(along**2 + across**2 < 1.0)


def find_plate(photograph: Photograph, cloth: Mask) -> Plate | None:
    """The plate's edge: the circle inside the silhouette whose edge is seen all round. None: there is none."""
    lab = np.asarray(skimage_module("color").rgb2lab(photograph.pixels))
    scale = max(max(lab.shape[:2]) / SEARCH_SIDE, 1.0)
    smooth = np.stack([ndimage.gaussian_filter(lab[..., c], 0.5 * scale) for c in range(3)])
    small = smooth[:, :: max(int(scale), 1), :: max(int(scale), 1)]
    step = max(int(scale), 1)
    found = _search(small, cloth[::step, ::step])
    if found is None:
        return None
    x, y, radius = (value * step for value in found)
    fine = np.stack([ndimage.gaussian_filter(lab[..., c], 1.0) for c in range(3)])
    depth = ndimage.distance_transform_edt(cloth)
    plate = None
    for reach in (0.06, 0.03):  # first near the circle, then near the circle through what was found
        points = _edge_points(fine, depth, x, y, radius, reach)
        plate = _ellipse(points)
        if plate is None:
            return None
        (x, y), radius = plate.center, float(np.sqrt(plate.axes[0] * plate.axes[1]))
    return plate


def _search(lab: Floats, cloth: Mask) -> tuple[float, float, float] | None:
    """Centre and radius of the best circle, after Daugman: one with an edge in most directions."""
    depth = ndimage.distance_transform_edt(cloth)
    area = float(cloth.sum())
    round_radius = np.sqrt(area / np.pi)
    cy, cx = ndimage.center_of_mass(cloth)
    shift = np.arange(-8, 9) * 0.025 * round_radius
    radii = np.linspace(RADII[0] * round_radius, RADII[1] * round_radius, 56)
    turn = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    best, where, scores = 0.0, None, []
    apart = max(0.02 * round_radius, 1.0)
    for dy in shift:
        for dx in shift:
            x = cx + dx + radii[:, None] * np.cos(turn)
            y = cy + dy + radii[:, None] * np.sin(turn)
            ex, ey = apart * np.cos(turn), apart * np.sin(turn)
            steps = [
                ndimage.map_coordinates(each, [y + ey, x + ex], order=1, mode="nearest")
                - ndimage.map_coordinates(each, [y - ey, x - ex], order=1, mode="nearest")
                for each in lab
            ]
            edge = np.sqrt(sum(each**2 for each in steps))
            inside = ndimage.map_coordinates(depth, [y, x], order=1, mode="constant") > INSIDE + 0.5 * apart
            enough = inside.mean(axis=1) > 0.3
            edge = np.sort(np.where(inside, edge, np.inf), axis=1)
            index = (SURE_PART * inside.sum(axis=1)).astype(int)
            score = np.where(enough, edge[np.arange(len(radii)), np.minimum(index, DIRECTIONS - 1)], 0.0)
            scores.append(score[enough])
            at = int(np.argmax(score))
            if score[at] > best:
                best, where = float(score[at]), (cx + dx, cy + dy, float(radii[at]))
    seen = np.concatenate(scores) if scores else np.zeros(1)
    usual = float(np.median(seen)) if len(seen) else 0.0
    return where if where is not None and best > max(LEAST_CONTRAST * usual, 1.0) else None


def _edge_points(lab: Floats, depth: Floats, x: float, y: float, radius: float, reach: float) -> Floats:
    """Points of the strongest edge in every direction near a circle, between pixels, shape [N, 2]."""
    turn = np.arange(EDGE_DIRECTIONS) * 2.0 * np.pi / EDGE_DIRECTIONS
    span = max(reach * radius, 3.0)
    steps = np.arange(-span, span + 0.25, 0.25)
    r = radius + steps[None, :]
    px, py = x + r * np.cos(turn)[:, None], y + r * np.sin(turn)[:, None]
    values = np.stack([ndimage.map_coordinates(each, [py, px], order=3, mode="nearest") for each in lab])
    edge = np.sqrt((np.gradient(values, axis=2) ** 2).sum(axis=0))
    inside = ndimage.map_coordinates(depth, [py, px], order=1, mode="constant") > BORDERING
    edge = np.where(inside, edge, 0.0)
    at = np.clip(np.argmax(edge, axis=1), 1, edge.shape[1] - 2)
    rows = np.arange(len(at))
    left, mid, right = edge[rows, at - 1], edge[rows, at], edge[rows, at + 1]
    bend = left - 2.0 * mid + right
    good = (mid > 0.0) & (bend < 0.0)
    off = np.where(good, 0.5 * (left - right) / np.where(good, bend, -1.0), 0.0)
    at_radius = radius + steps[at] + 0.25 * np.clip(off, -1.0, 1.0)
    good &= (at > 1) & (at < edge.shape[1] - 2)
    return np.column_stack([x + at_radius * np.cos(turn), y + at_radius * np.sin(turn)])[good]


def _ellipse(points: Floats) -> Plate | None:
    """The ellipse through most of the points, by least squares with outliers left out."""
    if len(points) < FEWEST_POINTS:
        return None
    keep = np.ones(len(points), dtype=bool)
    fit, off = np.zeros(5), np.zeros(len(points))
    for _ in range(8):
        fit = _harmonics(points[keep])
        off = _radial_error(points, fit)
        keep = np.abs(off) < max(2.5 * 1.4826 * float(np.median(np.abs(off[keep]))), 0.5)
        if keep.sum() < 20:
            return None
    if keep.sum() < LEAST_EDGE * len(points):
        return None
    cx, cy, radius, a, b = fit
    flat = float(np.hypot(a, b))
    axes = (float(radius + flat), float(radius - flat))
    if axes[1] < FLATTEST * axes[0]:
        return None
    error = float(np.std(off[keep]) / np.sqrt(keep.sum())) + 0.05
    return Plate((float(cx), float(cy)), axes, 0.5 * float(np.arctan2(b, a)), error)


def _harmonics(points: Floats) -> Floats:
    """Centre, mean radius and second harmonic of a curve that is nearly a circle, by least squares."""
    cx, cy = points.mean(axis=0)
    a = b = 0.0
    radius = 1.0
    for _ in range(6):
        x, y = points[:, 0] - cx, points[:, 1] - cy
        turn, r = np.arctan2(y, x), np.hypot(x, y)
        rows = np.column_stack([np.ones_like(r), np.cos(turn), np.sin(turn), np.cos(2 * turn), np.sin(2 * turn)])
        radius, dx, dy, a, b = np.linalg.lstsq(rows, r, rcond=None)[0]
        cx, cy = cx + dx, cy + dy
    return np.array([cx, cy, radius, a, b])


def _radial_error(points: Floats, fit: Floats) -> Floats:
    cx, cy, radius, a, b = fit
    x, y = points[:, 0] - cx, points[:, 1] - cy
    turn = np.arctan2(y, x)
    return np.asarray(np.hypot(x, y) - (radius + a * np.cos(2 * turn) + b * np.sin(2 * turn)))
