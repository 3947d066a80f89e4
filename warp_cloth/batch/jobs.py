"""Job files: one item per row, each a scene and changes to it, as ``warp-cloth fit`` takes them."""

from __future__ import annotations

import csv
import difflib
import functools
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8
from warp_cloth.base.toml_file import exists, read_toml, toml_text
from warp_cloth.batch.product import AXES, SWEEP, product_rows
from warp_cloth.batch.rows import COLUMNS
from warp_cloth.loading.raw import counted
from warp_cloth.scene.overrides import flat
from warp_cloth.scene.reference import TABLES
from warp_cloth.scene.schema import Scene

REMEDY = "give a table as .csv, .parquet or .toml, with the columns scene, name and scene keys such as garment.fabric"
WITHOUT_SCENE = "give each row a scene file or a shipped scene there, or a garment.mesh and an avatar.mesh"
GARMENTS = ("garment.mesh", "garment.pattern", "garment.shape")  # a row with one of these needs no scene
LARGEST_JOB_FILE = 200_000_000  # [bytes]; a million tables
FILE_KEYS = ("mesh", "pattern", "grain_texture", "fabric")  # last names of keys whose values may name files
AVATAR_KEYS = (
    "avatar=",
    "avatar.mesh",
    "avatar.prim",
    "avatar.units",
    "avatar.shape",
    "avatar.measures",
    "avatar.poses",
)
PLAIN_NAME = re.compile(r"[^/\\\x00-\x1f.][^/\\\x00-\x1f]{0,99}")
INTEGER = re.compile(r"^([-+]?\d+)\.0+$")
FRAME_INDEX = "__index_level_"  # prefix that pandas gives a data frame's index in a file
ALIKE = 0.75  # least likeness of a column to a scene key that it probably misspells
TEXTS = ("name", "scene")  # columns that hold no numbers


@dataclass(frozen=True)
class Item:
    """One fit of a batch: ``warp-cloth fit SCENE --set CHANGE ...`` gives the same."""

    name: str
    scene: str  # a scene file or a shipped scene's name; "": the changes state all
    changes: tuple[str, ...] = ()  # KEY=VALUE
    problem: str = ""  # why the row cannot be used, if it cannot
    cells: tuple[tuple[str, Any], ...] = field(default=(), compare=False)  # the row's columns as given, but its name

    @property
    def source(self) -> str | dict[str, Any]:
        """The scene that its changes go over, for ``load_scene``."""
        return self.scene or {}

    @property
    def columns(self) -> dict[str, Any]:
        """What the job says of it, by column, for its results: as given, or of an item made in Python its changes."""
        changes = (change.partition("=") for change in self.changes)
        return dict(self.cells or (("scene", self.scene), *((key, value) for key, _, value in changes)))


def avatar_key(item: Item) -> tuple[str, ...]:
    """What an item states about its avatar's mesh: equal for items of the same avatar."""
    return item.scene, *sorted(change for change in item.changes if change.startswith(AVATAR_KEYS))


def garments_key(item: Item) -> tuple[str, ...]:
    """What an item states about its garments' meshes, likewise."""
    changes = (change for change in item.changes if change.startswith("garment"))
    return tuple(sorted(change for change in changes if "fabric" not in change.partition("=")[0].split(".")))


def read_jobs(path: str | Path) -> list[Item]:
    """The items of a job file, in its order.

    Raises:
        InputError: the file cannot be used at all. A row that cannot be used is an item with a ``problem``.
    """
    source = Path(path)
    if not exists(source) or source.is_dir():
        raise InputError(source, "is a folder" if source.is_dir() else "no such job file", REMEDY)
    suffix = source.suffix.lower()
    if suffix == ".csv":
        rows: Iterable[Mapping[str, Any]] = _csv_rows(source)
    elif suffix in (".parquet", ".pq"):
        rows = _parquet_rows(source)
    elif suffix == ".toml":
        rows = _toml_rows(source)
    else:
        raise InputError(source, f'"{source.suffix}" is not a format of job files', REMEDY)
    return _checked([_item(row, number, source.parent) for number, row in enumerate(rows, start=1)], source)


def read_products(path: str | Path) -> tuple[dict[str, dict[str, Item]], tuple[str, ...]]:
    """The garments of a job file's product, each by size, and its fabrics; bodies are not part of it.

    A garment without sizes has the one size "".

    Raises:
        InputError: the file cannot be used, or holds no such product.
    """
    source = Path(path)
    values = read_toml(source, "job file", largest=LARGEST_JOB_FILE)
    product = values.get("product")
    if not isinstance(product, dict) or "garments" not in product:
        raise InputError(source, "has no product with garments", 'write [product] with garments = ["FILE", ..]')
    if "avatars" in product:
        raise InputError(source, "product.avatars: each request brings its body", "remove it")
    if SWEEP in product:
        raise InputError(source, f"product.{SWEEP} is for studies, not for a service", "remove it")
    shared = {key: value for key, value in values.items() if key != "product"}
    axes = {axis: product[axis] for axis in ("garments", "sizes") if axis in product}
    rows = product_rows(axes | {key: product[key] for key in product if key not in AXES}, shared, source)
    sizes = product_rows({"sizes": axes["sizes"]}, {}, source) if "sizes" in axes else [{"name": ""}]
    fabrics = product_rows({"fabrics": product["fabrics"]}, {}, source) if "fabrics" in product else []
    found: dict[str, dict[str, Item]] = {}
    for number, row in enumerate(rows):
        size = sizes[number % len(sizes)]["name"]
        name = row["name"].removesuffix(f"-{size}") if size else row["name"]
        item = _item(row, number + 1, source.parent)
        if item.problem:
            raise InputError(source, f"{item.name}: {item.problem}")
        found.setdefault(name, {})[size] = item
    named = (str(_from_folder("fabric", row["garment.fabric"], source.parent)) for row in fabrics)
    return found, tuple(named)


def checked_items(items: Sequence[Item]) -> list[Item]:
    """A caller's items; InputError where there are none, or they are not items."""
    if not isinstance(items, Sequence) or isinstance(items, str) or not all(isinstance(item, Item) for item in items):
        raise InputError("jobs", "must be a job file or a list of items", "give a path, or what read_jobs returned")
    return _checked(list(items), "jobs")


def _checked(items: list[Item], source: str | Path) -> list[Item]:
    """The items of a batch; InputError where there are none, or some have the same name."""
    if not items:
        raise InputError(source, "has no items", "give at least one row")
    _check_names(items, source)
    return items


def _csv_rows(path: Path) -> list[dict[str, Any]]:
    try:
        text = to_utf8(path.read_bytes()).decode("utf-8")
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror or error}", "check its permissions") from None
    except UnicodeDecodeError as error:
        raise InputError(path, f"is not text in UTF-8 (byte {error.start})", "save it as UTF-8") from None
    table: list[list[str]] = []
    reader, line = csv.reader(io.StringIO(text, newline=""), strict=True), 1
    try:
        for cells in reader:
            table.append(cells)
            line = reader.line_num + 1
    except csv.Error:  # otherwise a quote that is not closed would swallow the rows below it
        problem = "a cell's quotes are not closed, or text follows them"
        raise InputError(f"{path}:{line}", problem, "write quotes within a quoted cell twice") from None
    if not table:
        raise InputError(path, "is empty", REMEDY)
    header = [name.strip() for name in table[0]]
    for mark, words in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            raise InputError(path, f"separates cells by {words}, not commas", "save it with commas, and 0.5, not 0,5")
    _check_columns([name for place, name in enumerate(header) if name or not _says_nothing(table, place)], path)
    rows: list[dict[str, Any]] = []
    for cells in table[1:]:
        if not any(map(str.strip, cells)):  # an empty line, or one past a spreadsheet's last row
            continue
        texts = {name: cell.strip() for name, cell in zip(header, cells, strict=False) if name}
        row: dict[str, Any] = {
            name: text if name in TEXTS else _integer_text(text) for name, text in texts.items() if text
        }
        if len(cells) != len(header):
            row["problem"] = f"the row has {counted(len(cells), 'cell')}, the header {len(header)}"
        rows.append(row)
    return rows


def _says_nothing(table: Sequence[Sequence[str]], place: int) -> bool:
    """Whether a column is empty, as spreadsheets leave some, or a data frame's row numbers."""
    cells = (row[place].strip() for row in table[1:] if place < len(row))
    return all(not cell or cell.isdecimal() for cell in cells)


def _integer_text(text: str) -> str:
    """An integer as such, which data frames write as 3.0 in a column with empty cells; other text unchanged."""
    return INTEGER.sub(r"\1", text)


def _parquet_rows(path: Path) -> list[dict[str, Any]]:
    import pyarrow
    import pyarrow.parquet

    if not path.stat().st_size:
        raise InputError(path, "is empty", REMEDY)
    try:
        table = pyarrow.parquet.read_table(path)
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(path, f"not Parquet: {error}", REMEDY) from None
    columns = [name for name in table.column_names if not name.startswith(FRAME_INDEX)]
    _check_columns(columns, path)
    return [_filled(row) for row in table.select(columns).to_pylist()]


def _filled(row: Mapping[str, Any]) -> dict[str, Any]:
    """The cells that are not empty: data frames write empty ones as NaN, and integers in their column as 3.0."""
    found: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):  # rows share a table's keys: those of others are empty
            value = _filled(value)
        elif isinstance(value, float | Decimal) and math.isfinite(value):
            value = int(value) if value == int(value) else float(value)
        if value is not None and value != {} and value == value:
            found[key] = value
    return found


def _toml_rows(path: Path) -> list[dict[str, Any]]:
    values = read_toml(path, "job file", largest=LARGEST_JOB_FILE)
    shared = {key: value for key, value in values.items() if key not in ("item", "product")}
    if ("item" in values) == ("product" in values):
        raise InputError(
            path,
            "needs either [[item]] tables or one [product]",
            f"a [product] has some of {', '.join((*AXES, SWEEP))}",
        )
    if "product" in values:
        return product_rows(values["product"], shared, path)
    rows = values["item"]
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(path, "item is not a list of tables", "write [[item]] above each of them")
    return [{**shared, **row} for row in rows]


def _check_columns(header: Sequence[str], path: Path) -> None:
    double = next((name for name in header if header.count(name) > 1), None)
    if double is not None or "" in header:
        problem = f'has the column "{double}" twice' if double else "has a column without a name"
        raise InputError(path, problem, "give each column a name of its own")
    if "scene" not in header and not any(map(_states_garment, header)):
        raise InputError(path, 'has no column "scene"', WITHOUT_SCENE)


def _item(row: Mapping[str, Any], number: int, folder: Path) -> Item:
    """One row as an item; what is wrong with it goes into its result."""
    name = str(row.get("name", f"row-{number}"))
    problem = str(row.get("problem", ""))
    scene = row.get("scene")
    if not PLAIN_NAME.fullmatch(name):
        problem = f'column name: "{name}" cannot be a file name; use 1 to 100 characters, without slashes'
        name = f"row-{number}"
    cells = [(key, value) for key, value in flat(row) if key not in ("name", "problem")]
    if not problem and not isinstance(scene, str) and not any(_states_garment(key) for key, _ in cells):
        problem = f"the row names no scene; {WITHOUT_SCENE}"
    changes = [
        f"{key}={_text(_from_folder(key, value, folder))}"
        for key, value in cells
        if key != "scene" and not is_callers(key)
    ]
    return Item(name, str(_from_folder("scene", scene or "", folder)), tuple(changes), problem, tuple(cells))


def _states_garment(column: str) -> bool:
    """Whether a column says what the garment is."""
    return column.startswith(GARMENTS)


@functools.cache
def is_callers(column: str) -> bool:
    """Whether a column is no scene key, nor like one: the caller's own, which goes into the results as it is."""
    if not column.isidentifier() or column in COLUMNS:
        return False
    keys = {*Scene.model_fields, *(name for _, table in TABLES for name in table.model_fields)}
    keys |= {field.alias for field in Scene.model_fields.values() if field.alias}
    return not difflib.get_close_matches(column.lower(), sorted(keys), n=1, cutoff=ALIKE)


def _from_folder(key: str, value: Any, folder: Path) -> Any:
    """A file next to the job file by its full path, for workers elsewhere; any other value unchanged."""
    names_file = key == "scene" or key.rpartition(".")[2] in FILE_KEYS
    if names_file and isinstance(value, str) and value and (folder / value).is_file():
        return str((folder / value).absolute())
    return value


def _text(value: Any) -> str:
    """A value as TOML writes it. Text of a cell stays as it is, to be read as TOML or as text."""
    if isinstance(value, str):
        return value
    return toml_text(value)


def _check_names(items: Sequence[Item], place: str | Path) -> None:
    seen: set[str] = set()
    for item in items:
        if item.name in seen:
            raise InputError(place, f'two items have the name "{item.name}"', "give each its own, for its results")
        seen.add(item.name)
