"""Winding: consistent orientation within each component, outwards for closed bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import edges_of, unique_rows

OPEN_FRACTION = 0.05  # a component with at most this fraction of boundary edges is closed (a neck, eye holes)


def _neighbours(triangles: Ints) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Face pairs across each edge with exactly two, and whether both run along it in the same direction (wrong)."""
    edges = edges_of(triangles)
    found = unique_rows(np.sort(edges, axis=1))
    order = np.argsort(found.number, kind="stable")
    starts = np.cumsum(found.count) - found.count
    first = starts[found.count == 2]
    a, b = order[first], order[first + 1]
    return a // 3, b // 3, edges[a, 0] == edges[b, 0]


def consistent_winding(triangles: Ints) -> tuple[NDArray[np.bool_], int]:
    """Which faces to flip so that each component is oriented consistently, with the fewest flips.

    Also the number of one-sided components, which cannot be oriented and are left alone.
    """
    count = len(triangles)
    a, b, wrong = _neighbours(triangles)
    if not wrong.any():
        return np.zeros(count, dtype=bool), 0
    component = connected_components(count, a, b)
    mixed = np.zeros(count, dtype=bool)
    mixed[component[a[wrong]]] = True
    here = mixed[component[a]]
    a, b, wrong = a[here], b[here], wrong[here]
    flip = _turned(count, a, b, wrong)
    flipped = np.bincount(component, weights=flip, minlength=count)
    flip ^= (2 * flipped > np.bincount(component, minlength=count))[component]
    one_sided = np.zeros(count, dtype=bool)
    one_sided[component[a[(flip[a] ^ flip[b]) != wrong]]] = True
    return flip & ~one_sided[component], int(one_sided.sum())


def _turned(count: int, a: Ints, b: Ints, wrong: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each face must flip to agree with the first of its component, found by breadth-first search."""
    neighbours: dict[int, list[tuple[int, bool]]] = {}
    for first, second, differs in zip(a.tolist(), b.tolist(), wrong.tolist(), strict=True):
        neighbours.setdefault(first, []).append((second, differs))
        neighbours.setdefault(second, []).append((first, differs))
    turned: dict[int, bool] = {}
    for root in sorted(neighbours):
        if root in turned:
            continue
        turned[root] = False
        front = [root]
        while front:
            face = front.pop()
            for other, differs in neighbours[face]:
                if other not in turned:
                    turned[other] = turned[face] ^ differs
                    front.append(other)
    flip = np.zeros(count, dtype=bool)
    flip[list(turned)] = list(turned.values())
    return flip


def outward(points: Floats, triangles: Ints) -> NDArray[np.bool_]:
    """Which faces to flip so that every closed component encloses a positive volume."""
    a, b, wrong = _neighbours(triangles)
    component = connected_components(len(triangles), a, b)
    corners = points[triangles]
    count = len(triangles)
    faces = np.bincount(component, minlength=count)
    centre = (
        np.stack(
            [np.bincount(component, weights=corners[:, :, axis].mean(axis=1), minlength=count) for axis in range(3)],
            axis=1,
        )
        / np.maximum(faces, 1)[:, None]
    )
    x, y, z = np.moveaxis(corners - centre[component][:, None, :], 1, 0)
    volume = np.bincount(component, weights=np.einsum("ij,ij->i", x, np.cross(y, z)), minlength=count)
    open_edges = 3 * faces - 2 * np.bincount(component[a], minlength=count)
    inconsistent = np.bincount(component[a], weights=wrong, minlength=count) > 0
    inside_out = (volume < 0) & (open_edges <= OPEN_FRACTION * 1.5 * faces) & ~inconsistent
    flip: NDArray[np.bool_] = inside_out[component]
    return flip
