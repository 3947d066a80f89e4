"""A body that was given as a garment, or in its file, perhaps with the garment as the body."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from warp_cloth.anatomy.skeleton import Skeleton, skeleton_of
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, face_normals
from warp_cloth.base.topology import build_topology
from warp_cloth.loading.repair import CLOSED

# Volume over area, relative to the extent: 0.02 in people; of cloth modelled with its thickness far less than 0.005.
SOLID = 0.005
# Length of all rims over the root of the area: 2.2 in a T-shirt, 0.4 in a body whose feet were not scanned, 1.7 in a
# scan with eight holes of 6 cm.
OPEN = 1.0
TALL = 0.5  # of the whole: lower parts, such as buttons and shoes, are not looked at


def refuse_bodies(
    garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None, find_skeleton: Callable[[], Skeleton | None]
) -> None:
    """Refuses a person's body as a garment: a closed one, and a scan with holes whose wearer looks like a garment.

    Refuses one that is in the garment's mesh, too, as programs that hold both export it: it would be fitted as cloth.

    Args:
        garments: scene key ("garment", "garment[1]") and mesh of each.
        avatar: what wears them.
        find_skeleton: finds the avatar's.

    Raises:
        InputError: a garment is a body; where the avatar looks like a garment, with the advice to exchange them.
    """
    of_file = Counter(garment.name for _, garment in garments)
    for key, garment in garments:
        is_closed = CLOSED in garment.notes
        # a person may wear an overall with a hood, which has limbs, too
        may_be_body = is_closed or (avatar is not None and find_skeleton() is None and _rims(avatar) > OPEN)
        if may_be_body and _is_solid(garment) and skeleton_of(garment, is_whole=True) is not None:
            problem = f"is a body: a {'closed ' if is_closed else ''}surface with a head, arms and legs"
            remedy = "give the mesh of the garment"
            if avatar is not None and _rims(avatar) > OPEN:
                remedy = f'exchange it and "{avatar.name}", which is open'
            raise InputError(key, f'"{garment.name}" {problem}', remedy)
        alone = [garment] if of_file[garment.name] > 1 else []  # of a file whose meshes are garments of their own
        if any(_is_body(part) for part in (*alone, *_tall_parts(garment))):
            problem = f'"{garment.name}" holds a body, too: a surface with a head, arms and legs'
            remedy = f"export the garment alone, or name its mesh by {key}.prim (in .obj, .glb and USD files)"
            raise InputError(key, problem, remedy)


def _tall_parts(mesh: Mesh) -> Iterator[Mesh]:
    """The connected parts of a mesh that has several, but for low ones."""
    part = mesh_parts(mesh.vertex_count, mesh.triangles)[mesh.triangles[:, 0]]
    first = np.unique(part)
    if len(first) == 1:
        return
    least = TALL * float(np.ptp(mesh.points, axis=0).max())
    for number in first:
        used, triangles = np.unique(mesh.triangles[part == number], return_inverse=True)
        points = mesh.points[used]
        if float(np.ptp(points, axis=0).max()) >= least:
            yield Mesh(mesh.name, points, triangles.reshape(-1, 3).astype(np.int32))


def _is_body(part: Mesh) -> bool:
    return _is_solid(part) and _rims(part) < OPEN and skeleton_of(part, is_whole=True) is not None


def _is_solid(mesh: Mesh) -> bool:
    corners = mesh.points[mesh.triangles] - mesh.points.mean(axis=0)
    normal = face_normals(corners)
    area = 0.5 * float(np.linalg.norm(normal, axis=1).sum())
    volume = abs(float(np.einsum("ij,ij->", corners[:, 0], normal))) / 6.0
    return volume > SOLID * float(np.ptp(mesh.points, axis=0).max()) * area


def _rims(mesh: Mesh) -> float:
    """Length of the boundary over the root of the area."""
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    uses = np.bincount(topology.triangle_edges.ravel(), minlength=len(topology.edges))
    ends = mesh.points[topology.edges[uses == 1]]
    area = 0.5 * float(np.linalg.norm(face_normals(mesh.points[mesh.triangles]), axis=1).sum())
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) / max(area, np.finfo(float).tiny) ** 0.5
