"""Flat patches that close the end of a sleeve, a leg or a hem of a garment modelled in 3-D: a limb passes through."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.crossings import surface_crossings
from warp_cloth.anatomy.openings import NARROWEST
from warp_cloth.anatomy.skeleton import LIMBS, Skeleton
from warp_cloth.base.choice import Choice
from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Indices, Mesh, Points, face_normals
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.garment import Garment
from warp_cloth.loading.repair import CLOSED
from warp_cloth.scene import Scene

SHARP = 0.7  # cosine of 45 degrees, rounded, between the normals of two faces, below which they meet at a sharp edge
# Length of the sum of a patch's face normals over the sum of their lengths, from which on it is flat: 0.998 and more
# where rims of sleeves and legs are closed by a fan of faces. A half ball has 0.5.
FLAT = 0.98


def open_ends(
    scene: Scene, garments: Sequence[Garment], find_skeleton: Callable[[], Skeleton | None]
) -> tuple[Scene, list[Choice]]:
    """The scene with closed ends that a limb passes through opened, of the garments of its files; else the same scene.

    ``find_skeleton`` finds that of the body that stays; it is called only where a garment has such ends.
    """
    specs, choices = list(scene.garments), []
    for index, (spec, key, garment) in enumerate(zip(scene.garments, scene.garment_keys, garments, strict=True)):
        is_modelled = garment.is_modelled and spec.mesh is not None
        if not is_modelled or "open_ends" in spec.model_fields_set:
            continue
        ends = closed_ends(garment.points, garment.triangles)
        skeleton = find_skeleton() if ends else None
        if skeleton is None:
            continue
        counts = [surface_crossings(garment.points, garment.triangles[end], skeleton.curves) for end in ends]
        limbs = [LIMBS[limb] for limb in np.flatnonzero(np.any([count % 2 for count in counts], axis=0))]
        if limbs:
            specs[index] = spec.model_copy(update={"open_ends": True})
            reason = f"flat patches with sharp rims would be pierced by {', '.join(limbs)}"
            choices.append(Choice(f"{key}.open_ends", True, reason))
    return (scene.model_copy(update={"garments": tuple(specs)}) if choices else scene), choices


def closed_ends(points: Points, triangles: Indices) -> list[NDArray[np.intp]]:
    """The triangles of each flat patch at the end of a tube, whose rim is sharp all round; ``points`` [m].

    The cloth next to it is all on one side, and its rim is no shorter than a cuff's.
    """
    topology = build_topology(triangles, len(points))
    normals = face_normals(points[triangles])
    areas = np.linalg.norm(normals, axis=1)
    one, other = topology.hinge_triangles.T
    cosines = np.einsum("ij,ij->i", normals[one], normals[other])
    is_sharp = cosines < SHARP * areas[one] * areas[other]
    if not is_sharp.any():
        return []
    patch = connected_components(len(triangles), one[~is_sharp], other[~is_sharp])
    _, patch = np.unique(patch, return_inverse=True)
    count = int(patch.max()) + 1
    vector = np.stack([np.bincount(patch, normals[:, axis], count) for axis in range(3)], axis=1)
    is_flat = np.linalg.norm(vector, axis=1) >= FLAT * np.bincount(patch, areas, count)
    on_rim = np.bincount(topology.triangle_edges.ravel(), minlength=len(topology.edges))[topology.triangle_edges] != 2
    is_flat[patch[on_rim.any(axis=1)]] = False
    sides = np.zeros((2, count))  # how many faces next to each patch are above and below it
    for own, wing in ((one, topology.hinges[:, 3]), (other, topology.hinges[:, 2])):
        height = np.einsum("ij,ij->i", normals[own], points[wing] - points[triangles[own, 0]])[is_sharp]
        sides += np.stack([np.bincount(patch[own[is_sharp]], sign * height > 0.0, count) for sign in (1, -1)])
    is_flat &= sides.min(axis=0) == 0.0
    lengths = np.linalg.norm(np.diff(points[topology.edges[topology.hinge_edges]], axis=1)[:, 0], axis=1)
    around = [np.bincount(patch[each[is_sharp]], lengths[is_sharp], count) for each in (one, other)]
    is_flat &= around[0] + around[1] > NARROWEST
    largest = np.bincount(patch, areas, count).argmax()
    return [np.flatnonzero(patch == number) for number in np.flatnonzero(is_flat) if number != largest]


def with_open_ends(mesh: Mesh) -> Mesh:
    """A garment's mesh without its closed ends; other vertices keep their order."""
    ends = closed_ends(mesh.points, mesh.triangles)
    if not ends:
        return mesh
    kept = np.ones(mesh.triangle_count, dtype=bool)
    kept[np.concatenate(ends)] = False
    used = np.zeros(mesh.vertex_count, dtype=bool)
    used[mesh.triangles[kept]] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    before = np.arange(mesh.vertex_count) if mesh.vertex_map is None else mesh.vertex_map
    own = np.arange(mesh.triangle_count) if mesh.triangle_source is None else mesh.triangle_source
    return replace(
        mesh,
        points=mesh.points[used],
        triangles=number[mesh.triangles[kept]].astype(np.int32),
        texcoords=None if mesh.texcoords is None else mesh.texcoords[kept],
        panels=None if mesh.panels is None else mesh.panels[kept],
        materials=None if mesh.materials is None else mesh.materials[kept],
        folds=None,  # between faces of the file
        rest_corners=None if mesh.rest_corners is None else mesh.rest_corners[kept],
        notes=tuple(note for note in mesh.notes if note != CLOSED),
        vertex_map=np.where(before >= 0, number[before], -1),
        triangle_source=own[kept],
    )
