"""Users' stages for the tests: a cloth over a ball, in any unit and up axis, with what real stages have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from cloths import grid
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from warp_cloth.shapes import sphere

SIDE, COUNT, RADIUS = 0.5, 13, 0.15


def local(points: np.ndarray, metres: float, z_up: bool) -> Vt.Vec3fArray:
    """Points [m], y up, as a stage of that unit and axis has them."""
    turned = points[:, [0, 2, 1]] * (1.0, -1.0, 1.0) if z_up else points
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(turned / metres, dtype=np.float32))


def add_mesh(stage: Usd.Stage, path: str, points: Vt.Vec3fArray, triangles: np.ndarray) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(triangles), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel().astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    return mesh


def cloth_points() -> np.ndarray:
    """A level square above the ball [m]."""
    flat = grid(COUNT, SIDE).points
    return np.stack([flat[:, 0] - SIDE / 2, np.full(len(flat), 2 * RADIUS + 0.31), flat[:, 1] - SIDE / 2], axis=1)


def write_users_stage(
    folder: Path, *, metres: float = 1.0, z_up: bool = False, physics: bool = True, name: str = "user.usda"
) -> Path:
    """/World/wardrobe/cloth: placed by its parents; /World/ball: by reference, with a variant that sets its look."""
    ball = Usd.Stage.CreateNew(str(folder / "ball.usda"))
    UsdGeom.SetStageMetersPerUnit(ball, metres)
    UsdGeom.SetStageUpAxis(ball, UsdGeom.Tokens.z if z_up else UsdGeom.Tokens.y)
    body = sphere(radius=RADIUS, centre=(0.0, RADIUS + 0.3, 0.0), edge=0.02)
    ball.SetDefaultPrim(UsdGeom.Xform.Define(ball, "/ball").GetPrim())
    add_mesh(ball, "/ball/skin", local(body.points, metres, z_up), body.triangles)
    ball.Save()

    stage = Usd.Stage.CreateNew(str(folder / name))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if z_up else UsdGeom.Tokens.y)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    outfit = UsdGeom.Xform.Define(stage, "/World/wardrobe")
    lift = np.array([0.0, 0.0, 0.1]) if z_up else np.array([0.0, 0.1, 0.0])
    outfit.AddTranslateOp().Set(Gf.Vec3d(*(lift / metres).tolist()))
    outfit.AddScaleOp().Set(Gf.Vec3f(2.0))
    down = (cloth_points() - (0.0, 0.1, 0.0)) / 2.0
    cloth = add_mesh(stage, "/World/wardrobe/cloth", local(down, metres, z_up), grid(COUNT, SIDE).triangles)
    normals = UsdGeom.PrimvarsAPI(cloth).CreatePrimvar(
        "normals", Sdf.ValueTypeNames.Normal3fArray, UsdGeom.Tokens.constant
    )
    normals.Set(Vt.Vec3fArray([Gf.Vec3f(0, 1, 0)]))
    prim = UsdGeom.Xform.Define(stage, "/World/ball").GetPrim()
    prim.GetReferences().AddReference("./ball.usda")
    looks = prim.GetVariantSets().AddVariantSet("look")
    for look, colour in (("grey", 0.5), ("white", 1.0)):
        looks.AddVariant(look)
        looks.SetVariantSelection(look)
        with looks.GetVariantEditContext():
            over = UsdGeom.Mesh(stage.OverridePrim("/World/ball/skin"))
            over.CreateDisplayColorPrimvar().Set(Vt.Vec3fArray([Gf.Vec3f(colour)]))
    if physics:
        add_physics(stage, cloth, metres, z_up)
    stage.Save()
    return folder / name


def add_physics(stage: Usd.Stage, cloth: UsdGeom.Mesh, metres: float, z_up: bool) -> None:
    """A rest shape 2 % smaller than the mesh, thickness, density and stiffness in the stage's units."""
    prim = cloth.GetPrim()
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    for schema in ("PhysicsDeformableBodyAPI", "PhysicsSurfaceDeformableSimAPI", "PhysicsCollisionAPI"):
        prim.AddAppliedSchema(schema)
    rest = local(0.98 * cloth_points() / 2.0, metres, z_up)
    prim.CreateAttribute("physics:restShapePoints", Sdf.ValueTypeNames.Point3fArray, False).Set(rest)
    prim.CreateAttribute("physics:thicknesses", Sdf.ValueTypeNames.FloatArray, False).Set([0.0006 / metres])
    material = UsdShade.Material.Define(stage, "/World/linen")
    UsdPhysics.MaterialAPI.Apply(material.GetPrim()).CreateDensityAttr(300.0 * metres**3)
    material.GetPrim().AddAppliedSchema("PhysicsSurfaceDeformableMaterialAPI")
    constants = {"surfaceStretchStiffness": 800.0, "surfaceBendStiffness": 4e-6 / metres**2}
    for name, value in constants.items():
        material.GetPrim().CreateAttribute(f"physics:{name}", Sdf.ValueTypeNames.Float, False).Set(value)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
