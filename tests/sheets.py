"""Small sheets of cloth that may meet: how contact is tested on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from cloths import NO_PINS, grid

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.sheets import SheetKind
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.solver.relax import Relaxation

THICKNESS = 2e-3  # [m]; thick for the meshes' 20 mm edges, so that small sheets touch in many places
FABRIC = Fabric(thickness=THICKNESS, friction=0.4)


def sheets_at(
    meshes: Sequence[Mesh],
    *,
    pins: Sequence[np.ndarray] | None = None,
    fabric: Fabric = FABRIC,
    kinds: Sequence[SheetKind] | None = None,
    precision: str = "float64",
    gathers: bool | None = None,
) -> tuple[ClothModel, ClothContact, list[Garment]]:
    """Garments in contact, where they are; inner to outer."""
    held = pins or [NO_PINS] * len(meshes)
    garments = [
        Garment(mesh.points, mesh.triangles, build_rest_shape(mesh, fabric, rest="mesh"), pinned)
        for mesh, pinned in zip(meshes, held, strict=True)
    ]
    model = build_model(garments, device="cpu", precision=precision, gathers=gathers)
    chosen = kinds or [SheetKind(fabric.thickness, fabric.friction, layer=k) for k in range(len(meshes))]
    return model, ClothContact(model, garments, chosen), garments


def moved(mesh: Mesh, *offset: float) -> Mesh:
    return replace(mesh, points=mesh.points + np.array(offset))


def lying(mesh: Mesh) -> Mesh:
    """The sheet turned to lie, its front up."""
    x, y, z = mesh.points.T
    return replace(mesh, points=np.stack([x, z, -y], axis=1))


def crumpled(seed: int) -> Mesh:
    """A sheet folded over itself with a thickness between, shaken a little."""
    mesh = grid(12, 0.22)
    points = mesh.points.copy()
    over = points[:, 0] > 0.11
    points[over, 2] = 0.7 * THICKNESS
    points[over, 0] = 0.22 - points[over, 0] + 0.003
    points += np.random.default_rng(seed).normal(scale=0.1 * THICKNESS, size=points.shape)
    return replace(mesh, points=points)


def contact_state(model: ClothModel, relaxation: Relaxation | None) -> Any:
    """The state as contact numbers its vertices."""
    return model.state if relaxation is None else relaxation.contact_state()


def look(model: ClothModel, cloth_contact: ClothContact, relaxation: Relaxation | None = None) -> None:
    """Searches, with room for all that is found."""
    state = contact_state(model, relaxation)
    cloth_contact.awaken(state)
    cloth_contact.search(state)
    if cloth_contact.grow():
        cloth_contact.search(state)


def contact_forces(model: ClothModel, cloth_contact: ClothContact, relaxation: Relaxation | None = None) -> np.ndarray:
    """Contact's share of each vertex's load, shape [V, 4], as the certificate sums it."""
    types = cloth_types(model.precision)
    load = wp.zeros(model.vertex_count, dtype=types.vec4, device="cpu")
    cloth_contact.measure(contact_state(model, relaxation), types.Step(), load)
    return np.array(load.numpy(), dtype=np.float64)


def iterate(relaxation: Relaxation, count: int) -> Points:
    """Shape after some iterations, with room made for pairs where it is needed."""
    for _ in range(count // 20):
        relaxation.run(20)
        if relaxation.cloth_contact is not None and relaxation.cloth_contact.grow():
            relaxation.drop_graphs()
    return relaxation.model.points()
