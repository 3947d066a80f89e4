"""Which limbs pass through which openings of a garment, by linking numbers of curves; shares no code with warp_cloth.

A body has five limbs: curves from its middle to the head, both hands and both feet, inside the body and on to
infinity. An opening's class counts how often each of them passes through it. Any surface that spans the opening gives
the same counts but for a constant, which is removed by counting relative to the head.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from designs.geometry import Body, Floats, Ints, Mesh, box_pairs, components, cross, segments_hit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

VOXEL = 0.008  # [m]: fingers may get lost, wrists do not
FAR = 20.0  # [m]: as good as infinity
TAIL = 0.12  # [m] of a limb's end that tells where it points
SPREAD = 200  # directions in which a covered hand looks for its way out
LIMBS = ("head", "right arm", "left arm", "right leg", "left leg")  # right: the smaller x


@dataclass(frozen=True)
class Skeleton:
    """Curves [m] from the body's middle to the tips of its limbs, in the order of LIMBS, each [N, 3]."""

    curves: tuple[Floats, ...]

    @property
    def middle(self) -> Floats:
        return self.curves[0][0]


def skeleton_of(body: Body) -> Skeleton | None:
    """The curves of a standing body; None where it has not five limbs, one up, two sideways, two down."""
    low = body.low - VOXEL
    counts = np.ceil((body.high + VOXEL - low) / VOXEL).astype(np.int64)
    filled = _filled(body, low, counts)
    deep = distance_transform_edt(filled)
    number = np.full(filled.size, -1)
    voxels = np.flatnonzero(filled.ravel())
    number[voxels] = np.arange(len(voxels))
    number = number.reshape(counts)
    rows, columns, lengths = [], [], []
    steps = [s for s in np.ndindex(3, 3, 3) if s > (1, 1, 1)]
    for step in np.array(steps) - 1:
        here = tuple(slice(max(0, -s), n - max(0, s)) for s, n in zip(step, counts, strict=True))
        there = tuple(slice(max(0, s), n - max(0, -s)) for s, n in zip(step, counts, strict=True))
        a, b = number[here].ravel(), number[there].ravel()
        both = (a >= 0) & (b >= 0)
        rows.append(a[both])
        columns.append(b[both])
        lengths.append(np.full(both.sum(), np.linalg.norm(step)))
    a, b, length = (np.concatenate(parts) for parts in (rows, columns, lengths))
    shape = (len(voxels), len(voxels))
    plain = coo_matrix((length, (a, b)), shape=shape).tocsr()
    depth = deep.ravel()[voxels]
    central = coo_matrix((length / np.minimum(depth[a], depth[b]) ** 2, (a, b)), shape=shape).tocsr()
    middle = int(np.argmax(depth))
    nearest = dijkstra(plain, directed=False, indices=middle)
    nearest[~np.isfinite(nearest)] = -1.0
    tips: list[int] = []
    for _ in LIMBS:
        tips.append(int(np.argmax(nearest)))
        beyond = dijkstra(plain, directed=False, indices=tips[-1])
        nearest = np.where(np.isfinite(beyond), np.minimum(nearest, beyond), -1.0)
    places = low + (np.column_stack(np.unravel_index(voxels, counts)) + 0.5) * VOXEL
    ordered = _ordered(places, tips, middle)
    if ordered is None:
        return None
    _, before = dijkstra(central, directed=False, indices=middle, return_predecessors=True)
    return Skeleton(tuple(places[_path(before, tip)] for tip in ordered))


def _filled(body: Body, low: Floats, counts: Ints) -> NDArray[np.bool_]:
    """Which voxels' centres lie inside."""
    columns = np.stack(np.meshgrid(np.arange(counts[0]), np.arange(counts[1]), indexing="ij"), axis=-1).reshape(-1, 2)
    line, height, turn = body.hits(low[:2] + (columns + 0.5) * VOXEL, 2)
    below = np.ceil((height - low[2]) / VOXEL - 0.5).astype(np.int64)  # so many voxels have their centre below
    steps = np.zeros((len(columns), counts[2] + 1), dtype=np.int64)
    np.add.at(steps, (line, np.clip(below, 0, counts[2])), turn)
    above = np.cumsum(steps[:, ::-1], axis=1)[:, ::-1][:, 1:]
    return np.asarray((above != 0).reshape(counts))


def _ordered(places: Floats, tips: list[int], middle: int) -> list[int] | None:
    centre = places[middle]
    *others, foot, other_foot = sorted(tips, key=lambda tip: -places[tip][1])
    head, *hands = sorted(others, key=lambda tip: abs(places[tip][0] - centre[0]))
    feet = [foot, other_foot]
    pairs = [sorted(pair, key=lambda tip: places[tip][0]) for pair in (hands, feet)]
    apart = all(places[a][0] < centre[0] < places[b][0] for a, b in pairs)
    upright = places[head][1] > centre[1] and all(places[foot][1] < centre[1] for foot in feet)
    return [head, *pairs[0], *pairs[1]] if apart and upright else None


def _path(before: NDArray[np.int32], tip: int) -> list[int]:
    way = [tip]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way[::-1]


def boundary_loops(mesh: Mesh) -> list[Ints]:
    """Openings of the mesh as closed rows of vertices; loops that touch at a vertex stay apart."""
    edges, edge_of, count = mesh.edges
    corner = np.arange(3 * len(mesh.triangles)).reshape(-1, 3)
    at = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2)  # the corners at a side's ends
    swapped = mesh.triangles.ravel()[at[:, 0]] > mesh.triangles.ravel()[at[:, 1]]
    at[swapped] = at[swapped][:, ::-1]
    order = np.argsort(edge_of.ravel(), kind="stable")
    first = np.cumsum(count) - count
    pairs = [at[order[first[count == n] + k]] for n in (2, 3, 4) for k in range(1, n)]
    bases = [at[order[first[count == n]]] for n in (2, 3, 4) for _ in range(1, n)]
    joined = np.concatenate(
        [np.column_stack([a[:, end], b[:, end]]) for a, b in zip(bases, pairs, strict=True) for end in (0, 1)]
    )
    wedge = components(corner.size, joined)
    open_sides = order[first[count == 1]]
    ends = wedge[at[open_sides]]  # [B, 2]: an edge leads from one wedge to another
    sides_at: dict[int, list[int]] = {}
    for side, (a, b) in enumerate(ends):
        sides_at.setdefault(int(a), []).append(side)
        sides_at.setdefault(int(b), []).append(side)
    loops, left = [], set(range(len(ends)))
    while left:
        side = min(left)
        start = here = int(ends[side, 0])
        loop = []
        while True:
            left.discard(side)
            end = 0 if ends[side, 0] == here else 1
            loop.append(int(edges[edge_of.ravel()[open_sides[side]], end]))
            here = int(ends[side, 1 - end])
            onward = [other for other in sides_at[here] if other in left]
            if here == start or not onward:
                break
            side = onward[0]
        loops.append(np.array(loop))
    return loops


def ways_out(skeleton: Skeleton, corners: Floats) -> list[Floats]:
    """The limbs' curves and on to infinity: straight on, or by the way nearest to that which meets the least cloth.

    A hand in a long sleeve leaves by the cuff, wherever that bends; a face leaves a hood by its opening.
    """
    found = []
    for number, curve in enumerate(skeleton.curves):
        if number == 0:  # a face looks out of a hood below the crown
            curve = _from_the_face(curve, corners)
        tip = curve[-1]
        onward = tip - curve[np.flatnonzero(np.linalg.norm(curve - tip, axis=1) < TAIL)[0]]
        onward /= np.linalg.norm(onward)
        index = np.arange(SPREAD) + 0.5
        height, turn = 1.0 - 2.0 * index / SPREAD, np.pi * (1.0 + np.sqrt(5.0)) * index
        flat = np.sqrt(1.0 - height**2)
        sphere = np.column_stack([flat * np.cos(turn), height, flat * np.sin(turn)])
        ways = np.vstack([onward, sphere[np.argsort(-sphere @ onward)]])
        least, best = len(corners) + 1, onward
        for way in ways[ways @ onward > -0.3]:
            start, end = (np.broadcast_to(p, (len(corners), 3)) for p in (tip, tip + FAR * way))
            met = int(segments_hit(start, end, corners).sum())
            if met < least:
                least, best = met, way
            if met == 0:
                break
        found.append(np.vstack([curve, tip + FAR * best]))
    return found


def _from_the_face(curve: Floats, corners: Floats) -> Floats:
    """The head's curve, ended a TAIL below the crown where a hood covers the crown all round."""
    below = curve[np.linalg.norm(curve - curve[-1], axis=1) > TAIL]
    tip = curve[-1]
    onward = tip - below[-1]
    end = tip + FAR * onward / np.linalg.norm(onward)
    start, end = (np.broadcast_to(place, (len(corners), 3)) for place in (tip, end))
    return below if segments_hit(start, end, corners).any() else curve


def opening_class(loop: Floats, ways: list[Floats]) -> tuple[int, ...]:
    """How often each limb passes through a loop [N, 3]: (0, 1, 0, 0, 0): a right cuff, (0, 0, 0, 1, 1): a waist."""
    corners = np.stack([np.broadcast_to(loop.mean(axis=0), loop.shape), loop, np.roll(loop, -1, axis=0)], axis=1)
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    counts = []
    for way in ways:
        piece, face = (index.ravel() for index in np.indices((len(way) - 1, len(corners))))
        hit = segments_hit(way[piece], way[piece + 1], corners[face])
        along = ((way[piece + 1] - way[piece])[hit] * normals[face][hit]).sum(axis=1)
        counts.append(int(np.sign(along).sum()))
    shifted = [tuple(c - k for c in counts) for k in set(counts)]
    least = min(shifted, key=lambda c: (sum(map(abs, c)), c))
    return max(least, tuple(-c for c in least))


def limbs_cut(curves: Sequence[Floats], corners: Floats) -> int:
    """How many limbs' curves cloth [F, 3, 3] runs through."""
    count = 0
    for curve in curves:
        start, end = curve[:-1], curve[1:]
        is_short = np.linalg.norm(end - start, axis=1) < 1.0  # the box of the way to infinity holds all cloth
        low, high = np.minimum(start, end)[is_short], np.maximum(start, end)[is_short]
        piece, face = box_pairs(low, high, corners.min(axis=1), corners.max(axis=1), 5.0 * VOXEL)
        hit = bool(segments_hit(start[is_short][piece], end[is_short][piece], corners[face]).any())
        for first, last in zip(start[~is_short], end[~is_short], strict=True):
            hit |= bool(segments_hit(*(np.broadcast_to(p, (len(corners), 3)) for p in (first, last)), corners).any())
        count += hit
    return count
