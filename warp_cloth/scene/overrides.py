"""--set KEY=VALUE: overrides one value of a scene."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import exists, toml_value
from warp_cloth.scene.messages import show

PART = re.compile(r"([A-Za-z_][\w-]*)((?:\[\d{1,6}\])*)")


def set_place(text: str) -> str:
    """How messages name a --set."""
    return f"--set {text if len(text) <= 100 else text[:97] + '...'}"


def apply_override(values: dict[str, Any], text: str, directory: Path) -> str:
    """Writes one KEY=VALUE into a scene's values; returns the key as the schema's messages spell it.

    ``directory`` is the scene file's folder, where its relative paths start.
    """
    place = set_place(text)
    key, equals, value = text.partition("=")
    parts = _parts(key.strip(), place)
    if not equals:
        raise InputError(place, "has no value", "write KEY=VALUE, for instance garment.fabric=denim")
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
        _settle_choice(table, str(last), value.strip())
    table[last] = _path_from_here(str(last), toml_value(value.strip()), directory)
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


def _settle_choice(table: dict[str, Any], key: str, value: str) -> None:
    """Removes what a new mesh, shape or kind of shape replaces: these exclude each other."""
    if key == "mesh":
        table.pop("shape", None)
    elif key == "shape":
        for other in ("mesh", "prim", "units", "up"):
            table.pop(other, None)
    elif key == "kind" and show(table.get("kind")) != show(toml_value(value)):
        table.clear()


def _path_from_here(key: str, value: Any, directory: Path) -> Any:
    """A file that is missing in the scene's folder is taken from the current folder, where --set was typed."""
    file = key in ("mesh", "grain_texture") or (key == "fabric" and str(value).lower().endswith(".toml"))
    if file and isinstance(value, str) and not exists(directory / value) and exists(Path(value)):
        return str(Path(value).absolute())
    return value
