"""What the judge measures on a worn garment: strain against panels, depth in the body, bunching, girths, drops.

Nothing is imported from warp_cloth. Lengths are in metres.
"""

from __future__ import annotations

import numpy as np
from designs.geometry import Body, Floats, Ints, Mesh, components, dot, repeated
from scipy.spatial import cKDTree

EDGE_STEP = 0.008  # [m] between samples along an edge
FACE_STEP = 0.008  # [m] between samples within a face
CHORD = (0.06, 0.10)  # [m] on the panel, across which bunching is measured: wider than a fold, narrower than a panel


def panel_lengths(mesh: Mesh) -> Floats:
    """Each edge's length on its panels [m], shape [E]: the mean where two panels meet."""
    if mesh.panels is None:
        raise ValueError("the judge needs panels in the texture coordinates")
    sides = np.linalg.norm(np.roll(mesh.panels, -1, axis=1) - mesh.panels, axis=2)
    edges, edge, count = mesh.edges
    return np.asarray(np.bincount(edge.ravel(), weights=sides.ravel(), minlength=len(edges)) / count)


def edge_strains(mesh: Mesh, points: Floats) -> Floats:
    """Length over panel length, less 1, shape [E]."""
    edges = mesh.edges[0]
    lengths = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    return np.asarray(lengths / np.maximum(panel_lengths(mesh), 1e-9) - 1.0)


def edge_depths(body: Body, mesh: Mesh, points: Floats, clear: Floats) -> Floats:
    """How deep each edge dips into the body between its ends [m], shape [E]; ``clear``: vertices' distances from it."""
    ends = points[mesh.edges[0]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    near = np.flatnonzero(clear[mesh.edges[0]].min(axis=1) <= 0.5 * length)
    steps = np.minimum(np.ceil(length[near] / EDGE_STEP).astype(np.int64), 200)
    which, number = repeated(steps)
    share = ((number + 0.5) / steps[which])[:, None]
    edge = near[which]
    found = np.zeros(len(ends))
    np.maximum.at(found, edge, body.depth(ends[edge, 0] * (1.0 - share) + ends[edge, 1] * share))
    return found


def face_depths(body: Body, mesh: Mesh, points: Floats, clear: Floats) -> Floats:
    """How deep each triangle dips into the body inside [m], shape [F]."""
    corners = points[mesh.triangles]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    near = np.flatnonzero(clear[mesh.triangles].min(axis=1) <= longest)
    found = np.zeros(len(corners))
    counts = np.clip(np.ceil(longest[near] / FACE_STEP).astype(np.int64), 1, 12)
    for count in np.unique(counts):
        faces = near[counts == count]
        weights = _centres(int(count))
        samples = np.einsum("sk,fkx->fsx", weights, corners[faces])
        found[faces] = body.depth(samples.reshape(-1, 3)).reshape(len(faces), -1).max(axis=1)
    return found


def _centres(count: int) -> Floats:
    """Weights [count^2, 3] of the centres of the triangles into which ``count`` parts of each side divide one."""
    up = [(i + 1 / 3, j + 1 / 3) for i in range(count) for j in range(count - i)]
    down = [(i + 2 / 3, j + 2 / 3) for i in range(count) for j in range(count - i - 1)]
    first = np.array(up + down) / count
    return np.column_stack([first, 1.0 - first.sum(axis=1)])


def panel_corners(mesh: Mesh) -> tuple[Ints, Floats]:
    """Vertices as the panels have them: of each its mesh vertex [N] and place [m] [N, 3], panels far apart in z."""
    if mesh.panels is None:
        raise ValueError("the judge needs panels in the texture coordinates")
    flat = np.column_stack([mesh.triangles.ravel(), np.round(mesh.panels.reshape(-1, 2) * 1e6).astype(np.int64)])
    rows, corner = np.unique(flat, axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    part = components(len(rows), np.concatenate([corner[:, :2], corner[:, 1:]]))
    return rows[:, 0], np.column_stack([rows[:, 1:] * 1e-6, 10.0 * part])


def chord_ratios(mesh: Mesh, points: Floats) -> Floats:
    """Distance over panel distance of what lies CHORD apart on a panel, the best of all directions; NaN: none, [N].

    Folds shorten cloth across, never along them; bunched cloth is short in every direction.
    """
    vertex, places = panel_corners(mesh)
    pairs = cKDTree(places).query_pairs(CHORD[1], output_type="ndarray")
    flat = np.linalg.norm(places[pairs[:, 1]] - places[pairs[:, 0]], axis=1)
    far = flat > CHORD[0]
    pairs, flat = pairs[far], flat[far]
    ratio = np.linalg.norm(points[vertex[pairs[:, 1]]] - points[vertex[pairs[:, 0]]], axis=1) / flat
    best = np.full(len(vertex), -1.0)
    for end in (0, 1):
        np.maximum.at(best, pairs[:, end], ratio)
    return np.where(best < 0.0, np.nan, best)


def stretches(mesh: Mesh, points: Floats) -> tuple[Floats, Floats]:
    """Each triangle's largest stretch, less 1, and its area on the panel [m^2]; 0 and 0 where it has none there."""
    if mesh.panels is None:
        raise ValueError("the judge needs panels in the texture coordinates")
    u, v = np.moveaxis(mesh.panels[:, 1:] - mesh.panels[:, :1], 1, 0)
    a, b = np.moveaxis(points[mesh.triangles[:, 1:]] - points[mesh.triangles[:, :1]], 1, 0)
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    sound = np.abs(twice) > 1e-10
    scale = np.where(sound, twice, 1.0)[:, None]
    along, across = (a * v[:, 1:] - b * u[:, 1:]) / scale, (b * u[:, :1] - a * v[:, :1]) / scale
    p, q, r = dot(along, along), dot(across, across), dot(along, across)
    largest = np.sqrt(0.5 * (p + q) + np.sqrt(0.25 * (p - q) ** 2 + r**2))
    return np.where(sound, largest - 1.0, 0.0), 0.5 * np.abs(np.where(sound, twice, 0.0))
