"""Rest angles of a garment's hinges: flat, as modelled, or as a USD stage states them."""

from __future__ import annotations

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.topology import Topology
from warp_cloth.scene.wearables import RestAngles

SAME_PLACE = 1e-5  # of a hinge's length: two triangles of a rest shape that meet closer than this were not cut apart


def hinge_angles(mesh: Mesh, topology: Topology, kind: RestAngles, place: str, key: str) -> Points | None:
    """Rest angle of every hinge [rad], shape [H]; None where all are flat.

    Raises:
        InputError: "physics" without angles in the stage.
    """
    if kind == "flat":
        return None
    if kind == "mesh":
        return fold_angles(mesh.points, topology)
    if mesh.folds is None:
        problem = 'rest_angles = "physics" needs a USD mesh with physics:restBendAngles or a folded rest shape'
        raise InputError(place, problem, f'set {key}.rest_angles = "mesh" or "flat"')
    angles = np.zeros(len(topology.hinges))
    if mesh.folds.by_shape:
        angles = shape_angles(mesh, topology)
    face = np.arange(mesh.triangle_count) if mesh.triangle_source is None else mesh.triangle_source
    between = face[topology.hinge_triangles]
    stated = {
        (min(a, b), max(a, b)): angle
        for (a, b), angle in zip(mesh.folds.faces.tolist(), mesh.folds.angles.tolist(), strict=True)
    }
    for hinge, (a, b) in enumerate(np.sort(between, axis=1).tolist()):
        angles[hinge] = stated.get((a, b), angles[hinge])
    return angles


def shape_angles(mesh: Mesh, topology: Topology) -> Points:
    """Angle of every hinge in the stated rest shape, or in the mesh without one; 0 where it is cut apart there."""
    if mesh.rest_corners is None:
        return fold_angles(mesh.points, topology)
    first, second = topology.hinge_triangles.T
    start, end, wing_0, wing_1 = topology.hinges.T

    corners = mesh.rest_corners

    def placed(triangle: Indices, vertex: Indices) -> Points:
        corner = np.argmax(mesh.triangles[triangle] == vertex[:, None], axis=1)
        return np.asarray(corners[triangle, corner])

    a, b = placed(first, start), placed(first, end)
    length = np.linalg.norm(b - a, axis=1)
    apart = np.maximum(
        np.linalg.norm(placed(second, start) - a, axis=1), np.linalg.norm(placed(second, end) - b, axis=1)
    )
    angle = _angles(a, b, placed(first, wing_0), placed(second, wing_1))
    return np.where(apart <= SAME_PLACE * length, angle, 0.0)


def fold_angles(points: Points, topology: Topology) -> Points:
    """Angle of every hinge between its triangles' normals [rad], shape [H]; 0 where a triangle has no area."""
    return _angles(*(points[topology.hinges[:, column]] for column in range(4)))


def _angles(start: Points, end: Points, wing_0: Points, wing_1: Points) -> Points:
    """Angle between the normals of two triangles on an axis; positive where (n0 x n1) . axis is (laws.bending)."""
    axis = end - start
    normal_0, normal_1 = np.cross(axis, wing_0 - start), np.cross(wing_1 - start, axis)
    length = np.maximum(np.linalg.norm(axis, axis=1), np.finfo(float).tiny)
    sine = np.einsum("ij,ij->i", np.cross(normal_0, normal_1), axis) / length
    return np.asarray(np.arctan2(sine, np.einsum("ij,ij->i", normal_0, normal_1)))
