"""Loading scenes: finds and reads scene files, applies overrides, and validates them by the schema."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warp_cloth.base import arguments, mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import exists, read_toml
from warp_cloth.scene.held_mesh import Held, in_file
from warp_cloth.scene.messages import scene_error, show
from warp_cloth.scene.overrides import Override, apply_override, overrides_of, plain, still_stated
from warp_cloth.scene.paths import file_stem
from warp_cloth.scene.schema import Scene
from warp_cloth.scene.stage import check_prims, has_garments, stage_values
from warp_cloth.scene.worn_on import (
    MANNEQUIN,
    PATTERN_SUFFIXES,
    body_named,
    in_fabric,
    is_mesh,
    missing_file,
    worn_on,
)

OF_ANY_BODY = ("friction",)  # keys of a scene's avatar that hold for another body, too


@dataclass(frozen=True)
class _Source:
    """A scene's values as read, before overrides."""

    place: str  # how messages name it
    name: str
    directory: Path  # where its relative paths start
    values: dict[str, Any]
    stage: Path | None = None  # a USD stage, whose prims must be known
    stated: Mapping[str, str] = field(default_factory=dict)  # dotted key -> the argument that stated it


def load_scene(
    source: str | Path | Mapping[str, Any] | Held,
    overrides: Sequence[str] | Mapping[str, Any] | Sequence[Override] = (),
    *,
    on: str | Path | Held | None = None,
    fabric: Any = None,
) -> Scene:
    """Loads a scene: a TOML file, a USD stage, a shipped scene's name, a dictionary of the same keys, or two meshes.

    Relative paths start from the scene file's folder (for a dictionary and two meshes the current folder); those of
    overrides from there, or else from the current folder.

    Args:
        source: the scene, or with ``on`` a garment's mesh or pattern. Wherever a mesh file may be given, so may a mesh
            in memory: trimesh's, or an object like it with ``vertices`` and ``faces``; here and in ``on`` a tuple of
            these two arrays, too.
        overrides: changes: ``KEY=VALUE`` strings, each a dotted key, and a value in TOML or plain text; or a dictionary
            of dotted keys and values.
        on: a body's mesh file, or "mannequin": what the garments are worn on, instead of the scene's avatar.
        fabric: of all garments: a shipped name, a .toml file, a table or a ``Fabric``.

    Raises:
        InputError: the scene cannot be read, or a key or value is wrong.
    """
    changes = overrides_of(overrides)
    names_prim = any(each.key == "garment.prim" for each in changes)
    found = _read(in_file(source, "scene", "garment"), in_file(on, "on", "body"), fabric, names_prim)
    values, stated = found.values, dict(found.stated)
    for override in changes:
        key = apply_override(values, override, found.directory)
        for other, earlier in stated.items():
            sibling = key.endswith(".kind") and other.startswith(key.removesuffix("kind"))
            if sibling and not still_stated(values, other):
                raise InputError(earlier, f"is undone by {override.place}", "remove it, or put it after that")
        stated[key] = override.place
    if found.stage is not None:
        check_prims(values, found.stage)
    values.setdefault("name", found.name)
    try:
        return Scene.model_validate(values, context={"directory": found.directory})
    except ValidationError as error:
        many = isinstance(values.get("garment"), list) and len(values["garment"]) > 1
        raise scene_error(error, Scene, partial(_place, file=found.place, stated=stated), many) from None


def scene_of_body(source: str, overrides: Sequence[str] = ()) -> Scene | None:
    """The scene of a body alone, from its mesh file, or of the mannequin; None where ``source`` is neither.

    A scene has a garment: a square of cloth stands in for it. ``overrides`` as for ``load_scene``. A USD stage is a
    body where neither it nor the overrides hold a garment.

    Raises:
        InputError: it is a file of another kind than meshes and scenes.
    """
    path = Path(source)
    is_body = path.suffix.lower() in mesh_formats.MESHES or (source == MANNEQUIN and not exists(path))
    if not is_body and exists(path) and path.is_file():
        is_body = _is_body_file(path, overrides)
    if not is_body:
        return None
    cloth = {"shape": {"kind": "square"}, "fabric": "cotton"}
    return load_scene({"name": path.stem, "avatar": body_named(source)[0], "garment": cloth}, overrides)


def _is_body_file(path: Path, overrides: Sequence[str]) -> bool:
    """Whether a file that is no plain mesh is a body: a stage without garments."""
    kind = path.suffix.lower()
    if kind not in (".toml", "", *mesh_formats.USD, *PATTERN_SUFFIXES):
        supported = ", ".join(mesh_formats.SUPPORTED)
        raise InputError(path, f"{kind} is not a supported mesh format", f"use one of {supported}")
    names_garment = any(each.lstrip().startswith("garment") for each in overrides)
    return kind in mesh_formats.USD and not names_garment and not has_garments(path)


def _read(source: Any, on: Any, fabric: Any, names_prim: bool) -> _Source:
    """A scene's values as they are read, from wherever they come; ``names_prim`` as in ``worn_on``."""
    if on is not None and not _is_scene(source):
        path = arguments.path(source, "scene")
        values, stated = worn_on(path, on, fabric, names_prim=names_prim)
        return _Source(str(path), file_stem(path), Path(), values, stated=stated)
    found = _read_scene(source)
    stated = in_fabric(found.values, _from_here(fabric) if str(fabric).lower().endswith(".toml") else fabric)
    if on is None:
        return replace(found, stated=stated)
    avatar, of_body = body_named(_from_here(on))
    before = found.values.get("avatar")
    kept = {key: before[key] for key in OF_ANY_BODY if isinstance(before, dict) and key in before}
    return replace(found, values={**found.values, "avatar": {**kept, **avatar}}, stated={**stated, **of_body})


def _is_scene(source: Any) -> bool:
    """Whether a source names its body, unless another one is stated; else it is a garment's mesh or pattern."""
    if isinstance(source, Mapping):
        return True
    path = arguments.path(source, "scene")
    return str(source) in shipped_scenes() or path.suffix.lower() == ".toml"


def _from_here(value: Any) -> Any:
    """A file in the current folder, where it was typed, as such wherever the scene is; anything else unchanged."""
    named = isinstance(value, str | Path) and exists(Path(value)) and Path(value).is_file()
    return Path(value).absolute() if named else value


def _read_scene(source: Any) -> _Source:
    """A scene's values as they are read from a dictionary, a file or a stage."""
    if isinstance(source, Mapping):
        return _Source("scene", "scene", Path(), plain(source))
    path = _scene_file(source if isinstance(source, str) else arguments.path(source, "scene"))
    if path.suffix.lower() in mesh_formats.MESHES:
        raise InputError(path, "is a mesh, not a scene", 'say what it is worn on: on="BODY.obj" or on="mannequin"')
    if path.suffix.lower() in PATTERN_SUFFIXES:
        raise InputError(path, "is no scene", 'if it is a pattern, say what it is worn on: on="BODY.obj"')
    if path.suffix.lower() in mesh_formats.USD:
        return _Source(str(path), path.stem, path.parent, stage_values(path), path)
    return _Source(str(path), path.stem, path.parent, read_toml(path, "scene file"))


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
    if is_mesh(path):
        raise missing_file(path)
    name = path.name.removesuffix(".toml").lower()
    close = difflib.get_close_matches(name, shipped, n=1, cutoff=0.6)
    names = ", ".join(shipped)
    hint = f'did you mean "{close[0]}"? ' if close else ""
    raise InputError(show(str(source)), "no such scene file", f"{hint}shipped scenes: {names}")


def _place(key: str, with_key: bool, *, file: str, stated: Mapping[str, str]) -> str:
    """Where a key was stated: the file, or the override that wrote it or a key above or below it."""
    sought = key.replace("[0]", "")  # a single entry may stand without a list
    for own, text in reversed(list(stated.items())):
        own = own.replace("[0]", "")
        if sought == own:
            return text
        if f"{sought}.".startswith((f"{own}.", f"{own}[")) or own.startswith((f"{sought}.", f"{sought}[")):
            return f"{text}: {key}" if with_key else text
    return f"{file}: {key}" if key and with_key else file
