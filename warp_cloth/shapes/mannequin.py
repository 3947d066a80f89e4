"""The parametric mannequin as a closed mesh, and the tape measure that checks it."""

from __future__ import annotations

import numpy as np

from warp_cloth.errors import InputError
from warp_cloth.mesh import Mesh, Points
from warp_cloth.shapes.body import calibrated_form, convex_girth
from warp_cloth.shapes.measures import MannequinMeasures
from warp_cloth.shapes.surface import grid_values, is_closed_manifold, relax, split_quads, surface_nets

MANNEQUIN_EDGE = 0.011  # [m] about 20,000 vertices: finer than a garment's own edges, chords within 0.5 mm
RELAX_ROUNDS = 6
GRIDS_TRIED = 6  # where a grid cuts a narrow gap in two, a slightly finer one does not


def mannequin(measures: MannequinMeasures | None = None, *, edge: float = MANNEQUIN_EDGE) -> Mesh:
    """Closed mannequin in A-pose, feet on y = 0, facing +z, with the given girths; ``edge`` is its mesh size [m]."""
    if not 0.004 <= edge <= 0.015:
        raise InputError("mannequin edge", f"{edge!r} m is out of range", "allowed: 0.004 to 0.015 m")
    form = calibrated_form(measures or MannequinMeasures())
    for spacing in edge * np.linspace(1, 0.9, GRIDS_TRIED):
        points, quads = surface_nets(*grid_values(form.value, *form.bounds, spacing), spacing)
        if is_closed_manifold(quads, len(points)):
            break
    else:
        raise InputError(
            "mannequin", "these measures make a body that touches itself", "use less extreme measures"
        )
    points = relax(points, quads, form.project, RELAX_ROUNDS)
    points = form.project(points)
    points[:, 1] -= points[:, 1].min()
    return Mesh("mannequin", points, split_quads(points, quads))


def trunk_girth(mesh: Mesh, height: float) -> float:
    """Length [m] of a tape round the trunk of a body at a height: what arms and other limbs add is left out."""
    corners = mesh.points[mesh.triangles]
    level = corners[:, :, 1] - height
    cut = np.flatnonzero((level.min(axis=1) < 0) & (level.max(axis=1) >= 0))
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        la, lb = level[cut, a], level[cut, b]
        crossed = (la < 0) != (lb < 0)
        share = np.where(crossed, la / np.where(crossed, la - lb, 1.0), np.nan)[:, None]
        ends.append(corners[cut, a] * (1 - share) + corners[cut, b] * share)
    spots = np.concatenate(ends)[:, [0, 2]]
    spots = spots[~np.isnan(spots[:, 0])]
    return convex_girth(_trunk(spots))


def _trunk(spots: Points) -> Points:
    """Those points of a section that belong to the trunk: arms are set apart by a gap in x."""
    order = np.argsort(np.abs(spots[:, 0]))
    reach = np.abs(spots[order, 0])
    gaps = np.flatnonzero(np.diff(reach) > 0.02)
    return spots[order[: gaps[0] + 1]] if len(gaps) else spots
