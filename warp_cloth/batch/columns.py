"""The job's own columns in a batch's results: as they were given, numbers as numbers."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from warp_cloth.base.toml_file import toml_text
from warp_cloth.batch.jobs import Item
from warp_cloth.batch.rows import COLUMNS

if TYPE_CHECKING:
    import pyarrow

NUMBER = re.compile(r"-?(0|[1-9][0-9]{0,17})(\.[0-9]+)?([eE][-+]?[0-9]{1,2})?")


def with_columns(table: pyarrow.Table, items: Sequence[Item]) -> pyarrow.Table:
    """The table with the job's own columns after the names; those of numbers as numbers."""
    rows = [item.columns for item in items]
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in COLUMNS]
    for place, name in enumerate(names, start=1):
        table = table.add_column(place, name, _column([row.get(name) for row in rows]))
    return table


def _column(values: Sequence[Any]) -> pyarrow.Array:
    """Values as numbers or booleans, where all that are given are, else as text."""
    import pyarrow as arrow

    read = [_read(value) if isinstance(value, str) else value for value in values]
    given = {type(value) for value in read if value is not None}
    for kinds, kind in (({bool}, arrow.bool_()), ({int}, arrow.int64()), ({int, float}, arrow.float64())):
        if given and given <= kinds:
            with contextlib.suppress(OverflowError, arrow.ArrowException):  # an integer of many digits
                return arrow.array(read, type=kind)
    texts = [value if value is None or isinstance(value, str) else toml_text(value) for value in values]
    return arrow.array(texts, type=arrow.string())


def _read(text: str) -> str | int | float | bool:
    """The number or truth value that a text writes, or else the text: 007 is a name."""
    if text in ("true", "false"):
        return text == "true"
    if NUMBER.fullmatch(text) is None:
        return text
    return float(text) if set(text) & set(".eE") else int(text)
