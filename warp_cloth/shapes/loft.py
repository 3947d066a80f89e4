"""Lofts: tubes of superelliptic sections along an axis, as smooth implicit functions (negative inside)."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.base.mesh import Points

Values = NDArray[np.float64]
TABLE_SIZE = 400  # samples of each profile along the axis: linear between them, so dense enough not to show
TINY = 1e-12  # [m2] keeps quotients finite on the axis, far below any section's area


def natural_spline(knots: Values, values: Values, where: Values) -> Values:
    """Natural cubic spline through values at knots: twice differentiable, so that no station shows in shading."""
    widths = np.diff(knots)
    slopes = np.diff(values) / widths
    system = np.eye(len(knots))
    target = np.zeros(len(knots))
    for row in range(1, len(knots) - 1):
        before, after = widths[row - 1], widths[row]
        system[row, row - 1 : row + 2] = before, 2 * (before + after), after
        target[row] = 6 * (slopes[row] - slopes[row - 1])
    bend = np.linalg.solve(system, target)  # second derivatives
    cell = np.clip(np.searchsorted(knots, where, side="right") - 1, 0, len(widths) - 1)
    h, low, high = widths[cell], where - knots[cell], knots[cell + 1] - where
    return (
        (bend[cell] * high**3 + bend[cell + 1] * low**3) / (6 * h)
        + (values[cell] / h - bend[cell] * h / 6) * high
        + (values[cell + 1] / h - bend[cell + 1] * h / 6) * low
    )


@dataclass(frozen=True, eq=False)
class Loft:
    """A closed tube along the third of three axes.

    A section at ``along`` is |side / a|^n + |depth / b|^n = 1 round its centre, b differing to the front
    (positive depth) and to the back. The function is F = q - S: q the squared radius in the section's aspect, S
    the product of the section's half axes, interpolated so that an end of size 0 closes as an ellipsoid does.
    Divided by its gradient it approximates the distance [m].
    """

    origin: Values  # [m], shape [3]
    axes: Values  # rows: side, depth, along; unit vectors, shape [3, 3]
    exponent: float
    mirrored: float  # [m] rounding of the fold at x = 0 that mirrors the tube to the other side
    table: Values  # rows: along, S, its slope, side aspect, front aspect, back aspect, side and depth centre
    low: Values  # bounding box in x >= 0 [m], shape [3]
    high: Values

    @functools.cached_property
    def steepness(self) -> Values:
        """How steep each row but the first is after each knot; nothing follows the last one. Shape [7, TABLE_SIZE]."""
        return np.diff(self.table[1:], append=self.table[1:, -1:]) / np.diff(self.table[0], append=np.inf)

    def value(self, points: Points) -> Values:
        """Approximate signed distance [m] of points with x >= 0."""
        folded = points - self.origin
        folded[:, 0] = np.sqrt(points[:, 0] ** 2 + self.mirrored**2) - self.origin[0]
        side, depth, along = self.axes @ folded.T
        knots = self.table[0]
        clamped = np.clip(along, knots[0], knots[-1])
        at = np.searchsorted(knots, clamped, side="right") - 1
        size, slope, wide, front, back, side_centre, depth_centre = np.take(self.steepness, at, axis=1) * (
            clamped - knots[at]
        ) + np.take(self.table[1:], at, axis=1)
        size = size + slope * (along - clamped)
        x = (side - side_centre) / wide
        z = depth - depth_centre
        z = z / np.where(z > 0, front, back)
        n = self.exponent
        power_x, power_z = (x * x + TINY) ** (n / 2), (z * z + TINY) ** (n / 2)
        q = (power_x + power_z) ** (2 / n)
        # |grad q|^2 in the section, scaled out to the surface from inside: grad q grows as sqrt(q)
        share_x, share_z = power_x / (power_x + power_z), power_z / (power_x + power_z)
        grade = (2 * q * share_x / wide) ** 2 / (x * x + TINY) + (2 * q * share_z) ** 2 / (z * z + TINY) / (
            np.where(z > 0, front, back) ** 2
        )
        grade *= np.maximum(q, size) / q
        result: Values = (q - size) / np.sqrt(grade + slope * slope + TINY)
        return result


def loft(
    stations: ArrayLike,
    *,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    axes: ArrayLike = ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    exponent: float = 2.0,
    mirrored: float = 0.0,
) -> Loft:
    """Loft through rows (along, side half axis, front and back half axis, side centre, depth centre) [m].

    The first and the last row have half axes 0: the tube's ends.
    """
    rows = np.asarray(stations, dtype=float)
    knots, a, front, back = rows[:, 0], rows[:, 1].copy(), rows[:, 2].copy(), rows[:, 3].copy()
    size = a * (front + back) / 2
    for end, inner in ((0, 1), (-1, -2)):  # an end has no aspect of its own
        a[end], front[end], back[end] = a[inner], front[inner], back[inner]
    scale = np.sqrt(a * (front + back) / 2)
    where = np.linspace(knots[0], knots[-1], TABLE_SIZE)
    columns: list[Any] = [size, a / scale, front / scale, back / scale, rows[:, 4], rows[:, 5]]
    curves = [natural_spline(knots, column, where) for column in columns]
    table = np.vstack([where, curves[0], np.gradient(curves[0], where), *curves[1:]])
    frame = np.asarray(axes, dtype=float)
    centre = np.asarray(origin, dtype=float)
    (wide, ahead, behind), middle, depth = _half_axes(table), table[6], table[7]
    sides = np.repeat(np.stack([middle - wide, middle + wide], axis=1), 2, axis=1)
    depths = np.tile(np.stack([depth - behind, depth + ahead], axis=1), 2)
    spots = np.column_stack([sides.ravel(), depths.ravel(), np.repeat(where, 4)]) @ frame + centre
    return Loft(centre, frame, exponent, mirrored, table, spots.min(axis=0), spots.max(axis=0))


def _half_axes(table: Values) -> tuple[Values, Values, Values]:
    radius = np.sqrt(np.maximum(table[1], 0.0))
    return table[3] * radius, table[4] * radius, table[5] * radius


def smooth_minimum(one: Values, other: Values, blend: float) -> Values:
    """Union of two distances with a fillet of size ``blend`` [m], twice differentiable (after Quilez)."""
    overlap = np.maximum(blend - np.abs(one - other), 0.0) / blend
    result: Values = np.minimum(one, other) - overlap**3 * (blend / 6)
    return result
