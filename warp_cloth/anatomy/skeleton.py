"""The skeleton of a body from its mesh alone: curves from the middle of the trunk to head, hands and feet.

Distances along the surface hardly change with the pose, so the same figures tell limbs standing, sitting or with arms
up. All lengths are fractions of the span, the longest distance along the surface between two tips (hand to foot).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.completing import Completed, completed
from warp_cloth.anatomy.geodesics import EdgeGraph, Floats, level_lines, nearest_points, row_lengths
from warp_cloth.anatomy.ground import above_ground
from warp_cloth.anatomy.wrapping import wrapped
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.division import divided
from warp_cloth.base.lids import cones, with_tips
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.topology import mesh_edges

LIMBS = ("head", "right arm", "left arm", "right leg", "left leg")
HEAD, RIGHT_ARM, LEFT_ARM, RIGHT_LEG, LEFT_LEG = range(5)
TRUNK = 5

STEP = 0.005  # of the span, between level lines
# The fifth tip lies so far from the others at least, and the sixth is nearer by this factor: 0.4 and 0.65 in people.
FIFTH, SIXTH = 0.3, 0.85
REACH = 0.3  # of the span, around a tip: the area tells a head with its shoulders from a leg, and that from an arm
HEAD_AREA, LEG_AREA = 1.6, 1.1  # least ratios of those areas: 2.1 and 1.35 in people of any age, weight and pose
NECK = (0.08, 0.17)  # of the span, from the crown, between which the neck is narrowest
WRIST, ARM = 0.13, 0.45  # of the span, from the fingertips, between which an arm ends
WIDENS = 1.8  # girth per length of an arm where it joins the trunk; a heavy upper arm has 0.6
DIP = 12  # steps within which an arm is thinner again behind its elbow
ANKLE = 0.11  # of the span, from the toes
SLICES = 24  # of the trunk, from hips to neck
MIDDLE_SLICE = 8  # the waist
ENDS = 3  # slices at either end of the trunk that are a shoulder's, or a thigh's
SMALLEST_SPAN = 0.3  # [m]; a doll's
SHORTEST_LEG = 0.2  # of the span, from the toes to the crotch: 0.43 in people
COARSE = 4000  # triangles; where fewer show no limbs, they are divided
PART = 0.01  # of the largest part's area, that another part may have limbs from: a scan may have its floor
MOST_PARTS = 3  # that are looked at
FLAT = 0.01  # of the span, the least spread of a trunk's vertices in any direction; 0.03 in people
# Of the span, that the toes are ahead of the ankles: 0.146 to 0.197 in 42 people. Their legs cut 9 to 30 cm above the
# floor have 0.085 at most, two of three of them backward, and do not tell forward.
FLAT_FEET = 0.1
SIDEWAYS = 0.5  # sine of the angle from the x axis, beyond which what is square to such legs is forward where it is +z
LYING = 0.7  # cosine of 45 degrees, rounded, between y and forward, from which on a body lies
BELOW = 0.05  # of the span, by which the top of what a body stands on may be higher than its lowest point
LACKING = 0.06  # of the span, from the tip of a completed limb to the body, at least, where it lacks that limb's end
# A person's limbs, along their curves from the middle of the trunk: right as long as left, arms as long as legs (0.89
# to 1.15 in people, mannequins and halves of scans), the trunk 0.2 to 0.42 of the span, hips and shoulders wide apart.
ALIKE, ARMS_TO_LEGS, TRUNK_LENGTH, NARROW = 0.75, (0.65, 1.45), (0.15, 0.55), 0.02


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Where a body's limbs are. The order of limbs is that of LIMBS; right and left are the wearer's."""

    curves: tuple[Points, ...]  # of each limb, from the middle of the trunk to the tip [m], each shape [N, 3]
    joints: tuple[int, ...]  # the point of each curve at which the limb leaves the trunk
    spine: Points  # from the hips to the neck [m], shape [N, 3]
    up: Points  # unit vectors, shape [3]
    forward: Points
    left: Points
    span: float  # [m]
    skin: Points  # vertices of the body [m], shape [V, 3]
    limb: NDArray[np.int8]  # number of each vertex's limb, or TRUNK, shape [V]
    station: Floats  # where it is along its limb's curve, 0 to 1, shape [V]
    own: NDArray[np.bool_]  # the vertices of the connected part that has the limbs, shape [V]
    is_of_wrap: bool = False  # found on a surface wrapped round the body, as its own does not show the limbs
    is_on_ground: bool = False  # the body is grown together with a floor or a plinth, which is not its own
    is_holding: bool = False  # the same of a large flat thing that is not below it
    lacks: tuple[int, ...] = ()  # limbs that are not there, or end early; their curves are as a whole body's would be

    @property
    def middle(self) -> Points:
        """The start of all curves [m], shape [3]."""
        middle: Points = self.curves[0][0]
        return middle

    @property
    def facing(self) -> int:
        """Quarter turns about y from +z to the front; 0 of who lies."""
        if abs(self.forward[1]) > LYING:
            return 0
        return round(float(np.arctan2(self.forward[0], self.forward[2])) / (0.5 * np.pi)) % 4

    @property
    def shoulders(self) -> Points:
        """The middle between the arms, within the trunk [m], shape [3]."""
        shoulders: Points = self.spine[-ENDS]
        return shoulders

    @property
    def waist(self) -> Points:
        """Midway between hips and shoulders [m], shape [3]: women's waist; men's is up to 5 cm lower."""
        waist: Points = 0.5 * (self.spine[0] + self.shoulders)
        return waist

    @property
    def extremes(self) -> Points:
        """The skin, and the tips of the limbs that it lacks, as if they were there [m], shape [N, 3]."""
        return np.vstack([self.skin, *(self.curves[limb][-1:] for limb in self.lacks)])

    def spine_at(self, points: Points) -> Points:
        """The points of the spine at the heights of ``points`` [m], shape [V, 3]."""
        heights = (self.spine - self.spine[0]) @ self.up
        order = np.argsort(heights, kind="stable")
        height = (points - self.spine[0]) @ self.up
        return np.stack([np.interp(height, heights[order], self.spine[order, axis]) for axis in range(3)], axis=1)


def outward_of(skeleton: Skeleton, limb: int) -> Points:
    """The unit vector from the middle of a body to the side of one of its arms or legs, shape [3]."""
    return skeleton.left if limb in (LEFT_ARM, LEFT_LEG) else -skeleton.left


@dataclass(frozen=True, eq=False)
class _Limb:
    """A limb, from its tip inwards."""

    distances: Floats  # of all vertices from the tip along the surface [m], shape [V]
    levels: Floats  # distances at which it is cut [m], shape [N]
    centres: Points  # of these cuts [m], shape [N, 3]

    @property
    def end(self) -> float:
        """Distance from the tip at which the limb joins the trunk [m]."""
        return float(self.levels[-1])

    @property
    def root(self) -> Points:
        root: Points = self.centres[-1]
        return root


def skeleton_of(body: Mesh, *, is_whole: bool = False) -> Skeleton | None:
    """The skeleton of a person's body; None where the mesh is none.

    ``body`` may have further components, such as eyes; its holes are closed first. ``is_whole``: only where it has a
    head, two arms and two legs; else limbs may be missing, as those of an amputee or a dress form.
    """
    found = _found_in(body, may_stand=True, may_lack=not is_whole)
    return found if isinstance(found, Skeleton) else None


def skeleton_or_reason(body: Mesh) -> Skeleton | str:
    """The skeleton of a person's body, or why there is none: a clause about the body."""
    return _found_in(body, may_stand=True, may_lack=True)


def _found_in(body: Mesh, *, may_stand: bool, may_lack: bool) -> Skeleton | str:
    """The same; whether it may be grown together with a floor, and whether it may lack limbs."""
    edges = mesh_edges(body.triangles, body.vertex_count)
    points, triangles = body.points, body.triangles
    if 2 * len(edges) != 3 * body.triangle_count:
        # a hole makes level lines shorter: where it ends an arm seems to widen, as it does where it joins the trunk
        lids, rims = cones(body.triangles.astype(np.int64), body.vertex_count)
        points, triangles = with_tips(body.points, rims), np.vstack([body.triangles, lids.astype(np.int32)])
        edges = mesh_edges(triangles, len(points))
    found = _skeleton_of(points, triangles, edges)
    if isinstance(found, str) and len(triangles) < COARSE:
        finer, faces = divided(*divided(points, triangles))  # the body's own vertices stay the first
        retried = _skeleton_of(finer, faces, mesh_edges(faces, len(finer)))
        if isinstance(retried, Skeleton):
            points, found = finer, retried
    if isinstance(found, Skeleton):
        number = np.arange(body.vertex_count)
        return found if len(points) == len(number) else _of_vertices(found, body.points, number, found.own[number])
    standing = _on_ground(body, points, triangles) if may_stand else None
    if standing is not None:
        return standing
    around = _on_wrap(body, points, triangles)
    if around is None and may_lack:
        tried = (_on_completed(body, surface) for surface in completed(points, triangles))
        around = next((each for each in tried if each is not None), None)
    return found if around is None else around  # the reason is that of its own surface


def _on_wrap(body: Mesh, points: Points, triangles: Indices) -> Skeleton | None:
    """The skeleton of a body on a surface wrapped round this one; None: it has none."""
    wrap, faces = wrapped(points, triangles)
    found = _skeleton_of(wrap, faces, mesh_edges(faces, len(wrap))) if len(faces) else ""
    if isinstance(found, str):
        return None
    number = nearest_points(wrap, body.points)
    limbs = _of_vertices(found, body.points, number, _mostly(found.own[number], body))
    return replace(limbs, is_of_wrap=True)


def _on_completed(body: Mesh, surface: Completed) -> Skeleton | None:
    """The skeleton of a body on its completed surface, with the limbs whose tips it lacks; None: it has none."""
    found = _on_wrap(body, surface.points, surface.triangles)
    if found is None:
        return None
    tips = np.stack([curve[-1] for curve in found.curves])
    skin = body.points[surface.own[surface.own < body.vertex_count]]
    off = row_lengths(skin[nearest_points(skin, tips)] - tips)
    own = found.own & np.isin(np.arange(body.vertex_count), surface.own)
    return replace(found, own=own, lacks=tuple(np.flatnonzero(off > LACKING * found.span).tolist()))


def _on_ground(body: Mesh, points: Points, triangles: Indices) -> Skeleton | None:
    """The skeleton of who is grown together with a floor or a plinth; None: there is none."""
    above = above_ground(points, triangles)
    if above is None or not len(above):
        return None
    used, corners = np.unique(above, return_inverse=True)
    upper = Mesh(body.name, points[used], corners.reshape(-1, 3).astype(np.int32))
    found = _found_in(upper, may_stand=False, may_lack=False)
    if isinstance(found, str):
        return None
    tips = np.array([curve[-1] for curve in found.curves])
    off = points[:, None] - tips
    limb, station = np.einsum("vlc,vlc->vl", off, off).argmin(axis=1).astype(np.int8), np.ones(len(points))
    own = np.zeros(len(points), dtype=np.bool_)
    limb[used], station[used], own[used] = found.limb, found.station, found.own
    count = body.vertex_count
    limbs = replace(found, skin=body.points, limb=limb[:count], station=station[:count], own=own[:count])
    cut_off = np.setdiff1d(triangles, used)
    is_below = float((points[cut_off] @ found.up).max()) < float((points[used] @ found.up).min()) + BELOW * found.span
    return replace(limbs, is_on_ground=is_below, is_holding=not is_below)


def _of_vertices(found: Skeleton, points: Points, number: NDArray[np.int64], own: NDArray[np.bool_]) -> Skeleton:
    """The skeleton of vertices [m], shape [V, 3], that are where those of these numbers are on its surface."""
    return replace(found, skin=points, limb=found.limb[number], station=found.station[number], own=own)


def _mostly(own: NDArray[np.bool_], body: Mesh) -> NDArray[np.bool_]:
    """Whether most vertices of each vertex's connected part are, shape [V]."""
    part = mesh_parts(body.vertex_count, body.triangles)
    count, of_own = np.bincount(part, minlength=len(own)), np.bincount(part, own, len(own))
    return np.asarray((2 * of_own > count)[part])


def _skeleton_of(points: Points, triangles: Indices, edges: Indices) -> Skeleton | str:
    """The skeleton of a body without holes, or why its largest part, or any nearly as large, is no person's."""
    graph = EdgeGraph(edges, row_lengths(points[edges[:, 0]] - points[edges[:, 1]]), len(points))
    area = _vertex_areas(points, triangles)
    if not area.any():
        return "it has no surface"
    part = graph.parts()
    areas = np.bincount(part, area)
    largest = np.argsort(-areas, kind="stable")[:MOST_PARTS]
    reasons = []
    for number in largest[areas[largest] > PART * areas.max()]:
        found = _skeleton_of_part(points, triangles, graph, area, part == number)
        if isinstance(found, Skeleton):
            return found
        reasons.append(found)
    return reasons[0]


def _skeleton_of_part(
    points: Points, triangles: Indices, graph: EdgeGraph, area: Floats, main: NDArray[np.bool_]
) -> Skeleton | str:
    """The skeleton of the connected part ``main``, or why there is none."""
    found = _tips(points, graph, area, main)
    if isinstance(found, str):
        return found
    tips, distances, span = found
    triangles = triangles[main[triangles[:, 0]]]
    limbs = [
        _limb(number, points, triangles, of_tip, span, float(distances[RIGHT_LEG][tips[LEFT_LEG]]))
        for number, of_tip in enumerate(distances)
    ]
    if min(len(limbs[leg].levels) for leg in (RIGHT_LEG, LEFT_LEG)) * STEP < SHORTEST_LEG:
        return "its legs are too short, or its feet grown together"
    return _joined(points, triangles, main, tips, limbs, span)


def without_loose_parts(body: Mesh, skeleton: Skeleton) -> tuple[Mesh, Skeleton]:
    """A body's connected part that has the limbs, and its skeleton: without eyes, hair, a scan's specks and floor."""
    own = skeleton.own
    number = np.cumsum(own) - 1
    triangles = number[body.triangles[own[body.triangles].all(axis=1)]].astype(np.int32)
    limb, station = skeleton.limb[own], skeleton.station[own]
    limbs = replace(skeleton, skin=body.points[own], limb=limb, station=station, own=own[own])
    return Mesh(body.name, body.points[own], triangles), limbs


def _vertex_areas(points: Points, triangles: Indices) -> Floats:
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    (x, y, z), (u, v, w) = (b - a).T, (c - a).T
    third = np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2) / 6.0
    return np.asarray(np.bincount(triangles.ravel(), np.repeat(third, 3), len(points)), dtype=np.float64)


def _tips(
    points: Points, graph: EdgeGraph, area: Floats, main: NDArray[np.bool_]
) -> tuple[list[int], list[Floats], float] | str:
    """Vertices at the tips of head, hands and feet, distances from each, and the span; or why this is no person."""
    mean = np.average(points, axis=0, weights=area * main)
    start = int(np.argmin(np.where(main, row_lengths(points - mean), np.inf)))
    nearest = np.where(main, graph.distances(start), -1.0)
    tips, distances, prominence = [], [], []
    for number in range(6):
        tip = int(np.argmax(nearest))
        prominence.append(float(nearest[tip]))
        if number == 5:
            break
        tips.append(tip)
        distances.append(graph.distances(tip))
        nearest = np.where(main, np.minimum(nearest, distances[-1]), -1.0)
    span = max(float(distances[a][tips[b]]) for a in range(5) for b in range(5))
    if span < SMALLEST_SPAN:
        return f"it is {100.0 * span:.0f} cm from end to end, smaller than any person"
    if prominence[4] < FIFTH * span:
        return "fewer than five parts stick out of it: a person has a head, two arms and two legs"
    if prominence[5] > SIXTH * prominence[4]:
        return "other than five parts stick out of it: a person has a head, two arms and two legs"
    around = np.array([area[main & (each < REACH * span)].sum() for each in distances[:5]])
    head, *others = np.argsort(-around, kind="stable").tolist()
    if around[head] < HEAD_AREA * around[others[0]]:
        return "none of its five ends is a head above shoulders"
    if around[others[1]] < LEG_AREA * around[others[2]]:
        return "its arms and legs cannot be told apart: they are alike in size"
    order = [head, *others[2:], *others[:2]]
    return [tips[number] for number in order], [distances[number] for number in order], span


def _limb(
    number: int, points: Points, triangles: Indices, distances: Floats, span: float, between_feet: float
) -> _Limb:
    """A limb up to where it joins the trunk: at the neck, the shoulder or the crotch."""
    end = {HEAD: NECK[1] * span, RIGHT_LEG: 0.5 * between_feet, LEFT_LEG: 0.5 * between_feet}.get(number, ARM * span)
    step = STEP * span
    lines = level_lines(points, triangles, distances, np.arange(0.5 * step, end, step))
    girths, centres = lines.girths(), lines.centres()
    last = len(girths) - 1
    if number == HEAD:
        first = int(NECK[0] / STEP)
        last = first + int(np.argmin(girths[first:]))
    elif number in (RIGHT_ARM, LEFT_ARM):
        window = 3
        slopes = (girths[window:] - girths[:-window]) / (window * step)
        first = int(WRIST / STEP)
        # a bent elbow widens, too, but the arm behind it is thinner again
        dips = np.array([girths[n : n + DIP].argmax() < len(girths[n : n + DIP]) - 1 for n in range(len(girths))])
        widens = np.flatnonzero((slopes > WIDENS)[first:] & ~dips[first : len(slopes)])
        last = min(first + int(widens[0]) + 1, last) if len(widens) else last
    levels = np.asarray((np.arange(last + 1) + 0.5) * step, dtype=np.float64)
    return _Limb(distances, levels, centres[: last + 1])


def _joined(
    points: Points,
    triangles: Indices,
    main: NDArray[np.bool_],
    tips: list[int],
    limbs: list[_Limb],
    span: float,
) -> Skeleton | str:
    """The limbs, left and right told apart, joined by the trunk; or why they cannot be joined."""
    hips, neck = 0.5 * (limbs[RIGHT_LEG].root + limbs[LEFT_LEG].root), limbs[HEAD].root
    height = float(np.linalg.norm(neck - hips))
    if not TRUNK_LENGTH[0] * span < height < TRUNK_LENGTH[1] * span:
        return "its trunk is not as long as a person's, beside its limbs"
    up = (neck - hips) / height
    ankle = int(ANKLE / STEP)
    toes = np.sum([points[tips[leg]] - limbs[leg].centres[ankle] for leg in (RIGHT_LEG, LEFT_LEG)], axis=0)
    toes -= up * (toes @ up)
    if np.linalg.norm(toes) < FLAT_FEET * span:  # without feet: square to what joins right and left
        across = limbs[LEFT_LEG].root - limbs[RIGHT_LEG].root
        square = np.cross(across, up)
        tells = square[2] if abs(square[2]) > SIDEWAYS * np.linalg.norm(square) else square @ toes
        toes = square if tells >= 0.0 else -square
    if not toes.any():
        return "its front cannot be told from its back"
    forward = toes / np.linalg.norm(toes)
    left = np.cross(up, forward)
    for right_limb in (RIGHT_ARM, RIGHT_LEG):
        if (limbs[right_limb].root - limbs[right_limb + 1].root) @ left > 0.0:
            limbs[right_limb : right_limb + 2] = limbs[right_limb + 1], limbs[right_limb]
    limb = _nearest_limb(points, main, limbs)
    heights = np.linspace(0.05, 0.97, SLICES) * height
    is_trunk = limb == TRUNK
    if _least_spread(points[is_trunk & main]) < FLAT * span:
        return "its trunk is flat"
    trunk = triangles[is_trunk[triangles[:, 0]] | is_trunk[triangles[:, 1]] | is_trunk[triangles[:, 2]]]
    lines = level_lines(points, trunk, np.where(limb == TRUNK, (points - hips) @ up, np.inf), heights)
    if (lines.girths() <= 0.0).any():
        return "its trunk has a gap between hips and neck"
    centres = lines.centres()
    spine = np.vstack([hips, centres[ENDS:-ENDS], neck])
    upper, lower = centres[MIDDLE_SLICE:-ENDS], centres[MIDDLE_SLICE : ENDS - 1 : -1]
    trunk_parts = (upper, upper[:-1], upper[:-1], lower, lower)
    curves = tuple(np.vstack([part, each.centres[::-1]]) for part, each in zip(trunk_parts, limbs, strict=True))
    joints = tuple(len(part) for part in trunk_parts)
    if reason := _unlike_a_person(curves, limbs, left, span):
        return reason
    station = np.zeros(len(points))
    for number, each in enumerate(limbs):
        along = arc_lengths(curves[number])
        own = limb == number
        stations = along[joints[number] :][::-1] / along[-1]  # from the tip inwards, as the levels are
        station[own] = np.interp(each.distances[own], each.levels, stations)
    return Skeleton(curves, joints, spine, up, forward, left, span, points, limb, station, main)


def _least_spread(points: Points) -> float:
    """The standard deviation of points, shape [N, 3], along the direction in which it is least [m]."""
    if not len(points):
        return 0.0
    off = points - points.mean(axis=0)
    return float(np.sqrt(max(np.linalg.eigvalsh(off.T @ off / len(points))[0], 0.0)))


def _unlike_a_person(curves: Sequence[Points], limbs: list[_Limb], left: Points, span: float) -> str:
    """Why limbs of these proportions are no person's; empty: they may be."""
    lengths = [float(arc_lengths(curve)[-1]) for curve in curves]
    arms, legs = lengths[RIGHT_ARM : LEFT_ARM + 1], lengths[RIGHT_LEG:]
    if min(arms) < ALIKE * max(arms) or min(legs) < ALIKE * max(legs):
        return "its right and left limbs are not of one length"
    if not ARMS_TO_LEGS[0] * sum(legs) < sum(arms) < ARMS_TO_LEGS[1] * sum(legs):
        return "its arms and legs have not the lengths of a person's"
    widths = [float((limbs[n + 1].root - limbs[n].root) @ left) for n in (RIGHT_ARM, RIGHT_LEG)]
    if min(widths) < NARROW * span:
        return "its right and left limbs begin at one place"
    return ""


def _nearest_limb(points: Points, main: NDArray[np.bool_], limbs: list[_Limb]) -> NDArray[np.int8]:
    """The limb of each vertex, or TRUNK; vertices of other components belong where the nearest other one does."""
    reach = np.stack([np.where(each.distances < each.end, each.distances, np.inf) for each in limbs])
    limb = np.where(np.isfinite(reach).any(axis=0), reach.argmin(axis=0), TRUNK).astype(np.int8)
    apart = np.flatnonzero(~main)
    if len(apart):
        nearest = np.flatnonzero(main)[nearest_points(points[main], points[apart])]
        limb[apart] = limb[nearest]
        for each in limbs:
            each.distances[apart] = each.distances[nearest]
    return limb
