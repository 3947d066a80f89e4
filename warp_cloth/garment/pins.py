"""Pinned vertices of a garment: by vertex number, box or boundary loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh

# Axis and sign in which a loop lies furthest. Left and right are the wearer's, who faces +z: left is +x.
_SIDES = {
    "top": (1, 1.0),
    "bottom": (1, -1.0),
    "left": (0, 1.0),
    "right": (0, -1.0),
    "front": (2, 1.0),
    "back": (2, -1.0),
}


class PinSpec(Protocol):
    """One entry of a scene's ``pin``: exactly one of the three is set."""

    @property
    def vertices(self) -> Sequence[int] | None: ...
    @property
    def box(self) -> Sequence[Sequence[float]] | None: ...
    @property
    def loop(self) -> str | int | None: ...


def select_pins(mesh: Mesh, pins: Sequence[PinSpec], place: str) -> Indices:
    """Vertices that any of the pins selects, sorted, unique, int32, shape [N]; ``place`` is the pins' scene key.

    Vertices are numbered as in the file, from 0; boxes are in metres; loop 0 is the longest.

    Raises:
        InputError: a pin selects nothing.
    """
    chosen = [np.zeros(0, dtype=np.int64)]
    for number, pin in enumerate(pins):
        here = f"{place}[{number}]"
        if pin.vertices is not None:
            chosen.append(_by_number(mesh, pin.vertices, f"{here}.vertices"))
        if pin.box is not None:
            chosen.append(_by_box(mesh, pin.box, f"{here}.box"))
        if pin.loop is not None:
            chosen.append(_by_loop(mesh, pin.loop, f"{here}.loop"))
    return np.unique(np.concatenate(chosen)).astype(np.int32)


def _by_number(mesh: Mesh, numbers: Sequence[int], place: str) -> NDArray[np.int64]:
    count = mesh.vertex_count if mesh.vertex_map is None else len(mesh.vertex_map)
    outside = [number for number in numbers if not 0 <= number < count]
    if outside:
        problem = f"vertex {outside[0]} does not exist: {mesh.name} has {count:,} vertices"
        raise InputError(place, problem, f"use 0 to {count - 1}")
    chosen = np.array(numbers, dtype=np.int64)
    if mesh.vertex_map is None or not len(chosen):
        return chosen
    mapped = mesh.vertex_map[chosen]
    if (mapped < 0).any():
        problem = f"vertex {chosen[mapped < 0][0]} belongs to no face of {mesh.name} and was dropped"
        raise InputError(place, problem, "pin a vertex of the surface")
    return mapped


def _by_box(mesh: Mesh, box: Sequence[Sequence[float]], place: str) -> NDArray[np.int64]:
    corners = np.array(box, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    chosen = np.flatnonzero(((mesh.points >= low) & (mesh.points <= high)).all(axis=1))
    if not len(chosen):
        lowest, highest = ("[" + ", ".join(f"{v:.3g}" for v in corner) + "]" for corner in mesh.bounds())
        problem = f"the box contains no vertex of {mesh.name}"
        raise InputError(place, problem, f"the mesh spans {lowest} to {highest} (metres)")
    return chosen


def _by_loop(mesh: Mesh, loop: str | int, place: str) -> NDArray[np.int64]:
    loops = boundary_loops(mesh)
    if not loops:
        raise InputError(place, f"{mesh.name} is closed: it has no boundary loop", "pin by vertices or by box")
    if isinstance(loop, str):
        if loop not in _SIDES:
            raise InputError(place, f"{loop!r} is not a side", f"use {', '.join(_SIDES)}, or a number from 0")
        return loops[_furthest(mesh, loops, loop, place)]
    if not 0 <= loop < len(loops):
        have = f"{mesh.name} has {len(loops)} boundary loop{'s' if len(loops) > 1 else ''}"
        raise InputError(place, f"loop {loop} does not exist: {have}", f"use 0 to {len(loops) - 1} (0 is the longest)")
    return loops[loop]


def _furthest(mesh: Mesh, loops: Sequence[NDArray[Any]], side: str, place: str) -> int:
    """The loop that lies furthest to a side. Refuses where another reaches further, as an open front does to the neck.

    There the neck is part of one long loop with the fronts and the hem, and an armhole lies higher than that.
    """
    axis, sign = _SIDES[side]
    along = [sign * mesh.points[members, axis] for members in loops]
    lies = int(np.argmax([each.mean() for each in along]))
    reaches = int(np.argmax([each.max() for each in along]))
    if along[reaches].max() > along[lies].max():
        problem = f"loop {lies} of {mesh.name} is furthest to the {side} on average, but loop {reaches} reaches further"
        raise InputError(place, problem, f"set loop = {lies} or {reaches}, or pin by box")
    return lies


def boundary_loops(mesh: Mesh) -> list[NDArray[Any]]:
    """Vertices of each connected piece of boundary, longest first; loops that share a vertex count as one."""
    ends = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    edges = edges[count == 1]
    if not len(edges):
        return []
    label = connected_components(mesh.vertex_count, edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]], axis=1)
    totals = np.bincount(label[edges[:, 0]], weights=lengths, minlength=mesh.vertex_count)
    roots = np.unique(label[edges[:, 0]])
    roots = roots[np.argsort(-totals[roots], kind="stable")]
    on_boundary = np.unique(edges)
    return [on_boundary[label[on_boundary] == root] for root in roots]
