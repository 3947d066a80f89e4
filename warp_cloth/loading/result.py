"""Reads back what a fit has written: worn garments with their maps, the avatar, the report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.errors import InputError
from warp_cloth.maps.kinds import MAPS
from warp_cloth.mesh import Mesh
from warp_cloth.result import WornGarment

FIT_AGAIN = "name the .usdc file, or the --out folder, of `warp-cloth fit ... --maps all`"
SUFFIXES = (".usdc", ".usda", ".usd", ".usdz")


@dataclass(frozen=True, eq=False)
class WrittenFit:
    """A fit as its files tell it."""

    name: str
    garments: tuple[WornGarment, ...]
    avatar: Mesh | None
    report: dict[str, Any]  # empty where there is no report.json


def read_fit(place: Path) -> WrittenFit:
    """The fit of a stage, or of the folder that holds one; a garment is a mesh that has maps."""
    place = Path(place).absolute()
    path = _stage_file(place)
    from pxr import Tf, Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(path, "cannot be read as USD", FIT_AGAIN) from error
    garments, bodies = [], []
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        name = prim.GetParent().GetDisplayName() or prim.GetParent().GetName()
        surface = Mesh(
            name,
            np.array(mesh.GetPointsAttr().Get(), dtype=np.float64).reshape(-1, 3),
            np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int32).reshape(-1, 3),
        )
        fields = _fields(mesh)
        if fields:
            garments.append(WornGarment(name, surface, surface.points, thickness=0.0, fields=fields))
        else:
            bodies.append(surface)
    if not garments:
        raise InputError(path, "holds no fit maps", FIT_AGAIN)
    return WrittenFit(place.name, tuple(garments), bodies[0] if bodies else None, _report(path.parent / "report.json"))


def _stage_file(place: Path) -> Path:
    if place.is_dir():
        stages = sorted(path for path in place.iterdir() if path.suffix in SUFFIXES)
        if len(stages) != 1:
            raise InputError(place, f"holds {len(stages)} stages", FIT_AGAIN)
        return stages[0]
    if not place.is_file() or place.suffix not in SUFFIXES:
        raise InputError(place, "is no stage", FIT_AGAIN)
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
