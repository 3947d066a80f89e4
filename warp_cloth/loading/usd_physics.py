"""The surface-deformable physics schema of USD: rest shape, thickness, density and stiffness of cloth."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.loading.decimals import half_step
from warp_cloth.loading.raw import EXPORT_AGAIN, Floats, Ints
from warp_cloth.loading.usd_units import kilograms_per_unit, meshes_of, metres_per_unit
from warp_cloth.material.fabric import BOUNDS, Fabric
from warp_cloth.material.laboratory import EDGES
from warp_cloth.material.linearised import fabric_table

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

SURFACE = "PhysicsSurfaceDeformableSimAPI"
COLLISION = "PhysicsCollisionAPI"
OWN = "warpCloth:"  # namespace of what the schema cannot hold: warp and weft, the paper's quadratic law
SAME_MASS = 1e-5  # relative: more than the rounding of a stage's float32 masses and lengths
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
    has_folds: bool
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

    Only lengths matter, and x and y of a flat rest shape are weft and warp: rotations are not applied.
    """
    from pxr import Usd

    prim = mesh.GetPrim()
    if SURFACE not in applied(prim):
        return None
    stated = value_of(prim, "physics:restShapePoints")
    if stated is None or not len(stated):
        return None
    linear = matrix[:3, :3]
    scale = float(np.cbrt(abs(np.linalg.det(linear))))
    even = np.allclose(linear @ linear.T, scale**2 * np.eye(3), rtol=0.0, atol=1e-6 * scale**2)
    stored = np.array(stated, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(stored).all():
        raise InputError(place, "physics:restShapePoints are not finite", "repair the rest shape in the modelling tool")
    points = stored @ (scale * np.eye(3) if even else linear)
    listed = value_of(prim, "physics:restTriVertexIndices")
    indices = corners if listed is None or not len(listed) else np.array(listed, dtype=np.int64).ravel()
    if indices is corners and len(points) != len(mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()) or []):
        problem = "physics:restShapePoints are not one per vertex, and physics:restTriVertexIndices are missing"
        raise InputError(place, problem, EXPORT_AGAIN)
    if indices is corners and ((corners < 0) | (corners >= len(points))).any():
        return None  # the mesh itself is refused
    whole = len(indices) == len(corners) and ((indices >= 0) & (indices < len(points))).all()
    if not whole or (listed is not None and len(listed) and (counts != 3).any()):
        problem = "physics:restTriVertexIndices do not match the mesh: one rest triangle for each triangle"
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
            folds = states_folds(prim)
            found.append(StagedCloth(str(prim.GetPath()), name, has_rest, folds, fabric_of(stage, prim)))
    return found


def states_folds(prim: Usd.Prim) -> bool:
    """Whether a cloth prim says that it is not flat at rest."""
    listed = value_of(prim, "physics:restBendAngles")
    return value_of(prim, "physics:restBendAnglesDefault") == "restShape" or (listed is not None and len(listed) > 0)


def fabric_of(stage: Usd.Stage, prim: Usd.Prim) -> dict[str, Any]:
    """The fabric table of a cloth prim and the material bound to it for physics, in SI."""
    from pxr import UsdGeom, UsdShade

    place = stage.GetRootLayer().realPath
    metres = metres_per_unit(stage, place) or UsdGeom.GetStageMetersPerUnit(stage)
    kilograms = kilograms_per_unit(stage, place)
    weight = _stated_weight(prim, kilograms, metres, f"{place} {prim.GetPath()}")
    bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
    material = bound.GetPrim() if bound else None
    if material is not None:
        own = _own_fabric(material)
        if own:
            same = weight is None or abs(weight - own["weight"]) <= SAME_MASS * own["weight"]
            return own if same else {**own, "weight": weight}
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
        if value is not None and not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{place} {bound.GetPath()}", f"physics:{name} is {value:g}", "set a positive value")
        if value:  # 0 means not stated
            constants[name] = _stands_for(float(value), units[name])
    thickness = None
    listed = value_of(prim, "physics:thicknesses")
    if listed is not None and len(listed):
        values = np.array(listed, dtype=np.float64)
        if not (np.isfinite(values) & (values >= 0.0)).all():
            raise InputError(
                f"{place} {prim.GetPath()}", "physics:thicknesses are not all 0 or more", "set a thickness"
            )
        thickness = _stands_for(float(values.mean()), metres)
    return fabric_table(constants, thickness, weight)


def stated_masses(prim: Usd.Prim, vertex_count: int, place: str) -> Floats | None:
    """Mass of every vertex of a cloth prim, in the stage's unit; None where it states none.

    Raises:
        InputError: they are not one positive number for each vertex.
    """
    listed = value_of(prim, "physics:masses") if SURFACE in applied(prim) else None
    if listed is None or not len(listed):
        return None
    masses = np.array(listed, dtype=np.float64)
    if masses.shape != (vertex_count,) or not (np.isfinite(masses) & (masses > 0.0)).all():
        raise InputError(place, "physics:masses are not one positive number per vertex", EXPORT_AGAIN)
    return masses


def mass_notes(prim: Usd.Prim, vertex_count: int, place: str) -> tuple[str, ...]:
    """A note where a stage's masses differ more than a mesh's own unevenness: all vertices weigh the same here."""
    masses = stated_masses(prim, vertex_count, place)
    if masses is None or np.ptp(masses) <= SAME_MASS * masses.max():
        return ()
    return ("physics:masses differ between vertices: their sum is distributed evenly, as all vertices weigh the same",)


def _stated_weight(prim: Usd.Prim, kilograms: float, metres: float, place: str) -> float | None:
    """Mass per rest area [kg/m2] by the prim's own masses; None where it states none."""
    from pxr import Usd, UsdGeom

    mesh = UsdGeom.Mesh(prim)
    time = Usd.TimeCode.EarliestTime()
    points = np.array(mesh.GetPointsAttr().Get(time) or [], dtype=np.float64).reshape(-1, 3)
    masses = stated_masses(prim, len(points), place)
    if masses is None:
        return None
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int64)
    if counts.sum() != len(corners) or (counts < 0).any() or ((corners < 0) | (corners >= len(points))).any():
        return None  # the mesh is refused when it is read
    matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim), dtype=np.float64)
    rest = rest_corners(mesh, counts, corners, matrix, place)
    placed = points[corners] @ matrix[:3, :3] if rest is None else rest
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    own = np.arange(len(corners))
    inner = (own - starts >= 1) & (own - starts < np.repeat(counts, counts) - 1)
    a, b, c = placed[starts[inner]], placed[own[inner]], placed[own[inner] + 1]
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) * metres**2
    return float(masses.sum()) * kilograms / area if area > 0.0 else None


def _stands_for(stored: float, unit: float) -> float:
    """A float32 of a stage in SI, by the shortest decimal that rounds to it."""
    value = stored * unit
    doubt = float(half_step(np.array(stored))) * unit
    digits = next((d for d in range(1, 17) if abs(float(f"{value:.{d}g}") - value) <= doubt), 17)
    return float(f"{value:.{digits}g}")


def _own_fabric(material: Usd.Prim) -> dict[str, Any]:
    """The fabric that warp_cloth wrote, in addition to the schema's constants."""
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
    taken = {cloth.path for cloth in cloths}
    others = [prim for prim in meshes_of(stage) if str(prim.GetPath()) not in taken]
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
        problem = f"has {len(paths)} meshes that may be the avatar: {', '.join(paths[:6])}"
        raise InputError(place, problem, "override avatar.prim=PATH")
    return str(common)
