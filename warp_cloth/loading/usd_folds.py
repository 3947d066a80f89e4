"""Rest angles of pairs of faces, by the surface-deformable physics schema of USD."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Folds
from warp_cloth.loading.raw import EXPORT_AGAIN, Ints
from warp_cloth.loading.usd_physics import SURFACE, applied, states_folds, value_of

if TYPE_CHECKING:
    from pxr import Usd

DEFAULTS = ("flat", "restShape")


def stated_folds(prim: Usd.Prim, face_count: int, place: str) -> Folds | None:
    """Rest angles of a cloth prim with so many faces; None where it is flat at rest, or no cloth.

    Raises:
        InputError: they do not fit the mesh.
    """
    if SURFACE not in applied(prim):
        return None
    default = value_of(prim, "physics:restBendAnglesDefault") or "flat"
    if default not in DEFAULTS:
        problem = f'physics:restBendAnglesDefault is "{default}"'
        raise InputError(place, problem, f"use {' or '.join(DEFAULTS)}")
    if not states_folds(prim):
        return None
    listed = value_of(prim, "physics:restAdjTriPairs")
    stated = value_of(prim, "physics:restBendAngles")
    pairs: Ints = np.array(listed if listed is not None else [], dtype=np.int64).reshape(-1, 2)
    angles = np.radians(np.array(stated if stated is not None else [], dtype=np.float64).reshape(-1))
    within = ((pairs >= 0) & (pairs < face_count)).all()
    if len(pairs) != len(angles) or not within or not np.isfinite(angles).all():
        problem = "physics:restBendAngles and physics:restAdjTriPairs do not match: one angle for each pair of faces"
        raise InputError(place, problem, EXPORT_AGAIN)
    return Folds(pairs, angles, default == "restShape")
