"""Reads a saved fit: worn garments with their maps, the avatar, the report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base import mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.trims import TRIMS
from warp_cloth.loading.load import load_mesh
from warp_cloth.loading.usd import panels_of
from warp_cloth.maps.kinds import MAPS
from warp_cloth.model.result import WornGarment

REMEDY = "give the .usdc file, or the --out folder, of `warp-cloth fit ... --maps all`"
OVER = "_over"  # suffix of the name of a layer over the user's own stage


@dataclass(frozen=True, eq=False)
class WrittenFit:
    """A fit as read from its files."""

    name: str
    garments: tuple[WornGarment, ...]  # none where they have no maps
    avatar: Mesh | None
    report: dict[str, Any]  # empty where there is no report.json
    place: Path = Path()  # the folder or file that was given


def read_fit(place: Path) -> WrittenFit:
    """The fit in a stage, or in the folder of one; meshes with maps are garments, the others the avatar.

    Raises:
        InputError: there is no such fit, or neither maps nor a report with girths.
    """
    place = Path(place).absolute()
    path = _stage_file(place)
    from pxr import Tf, Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(path, "cannot be read as USD", REMEDY) from error
    garments, bodies = [], []
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        is_trims = prim.GetName() == f"{prim.GetParent().GetName()}_{TRIMS}"
        if is_trims or mesh.ComputePurpose() == UsdGeom.Tokens.guide:  # panels laid flat
            continue
        fields = _fields(mesh)
        if not fields:
            bodies.append(str(prim.GetPath()))
            continue
        name = prim.GetParent().GetDisplayName() or prim.GetParent().GetName()
        points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64).reshape(-1, 3)
        triangles = np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int32).reshape(-1, 3)
        panels, panel_names = panels_of(mesh, len(triangles))
        parts = None if panels is None else panels.astype(np.int32)
        surface = Mesh(name, points, triangles, panels=parts, panel_names=panel_names)
        garments.append(WornGarment(name, surface, surface.points, thickness=0.0, fields=fields))
    report = _report(path.parent / "report.json")
    if not garments and not report.get("girths_mm"):
        raise InputError(path, "has no fit maps", REMEDY)
    return WrittenFit(place.name, tuple(garments), _avatar(path, bodies) if garments else None, report, place)


def _avatar(path: Path, prims: list[str]) -> Mesh | None:
    """The other meshes of the stage, joined in place; they may be the user's own."""
    if not prims:
        return None
    parts = [load_mesh(path, role="avatar", key="avatar", prim=prim) for prim in prims]
    first = np.cumsum([0, *(part.vertex_count for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, first[:-1], strict=True)]
    points = np.concatenate([part.points for part in parts])
    return Mesh("avatar", points, np.concatenate(triangles).astype(np.int32))


def _stage_file(place: Path) -> Path:
    if place.is_dir():
        files = list(place.iterdir())
        stages = [path for suffix in mesh_formats.USD for path in sorted(files) if path.suffix == suffix]
        names = {path.stem for path in stages}
        names -= {f"{name}{OVER}" for name in names}  # layers over the user's stage
        if len(names) != 1:
            raise InputError(place, f"holds {len(names) or 'no'} stages", REMEDY)
        return next(path for path in stages if path.stem in names)
    if not place.exists():
        raise InputError(place, "no such file or folder", REMEDY)
    if not place.is_file() or place.suffix not in mesh_formats.USD:
        raise InputError(place, "is not a USD stage", REMEDY)
    return place


def _fields(mesh: Any) -> dict[str, Any]:
    from pxr import UsdGeom

    api = UsdGeom.PrimvarsAPI(mesh.GetPrim())
    found = {name: api.GetPrimvar(name) for name in MAPS}
    return {name: np.array(primvar.Get(), dtype=np.float32) for name, primvar in found.items() if primvar.HasValue()}


def _report(path: Path) -> dict[str, Any]:
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return report if isinstance(report, dict) else {}
