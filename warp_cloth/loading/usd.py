"""USD reader: one or more meshes of a stage, in stage space, in its unit, y up."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import quiet_usd, usd_sentence
from warp_cloth.loading.decimals import float32_doubt
from warp_cloth.loading.raw import EXPORT_AGAIN, POSED, Floats, Ints, RawMesh, Role, joined
from warp_cloth.loading.usd_folds import stated_folds
from warp_cloth.loading.usd_physics import mass_notes, rest_corners
from warp_cloth.loading.usd_units import (
    lost_references,
    meshes_of,
    metres_per_unit,
    standing_time,
    to_stage,
    why_missing,
)

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

PROBE_MEMORY = 4 * 2**30  # bytes that USD may use on top of what the file's size explains
PROBE_SECONDS = 120
DAMAGED = "the file is damaged: export it again"
_UV_NAMES = ("uv", "st", "map1", "texcoord")  # how primvars start that some exporters write as plain pairs
_LISTED = 6  # prim paths in a message
_REST = "unassigned"  # panel of the faces that no subset names


def read_usd(file: str, *, role: Role, key: str, prim: str | None) -> RawMesh:
    """The meshes at or below ``prim``, joined, or those of the stage: of a garment, its only one."""
    with opened_stage(file) as stage:
        return _read(stage, file, role, key, prim, None)


def read_usd_samples(file: str, *, key: str, prim: str | None) -> list[RawMesh]:
    """An avatar at each of its time samples, in order.

    Raises:
        InputError: it has none.
    """
    with opened_stage(file) as stage:
        times = _sample_times(stage, _mesh_paths(stage, prim, file, key))
        if not times:
            raise InputError(file, "the avatar has no time samples", "export its animation")
        return [_read(stage, file, "avatar", key, prim, time) for time in times]


def mesh_paths_of(file: str, prim: str | None = None, key: str = "") -> list[str]:
    """Paths of the meshes at or below ``prim``, or of all that the stage shows; of a file that was read before."""
    with opened_stage(file, known=True) as stage:
        return _mesh_paths(stage, prim, file, key)


@contextmanager
def opened_stage(file: str, *, known: bool = False) -> Iterator[Usd.Stage]:
    """The stage of a file; USD's errors become InputError. ``known``: the file was read before."""
    from pxr import Usd

    if not known:
        _refuse_unreadable(file)
    try:
        with quiet_usd():
            stage = Usd.Stage.Open(file)
            if stage is None:
                raise ValueError("USD cannot open it")
            yield stage
    except InputError:
        raise
    except Exception as error:  # USD raises its own kinds for whatever is wrong with a file
        problem = f"cannot be read as USD: {_reason(error)}"
        raise InputError(file, problem, DAMAGED) from error


def _read(stage: Usd.Stage, file: str, role: Role, key: str, prim: str | None, time: float | None) -> RawMesh:
    """The selected meshes, at time if it is not None."""
    from pxr import UsdGeom

    paths = _mesh_paths(stage, prim, file, key)
    if len(paths) > 1 and role == "garment" and prim is None:
        remedy = f'set {key}.prim = "PATH", of one mesh or of a prim with all meshes of the garment'
        raise InputError(file, f"holds {len(paths)} meshes: {_listed(paths)}", remedy)
    scale = metres_per_unit(stage, file)
    z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    parts = [_part(file, stage, path, scale, z_up, panels=role == "garment", at=time) for path in paths]
    found, lost = joined(parts, file, paths), lost_references(stage)
    return replace(found, notes=(*found.notes, lost)) if lost else found


def _sample_times(stage: Usd.Stage, paths: list[str]) -> list[float]:
    """Times at which a mesh, or an ancestor of it, has a sample of its own."""
    from pxr import UsdGeom

    times: set[float] = set()
    for path in paths:
        prim = stage.GetPrimAtPath(path)
        times.update(UsdGeom.Mesh(prim).GetPointsAttr().GetTimeSamples())
        while prim and not prim.IsPseudoRoot():
            times.update(UsdGeom.Xformable(prim).GetTimeSamples() if prim.IsA(UsdGeom.Xformable) else ())
            prim = prim.GetParent()
    return sorted(times)


def _refuse_unreadable(file: str) -> None:
    """Refuse a file that USD cannot read in a process of its own: it might take this one down."""
    if not Path(file).stat().st_size:
        raise InputError(file, "the file is empty", "export it again")
    limit = PROBE_MEMORY + 16 * Path(file).stat().st_size
    # One thread: each would reserve memory of its own.
    environment = {**os.environ, "PXR_WORK_THREAD_LIMIT": "1", "MALLOC_ARENA_MAX": "1"}
    command = [sys.executable, str(Path(__file__).with_name("usd_probe.py")), file, str(limit)]
    try:
        done = subprocess.run(command, capture_output=True, env=environment, timeout=PROBE_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(file, f"USD does not finish reading it within {PROBE_SECONDS} s", DAMAGED) from None
    except OSError:  # no interpreter to start, as in some embedding programs
        return
    if done.returncode:
        said = usd_sentence(done.stdout.decode("utf-8", errors="replace"))
        raise InputError(file, f"cannot be read as USD: {said or 'USD crashes'}", DAMAGED)


def _reason(error: Exception) -> str:
    try:
        return usd_sentence(str(error)) or type(error).__name__
    except UnicodeDecodeError as quoted:  # USD quotes the file's bytes
        return usd_sentence(quoted.object.decode("utf-8", errors="replace"))


def _listed(paths: list[str]) -> str:
    more = f" and {len(paths) - _LISTED} more" if len(paths) > _LISTED else ""
    return ", ".join(paths[:_LISTED]) + more


def _mesh_paths(stage: Usd.Stage, prim: str | None, file: str, key: str) -> list[str]:
    """Paths of the meshes to read, instances too; guides, proxies and hidden ones only for want of others."""
    from pxr import Sdf, UsdGeom

    everything = found = meshes_of(stage)
    if prim is not None:
        valid = prim.startswith("/") and Sdf.Path.IsValidPathString(prim)
        root = stage.GetPrimAtPath(prim) if valid else None
        found = [mesh for mesh in everything if mesh.GetPath().HasPrefix(root.GetPath())] if root else []
        if not found:
            problem = f"there is no mesh at {prim}" if root else f"there is no prim {prim}"
            known = _listed([str(p.GetPath()) for p in everything])
            reason, _ = why_missing(stage)
            problem += f" ({reason})" if reason else ""
            raise InputError(file, problem, f"{key}.prim may be {known}" if known else "the stage has no mesh")
    if not found:
        reason, remedy = why_missing(stage)
        problem = f"the stage has no mesh: {reason}" if reason else "the stage has no mesh"
        raise InputError(file, problem, remedy or "export the surface as a polygon mesh")
    shown = [p for p in found if _is_shown(UsdGeom.Imageable(p))]
    return [str(p.GetPath()) for p in (shown or found)]


def _is_shown(prim: UsdGeom.Imageable) -> bool:
    from pxr import UsdGeom

    hidden = prim.ComputeVisibility() == UsdGeom.Tokens.invisible
    return not hidden and prim.ComputePurpose() not in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)


def _part(
    file: str, stage: Usd.Stage, path: str, scale: float | None, z_up: bool, *, panels: bool, at: float | None
) -> RawMesh:
    """One mesh in stage space, y up, at a time; None: its default shape, or its first time sample."""
    from pxr import Usd, UsdGeom

    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(path))
    place = f"{file} {path}" + ("" if at is None else f" at time {at:g}")
    time = standing_time(mesh.GetPrim()) if at is None else Usd.TimeCode(at)
    matrix = to_stage(mesh, time, place)
    points = _array(mesh.GetPointsAttr().Get(time), np.float64).reshape(-1, 3)
    with np.errstate(all="ignore"):  # what is not finite is refused later
        doubt = float32_doubt(points) @ np.abs(matrix[:3, :3])
        points = points @ matrix[:3, :3] + matrix[3, :3]
        if z_up:
            points, doubt = points[:, [0, 2, 1]] * [1.0, 1.0, -1.0], doubt[:, [0, 2, 1]]
    counts = _array(_at(mesh.GetFaceVertexCountsAttr(), time), np.int64)
    corners = _array(_at(mesh.GetFaceVertexIndicesAttr(), time), np.int64)
    if (counts < 0).any() or counts.sum() != len(corners):
        problem = f"faceVertexCounts add up to {counts.sum():,}, but there are {len(corners):,} faceVertexIndices"
        raise InputError(place, problem, EXPORT_AGAIN)
    texcoords = _texcoords(mesh, time, corners, len(points))
    panel, names = panels_of(mesh, len(counts)) if panels else (None, ())
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    reverse = mirrored != (mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded)
    rest = rest_corners(mesh, counts, corners, matrix, place) if panels else None
    folds = stated_folds(mesh.GetPrim(), len(counts), place) if panels else None
    order = _order(counts, reverse, _array(mesh.GetHoleIndicesAttr().Get(time), np.int64))
    masses = mass_notes(mesh.GetPrim(), len(points), place) if panels else ()
    notes = (*order[2], *_subdivision(mesh), *_skinning(mesh.GetPrim()), *masses)
    return RawMesh(
        file=place,
        points=points,
        counts=counts[order[0]],
        corners=corners[order[1]],
        texcoords=None if texcoords is None else texcoords[order[1]],
        panels=None if panel is None else panel[order[0]],
        panel_names=names,
        metres_per_unit=scale,
        notes=notes,
        rest=None if rest is None else rest[order[1]],
        folds=None if folds is None else folds.among(order[0], len(counts)),
        doubt=doubt,
    )


def _array(value: Any, dtype: type) -> Any:
    """A copy of a USD array: its own may be a view of the file."""
    return np.array(value if value is not None else [], dtype=dtype)


def _at(attribute: Any, time: Usd.TimeCode) -> Any:
    """The value of an attribute or primvar at a time; its first where it has none then."""
    from pxr import Usd

    value = attribute.Get(time)
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def _order(counts: Ints, reverse: bool, holes: Ints) -> tuple[Ints, Ints, tuple[str, ...]]:
    """Faces and corners to keep, in order: without hole faces; ``reverse``: each face reversed."""
    owner = np.repeat(np.arange(len(counts)), counts)
    corner = np.arange(len(owner))
    if reverse:
        starts = np.cumsum(counts) - counts
        corner = (2 * starts + counts - 1)[owner] - corner
    solid = ~np.isin(np.arange(len(counts)), holes)
    notes = () if solid.all() else (f"{(~solid).sum():,} faces marked as holes dropped",)
    return np.flatnonzero(solid), corner[solid[owner]], notes


def _subdivision(mesh: UsdGeom.Mesh) -> tuple[str, ...]:
    """A note where the stage would show a smoother surface; the fallback, which many exporters leave, says nothing."""
    scheme = mesh.GetSubdivisionSchemeAttr()
    if not scheme.HasAuthoredValue() or scheme.Get() == "none":
        return ()
    return (f"subdivision ({scheme.Get()}) is not applied: the mesh is used as stored",)


def _skinning(prim: Usd.Prim) -> tuple[str, ...]:
    """A note where a skeleton or blend shapes would move the mesh."""
    moved = any(prim.HasAttribute(name) for name in ("primvars:skel:jointIndices", "skel:blendShapes"))
    return (POSED,) if moved else ()


def _texcoords(mesh: UsdGeom.Mesh, time: Usd.TimeCode, corners: Ints, vertex_count: int) -> Floats | None:
    """``st``, or else the first primvar whose type or name says texture coordinates, at every corner."""
    from pxr import Sdf, Usd, UsdGeom

    api = UsdGeom.PrimvarsAPI(mesh.GetPrim())
    kinds = (
        Sdf.ValueTypeNames.TexCoord2fArray,
        Sdf.ValueTypeNames.TexCoord2dArray,
        Sdf.ValueTypeNames.TexCoord2hArray,
    )
    every = api.FindPrimvarsWithInheritance()
    primvars = [api.FindPrimvarWithInheritance("st")]
    primvars += [primvar for primvar in every if primvar.GetTypeName() in kinds]
    primvars += [primvar for primvar in every if primvar.GetPrimvarName().lower().startswith(_UV_NAMES)]
    for primvar in primvars:
        if not primvar or not primvar.HasValue():
            continue
        known = time if primvar.Get(time) is not None else Usd.TimeCode.EarliestTime()
        values = _array(primvar.ComputeFlattened(known), np.float64)
        if values.ndim != 2 or values.shape[1] not in (2, 3):
            continue
        values = values[:, :2]
        if primvar.GetInterpolation() == UsdGeom.Tokens.faceVarying and len(values) == len(corners):
            found: Floats = values
            return found
        per_vertex = primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
        if per_vertex and len(values) == vertex_count and ((corners >= 0) & (corners < vertex_count)).all():
            return values[corners]
    return None


def panels_of(mesh: UsdGeom.Mesh, face_count: int) -> tuple[Ints | None, tuple[str, ...]]:
    """Panel of each face, one for each subset of faces."""
    from pxr import UsdGeom

    subsets = [s for s in UsdGeom.Subset.GetAllGeomSubsets(mesh) if s.GetElementTypeAttr().Get() == UsdGeom.Tokens.face]
    if not subsets:
        return None, ()
    panels = np.full(face_count, len(subsets), dtype=np.int64)
    for number, subset in enumerate(subsets):
        faces = _array(subset.GetIndicesAttr().Get(), np.int64)
        panels[faces[(faces >= 0) & (faces < face_count)]] = number
    names = [s.GetPrim().GetName() for s in subsets]
    return panels, tuple(names + [_REST] * bool((panels == len(subsets)).any()))
