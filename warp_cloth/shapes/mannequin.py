"""The parametric mannequin as a closed mesh."""

from __future__ import annotations

from functools import partial

import numpy as np

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.surface import (
    grid_values,
    is_closed_manifold,
    relax,
    split_quads,
    surface_nets,
    without_saddles,
)
from warp_cloth.shapes.body import calibrated_form
from warp_cloth.shapes.measures import MannequinMeasures

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
