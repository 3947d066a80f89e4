"""Products in job files: every garment in every size on every avatar in every fabric."""

from __future__ import annotations

import glob
import itertools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import read_toml
from warp_cloth.scene import shipped_scenes
from warp_cloth.scene.overrides import flat
from warp_cloth.scene.paths import file_stem

AXES = ("garments", "sizes", "avatars", "fabrics")  # in the order in which they form names
SIZE = "{size}"  # stands for the size's name in a garment's texts
MOST_ITEMS = 1_000_000  # which take 1 GB of memory


def product_rows(product: Any, shared: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    """One row for each combination, the last axis fastest; names are the entries' names joined by dashes.

    An entry is text, or a table of scene keys with a ``name``.
    """
    if not isinstance(product, dict):
        raise InputError(path, "product is not a table", f"write [product] with some of {', '.join(AXES)}")
    unknown = next((key for key in product if key not in AXES), None)
    if unknown is not None:
        raise InputError(path, f"unknown key product.{unknown}", f"allowed there: {', '.join(AXES)}")
    axes = []
    for axis in AXES:
        if axis in product:
            entries = product[axis]
            if not isinstance(entries, list) or not entries:
                raise InputError(path, f"product.{axis} is not a list of entries", 'write ["A", "B"]')
            axes.append([_entry(axis, each, path) for entry in entries for each in _files(entry, path)])
    if not axes:
        raise InputError(path, "the product is empty", f"give some of {', '.join(AXES)}")
    count = 1
    for entries in axes:
        count *= len(entries)
    if count > MOST_ITEMS:
        raise InputError(path, f"the product has {count:,} items", f"at most {MOST_ITEMS:,} go into one batch")
    rows = []
    for chosen in itertools.product(*axes):
        size = next((entry["name"] for entry in chosen if entry["axis"] == "sizes"), "")
        row: dict[str, Any] = dict(flat(shared))
        for entry in chosen:
            row.update({key: _sized(value, size) for key, value in entry["keys"].items()})
        if size and not any(_names_size(entry) for entry in chosen):
            row.setdefault(_size_key(row, path), size)
        row["name"] = "-".join(_sized(entry["name"], "").strip("_- ") for entry in chosen)
        rows.append(row)
    return rows


def _size_key(row: Mapping[str, Any], path: Path) -> str:
    """The key that a size is of: a DXF pattern's own, else that of a generated garment."""
    pattern, scene = row.get("garment.pattern"), row.get("scene")
    if pattern is None and isinstance(scene, str) and scene.lower().endswith(".toml"):
        try:
            stated = dict(flat(read_toml(path.parent / scene, "scene file")))
        except InputError:  # which its items say
            stated = {}
        pattern = stated.get("garment.pattern")
    return "garment.size" if str(pattern).lower().endswith(".dxf") else "garment.shape.size"


def _files(entry: Any, path: Path) -> list[Any]:
    """The entry, or the files that it stands for where it has a * or ?, by name; relative to the job file's folder."""
    if not isinstance(entry, str) or not set(entry) & set("*?"):
        return [entry]
    try:
        found = sorted(glob.glob(entry, root_dir=path.parent))
    except (OSError, ValueError, re.error):
        found = []
    if not found:
        raise InputError(path, f'no file fits "{entry}"', "check the pattern; it is relative to the job file")
    return found


def _entry(axis: str, entry: Any, path: Path) -> dict[str, Any]:
    """An entry's axis, name and the scene keys that it states."""
    if isinstance(entry, dict):
        if not isinstance(entry.get("name"), str):
            raise InputError(path, f"a table in product.{axis} has no name", "give each a name, for its results")
        keys = dict(flat({key: value for key, value in entry.items() if key != "name"}))
        return {"axis": axis, "name": entry["name"], "keys": keys, "own": axis == "sizes" and bool(keys)}
    if not isinstance(entry, str):
        raise InputError(
            path, f"{entry!r} in product.{axis} is neither text nor a table", 'write "NAME" or {name = ..}'
        )
    name = file_stem(Path(entry)) if "." in entry or "/" in entry else entry
    keys = {
        "garments": {"scene": entry} if _is_scene(entry) else {_garment_key(entry): entry},
        "sizes": {},
        "avatars": {"avatar.mesh": entry},
        "fabrics": {"garment.fabric": entry},
    }[axis]
    return {"axis": axis, "name": name, "keys": keys, "own": False}


def _is_scene(text: str) -> bool:
    return text.lower().endswith(".toml") or text in shipped_scenes()


def _garment_key(file: str) -> str:
    return "garment.pattern" if file.lower().endswith((".json", ".dxf")) else "garment.mesh"


def _names_size(entry: Mapping[str, Any]) -> bool:
    """Whether an entry states what a size means."""
    return entry["own"] or any(SIZE in str(value) for value in entry["keys"].values())


def _sized(value: Any, size: str) -> Any:
    return value.replace(SIZE, size) if isinstance(value, str) else value
