"""What a stage says of cloth by the surface-deformable physics schema: rest shape, thickness, density, stiffness."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_cloth.errors import InputError
from warp_cloth.fabric import BOUNDS, Fabric
from warp_cloth.laboratory import EDGES
from warp_cloth.linearised import fabric_table
from warp_cloth.loading.decimals import half_step
from warp_cloth.loading.raw import EXPORT_AGAIN, Floats, Ints

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

SURFACE = "PhysicsSurfaceDeformableSimAPI"
COLLISION = "PhysicsCollisionAPI"
OWN = "warpCloth:"  # namespace of what the schema cannot hold: warp and weft, the paper's quadratic law
CONSTANTS = (
    "density",
    "youngsModulus",
    "poissonsRatio",
    "surfaceStretchStiffness",
    "surfaceShearStiffness",
    "surfaceBendStiffness",
)


@dataclass(frozen=True)
class StagedCloth:
    """A garment prim as a scene takes it."""

    path: str
    name: str
    has_rest: bool
    fabric: dict[str, Any]  # a scene's fabric table


def applied(prim: Usd.Prim) -> set[str]:
    """Names of the API schemas that a prim states, registered or not."""
    listed = prim.GetMetadata("apiSchemas")
    stated = set(listed.GetAppliedItems()) if listed is not None else set()
    return stated | set(prim.GetAppliedSchemas())


def value_of(prim: Usd.Prim, name: str) -> Any:
    """An attribute's default or first value; None where it has none."""
    from pxr import Usd

    attribute = prim.GetAttribute(name)
    if not attribute:
        return None
    value = attribute.Get()
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def rest_corners(mesh: UsdGeom.Mesh, counts: Ints, corners: Ints, matrix: Floats, place: str) -> Floats | None:
    """Rest position of every corner in stage units, scaled as the mesh is; None where none is stated.

    Only lengths count, and x and y of a flat rest shape are weft and warp: what merely turns it is left out.
    """
    prim = mesh.GetPrim()
    if SURFACE not in applied(prim):
        return None
    stated = value_of(prim, "physics:restShapePoints")
    if stated is None or not len(stated):
        return None
    linear = matrix[:3, :3]
    scale = float(np.cbrt(abs(np.linalg.det(linear))))
    even = np.allclose(linear @ linear.T, scale**2 * np.eye(3), rtol=0.0, atol=1e-6 * scale**2)
    points = np.array(stated, dtype=np.float64).reshape(-1, 3) @ (scale * np.eye(3) if even else linear)
    listed = value_of(prim, "physics:restTriVertexIndices")
    indices = corners if listed is None or not len(listed) else np.array(listed, dtype=np.int64).ravel()
    whole = len(indices) == len(corners) and ((indices >= 0) & (indices < len(points))).all()
    if not whole or (listed is not None and len(listed) and (counts != 3).any()):
        problem = "physics:restTriVertexIndices do not fit the mesh: one rest triangle for each of its triangles"
        raise InputError(place, problem, EXPORT_AGAIN)
    return points[indices]


def staged_cloths(stage: Usd.Stage) -> list[StagedCloth]:
    """The stage's meshes that are surface deformables, in its order, instances too."""
    from pxr import Usd, UsdGeom

    found = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh) and SURFACE in applied(prim):
            rest = value_of(prim, "physics:restShapePoints")
            name = prim.GetName().removesuffix("_mesh")
            has_rest = rest is not None and len(rest) > 0
            found.append(StagedCloth(str(prim.GetPath()), name, has_rest, fabric_of(stage, prim)))
    return found


def fabric_of(stage: Usd.Stage, prim: Usd.Prim) -> dict[str, Any]:
    """The fabric table of a cloth prim and the material bound to it for physics, in SI."""
    from pxr import UsdGeom, UsdPhysics, UsdShade

    metres = UsdGeom.GetStageMetersPerUnit(stage)
    kilograms = UsdPhysics.GetStageKilogramsPerUnit(stage)
    bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    material = bound.GetPrim() if bound else None
    if material is not None:
        own = _own_fabric(material)
        if own:
            return own
    units = {
        "density": kilograms / metres**3,
        "youngsModulus": kilograms / metres,
        "poissonsRatio": 1.0,
        "surfaceStretchStiffness": kilograms,
        "surfaceShearStiffness": kilograms,
        "surfaceBendStiffness": kilograms * metres**2,
    }
    constants = {}
    for name in CONSTANTS if material is not None else ():
        value = value_of(material, f"physics:{name}")
        if value is not None and np.isfinite(value) and value > 0.0:
            constants[name] = _stands_for(float(value), units[name])
    thickness = None
    listed = value_of(prim, "physics:thicknesses")
    if listed is not None and len(listed):
        thickness = _stands_for(float(np.mean(np.array(listed, dtype=np.float64))), metres)
    return fabric_table(constants, thickness, None)


def _stands_for(stored: float, unit: float) -> float:
    """A float32 of a stage in SI, by the shortest number of significant digits that it may stand for."""
    value = stored * unit
    doubt = float(half_step(np.array(stored))) * unit
    digits = next((d for d in range(1, 17) if abs(float(f"{value:.{d}g}") - value) <= doubt), 17)
    return float(f"{value:.{digits}g}")


def _own_fabric(material: Usd.Prim) -> dict[str, Any]:
    """The fabric that this project wrote beside the schema's constants."""
    table = {}
    for field in fields(Fabric):
        value = value_of(material, OWN + field.name)
        if value is not None:
            table[field.name] = str(value) if field.name not in BOUNDS else float(value)
    if not set(BOUNDS) - {"shear"} <= set(table):
        return {}
    return {"shear": EDGES, **table}


def collision_meshes(stage: Usd.Stage, cloths: list[StagedCloth]) -> list[str]:
    """Paths of the meshes that cloth meets: those with a collision schema, or else all others that are shown."""
    from pxr import Usd, UsdGeom

    taken = {cloth.path for cloth in cloths}
    others = [
        prim
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Mesh) and str(prim.GetPath()) not in taken
    ]
    colliders = [prim for prim in others if COLLISION in applied(prim)]
    return [str(prim.GetPath()) for prim in (colliders or others)]


def common_ancestor(paths: list[str], apart_from: list[str], place: Path) -> str:
    """The prim that holds all ``paths`` and none of ``apart_from``."""
    from pxr import Sdf

    if len(paths) == 1:
        return paths[0]
    common = Sdf.Path(paths[0])
    for path in paths[1:]:
        common = common.GetCommonPrefix(Sdf.Path(path))
    if common == Sdf.Path.absoluteRootPath or any(Sdf.Path(path).HasPrefix(common) for path in apart_from):
        problem = f"holds {len(paths)} meshes that may be the avatar: {', '.join(paths[:6])}"
        raise InputError(place, problem, "say which: --set avatar.prim=PATH")
    return str(common)
