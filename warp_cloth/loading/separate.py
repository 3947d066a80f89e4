"""The garments of a file that holds several, each a mesh of its own, as programs export an outfit."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np

from warp_cloth.anatomy.openings import NARROWEST
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points, face_normals
from warp_cloth.base.mesh_formats import GLTF, NAMED, OBJ
from warp_cloth.base.topology import build_topology
from warp_cloth.loading.generic import gltf_mesh_names
from warp_cloth.loading.load import load_mesh
from warp_cloth.loading.obj import obj_mesh_names
from warp_cloth.loading.trims import SHARE
from warp_cloth.loading.unique_rows import unique_rows
from warp_cloth.loading.usd import mesh_paths_of

SEAM = 1e-4  # [m]; vertices of two meshes that are as near to each other are one, and sewn
SEWN = 0.25  # of a rim's vertices, from which on it is a seam: shells of one body share a vertex here and there
# [m], and of a rim's vertices: so near to another mesh's rim, and so much of it, is a seam with vertices of its own on
# either side, such as a sleeve modelled by itself has; the hems of two layers are farther apart.
ALONG, MOST = 2e-3, 0.5


def separate_garments(path: Path) -> list[str]:
    """The names of the meshes of a file that are garments of their own, in its order; [] where it holds one.

    All are, or none: each has two openings at least and is no trim of another, and no rim lies on the vertices of
    another, or along a rim of it, as those of panels and parts do along their seams.
    """
    try:
        data = path.read_bytes()
        names = mesh_names(path, data)
        if len(names) < 2 or len(set(names)) < len(names):
            return []
        meshes, rims = [], []
        for name in names:
            meshes.append(load_mesh(path, role="garment", key="garment", prim=name, data=data))
            rims.append(_rims(meshes[-1]))
            if len(rims[-1]) < 2:
                return []  # the first panel tells
    except (InputError, OSError, ValueError, LookupError, TypeError, AttributeError):
        return []  # told where the file is read as a whole
    areas = [float(np.linalg.norm(face_normals(mesh.points[mesh.triangles]), axis=1).sum()) for mesh in meshes]
    if min(areas) < SHARE * max(areas):
        return []
    pairs = permutations(zip(meshes, rims, strict=True), 2)
    sewn = any(
        _lies_on(rim, other.points) or any(_runs_along(rim, its) for its in others)
        for (_, own), (other, others) in pairs
        for rim in own
    )
    return [] if sewn else names


def mesh_names(path: Path, data: bytes) -> list[str]:
    """The name of each mesh of a file with this content, by which ``load_mesh`` reads it alone; [] of other formats."""
    kind = path.suffix.lower()
    if kind in OBJ:
        return obj_mesh_names(str(path), data)
    if kind in GLTF:
        return gltf_mesh_names(str(path), data)
    return mesh_paths_of(str(path)) if kind in NAMED else []


def _rims(mesh: Mesh) -> list[Points]:
    """The vertices of each opening [m], shape [N, 3]."""
    loops = [mesh.points[loop] for loop in build_topology(mesh.triangles, mesh.vertex_count).boundary_loops]
    return [ring for ring in loops if float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum()) > NARROWEST]


def _lies_on(rim: Points, other: Points) -> bool:
    """Whether much of a rim's vertices are where vertices of another mesh are [m]."""
    places = unique_rows(np.concatenate([np.round(other / SEAM), np.round(rim / SEAM)]) + 0.0)
    return bool((places.first[places.number[len(other) :]] < len(other)).mean() > SEWN)


def _runs_along(rim: Points, other: Points) -> bool:
    """Whether most of a rim is as near to another one as cloth is to a seam, shape [N, 3] and [M, 3]."""
    low, high = other.min(axis=0) - ALONG, other.max(axis=0) + ALONG
    near = rim[((rim >= low) & (rim <= high)).all(axis=1)]
    if len(near) <= MOST * len(rim):
        return False
    sides = np.roll(other, -1, axis=0) - other
    squares = np.maximum(np.einsum("mc,mc->m", sides, sides), np.finfo(np.float64).tiny)
    count = 0
    for point in near:
        off = point - other
        share = np.clip(np.einsum("mc,mc->m", off, sides) / squares, 0.0, 1.0)[:, None]
        count += bool((np.linalg.norm(off - share * sides, axis=1) <= ALONG).any())
    return count > MOST * len(rim)
