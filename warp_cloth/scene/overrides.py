"""Overrides of a scene: one value each, as text "KEY=VALUE" or as a dotted key with a value of its own."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base import arguments
from warp_cloth.base.errors import OVERRIDE, InputError
from warp_cloth.base.toml_file import exists, toml_value
from warp_cloth.scene.held_mesh import in_file, is_held
from warp_cloth.scene.messages import show

WHOLE = ("kind", "name")  # a table with one of these keys replaces the scene's; others change it key by key
PART = re.compile(r"([A-Za-z_][\w-]*)((?:\[\d{1,6}\])*)")


# Where a garment or an avatar comes from, with the keys that are for one of these alone
SOURCES = {
    "mesh": ("mesh", "prim", "units", "up"),
    "pattern": ("pattern", "edge_mm", "size", "seam_allowance_mm", "seam", "piece"),
    "shape": ("shape",),
}


@dataclass(frozen=True)
class Override:
    """One value of a scene, and how messages name it."""

    key: str  # dotted
    value: Any
    place: str


def overrides_of(given: str | Iterable[str] | Mapping[str, Any] | Sequence[Override]) -> list[Override]:
    """Overrides from what callers give: texts ``KEY=VALUE``, values in TOML or plain text, a dictionary, or overrides.

    A table within a dictionary changes a scene's key by key, unless it has a ``kind`` or ``name`` and replaces it.
    """
    if isinstance(given, Mapping):
        return [Override(key, value, _place(f"{key}={value}")) for key, value in flat(plain(given))]
    if isinstance(given, list) and all(isinstance(each, Override) for each in given):
        return list(given)
    return [_from_text(text) for text in arguments.strings(given, "overrides")]


def _from_text(text: str) -> Override:
    place = _place(text)
    key, equals, value = text.partition("=")
    _parts(key.strip(), place)
    if not equals:
        raise InputError(place, "has no value", "write KEY=VALUE, for instance garment.fabric=denim")
    return Override(key.strip(), toml_value(value.strip()), place)


def _place(text: str) -> str:
    return f"{OVERRIDE}{text if len(text) <= 100 else text[:97] + '...'}"


def flat(values: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Dotted keys and values of nested tables; a table with a key of WHOLE stays a table."""
    found: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, Mapping) and not any(word in value for word in WHOLE):
            found += flat(value, f"{above}{key}.")
        else:
            found.append((f"{above}{key}", value))
    return found


def plain(values: Any) -> Any:
    """A copy of a dictionary or a value with NumPy's as Python's, and files for meshes in memory."""
    if isinstance(values, Mapping):
        return {key: plain(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [plain(value) for value in values]
    if is_held(values):
        return str(in_file(values, "mesh"))
    return values.tolist() if isinstance(values, np.generic | np.ndarray) else deepcopy(values)


def apply_override(values: dict[str, Any], override: Override, directory: Path) -> str:
    """Writes one override into a scene's values; returns the key as the schema's messages spell it.

    ``directory`` is the scene file's folder, where its relative paths start.
    """
    place, value = override.place, override.value
    parts = _parts(override.key, place)
    garments = values.get("garment")
    if parts[0] == "garment":
        parts = _chosen_garment(parts, garments, place)
    *way, last = parts
    table: Any = values
    for part in way:
        table = _step(table, part, place)
    if isinstance(last, int):
        _check_entry(table, last, place)
    elif not isinstance(table, dict):
        raise InputError(place, f"{show(table)} is a value, not a table", "remove the last key")
    else:
        _settle_choice(table, str(last), value)
    table[last] = _path_from_here(str(last), value, directory)
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in parts).lstrip(".")


def still_stated(values: Any, key: str) -> bool:
    """Whether a key that was written into a scene's values is still there."""
    for part in _parts(key, key):
        entries = dict(enumerate(values)) if isinstance(values, list) else values
        if not isinstance(entries, dict) or part not in entries:
            return False
        values = entries[part]
    return True


def _parts(key: str, place: str) -> list[str | int]:
    """Names and list indices of a dotted key: garment[1].fabric is garment, 1, fabric."""
    parts: list[str | int] = []
    for piece in key.split("."):
        match = PART.fullmatch(piece.strip())
        if match is None:
            raise InputError(place, f"{show(key)} is not a key", "write KEY=VALUE, for instance solver.iterations=500")
        parts.append(match[1])
        parts += [int(number) for number in re.findall(r"\d+", match[2])]
    return parts


def _chosen_garment(parts: list[str | int], garments: Any, place: str) -> list[str | int]:
    """Resolves which garment a key means: a single one needs no index, and may have one."""
    numbered = len(parts) > 1 and isinstance(parts[1], int)
    if isinstance(garments, list):
        if len(garments) == 1 and not numbered and len(parts) > 1:
            return ["garment", 0, *parts[1:]]
        if not numbered and len(parts) > 1:
            raise InputError(place, f"the scene has {len(garments)} garments", "give an index: garment[0] is the first")
    elif numbered and parts[1] == 0:
        return ["garment", *parts[2:]]
    elif numbered:
        raise InputError(place, f"there is no garment[{parts[1]}]", "the scene has one garment: remove the index")
    return parts


def _step(table: Any, part: str | int, place: str) -> Any:
    """The table or list one level down; a missing table is created."""
    if isinstance(part, int):
        _check_entry(table, part, place)
        return table[part]
    if not isinstance(table, dict):
        raise InputError(place, f"{show(table)} is a value, not a table", "remove the last key")
    inner = table.setdefault(part, {})
    if part == "fabric" and isinstance(inner, str):  # a named fabric, of which one value is overridden
        inner = table[part] = {"name": inner}
    return inner


def _check_entry(table: Any, index: int, place: str) -> None:
    if not isinstance(table, list):
        raise InputError(place, f"there is no list for [{index}]", "remove the index")
    if index >= len(table):
        raise InputError(place, f"there is no [{index}]", f"the list has {len(table)}, counted from 0")


def _settle_choice(table: dict[str, Any], key: str, value: Any) -> None:
    """Removes what a new mesh, pattern, shape or kind of shape replaces: these exclude each other."""
    if key in SOURCES:
        for other in (each for source, keys in SOURCES.items() if source != key for each in keys):
            table.pop(other, None)
    elif key == "kind" and show(table.get("kind")) != show(value):
        table.clear()


def _path_from_here(key: str, value: Any, directory: Path) -> Any:
    """A file that is missing in the scene's folder is taken from the current folder, where it was typed.

    So are those in a table or a list of tables.
    """
    if isinstance(value, dict):
        return {name: _path_from_here(name, each, directory) for name, each in value.items()}
    if isinstance(value, list):
        return [_path_from_here(key, each, directory) for each in value]
    file = key in ("mesh", "pattern", "grain_texture") or (key == "fabric" and str(value).lower().endswith(".toml"))
    if file and isinstance(value, str) and not exists(directory / value) and exists(Path(value)):
        return str(Path(value).absolute())
    return value
