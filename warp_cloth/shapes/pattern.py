"""The T-shirt's pattern: four flat panels drafted from the finished garment's measures, and how they are sewn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_cloth.base.cache import Cache
from warp_cloth.base.curves import resampled
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.shapes.triangulate import triangulate

CURVE_SAMPLES = 400  # of a curve when its length is measured: chord error below 0.01 mm
_ALONG = np.linspace(0, 1, CURVE_SAMPLES)
# Shares of a cubic curve's handles, at all its samples.
CUBIC = (
    (1 - _ALONG) ** 3,
    3 * _ALONG * (1 - _ALONG) ** 2,
    3 * _ALONG**2 * (1 - _ALONG),
    _ALONG**3,
)
CAP_EASE = 1.015  # sleeve cap over armhole: a knitted set-in sleeve is eased in by 1 to 3 %
PANEL_GAP = 0.05  # [m] between panels in texture space


@dataclass(frozen=True)
class TshirtMeasures:
    """Finished T-shirt [m]; widths and girths are those of the sewn garment laid flat or closed round."""

    chest: float  # girth under the arms
    hem: float  # girth of the hem
    length: float  # highest point of the shoulder to the hem
    neck_width: float
    front_neck_drop: float
    back_neck_drop: float
    shoulder_width: float  # from one shoulder tip to the other
    shoulder_drop: float
    armhole_depth: float  # shoulder tip to underarm, straight down
    sleeve_length: float  # shoulder tip to cuff
    bicep: float  # sleeve girth at the underarm
    cuff: float  # sleeve girth at the cuff


# Chest: that of the size's standard body and 10 cm of ease, a regular fit; the rest graded as is usual for T-shirts.
SIZE_MEASURES: dict[str, TshirtMeasures] = {
    "S": TshirtMeasures(1.00, 1.01, 0.67, 0.210, 0.108, 0.022, 0.425, 0.042, 0.205, 0.205, 0.37, 0.33),
    "M": TshirtMeasures(1.08, 1.09, 0.70, 0.215, 0.112, 0.024, 0.450, 0.044, 0.215, 0.215, 0.39, 0.35),
    "L": TshirtMeasures(1.16, 1.17, 0.73, 0.220, 0.116, 0.026, 0.475, 0.046, 0.225, 0.225, 0.41, 0.37),
}


@dataclass(frozen=True, eq=False)
class Panel:
    """A triangulated panel as seen from outside: y is the warp, up; x runs to the body's left on the front."""

    name: str
    points: Points  # [m], shape [N, 2]
    triangles: Indices  # counter-clockwise, shape [F, 3]
    seams: dict[str, NDArray[np.int64]]  # vertices along each side of the outline, in the order in which it is sewn

    def mirrored(self, name: str) -> Panel:
        """The mirror image: x negated, winding still counter-clockwise."""
        return Panel(name, self.points * (-1, 1), self.triangles[:, ::-1].copy(), self.seams)


@dataclass(frozen=True, eq=False)
class Pattern:
    """All panels and the pairs of sides that are sewn together, vertex to vertex."""

    panels: tuple[Panel, ...]
    sewing: tuple[tuple[tuple[str, str], tuple[str, str]], ...]  # ((panel, seam), (panel, seam))

    def panel(self, name: str) -> Panel:
        return next(panel for panel in self.panels if panel.name == name)


def tshirt_pattern(measures: TshirtMeasures, edge: float, cache: Cache) -> Pattern:
    """Front, back and two sleeves, with as many vertices on each side of a seam, about ``edge`` [m] apart.

    ``cache`` shares sleeves between edge lengths.
    """
    front, back = (_trunk_curves(measures, is_front) for is_front in (True, False))
    armholes = curve_length(front["armhole"]), curve_length(back["armhole"])
    sleeve = cache.get_or_make("sleeve", (), partial(_sleeve_curves, measures, *armholes), measures)
    counts = {
        "hem": _steps(edge, front["hem"]),
        "side": _steps(edge, front["side"]),
        "shoulder": _steps(edge, front["shoulder"]),
        "front_cap": _steps(edge, front["armhole"]),
        "back_cap": _steps(edge, back["armhole"]),
        "underarm": _steps(edge, sleeve["front_underarm"]),
        "cuff": _steps(edge, sleeve["cuff"]),
    }
    panels = [
        _trunk_panel("front", front, {**counts, "armhole": counts["front_cap"]}, edge),
        _trunk_panel("back", back, {**counts, "armhole": counts["back_cap"]}, edge).mirrored("back"),
    ]
    both = {"front_underarm": counts["underarm"], "back_underarm": counts["underarm"]}
    left = _fill("left_sleeve", sleeve, {**counts, **both}, edge)
    sewing: list[tuple[tuple[str, str], tuple[str, str]]] = []
    for side in ("left", "right"):
        arm = f"{side}_sleeve"
        sewing += [
            (("front", f"{side}_shoulder"), ("back", f"{side}_shoulder")),
            (("front", f"{side}_side"), ("back", f"{side}_side")),
            (("front", f"{side}_armhole"), (arm, "front_cap")),
            (("back", f"{side}_armhole"), (arm, "back_cap")),
            ((arm, "front_underarm"), (arm, "back_underarm")),
        ]
    return Pattern((*panels, left, left.mirrored("right_sleeve")), tuple(sewing))


def curve_length(curve: Points) -> float:
    """Length of a polyline [m]."""
    x, y = curve[:, 0], curve[:, 1]
    across, up = x[1:] - x[:-1], y[1:] - y[:-1]
    return float(np.sqrt(across * across + up * up).sum())


def _steps(edge: float, curve: Points) -> int:
    return max(2, round(curve_length(curve) / edge))


def _bezier(*handles: ArrayLike) -> Points:
    """Cubic curve through its first and last handle, finely sampled."""
    own, after, before, last = CUBIC
    curve = np.empty((CURVE_SAMPLES, 2))
    for axis, (p0, p1, p2, p3) in enumerate(np.array(handles, dtype=float).T):
        curve[:, axis] = own * p0 + after * p1 + before * p2 + last * p3
    return curve


def _line(start: ArrayLike, end: ArrayLike) -> Points:
    return np.array([start, end], dtype=float)


def _trunk_curves(m: TshirtMeasures, is_front: bool) -> dict[str, Points]:
    """Sides of the left half of front or back, counter-clockwise from the hem's middle; y = 0 at the hem."""
    tip = np.array([m.shoulder_width / 2, m.length - m.shoulder_drop])
    underarm = np.array([m.chest / 4, tip[1] - m.armhole_depth])
    neck = np.array([m.neck_width / 2, m.length])
    drop = m.front_neck_drop if is_front else m.back_neck_drop
    hollow = 0.020 if is_front else 0.010  # [m] the front is cut further in, for the arm's movement
    reach = underarm[0] - tip[0]
    low = m.length - drop
    steep = (neck[0] - 0.004, low + 0.45 * drop) if is_front else (0.80 * neck[0], low + 0.10 * drop)
    return {
        "hem": _line((0, 0), (m.hem / 4, 0)),
        "side": _line((m.hem / 4, 0), underarm),
        "armhole": _bezier(
            underarm,
            underarm - (0.85 * reach + hollow, -0.008),
            tip - (hollow + 0.004, 0.60 * m.armhole_depth),
            tip,
        ),
        "shoulder": _line(tip, neck),
        "neckline": _bezier(neck, steep, (0.52 * neck[0], low), (0, low)),
        "middle": _line((0, low), (0, 0)),
    }


def _sleeve_curves(m: TshirtMeasures, front: float, back: float) -> dict[str, Points]:
    """Sides of the left sleeve, counter-clockwise from the cuff; x < 0 is sewn to the front, y = 0 at the crown."""
    height, ahead = _cap(m, front, back)
    cuff_ahead, cuff_behind = m.cuff * ahead / m.bicep, m.cuff * (1 - ahead / m.bicep)
    front_cap = _half_cap(ahead, height) * (-1, 1)
    back_cap = _half_cap(m.bicep - ahead, height)
    return {
        "cuff": _line((-cuff_ahead, -m.sleeve_length), (cuff_behind, -m.sleeve_length)),
        "back_underarm": _line((cuff_behind, -m.sleeve_length), (m.bicep - ahead, -height)),
        "back_cap": back_cap,
        "front_cap": front_cap[::-1],
        "front_underarm": _line((-ahead, -height), (-cuff_ahead, -m.sleeve_length)),
    }


def _half_cap(width: float, height: float) -> Points:
    return _bezier((width, -height), (0.62 * width, -height), (0.50 * width, 0), (0, 0))


def _cap(m: TshirtMeasures, front: float, back: float) -> tuple[float, float]:
    """Height of the sleeve's cap, and its half width to the front [m].

    Both are found by bisection, so that each half of the cap is as long as its armhole and the ease.
    """

    def crown(height: float) -> float:
        """Half width of the cap's front, so that the cap divides between front and back as the armholes do."""
        return _bisect(
            lambda w: curve_length(_half_cap(w, height)) / curve_length(_half_cap(m.bicep - w, height)) - front / back,
            0.3 * m.bicep,
            0.7 * m.bicep,
        )

    height = _bisect(lambda h: curve_length(_half_cap(crown(h), h)) - CAP_EASE * front, 0.01, m.sleeve_length - 0.02)
    return height, crown(height)


def _bisect(function: Callable[[float], float], low: float, high: float) -> float:
    """Root of an increasing function; 40 halvings leave less than a picometre."""
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if function(middle) > 0 else (middle, high)
    return (low + high) / 2


def _fill(name: str, curves: dict[str, Points], counts: dict[str, int], edge: float) -> Panel:
    """Panel from its sides; a side without a count is divided by ``edge``."""
    outline, sides = [], {}
    start = 0
    for side, curve in curves.items():
        steps = counts.get(side) or _steps(edge, curve)
        outline.append(resampled(curve, steps + 1)[:-1])
        sides[side] = start + np.arange(steps + 1)
        start += steps
    for side in sides:
        sides[side] %= start
    for side in ("front_cap", "front_underarm"):  # turned, so that partners run the same way
        if side in sides:
            sides[side] = sides[side][::-1]
    points, triangles = triangulate(np.vstack(outline), edge)
    return Panel(name, points, triangles, sides)


def _trunk_panel(name: str, curves: dict[str, Points], counts: dict[str, int], edge: float) -> Panel:
    """Front or back: the left half and its mirror image, joined along the middle."""
    half = _fill(name, curves, counts, edge)
    count = len(half.points)
    own = np.ones(count, dtype=bool)
    own[half.seams["middle"]] = False
    points = half.points.copy()
    points[~own, 0] = 0.0
    image = np.arange(count)
    image[own] = count + np.arange(own.sum())
    triangles = np.vstack([half.triangles, image[half.triangles[:, ::-1]]]).astype(np.int32)
    seams = {}
    for side in ("hem", "side", "armhole", "shoulder", "neckline"):
        seams[f"left_{side}"] = half.seams[side]
        seams[f"right_{side}"] = image[half.seams[side]]
    return Panel(name, np.vstack([points, points[own] * (-1, 1)]), triangles, seams)
