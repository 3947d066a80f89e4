"""The T-shirt: panels bent round the mannequin that wears it, and welded along the seams."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.section import convex_girth
from warp_cloth.shapes.body import Form, calibrated_form, section
from warp_cloth.shapes.loft import Values
from warp_cloth.shapes.measures import SIZE_BODIES, MannequinMeasures
from warp_cloth.shapes.pattern import PANEL_GAP, SIZE_MEASURES, Pattern, TshirtMeasures, tshirt_pattern

TSHIRT_EDGE = 0.012  # [m] folds of 5 cm keep four edges
CLEARANCE = 0.008  # [m] between body and panels at the start: more than any contact offset in use
PUSH_ROUNDS = 8
FADE = 0.98  # of a seam's shift from one row of vertices to the next, besides the averaging
FADE_ROUNDS = 60


def tshirt(
    *, size: str = "M", edge: float = TSHIRT_EDGE, body: MannequinMeasures | None = None, cache: Cache | None = None
) -> Mesh:
    """T-shirt of a size, with edges of about ``edge`` [m], as stitched panels round a mannequin.

    ``body`` is the mannequin that wears it, by default the size's own standard body. The rest shape is in the
    texture coordinates, in metres; the 3-D shape is only where the panels start. ``cache`` shares drafts of shapes.

    Raises:
        InputError: unknown size, or an edge out of range.
    """
    if size not in SIZE_MEASURES:
        raise InputError("tshirt size", f"{size!r} is unknown", f"use {', '.join(SIZE_MEASURES)}")
    if not 0.002 <= edge <= 0.06:
        raise InputError("tshirt edge", f"{edge!r} m is out of range", "allowed: 0.002 to 0.06 m")
    measures = SIZE_MEASURES[size]
    cache, worn_by = cache or Cache(), body or SIZE_BODIES[size]
    pattern = cache.get_or_make("pattern", (), partial(tshirt_pattern, measures, edge, cache), measures, edge)
    form = cache.get_or_make("form", (), partial(calibrated_form, worn_by), worn_by)
    trunk = cache.get_or_make("trunk", (), partial(_fit_trunk, form, measures, worn_by), measures, worn_by)
    return _sew(pattern, _place(pattern, measures, worn_by, trunk), form)


@dataclass(frozen=True)
class _Trunk:
    """Where the trunk panels go: a cylinder round the body that closes like a roll over the shoulders."""

    half_width: float  # [m] of the cylinder's section
    front: float  # [m] its depth to the front and to the back
    back: float
    neck_height: float  # [m] of the shoulder seam at the neck
    seam_depth: float  # [m] z of the shoulder seam


def _place(pattern: Pattern, m: TshirtMeasures, body: MannequinMeasures, trunk: _Trunk) -> list[Points]:
    """Where the panels' vertices go [m], each shape [N, 3]."""
    front, back = pattern.panel("front"), pattern.panel("back")
    left = _place_sleeve(pattern.panel("left_sleeve").points, m, body, trunk)
    return [
        _place_trunk(front.points, m, trunk, 1.0),
        _place_trunk(back.points * (-1, 1), m, trunk, -1.0),
        left,
        left * (-1, 1, 1),
    ]


def _fit_trunk(form: Form, m: TshirtMeasures, body: MannequinMeasures) -> _Trunk:
    """Cylinder round everything from the hem to the chest, no tighter than the shirt."""
    seam_depth = -0.010 * body.stature
    slope = m.shoulder_drop / (0.5 * (m.shoulder_width - m.neck_width))
    across = np.linspace(m.neck_width / 2, m.shoulder_width / 2, 12)
    tops = _heights(form, across, seam_depth, body.stature)
    neck_height = float(np.max(tops + slope * (across - m.neck_width / 2))) + CLEARANCE
    levels = np.linspace(max(neck_height - m.length, 0.47 * body.stature), body.chest_height, 9)
    outlines = np.concatenate([section(form, level) for level in levels])
    half_width, front, back = outlines[:, 0].max(), outlines[:, 1].max(), -outlines[:, 1].min()
    girth = max(m.chest, convex_girth(outlines) + 2 * math.pi * CLEARANCE)
    # a superellipse is nearly as long as its box is round: scale all three alike to the wanted girth
    around = _section_curve(half_width, front)[0][-1] + _section_curve(half_width, back)[0][-1]
    scale = girth / (2 * around)
    return _Trunk(half_width * scale, front * scale, back * scale, neck_height, seam_depth)


def _heights(form: Form, x: Values, z: float, top: float) -> Values:
    """Height of the body's top [m] over places (x, z), looked for downwards from below the chin."""
    y = np.linspace(0.87 * top, 0.6 * top, 400)
    spots = np.stack(np.broadcast_arrays(x[:, None], y[None, :], z), axis=-1)
    inside = form.value(spots.reshape(-1, 3)).reshape(len(x), -1) < 0
    result: Values = y[np.argmax(inside, axis=1)]
    return result


def _section_curve(half_width: float, depth: float) -> tuple[Values, Values, Values]:
    """Quarter of a superellipse from the middle (0, depth) to the side: arc length, x, fraction of the depth."""
    angle = np.linspace(0, math.pi / 2, 200)
    x, z = half_width * np.sin(angle) ** 0.85, np.cos(angle) ** 0.85
    step = np.hypot(np.diff(x), np.diff(z) * depth)
    return np.concatenate([[0], np.cumsum(step)]), x, z


def _place_trunk(panel: Points, m: TshirtMeasures, trunk: _Trunk, side: float) -> Points:
    """Front (side 1) or back (-1): bent round the body, then rolled over the shoulder to the seam."""
    depth = trunk.front if side > 0 else trunk.back
    along, x_curve, z_curve = _section_curve(trunk.half_width, depth)
    x, y = np.abs(panel[:, 0]), panel[:, 1]
    arc = x / (m.chest / 4) * along[-1]
    bent_x, bent_z = np.interp(arc, along, x_curve), np.interp(arc, along, z_curve)
    slope = m.shoulder_drop / (0.5 * (m.shoulder_width - m.neck_width))
    fall = slope * np.clip(x - m.neck_width / 2, 0, None)
    below = m.length - fall - y  # panel length below the shoulder line
    roll_depth, roll_height = depth - side * trunk.seam_depth, 1.2 * depth
    angle = np.linspace(0, math.pi / 2, 100)
    out, down = np.sin(angle), roll_height * (1 - np.cos(angle))
    rolled = np.concatenate([[0], np.cumsum(np.hypot(np.diff(out) * roll_depth, np.diff(down)))])
    drop = np.where(below < rolled[-1], np.interp(below, rolled, down), roll_height + below - rolled[-1])
    over = np.interp(below, rolled, out)
    # at the side there is no depth to roll over; down to the hem that difference fades, so that the hem is level
    armhole = m.shoulder_drop + m.armhole_depth
    fade = np.clip((below - armhole) / (m.length - armhole), 0, 1)
    drop += (below - drop) * (1 - np.maximum(bent_z, 0.0)) * (1 - fade)
    flat = np.clip(1 - below / (1.1 * m.armhole_depth), 0, 1)
    flat = flat * flat * (3 - 2 * flat)  # at the seam the shoulder keeps its full width
    place_x = np.sign(panel[:, 0]) * (flat * x + (1 - flat) * bent_x)
    z = trunk.seam_depth * (1 - over) + side * depth * over * np.maximum(bent_z, 0.0)
    return np.column_stack([place_x, trunk.neck_height - fall - drop, z])


def _place_sleeve(panel: Points, m: TshirtMeasures, body: MannequinMeasures, trunk: _Trunk) -> Points:
    """Left sleeve: a tube along the arm, its crown at the shoulder tip, its seam underneath."""
    arm = math.radians(body.arm_angle)
    along = np.array([math.sin(arm), -math.cos(arm), 0.0])
    above = np.array([math.cos(arm), math.sin(arm), 0.0])
    tip = np.array([m.shoulder_width / 2, trunk.neck_height - m.shoulder_drop, trunk.seam_depth])
    down, around = -panel[:, 1], panel[:, 0]
    girth = np.interp(down, [0, m.sleeve_length], [m.bicep, m.cuff])
    radius = girth / (2 * math.pi)
    angle = around / radius
    crown = tip - above * m.bicep / (2 * math.pi)
    return (
        crown
        + down[:, None] * along
        + (radius * np.cos(angle))[:, None] * above
        - (radius * np.sin(angle))[:, None] * np.array([0.0, 0.0, 1.0])
    )


def _sew(pattern: Pattern, placed: list[Points], form: Form) -> Mesh:
    """One mesh: vertices of a seam merged at their mean place, then all of them moved out of the body."""
    names = tuple(panel.name for panel in pattern.panels)
    starts = dict(zip(names, np.cumsum([0, *(len(p.points) for p in pattern.panels)]), strict=False))
    count = sum(len(panel.points) for panel in pattern.panels)
    label = np.arange(count)
    pairs = [
        np.column_stack([starts[name] + pattern.panel(name).seams[seam] for name, seam in pair])
        for pair in pattern.sewing
    ]
    one, other = np.concatenate(pairs).T
    for _ in range(4):  # the vertex under the arm is shared by four corners: no chain is longer
        low = np.minimum(label[one], label[other])
        np.minimum.at(label, one, low)
        np.minimum.at(label, other, low)
    _, vertex = np.unique(label, return_inverse=True)
    weight = np.bincount(vertex)
    flat = np.concatenate([starts[panel.name] + panel.triangles for panel in pattern.panels])
    everywhere = np.concatenate(placed)
    sewn = _mean_place(everywhere, vertex, weight)[vertex]
    everywhere = everywhere + _spread(sewn - everywhere, weight[vertex] > 1, flat)
    points = _push_out(_mean_place(everywhere, vertex, weight), form)
    triangles = vertex[flat]
    sizes = [len(panel.triangles) for panel in pattern.panels]
    return Mesh(
        "tshirt",
        points,
        triangles.astype(np.int32),
        texcoords=_texcoords(pattern),
        panels=np.repeat(np.arange(len(names), dtype=np.int32), sizes),
        panel_names=names,
    )


def _mean_place(points: Points, vertex: NDArray[np.int64], weight: NDArray[np.int64]) -> Points:
    """Mean of the places of all copies of a vertex [m]."""
    return np.column_stack([np.bincount(vertex, points[:, axis]) / weight for axis in range(3)])


def _spread(shift: Points, on_seam: NDArray[np.bool_], triangles: NDArray[np.int64]) -> Points:
    """Let the seams' shift [m] fade into the panels, so that no seam starts with one long row of edges."""
    one = np.concatenate([triangles, np.roll(triangles, 1, axis=1)]).ravel()
    other = np.concatenate([np.roll(triangles, -1, axis=1), triangles]).ravel()
    degree = np.bincount(one)

    def along(own: Values) -> Values:
        spread = np.where(on_seam, own, 0.0)
        for _ in range(FADE_ROUNDS):
            spread = np.where(on_seam, own, FADE * (np.bincount(one, spread[other]) / degree))
        return spread

    return np.column_stack([along(np.ascontiguousarray(own)) for own in shift.T])


def _push_out(points: Points, form: Form) -> Points:
    """Vertices that start in the body, or too near it, moved out along its gradient."""
    points = points.copy()
    for _ in range(PUSH_ROUNDS):
        near = np.flatnonzero(form.value(points) < CLEARANCE)
        if not len(near):
            break
        points[near] = form.project(points[near], level=1.05 * CLEARANCE)
    return points


def _texcoords(pattern: Pattern) -> NDArray[np.float64]:
    """Panel coordinates of each corner [m], the panels side by side, shape [F, 3, 2]."""
    corners = []
    edge = 0.0
    for panel in pattern.panels:
        low, high = panel.points.min(axis=0), panel.points.max(axis=0)
        corners.append((panel.points - low + (edge, 0.0))[panel.triangles])
        edge += high[0] - low[0] + PANEL_GAP
    return np.concatenate(corners)
