"""A scene of two files: a garment's mesh or pattern, and the body that it is worn on."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

from warp_cloth.base import arguments, mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import exists
from warp_cloth.scene.stage import stage_values

PATTERN_SUFFIXES = (".json", ".dxf")
MANNEQUIN = "mannequin"  # the shipped body, of an M


def is_mesh(path: Path) -> bool:
    """Whether the file's name is that of a mesh; that of a USD stage may be a scene's, too."""
    return path.suffix.lower() in mesh_formats.SUPPORTED


def worn_on(garment: Path, on: Any, fabric: Any, *, names_prim: bool = False) -> tuple[dict[str, Any], dict[str, str]]:
    """Scene values of a garment on a body, and which of them the arguments stated, by dotted key.

    ``names_prim``: whether the caller says which mesh of the file is the garment.

    Raises:
        InputError: a file is missing, or the body is a scene.
    """
    if not exists(garment):
        raise missing_file(garment)
    if garment.is_dir():
        raise InputError(garment, "is a folder", "name a mesh file in it")
    avatar, stated = body_named(on)
    body = avatar.get("mesh", "")
    if Path(body).suffix.lower() in mesh_formats.MESHES and Path(body).resolve() == garment.resolve():
        raise InputError("on", f"{body} is the garment, too", "give the body's mesh file")
    values = {"garment": _garment(garment, names_prim), "avatar": avatar}
    return values, {"garment": str(garment), **stated, **in_fabric(values, fabric)}


def body_named(on: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """The table of the avatar that ``on`` names, and what it states, by dotted key."""
    if on == MANNEQUIN and not exists(Path(on)):
        return {"shape": {"kind": "mannequin"}}, {}
    body = arguments.path(on, "on")
    if body.suffix.lower() == ".toml":
        raise InputError("on", f"{body} is a scene, not a body", "give a body's mesh file")
    if not exists(body):
        raise missing_file(body, MANNEQUIN)
    return {"mesh": str(body)}, {"avatar": str(body)}


def in_fabric(values: dict[str, Any], fabric: Any) -> dict[str, str]:
    """Gives all garments of a scene's values this fabric, if there is one; returns what that states, by dotted key."""
    garments = values.get("garment")
    tables = {"garment": garments}
    if isinstance(garments, list):
        tables = {f"garment[{index}]": each for index, each in enumerate(garments)}
    if fabric is None:
        return {}
    for table in tables.values():
        if isinstance(table, dict):
            table["fabric"] = fabric
    return {f"{key}.fabric": "fabric" for key in tables}


def _garment(path: Path, names_prim: bool) -> Any:
    """A garment's table; of a USD stage that says which of its meshes are cloth, or of an outfit, theirs."""
    if path.suffix.lower() in PATTERN_SUFFIXES:
        return {"pattern": str(path)}
    if path.suffix.lower() in mesh_formats.USD:
        cloths = stage_values(path)["garment"]
        if isinstance(cloths, list):
            return [{**cloth, "mesh": str(path)} for cloth in cloths]
    if path.suffix.lower() in mesh_formats.NAMED and not names_prim:
        from warp_cloth.loading.separate import separate_garments  # and with it all readers of meshes

        if names := separate_garments(path):
            return [{"mesh": str(path), "prim": name} for name in names]
    return {"mesh": str(path)}


def missing_file(path: Path, *others: str) -> InputError:
    """The error for a mesh file that is not there, with the most similar name in its folder or among ``others``."""
    close = difflib.get_close_matches(str(path), others, n=1, cutoff=0.8)
    if close:
        return InputError(path, "no such file", f"did you mean {close[0]}?")
    names: list[str] = []
    if exists(path.parent) and path.parent.is_dir():
        names = [entry.name for entry in path.parent.iterdir() if entry.is_file()]
    close = difflib.get_close_matches(path.name, names, n=1, cutoff=0.6)
    remedy = " or ".join(["check the path", *(f"give {other}" for other in others)])
    return InputError(path, "no such file", f"did you mean {path.with_name(close[0])}?" if close else remedy)
