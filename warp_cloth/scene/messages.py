"""Error messages for scenes: pydantic's findings as one line with the key, its value and what is allowed."""

from __future__ import annotations

import difflib
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError, ValidationError

from warp_cloth.base.errors import InputError

Location = tuple[str | int, ...]


def refusal(problem: str, remedy: str = "", *, below: str = "", place: str = "") -> PydanticCustomError:
    """An error for pydantic to carry to load_scene, which raises it as an InputError.

    ``below`` is the key at fault below the one being validated, ``place`` another file at fault.
    """
    context = {"problem": problem, "remedy": remedy, "below": below, "place": place}
    return PydanticCustomError("refusal", "{problem}", context)


def show(value: Any) -> str:
    """A value as a scene file writes it, shortened and safe to print."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    if value is None:  # of JSON and of Python: TOML has none
        return "null"
    try:
        text = str(list(value)) if isinstance(value, tuple) else str(value)
    except ValueError:  # an integer with more digits than Python converts
        text = "a huge number"
    text = "".join(letter if letter.isprintable() else "?" for letter in text[:60]) + "..." * (len(text) > 60)
    return f'"{text}"' if isinstance(value, str) else text


def listed(names: Iterable[Any]) -> str:
    """The names in quotes, separated by commas."""
    return ", ".join(show(name) for name in names)


def nearest(name: str, names: Iterable[str], ask: str = "did you mean {}?") -> str:
    """``ask`` with the most similar name; empty if none is similar."""
    close = difflib.get_close_matches(name.lower(), list(names), n=1, cutoff=0.6)
    return ask.format(close[0]) if close else ""


def scene_error(
    error: ValidationError, model: type[BaseModel], place: Callable[[str, bool], str], many_garments: bool
) -> InputError:
    """The first error as one line, with the number of further errors.

    ``place(key, with_key)`` is the file or the --set that states a dotted key, followed by the key if wanted.
    """
    found = [detail for detail in error.errors(include_url=False) if not _follows(detail, error)]
    found.sort(key=lambda detail: detail["type"] == "missing")  # a misspelt key also counts as missing
    first = found[0]
    key, allowed, keys = _look_up(model, first["loc"], many_garments)
    problem, remedy = _describe(first, key, allowed, keys, model)
    context = first.get("ctx", {})
    if first["type"].startswith("union_tag"):
        key += ".kind"
    if context.get("below"):
        key += ("." if key else "") + context["below"]
    if len(found) > 1:
        more = f"(and {len(found) - 1} more)"
        problem, remedy = (problem, f"{remedy} {more}") if remedy else (f"{problem} {more}", "")
    names_key = problem.startswith((f"{key} = ", "unknown key " + key)) if key else True
    return InputError(context.get("place") or place(key, not names_key), problem, remedy)


def _follows(detail: ErrorDetails, error: ValidationError) -> bool:
    """Whether this follows from another error: a list whose entries fail counts as empty."""
    return detail["type"] == "too_short" and bool(detail["input"]) and error.error_count() > 1


def _describe(
    detail: ErrorDetails, key: str, allowed: str, keys: Sequence[str], model: type[BaseModel]
) -> tuple[str, str]:
    """Problem and remedy of a pydantic error."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "refusal":
        return str(context["problem"]), str(context["remedy"])
    if kind == "extra_forbidden":
        table = key.rpartition(".")[0] + "." * ("." in key)
        name = str(detail["loc"][-1])
        close = nearest(name, keys, ask=f"did you mean {table}{{}}?") or _elsewhere(name, model)
        return f"unknown key {key}", " ".join(filter(None, (close, f"allowed there: {', '.join(keys)}")))
    if kind == "missing":
        return "is missing", f"give {allowed}" if allowed else ""
    if kind in ("too_short", "string_too_short") and not value:
        return "is empty", f"give {allowed}" if allowed else "give at least one"
    if kind in ("too_long", "string_too_long") and not allowed.startswith("a list of"):  # which says how many
        unit = "letters" if isinstance(value, str) else "entries"
        return f"has {len(value):,} {unit}; at most {context['max_length']} are taken", ""
    if kind == "union_tag_not_found":
        return "is missing", f"give one of {_tags(context)}"
    if kind == "union_tag_invalid":
        return f"unknown kind {show(context['tag'])}", f"use one of {_tags(context)}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"must be a table, not {show(value)}", ""
    close = nearest(value, allowed.split('"')[1::2]) if kind == "literal_error" and isinstance(value, str) else ""
    return f"must be {allowed}, not {show(value)}" if allowed else f"{show(value)} is not allowed", close


def _elsewhere(name: str, model: type[BaseModel]) -> str:
    """Suggests the tables of a scene that have a key of this name, or one like it; empty if none does."""
    homes: dict[str, list[str]] = {}
    for table, field in _fields(model).items():
        for key in dict.fromkeys(key for inner in _tables(field.annotation) for key in _fields(inner)):
            homes.setdefault(key, []).append(f"{table}.{key}")
    close = [name] if name in homes else difflib.get_close_matches(name.lower(), homes, n=1, cutoff=0.75)
    return f"did you mean {' or '.join(homes[close[0]])}?" if close else ""


def _tags(context: Mapping[str, Any]) -> str:
    return str(context.get("expected_tags", '"square", "tshirt", "sphere", "mannequin"')).replace("'", '"')


def _look_up(model: type[BaseModel], location: Location, many_garments: bool) -> tuple[str, str, tuple[str, ...]]:
    """Dotted key of a pydantic location, what is allowed there, and the keys of its table."""
    tables, key, allowed = [model], "", ""
    keys: tuple[str, ...] = ()
    annotation: Any = None
    metadata: list[Any] = []
    for part in location:
        if isinstance(part, int):
            key += f"[{part}]" if key != "garment" or many_garments else ""
            annotation, metadata = _entry(annotation, part)
            allowed = _allowed(annotation, metadata)
            continue
        chosen = [table for table in tables if _tag(table) == part]
        if chosen:  # pydantic's location includes the kind of a shape; a scene has no such key
            tables = chosen
            continue
        named, _ = bare_annotation(annotation)
        if get_origin(named) in (Mapping, dict):
            annotation, metadata = bare_annotation(get_args(named)[1])
            tables = _tables(annotation)
            key, allowed = f"{key}.{part}", _allowed(annotation, metadata)
            continue
        keys = tuple(name for table in tables for name in _fields(table))
        key += ("." if key else "") + part
        field = next((_fields(table)[part] for table in tables if part in _fields(table)), None)
        if field is None:
            return key, "", keys
        annotation, metadata = field.annotation, list(field.metadata)
        allowed = _allowed(annotation, metadata)
        tables = _tables(annotation)
    return key, allowed, keys


def _fields(table: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in table.model_fields.items()}


def _tag(table: type[BaseModel]) -> str | None:
    field = table.model_fields.get("kind")
    return get_args(field.annotation)[0] if field else None


def _tables(annotation: Any) -> list[type[BaseModel]]:
    """The tables in an annotation, at any depth."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for inner in get_args(annotation) for table in _tables(inner)]


def _entry(annotation: Any, index: int) -> tuple[Any, list[Any]]:
    """Annotation and metadata of a tuple's entry."""
    bare, _ = bare_annotation(annotation)
    entries = get_args(bare)
    if get_origin(bare) is not tuple or not entries:
        return None, []
    entry = entries[0] if entries[-1] is Ellipsis else entries[min(index, len(entries) - 1)]
    return bare_annotation(entry)


def bare_annotation(annotation: Any) -> tuple[Any, list[Any]]:
    """An annotation without ``Annotated`` and ``| None``, and the metadata of these."""
    metadata: list[Any] = []
    while True:
        if get_origin(annotation) is Annotated:
            annotation, *more = get_args(annotation)
            metadata += [m for item in more for m in (item.metadata if isinstance(item, FieldInfo) else [item])]
        elif get_origin(annotation) in (Union, types.UnionType):
            kept = [inner for inner in get_args(annotation) if inner is not type(None)]
            if len(kept) != 1:
                return annotation, metadata
            annotation = kept[0]
        else:
            return annotation, metadata


def _allowed(annotation: Any, metadata: list[Any]) -> str:
    """What a value may be, as a phrase."""
    bare, more = bare_annotation(annotation)
    if get_origin(bare) is Literal:
        return "one of " + listed(get_args(bare))
    if bare is bool:
        return "true or false"
    if bare is str:
        return "a string"
    if bare in (int, float):
        return ("an integer" if bare is int else "a number") + _range([*metadata, *more])
    if get_origin(bare) is tuple:
        entries = get_args(bare)
        if entries[-1] is not Ellipsis:
            return f"a list of {len(entries)}, each {_allowed(entries[0], [])}"
        return "a list" if not _tables(bare) else "a table, or a list of tables"
    return "a table" if _tables(bare) else ""


def _range(metadata: Sequence[Any]) -> str:
    bounds = {name: getattr(m, name) for m in metadata for name in ("ge", "gt", "le") if hasattr(m, name)}
    lowest = f" above {bounds['gt']:.10g}" if "gt" in bounds else f" from {bounds['ge']:.10g}" if "ge" in bounds else ""
    return lowest + (f" to {bounds['le']:.10g}" if "le" in bounds else "") if lowest else ""
