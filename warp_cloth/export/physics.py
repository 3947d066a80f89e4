"""A garment's cloth in the surface-deformable physics schema of USD, for other simulators.

The schema is not registered with OpenUSD yet, so its API names and attributes are authored by hand.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from warp_cloth.garment.rest import RestShape
from warp_cloth.loading.usd_physics import COLLISION, OWN, SURFACE
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.material.linearised import linear_constants
from warp_cloth.model.result import WornGarment

BODY = "PhysicsDeformableBodyAPI"
MATERIAL = "PhysicsSurfaceDeformableMaterialAPI"


def author_physics(surface: UsdGeom.Mesh, garment: WornGarment, material: UsdShade.Material) -> None:
    """Rest shape, thickness and masses on the mesh, density and stiffness on its material; in SI units."""
    if garment.fabric is None or garment.rest is None:
        return
    prim = surface.GetPrim()
    for schema in (BODY, SURFACE, COLLISION):
        prim.AddAppliedSchema(schema)
    points, triangles = rest_arrays(garment, garment.rest)
    _set(prim, "physics:restShapePoints", Sdf.ValueTypeNames.Point3fArray, Vt.Vec3fArray.FromNumpy(points))
    indices = Vt.Vec3iArray.FromNumpy(triangles)
    _set(prim, "physics:restTriVertexIndices", Sdf.ValueTypeNames.Int3Array, indices)
    _set(prim, "physics:restBendAnglesDefault", Sdf.ValueTypeNames.Token, "flat")
    _author_folds(prim, garment.rest)
    thickness = Vt.FloatArray([garment.fabric.thickness])
    _set(prim, "physics:thicknesses", Sdf.ValueTypeNames.FloatArray, thickness)
    _set(prim, "physics:thicknesses:elementType", Sdf.ValueTypeNames.Token, "constant")
    masses = np.ascontiguousarray(garment.rest.vertex_weight / GRAVITY, dtype=np.float32)
    _set(prim, "physics:masses", Sdf.ValueTypeNames.FloatArray, Vt.FloatArray.FromNumpy(masses))
    author_cloth_material(material, garment.fabric)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")


def rest_arrays(garment: WornGarment, rest: RestShape) -> tuple[Any, Any]:
    """Rest points [m] and triangles: each triangle laid flat on its own, x weft and y warp; or the mesh as loaded.

    Separate triangles have the rest lengths that the fit used, also at seams, where panels may differ.
    """
    sheet = rest.sheet
    if sheet is None or not sheet.directed:
        return (
            np.ascontiguousarray(garment.mesh.points, dtype=np.float32),
            np.ascontiguousarray(garment.mesh.triangles, dtype=np.int32),
        )
    flat = sheet.flat - sheet.flat.mean(axis=1, keepdims=True)
    points = np.zeros((3 * len(flat), 3), dtype=np.float32)
    points[:, :2] = flat.reshape(-1, 2)
    return points, np.arange(len(points), dtype=np.int32).reshape(-1, 3)


def _author_folds(prim: Usd.Prim, rest: RestShape) -> None:
    """Rest angles [degrees] by pairs of faces, where cloth is not flat at rest."""
    if rest.hinge_angle is None:
        return
    bent = np.flatnonzero(rest.hinge_angle)
    pairs = np.ascontiguousarray(rest.topology.hinge_triangles[bent], dtype=np.int32)
    angles = np.degrees(rest.hinge_angle[bent]).astype(np.float32)
    _set(prim, "physics:restAdjTriPairs", Sdf.ValueTypeNames.Int2Array, Vt.Vec2iArray.FromNumpy(pairs))
    _set(prim, "physics:restBendAngles", Sdf.ValueTypeNames.FloatArray, Vt.FloatArray.FromNumpy(angles))


def author_cloth_material(material: UsdShade.Material, fabric: Fabric) -> None:
    """The fabric as the schema's linear constants, together with its own values."""
    prim = material.GetPrim()
    UsdPhysics.MaterialAPI.Apply(prim)
    prim.AddAppliedSchema(MATERIAL)
    for name, value in linear_constants(fabric).items():
        _set(prim, f"physics:{name}", Sdf.ValueTypeNames.Float, value)
    for field in fields(fabric):
        value = getattr(fabric, field.name)
        if value is not None:
            kind = Sdf.ValueTypeNames.String if isinstance(value, str) else Sdf.ValueTypeNames.Double
            _set(prim, OWN + field.name, kind, value)


def author_collider(surface: UsdGeom.Mesh) -> None:
    """Makes the avatar a collider."""
    UsdPhysics.CollisionAPI.Apply(surface.GetPrim())
    UsdPhysics.MeshCollisionAPI.Apply(surface.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.none)


def _set(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: Any) -> None:
    prim.CreateAttribute(name, kind, False).Set(value)
