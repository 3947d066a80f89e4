"""Reads back what a fit has written: worn garments with their maps, the avatar, the report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading.load import load_mesh
from warp_cloth.loading.usd import panels_of
from warp_cloth.maps.kinds import MAPS
from warp_cloth.model.result import WornGarment

FIT_AGAIN = "name the .usdc file, or the --out folder, of `warp-cloth fit ... --maps all`"
SUFFIXES = (".usdc", ".usda", ".usd", ".usdz")
OVER = "_over"  # what a layer over the user's own stage is called after the name


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
        fields = _fields(mesh)
        if not fields:
            bodies.append(str(prim.GetPath()))
            continue
        name = prim.GetParent().GetDisplayName() or prim.GetParent().GetName()
        points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64).reshape(-1, 3)
        triangles = np.array(mesh.GetFaceVertexIndicesAttr().Get(), dtype=np.int32).reshape(-1, 3)
        panels, called = panels_of(mesh, len(triangles))
        parts = None if panels is None else panels.astype(np.int32)
        surface = Mesh(name, points, triangles, panels=parts, panel_names=called)
        garments.append(WornGarment(name, surface, surface.points, thickness=0.0, fields=fields))
    if not garments:
        raise InputError(path, "holds no fit maps", FIT_AGAIN)
    return WrittenFit(place.name, tuple(garments), _avatar(path, bodies), _report(path.parent / "report.json"))


def _avatar(path: Path, prims: list[str]) -> Mesh | None:
    """The meshes that the garments are worn by, as one, where they stand; they may be the user's own."""
    if not prims:
        return None
    parts = [load_mesh(path, role="avatar", key="avatar", prim=prim) for prim in prims]
    first = np.cumsum([0, *(part.vertex_count for part in parts)])
    triangles = [part.triangles + start for part, start in zip(parts, first[:-1], strict=True)]
    points = np.concatenate([part.points for part in parts])
    return Mesh("avatar", points, np.concatenate(triangles).astype(np.int32))


def _stage_file(place: Path) -> Path:
    if place.is_dir():
        stages = sorted((path for path in place.iterdir() if path.suffix in SUFFIXES), key=_preferred)
        names = {path.stem for path in stages}
        names -= {f"{name}{OVER}" for name in names}  # layers over what the user gave
        if len(names) != 1:
            raise InputError(place, f"holds {len(names)} stages", FIT_AGAIN)
        return next(path for path in stages if path.stem in names)
    if not place.exists():
        raise InputError(place, "no such file or folder", FIT_AGAIN)
    if not place.is_file() or place.suffix not in SUFFIXES:
        raise InputError(place, "is no stage", FIT_AGAIN)
    return place


def _preferred(path: Path) -> int:
    """Rank of a format, where a fit was written in several."""
    return SUFFIXES.index(path.suffix)


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
