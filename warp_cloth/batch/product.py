"""Products in job files: every garment in every size on every avatar in every fabric, with every value of a sweep."""

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
from warp_cloth.scene.messages import nearest
from warp_cloth.scene.overrides import flat
from warp_cloth.scene.paths import file_stem

AXES = ("garments", "sizes", "avatars", "fabrics")  # in the order in which they form names
SWEEP = "sweep"  # further axes: any scene keys
RANGE = ("from", "to", "count")
RANGE_REMEDY = "write [0.9, 1.0], or {from = 0.9, to = 1.1, count = 5}"
DIGITS = 9  # after the point, of a range's values
SIZE = "{size}"  # stands for the size's name in a garment's texts
MOST_ITEMS = 1_000_000  # which take 1 GB of memory


def product_rows(product: Any, shared: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    """One row for each combination, the last axis fastest; names are the entries' names joined by dashes.

    An entry is text, or a table of scene keys with a ``name``.
    """
    known = ", ".join((*AXES, SWEEP))
    if not isinstance(product, dict):
        raise InputError(path, "product is not a table", f"write [product] with some of {known}")
    unknown = next((key for key in product if key not in (*AXES, SWEEP)), None)
    if unknown is not None:
        close = nearest(unknown, (*AXES, SWEEP), ask="did you mean product.{}? ")
        raise InputError(path, f"unknown key product.{unknown}", f"{close}allowed there: {known}")
    axes = []
    for axis in AXES:
        if axis in product:
            entries = product[axis]
            if not isinstance(entries, list) or not entries:
                raise InputError(path, f"product.{axis} is not a list of entries", 'write ["A", "B"]')
            axes.append([_entry(axis, each, path) for entry in entries for each in _files(entry, path)])
    axes += _swept(product.get(SWEEP, {}), path)
    if not axes:
        raise InputError(path, "the product is empty", f"give some of {known}")
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


def _swept(sweep: Any, path: Path, above: str = "") -> list[list[dict[str, Any]]]:
    """An axis for each scene key of a sweep: a list of values, or a table {from, to, count} of evenly spaced ones."""
    if not isinstance(sweep, dict):
        raise InputError(path, f"product.{SWEEP}{above and '.' + above} is not a list of values", RANGE_REMEDY)
    axes = []
    for key, values in sweep.items():
        whole = f"{above}.{key}".lstrip(".")
        if isinstance(values, dict) and set(values) != set(RANGE):
            axes += _swept(values, path, whole)
            continue
        chosen = _range(values, whole, path) if isinstance(values, dict) else values
        if not isinstance(chosen, list) or not chosen:
            raise InputError(path, f"product.{SWEEP}.{whole} is not a list of values", RANGE_REMEDY)
        axes.append(
            [{"axis": SWEEP, "name": _value_name(each), "keys": {whole: each}, "own": False} for each in chosen]
        )
    return axes


def _range(values: Mapping[str, Any], key: str, path: Path) -> list[float]:
    first, last, count = (values[name] for name in RANGE)
    numbers = all(isinstance(each, int | float) and not isinstance(each, bool) for each in (first, last))
    if not numbers or type(count) is not int or not 2 <= count <= MOST_ITEMS:
        raise InputError(path, f"product.{SWEEP}.{key} is not a range of numbers", RANGE_REMEDY)
    return [round(first + (last - first) * place / (count - 1), DIGITS) for place in range(count)]


def _value_name(value: Any) -> str:
    """A value as a part of its item's name."""
    return re.sub(r"[^\w.+-]+", "_", file_stem(Path(value)) if isinstance(value, str) else str(value)).strip("_.")


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
