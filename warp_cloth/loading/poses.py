"""Further poses of an avatar: meshes with the same vertices and faces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from warp_cloth.base import mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.units import METRES_PER, BodyUp, LengthUnit
from warp_cloth.loading.load import in_metres, read_raw
from warp_cloth.loading.raw import RawMesh, check
from warp_cloth.loading.usd import read_usd_samples

KEY = "avatar.poses"
OTHER = 5.0  # factor of length that no pose gives to a tenth of a body's edges


def load_poses(
    avatar: Mesh,
    path: Path,
    poses: Sequence[Path] | Literal["samples"],
    *,
    prim: str | None = None,
    units: LengthUnit | None = None,
    up: BodyUp | None = None,
) -> tuple[Points, ...]:
    """Vertices of ``avatar``, loaded from ``path``, in further poses [m], each shape [V, 3].

    ``poses`` are files of the same vertices and faces, or "samples": the time samples of the USD file itself.

    Raises:
        InputError: a file cannot be read, or has another mesh.
    """
    first = read_raw(path, role="avatar", key="avatar", prim=prim, up=up)
    metres = METRES_PER[units] if units is not None else None
    if poses == "samples":
        if path.suffix.lower() not in mesh_formats.USD:
            raise InputError(KEY, f'"samples" is for USD files, but avatar.mesh is {path.name}', "list mesh files")
        others = read_usd_samples(str(path), key="avatar", prim=prim)
    else:
        others = [read_raw(pose, role="avatar", key="avatar", prim=prim, up=up) for pose in poses]
    return tuple(_posed(avatar, first, other, metres) for other in others)


def _posed(avatar: Mesh, first: RawMesh, other: RawMesh, metres: float | None) -> Points:
    """The avatar's vertices where another mesh has them."""
    check(other)
    if len(other.points) != len(first.points):
        problem = f"has {len(other.points):,} vertices, but avatar.mesh has {len(first.points):,}"
        raise InputError(other.file, problem, "export every pose from the same mesh, with the same vertex order")
    if not (np.array_equal(other.counts, first.counts) and np.array_equal(other.corners, first.corners)):
        raise InputError(
            other.file, "its faces differ from those of avatar.mesh", "export every pose from the same mesh"
        )
    scale = metres if metres is not None else other.metres_per_unit or METRES_PER[avatar.unit]  # type: ignore[index]
    points = np.empty_like(avatar.points)
    number = np.arange(len(first.points)) if avatar.vertex_map is None else avatar.vertex_map
    used = number >= 0
    points[number[used]] = in_metres(other, scale)[used]
    _refuse_other(avatar, points, other.file)
    return points


def _refuse_other(avatar: Mesh, points: Points, file: str) -> None:
    """Refuses a pose in another unit or vertex order; its ``points`` [m], shape [V, 3]."""
    one, other = avatar.triangles.ravel(), np.roll(avatar.triangles, 1, axis=1).ravel()
    before, now = (np.linalg.norm(each[one] - each[other], axis=1) for each in (avatar.points, points))
    least = np.finfo(float).tiny
    ratio = np.maximum(now, least) / np.maximum(before, least)
    if np.quantile(np.maximum(ratio, 1.0 / ratio), 0.9) > OTHER:
        problem = f"its edges are {np.median(ratio):.3g} times as long as those of avatar.mesh (median)"
        raise InputError(file, problem, "export it in the same unit, with the same vertex order")
