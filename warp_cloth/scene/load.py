"""Loading scenes: finds and reads scene files, applies --set, and validates them by the schema."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from warp_cloth.base import arguments
from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import exists, read_toml
from warp_cloth.scene.messages import scene_error, show
from warp_cloth.scene.overrides import apply_override, set_place, still_stated
from warp_cloth.scene.schema import Scene
from warp_cloth.scene.stage import USD_SUFFIXES, check_prims, stage_values

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf")


def load_scene(source: str | Path | Mapping[str, Any], overrides: Sequence[str] = ()) -> Scene:
    """Loads a scene from a TOML file, a USD stage, the name of a shipped scene, or a dictionary of the same keys.

    ``overrides`` are ``KEY=VALUE`` strings as --set takes them: a dotted key, and a value in TOML or plain text.
    Relative paths start from the scene file's folder (for a dictionary the current folder); those of overrides from
    there, or else from the current folder.

    Raises:
        InputError: the scene cannot be read, or a key or value is wrong.
    """
    if isinstance(source, Mapping):
        place, name, directory, values = "scene", "scene", Path(), _plain(source)
    else:
        path = _scene_file(source if isinstance(source, str) else arguments.path(source, "scene"))
        place, name, directory = str(path), path.stem, path.parent
        staged = path.suffix.lower() in USD_SUFFIXES
        if path.suffix.lower() in MESH_SUFFIXES:
            remedy = f'write a scene.toml with garment.mesh = "{path.name}" and avatar.mesh = "BODY.obj"'
            raise InputError(path, "is a mesh, not a scene", remedy)
        values = stage_values(path) if staged else read_toml(path, "scene file")
    stated: dict[str, str] = {}  # dotted key -> the --set that stated it
    for text in arguments.strings(overrides, "overrides"):
        key = apply_override(values, text, directory)
        for other, earlier in stated.items():
            sibling = key.endswith(".kind") and other.startswith(key.removesuffix("kind"))
            if sibling and not still_stated(values, other):
                raise InputError(earlier, f"is undone by {set_place(text)}", "remove it, or put it after that")
        stated[key] = set_place(text)
    if not isinstance(source, Mapping) and path.suffix.lower() in USD_SUFFIXES:
        check_prims(values, path)
    values.setdefault("name", name)
    try:
        return Scene.model_validate(values, context={"directory": directory})
    except ValidationError as error:
        many = isinstance(values.get("garment"), list) and len(values["garment"]) > 1
        raise scene_error(error, Scene, partial(_place, file=place, stated=stated), many) from None


def scene_of_body(source: str, overrides: Sequence[str] = ()) -> Scene | None:
    """The scene of a body alone, from its mesh file; None where ``source`` is no mesh.

    A scene has a garment: a square of cloth stands in for it. ``overrides`` as for ``load_scene``.
    """
    path = Path(source)
    if path.suffix.lower() not in MESH_SUFFIXES:
        return None
    cloth = {"shape": {"kind": "square"}, "fabric": "cotton"}
    return load_scene({"name": path.stem, "avatar": {"mesh": source}, "garment": cloth}, overrides)


def _plain(values: Any) -> Any:
    """A copy of a dictionary with NumPy values as Python's."""
    if isinstance(values, Mapping):
        return {key: _plain(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [_plain(value) for value in values]
    return values.tolist() if isinstance(values, np.generic | np.ndarray) else deepcopy(values)


def shipped_scenes() -> dict[str, Path]:
    """Names and files of the scenes that come with the package."""
    folder = Path(str(files("warp_cloth.scenes")))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def describe_scene(path: Path) -> str:
    """The first comment line of a scene file, which describes the scene."""
    first = path.read_text(encoding="utf-8").partition("\n")[0]
    return first.lstrip("# ").strip() if first.startswith("#") else ""


def _scene_file(source: str | Path) -> Path:
    """The file of a path or of a shipped scene's name."""
    shipped = shipped_scenes()
    path = Path(source)
    if isinstance(source, str) and source in shipped:
        return shipped[source]
    if exists(path):
        return path
    if str(source) in shipped:
        return shipped[str(source)]
    name = path.name.removesuffix(".toml").lower()
    close = difflib.get_close_matches(name, shipped, n=1, cutoff=0.6)
    names = ", ".join(shipped)
    hint = f'did you mean "{close[0]}"? ' if close else ""
    raise InputError(show(str(source)), "no such scene file", f"{hint}shipped scenes: {names}")


def _place(key: str, with_key: bool, *, file: str, stated: Mapping[str, str]) -> str:
    """Where a key was stated: the file, or the --set that wrote it or a key above or below it."""
    sought = key.replace("[0]", "")  # a single entry may stand without a list
    for own, text in reversed(list(stated.items())):
        own = own.replace("[0]", "")
        if sought == own:
            return text
        if f"{sought}.".startswith((f"{own}.", f"{own}[")) or own.startswith((f"{sought}.", f"{sought}[")):
            return f"{text}: {key}" if with_key else text
    return f"{file}: {key}" if key and with_key else file
