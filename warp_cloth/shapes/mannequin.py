"""The parametric mannequin as a closed mesh, and the tape measure that checks it."""

from __future__ import annotations

from functools import partial

import numpy as np

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.shapes.body import calibrated_form, convex_girth
from warp_cloth.shapes.measures import MannequinMeasures
from warp_cloth.shapes.surface import (
    grid_values,
    is_closed_manifold,
    relax,
    split_quads,
    surface_nets,
    without_saddles,
)

MANNEQUIN_EDGE = 0.011  # [m] about 20,000 vertices: finer than a garment's own edges, chords within 0.5 mm
RELAX_ROUNDS = 6
GRIDS_TRIED = 4  # where a grid cuts a narrow gap in two, a slightly finer one does not


def mannequin(
    measures: MannequinMeasures | None = None, *, edge: float = MANNEQUIN_EDGE, cache: Cache | None = None
) -> Mesh:
    """Closed mannequin in A-pose with the given girths, feet on y = 0, facing +z, its left to +x.

    ``edge`` is its mean edge length [m]; ``cache`` shares drafts between shapes.
    """
    if not 0.004 <= edge <= 0.015:
        raise InputError("mannequin edge", f"{edge!r} m is out of range", "allowed: 0.004 to 0.015 m")
    measures = measures or MannequinMeasures()
    form = (cache or Cache()).get_or_make("form", (), partial(calibrated_form, measures), measures)
    for spacing in edge * np.linspace(1, 0.9, GRIDS_TRIED):
        values, origin = grid_values(form.value, *form.bounds, spacing)
        points, quads = surface_nets(without_saddles(values), origin, spacing)
        if is_closed_manifold(quads, len(points)):
            break
    else:
        raise InputError("mannequin", "these measures make a body that touches itself", "use less extreme measures")
    points = relax(points, quads, form.project, RELAX_ROUNDS)
    points = form.project(points)
    points[:, 1] -= points[:, 1].min()
    return Mesh("mannequin", points, split_quads(points, quads))


def trunk_girth(mesh: Mesh, height: float) -> float:
    """Length [m] of a tape round the trunk at a height: round all parts of the section that x = 0 passes through.

    Arms that are apart from the trunk at that height are left out.
    """
    one = mesh.triangles.ravel().astype(np.int64)
    other = np.roll(mesh.triangles, -1, axis=1).ravel().astype(np.int64)
    level = mesh.points[:, 1] - height
    cut = (level[one] < 0) != (level[other] < 0)  # an edge of a triangle; each cut triangle has two of them
    low, high = np.minimum(one, other)[cut], np.maximum(one, other)[cut]
    edges, spot = np.unique(low * mesh.vertex_count + high, return_inverse=True)
    if not len(edges):
        raise InputError("mannequin", f"it does not reach a height of {height} m", "measure lower")
    start, end = edges // mesh.vertex_count, edges % mesh.vertex_count
    fraction = (level[start] / (level[start] - level[end]))[:, None]
    spots = (mesh.points[start] * (1 - fraction) + mesh.points[end] * fraction)[:, [0, 2]]
    links = spot.reshape(-1, 2)
    part = np.arange(len(edges))
    for _ in range(len(edges)):
        lowest = part.copy()
        np.minimum.at(lowest, links[:, 0], part[links[:, 1]])
        np.minimum.at(lowest, links[:, 1], part[links[:, 0]])
        lowest = lowest[lowest]
        if np.array_equal(lowest, part):
            break
        part = lowest
    left = np.unique(part[spots[:, 0] < 0])
    central = np.intersect1d(left, part[spots[:, 0] >= 0])
    return convex_girth(spots[np.isin(part, central)])
