"""Inner edges that sewing would lay on other edges: cloth has at most two triangles at an edge, but for
seams of layers.

Where two panels each have an edge across the same corner, sewing both sides of the corner makes the edges one, with
four triangles; a dart's cone does so with itself. Such edges are divided, or turned.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.delaunay import Ints, doubled_areas
from warp_cloth.pattern.mesher import Flat


def crowded_edges(flat: Flat, welded: Ints, layered: Ints) -> Ints:
    """Sides of triangles, by place in ``triangles.ravel()``, that become points, or edges of over two triangles.

    ``layered``: vertices on seams of three panels or more, shape [n]: sides of outlines between them may be one.
    """
    one, other = (welded[ids.ravel()] for ids in (flat.triangles, np.roll(flat.triangles, -1, axis=1)))
    key = np.minimum(one, other) * len(welded) + np.maximum(one, other)
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    crowded = np.zeros(len(key), dtype=bool)
    crowded[order[2:][ranked[2:] == ranked[:-2]]] = True
    found = np.isin(key, key[crowded])
    if len(layered):
        on = np.zeros(len(welded), dtype=bool)
        on[layered] = True
        start, end = flat.triangles.ravel(), np.roll(flat.triangles, -1, axis=1).ravel()
        forward, backward = start * len(welded) + end, end * len(welded) + start
        rim = ~np.isin(forward, backward) & on[start] & on[end]
        found &= np.isin(key, key[found & ~rim])  # one that is of outlines alone is a seam
    return np.flatnonzero(found | (one == other))


def parted(flat: Flat, welded: Ints, crowded: Ints) -> Flat:
    """The mesh with the inner ones of those edges changed: turned where they would become points, else divided."""
    count = len(flat.points)
    start = flat.triangles.ravel()
    end = np.roll(flat.triangles, -1, axis=1).ravel()
    order = np.argsort(start * count + end, kind="stable")
    keys = (start * count + end)[order]
    triangles: list[list[int]] = flat.triangles.tolist()
    points: list[Floats] = []
    panel: list[int] = []
    touched: set[int] = set()
    to_points = welded[start[crowded]] == welded[end[crowded]]
    for place in [*crowded[to_points].tolist(), *crowded[~to_points].tolist()]:
        a, b = int(start[place]), int(end[place])
        at = int(np.searchsorted(keys, b * count + a))
        if at == len(keys) or keys[at] != b * count + a:
            continue  # on an outline
        first, second = place // 3, int(order[at]) // 3
        if first in touched or second in touched:
            continue
        tip, far = sum(triangles[first]) - a - b, sum(triangles[second]) - a - b
        if welded[a] == welded[b]:
            made = [[tip, a, far], [tip, far, b]]
            if not _sound(flat.points, made):
                continue
        else:
            middle = count + len(points)
            points.append(0.5 * (flat.points[a] + flat.points[b]))
            panel.append(int(flat.panel[a]))
            made = [[a, middle, tip], [middle, b, tip], [b, middle, far], [middle, a, far]]
        touched |= {first, second}
        triangles[first], triangles[second] = made[:2]
        triangles += made[2:]
    return replace(
        flat,
        points=np.concatenate([flat.points, np.reshape(points, (-1, 2))]),
        triangles=np.array(triangles, dtype=np.int64),
        panel=np.concatenate([flat.panel, np.array(panel, dtype=np.int64)]),
    )


def _sound(points: Floats, triangles: list[list[int]]) -> bool:
    return bool((doubled_areas(points, np.array(triangles)) > 0.0).all())
