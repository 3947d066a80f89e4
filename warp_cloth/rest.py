"""Rest shape of a garment: lengths, areas and the constants of its edges and hinges, in float64 on the host."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from warp_cloth.errors import InputError
from warp_cloth.mesh import Mesh
from warp_cloth.topology import Topology, build_topology

if TYPE_CHECKING:
    from warp_cloth.fabric import Fabric

Floats = NDArray[np.float64]

GRAVITY = 9.80665  # standard gravity [m/s2]

# A regular grid pulled along its threads bears on one of its three edge families, and an equilateral one, its sides
# free, likewise: so each edge answers for three times the area that it carries (a third of its triangles').
EDGE_SHARE = 3.0

# Edges far shorter than their neighbours would get constants without bound (k ~ 1 / L^3): below this share of the
# garment's median edge they count as that long.
SHORTEST_EDGE_SHARE = 1.0e-3


@dataclass(frozen=True, eq=False)
class RestShape:
    """Constants of one garment (SI). E edges, H hinges, V vertices."""

    topology: Topology
    edge_length: Floats  # L [m], shape [E]
    edge_pull: Floats  # k [N/m2] of f = k (r - L)^2, shape [E]
    edge_push: Floats  # c k [N/m2], shape [E]
    hinge_stiffness: Floats  # C [N m], shape [H]
    vertex_weight: Floats  # [N], shape [V]
    area: float  # of the cloth [m2]


def rest_sides(mesh: Mesh, rest: Literal["mesh", "uv"], metres_per_uv: float, place: str) -> Floats:
    """Rest lengths of each triangle's sides (0,1), (1,2), (2,0) [m], shape [F, 3].

    Raises:
        InputError: ``rest = "uv"`` on a mesh without usable texture coordinates.
    """
    if rest == "mesh":
        corners = mesh.points[mesh.triangles]
    else:
        if mesh.texcoords is None:
            raise InputError(
                place,
                'rest = "uv" needs texture coordinates on every face, and this mesh has none',
                'export the panels as UVs, or set rest = "mesh"',
            )
        corners = mesh.texcoords * metres_per_uv
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def triangle_areas(sides: Floats) -> Floats:
    """Areas [m2] from side lengths, Kahan's stable form of Heron's formula, shape [F]."""
    c, b, a = np.sort(sides, axis=1).T
    product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
    return 0.25 * np.sqrt(np.maximum(product, 0.0))


def build_rest_shape(
    mesh: Mesh, fabric: Fabric, *, rest: Literal["mesh", "uv"], metres_per_uv: float = 1.0, place: str = "garment"
) -> RestShape:
    """Rest lengths and constants of a garment of this fabric.

    Edges: k L^3 = 3 K A, with A the area that the edge carries, so that a strip of cloth pulled to strain e bears
    K e^2 per width at any resolution. Hinges: C = B3 (axis length) / (mean wing height)^2 (model: bending,
    mesh-independent form). Gravity: total weight / V on every vertex (the paper, section 2.3).

    Args:
        mesh: the garment.
        fabric: its material.
        rest: where the rest shape comes from.
        metres_per_uv: length of one unit of texture space [m].
        place: scene key, for messages.

    Raises:
        InputError: the rest shape cannot be used.
    """
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    sides = rest_sides(mesh, rest, metres_per_uv, place)
    areas = triangle_areas(sides)
    if not areas.sum() > 0.0:
        raise InputError(
            place,
            f'rest = "{rest}" gives a garment without area',
            'lay the panels out as UVs, or set rest = "mesh"' if rest == "uv" else "check the mesh",
        )
    edge_count = len(topology.edges)
    side_edge = topology.triangle_edges.ravel()
    side_count = np.bincount(side_edge, minlength=edge_count)
    # an edge between two panels takes the mean of the panels' lengths (model: cloth)
    length = np.bincount(side_edge, sides.ravel(), edge_count) / side_count
    carried = np.bincount(side_edge, np.repeat(areas / 3.0, 3), edge_count)
    floor = SHORTEST_EDGE_SHARE * float(np.median(length))
    pull = EDGE_SHARE * fabric.stretch * carried / np.maximum(length, floor) ** 3

    axis = np.maximum(length[topology.hinge_edges], floor)
    height = areas[topology.hinge_triangles].sum(axis=1) / axis  # mean of the two wings' 2 A / axis
    bending = fabric.bending * axis / np.maximum(height, floor) ** 2
    weight = fabric.weight * float(areas.sum()) * GRAVITY / mesh.vertex_count
    return RestShape(
        topology=topology,
        edge_length=length,
        edge_pull=pull,
        edge_push=fabric.compression * pull,
        hinge_stiffness=bending,
        vertex_weight=np.full(mesh.vertex_count, weight),
        area=float(areas.sum()),
    )
