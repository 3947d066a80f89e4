"""Small garments that several test files build."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.topology import Topology
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import RestShape, build_rest_shape
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.vertices import AvatarSkin
from warp_cloth.solver.forces import ForcePass

STEP = 1e-7  # [m]; central differences of a smooth force: relative error near 1e-8
NO_PINS = np.zeros(0, dtype=np.int32)


def grid(count: int = 5, side: float = 0.2) -> Mesh:
    """A flat square of ``count`` vertices a side in the xy plane, diagonals alternating."""
    x, y = np.meshgrid(np.linspace(0.0, side, count), np.linspace(0.0, side, count))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(count * count)], axis=1)
    triangles = []
    for row in range(count - 1):
        for column in range(count - 1):
            a = row * count + column
            b, c, d = a + 1, a + count, a + count + 1
            triangles += [[a, b, d], [a, d, c]] if (row + column) % 2 == 0 else [[a, b, c], [b, d, c]]
    return Mesh("grid", points, np.array(triangles, dtype=np.int32))


def tube(radius: float, low: float, high: float, around: int = 96, rows: int = 9) -> Mesh:
    """An upright tube, ring by ring from below, facing outwards."""
    turn, height = np.meshgrid(2.0 * np.pi * np.arange(around) / around, np.linspace(low, high, rows))
    points = np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], axis=2).reshape(-1, 3)
    a = np.arange(around * (rows - 1))
    b = a // around * around + (a + 1) % around
    triangles = np.concatenate([np.stack([a, a + around, b + around], 1), np.stack([a, b + around, b], 1)])
    return Mesh("tube", points, triangles.astype(np.int32))


def model_of(
    mesh: Mesh,
    rest: RestShape,
    *,
    pins: np.ndarray = NO_PINS,
    precision: str = "float64",
    device: str = "cpu",
    gathers: bool | None = None,
    avatar_friction: float = 0.0,
    offset: float = 0.0,
) -> ClothModel:
    """One garment on a device."""
    garment = Garment(mesh.points, mesh.triangles, rest, pins)
    return build_model(
        [garment],
        device=device,
        precision=precision,
        gathers=gathers,
        avatars=[AvatarSkin(avatar_friction, offset)],
    )


def deformed_model(mesh: Mesh, points: Points, fabric: Fabric, **options: str) -> ClothModel:
    """A garment whose rest shape is ``mesh`` and whose shape now is ``points``."""
    model = model_of(mesh, build_rest_shape(mesh, fabric, rest="mesh"), **options)
    model.set_points(points)
    return model


def cloth_forces(model: ClothModel, accumulate: Accumulate = Accumulate.NONE, step: Any = None) -> np.ndarray:
    """Forces of tension and bending [N] and the bound or magnitude, shape [V, 4]; ``step``: by default nothing."""
    types = cloth_types(model.precision)
    load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
    ForcePass(model, accumulate, load).launch(types.Step() if step is None else step)
    return np.array(load.numpy(), dtype=np.float64)


def slopes(model: ClothModel) -> np.ndarray:
    """Minus the change of all forces with every coordinate, by central differences, shape [3 V, 3 V]."""
    points = model.points()
    columns = []
    for coordinate in range(points.size):
        sides = []
        for way in (STEP, -STEP):
            moved = points.ravel().copy()
            moved[coordinate] += way
            model.set_points(moved.reshape(-1, 3))
            sides.append(cloth_forces(model)[:, :3].ravel())
        columns.append((sides[1] - sides[0]) / (2.0 * STEP))
    model.set_points(points)
    return np.stack(columns, axis=1)


def bare_rest(
    points: Points, *, edges: list[list[int]], length: list[float], pull: float, weight: float, c: float = 0.1
) -> RestShape:
    """Edges without triangles: what a hand calculation has."""
    none = np.zeros((0, 4), dtype=np.int32)
    topology = Topology(np.array(edges, dtype=np.int32), none[:, :3], none[:, 0], none[:, :2], none)
    constants = np.full(len(edges), pull)
    return RestShape(
        topology, np.array(length), constants, c * constants, np.zeros(0), np.full(len(points), weight), 0.0
    )


def without(rest: RestShape, *, tension: bool = False, bending: bool = False) -> RestShape:
    """The rest shape with a term's constants at zero."""
    if tension:
        rest = replace(rest, edge_pull=0.0 * rest.edge_pull, edge_push=0.0 * rest.edge_push)
    return replace(rest, hinge_stiffness=0.0 * rest.hinge_stiffness) if bending else rest
