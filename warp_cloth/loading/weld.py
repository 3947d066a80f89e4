"""Joining the seams of a mesh whose neighbouring faces have vertices of their own at the very same places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.topology import used_ids
from warp_cloth.loading.raw import Floats, Ints
from warp_cloth.loading.unique_rows import edges_of, unique_rows

# Vertices of two rims closer than this [m], and than this fraction of their edges, are one: files round that much.
NEAR, NEAR_FRACTION = 1e-4, 0.01
NEXT = (1, 2, 3)  # ranks in a cell between compared vertices: rims are joined, not clouds


@dataclass(frozen=True, eq=False)
class Weld:
    """The vertex that replaces each, and how many were joined, or not joined at the same place."""

    vertex: Ints  # lowest vertex joined with each, shape [V]
    joined: int = 0
    apart: int = 0
    farthest: float = 0.0  # between two that were joined [m]


def weld(points: Floats, triangles: Ints, *, panels: Floats | None = None, copies: bool = False) -> Weld:
    """Join boundary edges that coincide, exactly or nearly, two and two.

    Edges, not points: parts that only touch stay apart. Where more than two faces would meet, two layers lie
    on each other, and they stay apart too; only where no faces share a vertex at all (an STL) do positions
    alone say what is joined, and a third face at an edge is then the file's own.

    ``panels`` are texture coordinates, shape [F, 3, 2]: a piece whose panels share vertices along its seams is sewn
    already, and where two of its rims coincide all the same it is open, as a jacket is in front.

    With ``copies``, a piece that lies face by face on an earlier one is joined with it: the back side of a
    two-sided export. Cloth so placed has no side to be on, so that no contact could ever part the two.
    """
    used = used_ids(triangles, len(points))
    places = unique_rows(points[used] + 0.0)  # -0 and 0 are one place
    place = np.full(len(points), -1, dtype=np.int64)
    place[used] = places.number
    same = _near_rims(points[used[places.first]], place[triangles])
    place[used], count = same[places.number], len(used_ids(same, len(places.first)))
    if count == len(used):
        return Weld(np.arange(len(points)))
    soup = len(triangles) > 1 and int(np.bincount(triangles.reshape(-1)).max()) == 1
    own = ~_copies(place, triangles, panels) if copies and not soup else np.ones(len(triangles), dtype=bool)
    faces = triangles[np.sort(unique_rows(np.sort(place[triangles], axis=1)).first)] if soup else triangles[own]
    a, b = _matched(place, faces, soup, panels if panels is None else panels[own])
    while True:
        vertex = connected_components(len(points), a, b)
        bad = np.zeros(len(points), dtype=bool) if soup else _spoilt(vertex, faces)
        if not bad.any():
            break
        keep = ~(bad[vertex[a]] | bad[vertex[b]])
        a, b = a[keep], b[keep]
    if len(faces) < len(triangles):  # a duplicate face goes where its twin goes, and is dropped there
        vertex = _twins_joined(vertex, place, triangles)
    left = len(used_ids(vertex[used], len(points)))
    farthest = float(np.linalg.norm(points[used] - points[vertex[used]], axis=1).max())
    return Weld(vertex, joined=len(used) - left, apart=left - count, farthest=farthest)


def _near_rims(points: Floats, triangles: Ints) -> Ints:
    """The lowest of the places that are one with each, shape [P]: those on a rim that nearly coincide."""
    edges = edges_of(triangles)
    rim = edges[(_per_row(edges)[1] == 1) & (edges[:, 0] != edges[:, 1])]
    length = np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)
    tolerance = np.full(len(points), NEAR)
    for end in rim.T:
        np.minimum.at(tolerance, end, NEAR_FRACTION * length)
    on_rim = used_ids(rim, len(points))
    first, second = [], []
    for shift in np.ndindex(2, 2, 2):  # two points within NEAR lie in one cell of at least one of these
        cell = unique_rows(np.floor(points[on_rim] / (2.0 * NEAR) + 0.5 * np.array(shift))).number
        order = np.argsort(cell, kind="stable")
        for lag in NEXT:
            together = cell[order[lag:]] == cell[order[:-lag]]
            first.append(on_rim[order[:-lag][together]])
            second.append(on_rim[order[lag:][together]])
    a, b = np.concatenate(first), np.concatenate(second)
    close = np.linalg.norm(points[a] - points[b], axis=1) <= np.minimum(tolerance[a], tolerance[b])
    return connected_components(len(points), a[close], b[close])


def _per_row(rows: Ints) -> tuple[Ints, Ints]:
    """A number for each different row (whatever the order within it), and how often each row stands there."""
    found = unique_rows(np.sort(rows, axis=1))
    return found.number, found.count[found.number]


def _matched(place: Ints, faces: Ints, soup: bool, panels: Floats | None) -> tuple[Ints, Ints]:
    """Pairs of vertices that coinciding boundary edges ask to join."""
    edges = edges_of(faces)
    boundary = _per_row(edges)[1] == 1
    spot, together = _per_row(place[edges])
    candidate = boundary & (place[edges[:, 0]] != place[edges[:, 1]])
    candidate &= (together > 1) if soup else (together == 2)
    if not soup:  # faces that lie on each other are layers
        layered = _per_row(place[faces])[1] > 1
        candidate &= ~np.repeat(layered, 3)
    chosen = np.flatnonzero(candidate)
    chosen = chosen[np.argsort(spot[chosen], kind="stable")]
    same = spot[chosen[1:]] == spot[chosen[:-1]]
    one, other = chosen[:-1][same], chosen[1:][same]
    if not soup and panels is not None and len(one):
        closed = ~_left_open(place, faces, panels, one, other)
        one, other = one[closed], other[closed]
    first, second = edges[one], edges[other]
    crossed = place[first[:, 0]] != place[second[:, 0]]
    second = np.where(crossed[:, None], second[:, ::-1], second)
    return first.reshape(-1), second.reshape(-1)


def _left_open(place: Ints, faces: Ints, panels: Floats, one: Ints, other: Ints) -> NDArray[np.bool_]:
    """Which pairs of coinciding boundary edges (rows of ``edges_of``) are an opening between two panels.

    Both belong to one piece, whose panels are sewn elsewhere by vertices that they share.
    """
    edges = edges_of(faces)
    piece = connected_components(len(place), *edges.T)
    number, together = _per_row(edges)
    inner = np.flatnonzero(together == 2)
    inner = inner[np.argsort(number[inner], kind="stable")]
    seams = inner[::2][_between_panels(place, edges, panels, inner[::2], inner[1::2])]
    sewn = np.zeros(len(place), dtype=bool)
    sewn[piece[edges[seams, 0]]] = True
    own, others = piece[edges[one, 0]], piece[edges[other, 0]]
    open_: NDArray[np.bool_] = (own == others) & sewn[own] & _between_panels(place, edges, panels, one, other)
    return open_


def _between_panels(place: Ints, edges: Ints, panels: Floats, one: Ints, other: Ints) -> NDArray[np.bool_]:
    """Whether two faces that meet at edges do not do so in texture space: they lie elsewhere, or on each other."""
    a, b, c = (np.roll(panels, -shift, axis=1).reshape(-1, 2) for shift in (0, 1, 2))  # its ends and what faces it
    crossed = (place[edges[one, 0]] != place[edges[other, 0]])[:, None]
    a2, b2 = np.where(crossed, b[other], a[other]), np.where(crossed, a[other], b[other])
    along = b[one] - a[one]
    near = NEAR_FRACTION * np.linalg.norm(along, axis=1)
    apart = (np.linalg.norm(a2 - a[one], axis=1) > near) | (np.linalg.norm(b2 - b[one], axis=1) > near)
    sides = [along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] for off in (c[one] - a[one], c[other] - a[one])]
    return np.asarray(apart | (sides[0] * sides[1] > 0.0))


def _spoilt(vertex: Ints, triangles: Ints) -> NDArray[np.bool_]:
    """Joined vertices at an edge that joining gave a third face, or in a face that it closed."""
    edges = edges_of(vertex[triangles])
    bad_edge = (_per_row(edges)[1] > 2) & (_per_row(edges_of(triangles))[1] <= 2)
    closed = edges[:, 0] == edges[:, 1]
    bad = np.zeros(len(vertex), dtype=bool)
    bad[edges[bad_edge | closed]] = True
    merged = np.bincount(vertex[used_ids(triangles, len(vertex))], minlength=len(vertex)) > 1
    return bad & merged


def _copies(place: Ints, triangles: Ints, panels: Floats | None) -> NDArray[np.bool_]:
    """Which triangles belong to a piece that lies face by face, vertex by vertex, on earlier pieces; shape [F].

    Panels that are to be sewn to each other may start so, too: they differ in texture space.
    """
    found = unique_rows(np.sort(place[triangles], axis=1))
    twin = found.first[found.number]
    piece = connected_components(len(place), *edges_of(triangles).T)[triangles[:, 0]]
    by_place, twin_by_place = (
        np.argsort(place[triangles[rows]], axis=1, kind="stable") for rows in (slice(None), twin)
    )
    own = np.take_along_axis(triangles, by_place, axis=1)
    other = np.take_along_axis(triangles[twin], twin_by_place, axis=1)
    partner = np.arange(len(place))
    partner[own] = other
    same = (twin != np.arange(len(triangles))) & (partner[own] == other).all(axis=1)
    if panels is not None:
        here = np.take_along_axis(panels, by_place[:, :, None], axis=1)
        same &= (here == np.take_along_axis(panels[twin], twin_by_place[:, :, None], axis=1)).all(axis=(1, 2))
    differs = np.zeros(len(place), dtype=bool)
    differs[piece[~same]] = True
    return ~differs[piece]


def _twins_joined(vertex: Ints, place: Ints, triangles: Ints) -> Ints:
    """Vertices of duplicate facets joined with those of the facet that they double."""
    found = unique_rows(np.sort(place[triangles], axis=1))
    twin = triangles[found.first[found.number]]
    by_place = np.argsort(place[triangles], axis=1, kind="stable")
    twin_by_place = np.argsort(place[twin], axis=1, kind="stable")
    own = np.take_along_axis(triangles, by_place, axis=1).reshape(-1)
    other = np.take_along_axis(twin, twin_by_place, axis=1).reshape(-1)
    joined = vertex.copy()
    joined[own] = vertex[other]
    return joined
