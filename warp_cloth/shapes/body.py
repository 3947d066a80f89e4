"""The mannequin's form: lofts for its parts, blended, with girths calibrated to the measures."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warp_cloth.base.mesh import Points
from warp_cloth.base.section import convex_girth
from warp_cloth.shapes.loft import Loft, Values, loft, natural_spline, smooth_minimum
from warp_cloth.shapes.measures import CHEST_LEVEL, HIP_LEVEL, WAIST_LEVEL, MannequinMeasures

Stations = tuple[tuple[float, ...], ...]

# Rows: place along the axis, side half axis, front half axis, back half axis, side centre, depth centre, all
# as fractions of stature. Lengths between joints follow Drillis & Contini (upper arm 0.186, forearm 0.146, hand
# 0.108, knee 0.285, ankle 0.039, foot 0.152); sections are drawn by eye and scaled to the girths.
TORSO: Stations = (
    (0.438, 0.000, 0.000, 0.000, 0, 0.000),
    (0.462, 0.066, 0.044, 0.050, 0, 0.000),
    (0.485, 0.088, 0.057, 0.066, 0, 0.000),
    (HIP_LEVEL, 0.095, 0.062, 0.072, 0, 0.000),
    (0.545, 0.093, 0.062, 0.066, 0, 0.001),
    (0.585, 0.086, 0.060, 0.053, 0, 0.003),
    (WAIST_LEVEL, 0.081, 0.058, 0.047, 0, 0.004),
    (0.670, 0.087, 0.062, 0.053, 0, 0.002),
    (CHEST_LEVEL, 0.099, 0.069, 0.062, 0, -0.002),
    (0.760, 0.104, 0.062, 0.065, 0, -0.006),
    (0.790, 0.091, 0.047, 0.055, 0, -0.010),
    (0.815, 0.062, 0.034, 0.040, 0, -0.013),
    (0.836, 0.000, 0.000, 0.000, 0, -0.014),
)
# along x, from spine to the tip of the shoulder: side is y, so half height, front, back, height, depth centre
SHOULDERS: Stations = (
    (-0.060, 0.000, 0.000, 0.000, 0.803, -0.012),
    (0.000, 0.035, 0.036, 0.042, 0.803, -0.012),
    (0.040, 0.031, 0.034, 0.040, 0.803, -0.012),
    (0.080, 0.028, 0.032, 0.037, 0.793, -0.011),
    (0.105, 0.025, 0.029, 0.032, 0.782, -0.010),
    (0.130, 0.000, 0.000, 0.000, 0.770, -0.009),
)
NECK: Stations = (
    (-0.040, 0.000, 0.000, 0.000, 0, 0.000),
    (-0.005, 0.034, 0.034, 0.034, 0, 0.000),
    (0.030, 0.030, 0.031, 0.031, 0, 0.000),
    (0.080, 0.030, 0.032, 0.032, 0, 0.000),
    (0.120, 0.000, 0.000, 0.000, 0, 0.000),
)
HEAD: Stations = (
    (0.867, 0.000, 0.000, 0.000, 0, 0.026),
    (0.880, 0.026, 0.028, 0.034, 0, 0.021),
    (0.902, 0.037, 0.042, 0.043, 0, 0.014),
    (0.935, 0.044, 0.049, 0.053, 0, 0.009),
    (0.965, 0.043, 0.046, 0.052, 0, 0.006),
    (0.988, 0.029, 0.031, 0.036, 0, 0.005),
    (1.000, 0.000, 0.000, 0.000, 0, 0.004),
)
# along the arm, from the shoulder joint to the finger tips; side lies in the plane of both arms
ARM: Stations = (
    (-0.036, 0.000, 0.000, 0.000, 0, 0.000),
    (0.000, 0.031, 0.032, 0.033, 0, 0.000),
    (0.045, 0.030, 0.032, 0.033, 0, 0.000),
    (0.095, 0.0265, 0.0285, 0.0285, 0, 0.000),
    (0.150, 0.0235, 0.0245, 0.0245, 0, 0.000),
    (0.186, 0.0215, 0.0225, 0.0225, 0, 0.000),
    (0.220, 0.0220, 0.0235, 0.0225, 0, 0.000),
    (0.270, 0.0185, 0.0205, 0.0195, 0, 0.000),
    (0.325, 0.0130, 0.0165, 0.0165, 0, 0.000),
    (0.345, 0.0130, 0.0190, 0.0185, 0, 0.000),
    (0.375, 0.0130, 0.0230, 0.0225, 0, 0.000),
    (0.405, 0.0115, 0.0220, 0.0220, 0, 0.000),
    (0.430, 0.0090, 0.0175, 0.0180, 0, 0.000),
    (0.442, 0.000, 0.000, 0.000, 0, -0.002),
)
THUMB: Stations = (
    (-0.030, 0.0000, 0.0000, 0.0000, 0, 0),
    (-0.015, 0.0090, 0.0100, 0.0100, 0, 0),
    (0.012, 0.0090, 0.0090, 0.0090, 0, 0),
    (0.028, 0.0078, 0.0080, 0.0080, 0, 0),
    (0.038, 0.0000, 0.0000, 0.0000, 0, 0),
)
# upwards; side centre is how far the leg stands from the middle
LEG: Stations = (
    (0.012, 0.0000, 0.0000, 0.0000, 0.0800, -0.012),
    (0.028, 0.0185, 0.0190, 0.0220, 0.0795, -0.012),
    (0.060, 0.0175, 0.0190, 0.0210, 0.0790, -0.012),
    (0.110, 0.0200, 0.0215, 0.0235, 0.0780, -0.012),
    (0.160, 0.0265, 0.0265, 0.0320, 0.0765, -0.012),
    (0.205, 0.0305, 0.0285, 0.0365, 0.0750, -0.011),
    (0.250, 0.0300, 0.0290, 0.0325, 0.0730, -0.007),
    (0.285, 0.0305, 0.0315, 0.0290, 0.0710, -0.003),
    (0.330, 0.0345, 0.0360, 0.0330, 0.0690, -0.001),
    (0.390, 0.0410, 0.0430, 0.0420, 0.0655, 0.000),
    (0.440, 0.0460, 0.0470, 0.0490, 0.0615, 0.000),
    (0.485, 0.0470, 0.0500, 0.0530, 0.0560, 0.000),
    (0.540, 0.0000, 0.0000, 0.0000, 0.0500, 0.000),
)
# from heel to toe: side is x, depth is up
FOOT: Stations = (
    (-0.042, 0.0000, 0.0000, 0.0000, 0, 0.018),
    (-0.028, 0.0165, 0.0200, 0.0240, 0, 0.018),
    (-0.005, 0.0180, 0.0270, 0.0240, 0, 0.018),
    (0.030, 0.0210, 0.0200, 0.0200, 0, 0.016),
    (0.065, 0.0265, 0.0120, 0.0180, 0, 0.013),
    (0.090, 0.0250, 0.0080, 0.0150, 0, 0.011),
    (0.110, 0.0000, 0.0000, 0.0000, 0, 0.009),
)
SHOULDER_JOINT = (0.104, 0.784, -0.010)
NECK_BASE = (0.0, 0.818, -0.012)
NECK_TILT = 14.0  # degrees forward
THUMB_ANGLE = 0.85  # radians from the arm, forward
TOE_OUT = 9.0  # degrees
FOLD = 0.006  # rounding of the fold that mirrors a limb to the other side
ARM_PARTS = (4, 5)  # arm and thumb among a form's parts
CALIBRATION_STEPS = 8  # each divides the girth's error by about 5
GIRTH_ERROR = 2e-4  # relative, at which calibration ends: 0.2 mm
ARMS_JOINED = 0.03  # relative: fillets add less to a girth, arms more
FAR = 1.0  # [m] value where no part is near


@dataclass(frozen=True, eq=False)
class Form:
    """Parts with the size of their fillets [m], in the order in which they are joined."""

    parts: tuple[tuple[Loft, float], ...]
    floor_blend: float  # [m] rounding of the soles' rim

    def value(self, points: Points) -> Values:
        """Approximate signed distance [m], negative inside, shape [N], of points in space, shape [N, 3]."""
        mirrored = points.copy()
        np.abs(mirrored[:, 0], out=mirrored[:, 0])
        places = np.ascontiguousarray(mirrored.T)
        result = np.full(len(points), FAR)
        for part, blend in self.parts:
            margin = 2.5 * blend + 0.02  # beyond it the fillet has faded, even where distance is underestimated
            low, high = part.low - margin, part.high + margin
            within = np.ones(len(points), dtype=bool)
            for place, first, last in zip(places, low, high, strict=True):
                within &= (place > first) & (place < last)
            near = np.flatnonzero(within)
            result[near] = smooth_minimum(result[near], part.value(mirrored[near]), blend)
        below = self.floor_blend - points[:, 1]
        near = np.flatnonzero(below > -0.1)
        result[near] = -smooth_minimum(-result[near], self.floor_blend - below[near], self.floor_blend)
        return result

    def gradient(self, points: Points, value: Values, step: float = 1e-4) -> Points:
        """Gradient by forward differences, shape [N, 3]."""
        slopes = [(self.value(points + step * axis) - value) / step for axis in np.eye(3)]
        return np.column_stack(slopes)

    def project(self, points: Points, level: float = 0.0) -> Points:
        """One Newton step of points towards the surface at distance ``level`` [m]."""
        value = self.value(points)
        slope = self.gradient(points, value)
        factor = (value - level) / np.maximum(np.einsum("ij,ij->i", slope, slope), 0.05)
        return points - np.clip(factor, -0.02, 0.02)[:, None] * slope

    def without(self, numbers: Sequence[int]) -> Form:
        """The form without some of its parts."""
        kept = tuple(part for number, part in enumerate(self.parts) if number not in numbers)
        return Form(kept, self.floor_blend)

    @functools.cached_property
    def bounds(self) -> tuple[Points, Points]:
        """Corners of a box round the body [m]."""
        low = np.min([part.low for part, _ in self.parts], axis=0)
        high = np.max([part.high for part, _ in self.parts], axis=0)
        return np.array([-high[0], 0.0, low[2]]), high


def _scaled(stations: Stations, scale: float, widths: ArrayLike = 1.0) -> Values:
    """Stations in metres, their half axes widened."""
    rows = np.array(stations) * scale
    rows[:, 1:4] *= np.broadcast_to(widths, len(rows))[:, None]
    return rows


def build_form(measures: MannequinMeasures, factors: Values) -> Form:
    """Form whose torso is widened by ``factors`` at hip, waist and chest."""
    h = measures.stature
    hip, _, chest = factors.tolist()
    top = 0.5 + 0.5 * chest  # shoulders and neck follow the chest by half
    levels = np.array([TORSO[0][0], HIP_LEVEL, WAIST_LEVEL, CHEST_LEVEL, TORSO[-1][0]])
    widths = natural_spline(levels, np.array([hip, *factors, top]), np.array([row[0] for row in TORSO]))
    shoulders = _scaled(SHOULDERS, h, top)
    shoulders[:, 0] *= max(top, chest)
    side, tilt = (1, 0, 0), math.radians(NECK_TILT)
    forward, upward = (0, -math.sin(tilt), math.cos(tilt)), (0, math.cos(tilt), math.sin(tilt))
    trunk = (
        (loft(_scaled(TORSO, h, widths), exponent=2.25), 0.020 * h),
        (loft(shoulders, axes=((0, 1, 0), (0, 0, 1), side), mirrored=FOLD * h), 0.040 * h),
        (
            loft(_scaled(NECK, h, top), origin=np.array(NECK_BASE) * h, axes=(side, forward, upward)),
            0.045 * h,
        ),
        (loft(_scaled(HEAD, h)), 0.014 * h),
    )
    return Form((*trunk, *_arm(measures, chest), *_leg(h, hip)), floor_blend=0.005 * h)


def _arm(measures: MannequinMeasures, chest: float) -> tuple[tuple[Loft, float], ...]:
    """Arm with hand, and thumb; their girth follows the chest's widening by a third."""
    h = measures.stature
    angle = math.radians(measures.arm_angle)
    axes = np.array([[math.cos(angle), math.sin(angle), 0], [0, 0, 1], [math.sin(angle), -math.cos(angle), 0]])
    across, forward, along = axes
    span = max(0.5 + 0.5 * chest, chest)  # arms must start outside a wide chest
    joint = np.array(SHOULDER_JOINT) * h * (span, 1, 1)
    base = joint + (0.358 * along + 0.018 * forward - 0.002 * across) * h
    outward = along * math.cos(THUMB_ANGLE) + forward * math.sin(THUMB_ANGLE)
    thumb_axes = np.array([across, np.cross(outward, across), outward])
    girth = (2 + chest) / 3
    return (
        (loft(_scaled(ARM, h, girth), origin=joint, axes=axes, mirrored=FOLD * h), 0.032 * h),
        (loft(_scaled(THUMB, h, girth), origin=base, axes=thumb_axes, mirrored=FOLD * h), 0.014 * h),
    )


def _leg(h: float, hip: float) -> tuple[tuple[Loft, float], ...]:
    """Leg and foot; the thigh follows the hip's widening, sideways too, the ankle hardly."""
    leg = _scaled(LEG, h)
    widths = 1 + (hip - 1) * np.interp(leg[:, 0] / h, [0.05, 0.45], [0.2, 1.0])
    leg[:, 1:5] *= widths[:, None]
    toe = math.radians(TOE_OUT)
    axes = ((math.cos(toe), 0, -math.sin(toe)), (0, 1, 0), (math.sin(toe), 0, math.cos(toe)))
    ankle = (leg[1, 4], 0.0, leg[1, 5])
    return (
        (loft(leg, mirrored=FOLD * h), 0.030 * h),
        (loft(_scaled(FOOT, h), origin=ankle, axes=axes, exponent=2.2, mirrored=FOLD * h), 0.022 * h),
    )


def section(form: Form, height: float, rays: int = 120) -> Points:
    """Outline of the trunk at a height: first crossing of rays from the axis (x, z) [m], shape [rays, 2]."""
    angles = np.linspace(0, 2 * math.pi, rays, endpoint=False)
    directions = np.column_stack([np.sin(angles), np.zeros(rays), np.cos(angles)])
    radii = np.linspace(0.03, 0.45, 43)
    axis = np.array([0.0, height, 0.0])
    spots = axis + radii[:, None, None] * directions
    values = form.value(spots.reshape(-1, 3)).reshape(len(radii), rays)
    first = np.clip(np.argmax(values > 0, axis=0), 1, None)
    columns = np.arange(rays)
    low, high = radii[first - 1], radii[first]
    at_low, at_high = values[first - 1, columns], values[first, columns]
    for _ in range(4):  # regula falsi: the values are nearly linear in a step of 1 cm
        middle = low - at_low * (high - low) / (at_high - at_low)
        value = form.value(axis + middle[:, None] * directions)
        outside = value > 0
        high, at_high = np.where(outside, middle, high), np.where(outside, value, at_high)
        low, at_low = np.where(outside, low, middle), np.where(outside, at_low, value - 1e-15)
    return middle[:, None] * directions[:, [0, 2]]


def calibrated_form(measures: MannequinMeasures) -> Form:
    """Form whose girths at the three levels are the measures: fixed point on the torso's widths.

    First without arms; then with them, as their fillets add some millimetres to the chest. Where a wide chest or a
    steep arm joins them at the level of the chest, no tape goes round: there the girth stays that of the bare trunk.
    """
    heights = (measures.hip_height, measures.waist_height, measures.chest_height)
    wanted = np.array([measures.hip, measures.waist, measures.chest])
    factors = np.ones(3)
    form = build_form(measures, factors)
    for with_arms in (False, True):
        for _ in range(CALIBRATION_STEPS):
            whole = form if with_arms else form.without(ARM_PARTS)
            girths = np.array([convex_girth(section(whole, height)) for height in heights])
            error = np.abs(girths / wanted - 1).max()
            if error < GIRTH_ERROR or (with_arms and error > ARMS_JOINED):
                break
            factors *= wanted / girths
            form = build_form(measures, factors)
    return form
