"""The table of all scene keys in Markdown, written from the schema: scenes/keys.md holds it, a test compares them."""

from __future__ import annotations

import types
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from warp_cloth.material.fabric import Fabric
from warp_cloth.scene.messages import bare_annotation
from warp_cloth.scene.schema import CollisionSpec, Scene, SolverSpec
from warp_cloth.scene.shapes import BodyMeasures, MannequinShape, SphereShape, SquareShape, TshirtShape
from warp_cloth.scene.wearables import AvatarSpec, GarmentSpec, PieceSpec, PinSpec, SeamSpec, Wearable

TABLES: tuple[tuple[str, type[BaseModel]], ...] = (
    ("garment", GarmentSpec),
    ("garment.pin", PinSpec),
    ("garment.seam", SeamSpec),
    ("garment.piece", PieceSpec),
    ("garment.shape", SquareShape),
    ("garment.shape", TshirtShape),
    ("avatar", AvatarSpec),
    ("avatar.shape", SphereShape),
    ("avatar.shape", MannequinShape),
    ("avatar.measures", BodyMeasures),
    ("collision", CollisionSpec),
    ("solver", SolverSpec),
)


def key_lines(wanted: str = "") -> list[str]:
    """Keys whose name contains ``wanted``, as a terminal shows them: values and default, below them the meaning."""
    lines = []
    for row in key_table().splitlines()[2:]:
        key, values, default, meaning = (cell.strip().replace("`", "") for cell in row.strip("|").split("|"))
        if wanted in key:
            lines += [" = ".join(filter(None, (key, values))) + f"  [default: {default}]" * bool(default)]
            lines += [f"    {meaning}"]
    return lines


def keys_called(name: str) -> list[str]:
    """Whole keys whose last part is ``name``: ["garment.size", "garment.shape.size", ...] of "size"."""
    found = (row.split("`")[1] for row in key_table().splitlines() if "`" in row)
    return list(dict.fromkeys(key for key in found if key.rpartition(".")[2] == name))


def key_table() -> str:
    """Every key of a scene file with its values, default and meaning, as one Markdown table."""
    rows = [f"| `name` | string | | {Scene.model_fields['name'].description} |"]
    for table, model in TABLES:
        shared = Wearable.model_fields if table == "avatar" else {}
        kind = model.model_fields.get("kind")
        if kind is not None:
            rows.append(f"| `{table}.kind` | {_values(kind)} | | {_sentence(model.__doc__ or '')} |")
        names = [name for name in model.model_fields if name != "kind" and name not in shared]
        rows += [_row(table, name, model.model_fields[name]) for name in names]
        if shared:
            rows.insert(len(rows) - len(names), f"| `avatar.{'`, `'.join(shared)}` | | | As for the garment. |")
    return "\n".join(["| key | values | default | meaning |", "| --- | --- | --- | --- |", *rows])


def _row(table: str, name: str, field: FieldInfo) -> str:
    key = f"{table}.{name}" if table else name
    cells = f"`{key}`", _values(field), _default(field), _sentence(field.description or "")
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


def _sentence(text: str) -> str:
    return " ".join(text.split())


def _default(field: FieldInfo) -> str:
    """The default as a scene file states it; empty where the meaning says it, or there is none."""
    value: Any = field.get_default(call_default_factory=True)
    if field.is_required() or value is None or value in ((), {}, ""):
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:g}" if isinstance(value, int | float) and abs(value) < 1e5 else str(list(value))


def _values(field: FieldInfo) -> str:
    """What a value may be: strings, bounds, or a type."""
    return _phrase(*bare_annotation(field.annotation), field.metadata)


def _quoted(values: Sequence[Any]) -> str:
    return ", ".join(f'"{value}"' for value in values)


def _phrase(bare: Any, *metadata: Sequence[Any]) -> str:
    if get_origin(bare) is Literal:
        values = get_args(bare)
        sided = [value for value in values if {f"left_{value}", f"right_{value}"} <= {*values}]
        sides = {f"{side}_{value}" for side in ("left", "right") for value in sided}
        both, others = _quoted(sided), _quoted([value for value in values if value not in {*sided, *sides}])
        return f"{both} (also with left_ or right_ before); {others}" if sided else others
    if get_origin(bare) in (Union, types.UnionType):
        return ", ".join(filter(None, (_phrase(*bare_annotation(inner)) for inner in get_args(bare))))
    if bare in (int, float):
        bounds = {n: getattr(m, n) for m in chain(*metadata) for n in ("ge", "gt", "le") if hasattr(m, n)}
        if not bounds or bounds["le"] >= 2**31 - 1:
            return "integer" if bare is int else "number"
        low = f"above {bounds['gt']:g}" if "gt" in bounds else f"{bounds['ge']:g}"
        return f"{low} to {bounds['le']:g}"
    names = {bool: "true, false", str: "string", Path: "file", Fabric: "name, file, table", tuple: "list"}
    return names.get(get_origin(bare) or bare, "")
