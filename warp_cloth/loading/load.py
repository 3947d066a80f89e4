"""Loading a mesh file: a valid Mesh in metres, or one line that says why not."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Folds, Mesh
from warp_cloth.base.mesh_formats import GLTF, NAMED, OBJ, PLAIN, SUPPORTED, USD
from warp_cloth.base.topology import used_ids
from warp_cloth.base.units import BodyUp, LengthUnit
from warp_cloth.loading.decimals import half_step, shortest_decimals
from warp_cloth.loading.generic import read_gltf, read_stl
from warp_cloth.loading.obj import read_obj
from warp_cloth.loading.placement import AS_LOADED, Placement
from warp_cloth.loading.ply import read_ply
from warp_cloth.loading.raw import Floats, Ints, RawMesh, Role, check
from warp_cloth.loading.repair import Repaired, RestKey, repaired
from warp_cloth.loading.sizes import choose_unit, refuse_far
from warp_cloth.loading.usd import read_usd

_NAMED_READERS: dict[str, Callable[..., RawMesh]] = {  # of formats whose meshes have names: ``key`` and ``name``, too
    **dict.fromkeys(OBJ, read_obj),
    **dict.fromkeys(GLTF, read_gltf),
}
_READERS: dict[str, Callable[[str, bytes], RawMesh]] = {".ply": read_ply, ".stl": read_stl}  # of the others

REMOTE = {"http", "https", "ftp", "s3", "gs"}  # schemes of remote addresses

# A body lies if it is nearly longest along z (arms may be stretched out) and less than half as high.
LYING_LONG, LYING_LOW = 0.8, 0.5
# Which coordinates become x, y and z, and their signs, as an up axis becomes y: a turn, by as little as does it; who is
# upside down goes on facing the same way.
TURNS: dict[BodyUp, tuple[list[int], list[float]]] = {
    "y": ([0, 1, 2], [1.0, 1.0, 1.0]),
    "z": ([0, 2, 1], [1.0, 1.0, -1.0]),
    "-z": ([0, 2, 1], [1.0, -1.0, 1.0]),
    "x": ([1, 0, 2], [-1.0, 1.0, 1.0]),
    "-x": ([1, 0, 2], [1.0, -1.0, 1.0]),
    "-y": ([0, 1, 2], [-1.0, -1.0, 1.0]),
}
FLAT = 0.02  # thinner parts, relative to their extent, are a floor, not a body


def load_mesh(
    path: Path,
    *,
    role: Role,
    key: str,
    prim: str | None = None,
    units: LengthUnit | None = None,
    up: BodyUp | None = None,
    rest: RestKey = "mesh",
    placement: Placement = AS_LOADED,
    data: bytes | None = None,
) -> Mesh:
    """Mesh of a file in metres, y up, repaired where that is safe; its ``notes`` list guesses and repairs.

    Args:
        path: .obj, .ply, .stl, .glb, .gltf, .usd, .usda, .usdc or .usdz.
        role: "garment" or "avatar".
        key: the scene table that names the file ("garment", "garment[1]", "avatar"), for messages.
        prim: prim path in a USD file, name in a glTF file or an OBJ; None: the only mesh.
        units: length unit; None: as the file declares, or guessed.
        up: up axis of a format that does not state it; None: y.
        rest: with "uv" or "auto", triangles without area are kept if they have one in texture space.
        placement: where the scene puts it; sizes are judged, and units guessed, of the mesh so placed.
        data: the file's content, where it has been read.

    Raises:
        InputError: the file cannot be read or repaired.
    """
    try:
        raw = read_raw(Path(path), role=role, key=key, prim=prim, up=up, data=data)
        check(raw)
        used = raw.points[used_ids(raw.corners, len(raw.points))] if len(raw.corners) else raw.points
        declared = raw.metres_per_unit
        scale = placement.scale
        unit = choose_unit(
            used,
            file=raw.file,
            role=role,
            key=key,
            stated=units,
            declared=declared,
            scale=scale,
            texture_scale=raw.texture_scale,
        )
        metres = unit.metres * scale
        refuse_far(placement.moved(used * metres), raw.file)

        def mirrored() -> Floats:
            image = replace(raw, points=raw.points * [-1.0, 1.0, 1.0])
            return placement.moved(in_metres(image, metres))

        sound = repaired(raw, placement.moved(in_metres(raw, metres)), role=role, rest=rest, mirrored=mirrored)
    except (MemoryError, OverflowError) as error:
        problem = f"is too large to load ({type(error).__name__})"
        raise InputError(path, problem, "check the file, or reduce the mesh") from error
    same_vertices = np.array_equal(sound.vertex_map, np.arange(len(sound.points)))
    same_faces = np.array_equal(sound.faces, np.arange(len(raw.counts)))
    return Mesh(
        name=Path(path).stem,
        points=np.ascontiguousarray(sound.points),
        triangles=np.ascontiguousarray(sound.triangles, dtype=np.int32),
        texcoords=sound.texcoords,
        panels=None if raw.panels is None else raw.panels[sound.faces].astype(np.int32),
        panel_names=raw.panel_names,
        materials=None if raw.materials is None else raw.materials[sound.faces].astype(np.int32),
        material_names=raw.material_names,
        notes=(*raw.notes, *unit.notes, *sound.notes, *_doubts(raw, sound, role, up)),
        unit=unit.name,
        vertex_map=None if same_vertices else sound.vertex_map,
        triangle_source=None if same_faces else sound.faces,
        rest_corners=None if sound.rest is None else _rest_in_metres(sound.rest, metres),
        folds=None if raw.folds is None else _folds_of(raw.folds, sound, len(raw.counts)),
        **_trims_of(sound),
    )


def _trims_of(sound: Repaired) -> dict[str, Any]:
    """The fields of a mesh that hold its trims."""
    trims = sound.trims
    if trims is None:
        return {}
    triangles = np.ascontiguousarray(trims.triangles, dtype=np.int32)
    return {"trim_points": trims.points, "trim_triangles": triangles, "trim_map": trims.vertex_map}


def _doubts(raw: RawMesh, sound: Repaired, role: Role, up: BodyUp | None) -> list[str]:
    """Notes on what may be meant otherwise: the axis of a body, texture coordinates that are no panels."""
    notes = []
    if role == "avatar" and up is None and raw.axis_unknown and lies(sound.points, sound.triangles):
        notes.append(
            'lies along z: set avatar.up = "z" if it should stand (a fit stands a person up by itself), else "y"'
        )
    if raw.texcoords is not None and sound.texcoords is None:
        notes.append("texture coordinates ignored: some corners have none, or implausible ones")
    return notes


def lies(points: Floats, triangles: Ints) -> bool:
    """Whether a body lies along z, apart from a floor that it may stand on.

    ``points`` [m], shape [V, 3], are all used by ``triangles``, shape [F, 3].
    """
    if not _long_and_low(np.ptp(points, axis=0)):
        return False
    part = mesh_parts(len(points), triangles)
    _, number = np.unique(part, return_inverse=True)
    low, high = np.full((number.max() + 1, 3), np.inf), np.full((number.max() + 1, 3), -np.inf)
    np.minimum.at(low, number, points)
    np.maximum.at(high, number, points)
    extent = high - low
    thick = extent.min(axis=1) > FLAT * extent.max(axis=1)
    return not thick.any() or _long_and_low(high[thick].max(axis=0) - low[thick].min(axis=0))


def _long_and_low(extent: Floats) -> bool:
    across, height, along = extent
    return bool(along >= LYING_LONG * max(across, along) and height <= LYING_LOW * along)


def _folds_of(folds: Folds, sound: Repaired, face_count: int) -> Folds:
    """Rest angles after the repair: where faces were flipped, their sign changes."""
    turned = np.zeros(face_count, dtype=bool)
    if sound.turned is not None:
        turned[sound.faces] = sound.turned
    return replace(folds, angles=np.where(turned[folds.faces].all(axis=1), -folds.angles, folds.angles))


def in_metres(raw: RawMesh, metres: float) -> Floats:
    """The vertices in metres, shape [V, 3]; of binary files the shortest decimals within rounding."""
    if raw.doubt is None and metres == 1.0:
        return raw.points
    return shortest_decimals(raw.points * metres, 0.0 if raw.doubt is None else raw.doubt * metres)


def _rest_in_metres(rest: Floats, metres: float) -> Floats:
    return shortest_decimals(rest * metres, half_step(rest) * metres)


def read_raw(
    path: Path, *, role: Role, key: str, prim: str | None, up: BodyUp | None = None, data: bytes | None = None
) -> RawMesh:
    """Reads a file by its extension; ``up`` is the up axis of a format that does not state it.

    ``data`` is the file's content, where it has been read.

    Raises:
        InputError: the file cannot be read.
    """
    data = content(path) if data is None else data
    kind = path.suffix.lower()
    if up is not None and kind in SUPPORTED and kind not in PLAIN:
        raise InputError(path, f"{kind} files state their up axis, but {key}.up is given", f"remove {key}.up")
    if kind in USD:
        return read_usd(str(path), role=role, key=key, prim=prim)
    if kind not in SUPPORTED:
        problem = f"{path.suffix or 'a file without extension'!s} is not a supported mesh format"
        raise InputError(path, problem, f"use one of {', '.join(SUPPORTED)}")
    if prim is not None and kind not in NAMED:
        raise InputError(path, f"{key}.prim is given, but {kind} files have no prims", f"remove {key}.prim")
    try:
        with np.errstate(all="ignore"):  # non-finite values are refused later
            if kind in _NAMED_READERS:
                raw = _NAMED_READERS[kind](str(path), data, key=key, name=prim)
            else:
                raw = _READERS[kind](str(path), data)
            return _stood_up(raw, up) if kind in PLAIN else raw
    except (ValueError, ArithmeticError, LookupError, RecursionError) as error:
        reason = " ".join(str(error).split())[:120]
        problem = f"cannot be read as {kind[1:].upper()}: {reason} ({type(error).__name__})"
        raise InputError(path, problem, "the file is damaged: export it again") from error


def _stood_up(raw: RawMesh, up: BodyUp | None) -> RawMesh:
    raw = replace(raw, axis_unknown=True)
    if up is None or up == "y":
        return raw
    order, _ = TURNS[up]
    doubt = None if raw.doubt is None else raw.doubt[:, order]
    return replace(raw, points=with_y_up(raw.points, up), doubt=doubt)


def with_y_up(points: Floats, up: BodyUp = "z") -> Floats:
    """Points of a file whose ``up`` axis points up, with the y axis up; shape [V, 3]."""
    order, signs = TURNS[up]
    return points[:, order] * signs


def content(path: Path, what: str = "mesh") -> bytes:
    """All bytes of a file of a mesh, or of ``what`` it is.

    Raises:
        InputError: it is missing, unreadable or empty.
    """
    try:
        if path.is_dir():
            raise InputError(path, "is a folder", f"name a {what} file in it")
        if not path.exists():
            raise InputError(path, *_missing(path))
        if not path.is_file():
            raise InputError(path, "is not a regular file", f"name a {what} file")
        data = path.read_bytes()
    except InputError:
        raise
    except PermissionError:
        raise InputError(path, "cannot be read: permission denied", "change its permissions") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(path, f"cannot be opened: {reason}", "check the path") from None
    if not data:
        raise InputError(path, "the file is empty", f"export the {what} again")
    return data


def _missing(path: Path) -> tuple[str, str]:
    """Problem and remedy for a path without a file, with similar names."""
    if path.is_symlink():
        return "is a link to a file that does not exist", "correct the link"
    if REMOTE & {part.rstrip(":") for part in path.parts if part.endswith(":")}:
        return "is not a local file", "download it first"
    if "\\" in str(path) and Path(str(path).replace("\\", "/")).exists():
        return "no such file", f"write {str(path).replace(chr(92), '/')}, with /, which works on every system"
    if not path.parent.is_dir():
        return "no such file: its folder does not exist", "check the path; in a scene file it is relative to that file"
    names = [entry.name for entry in path.parent.iterdir() if entry.is_file()]
    close = difflib.get_close_matches(path.name, names, n=3, cutoff=0.6)
    close += [n for n in names if Path(n).stem == path.stem and Path(n).suffix.lower() in SUPPORTED and n not in close]
    if not close:
        return "no such file", "check the path; in a scene file it is relative to that file"
    return "no such file", f"did you mean {' or '.join(close[:3])}?"
