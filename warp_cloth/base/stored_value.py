"""Values derived from meshes, kept in the user's cache on disk: dataclasses of this package, arrays and numbers."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.disk_cache import Entry, disk_cache, key_of
from warp_cloth.base.mesh import Mesh

T = TypeVar("T")

PACKAGE = __name__.partition(".")[0]
NOT_OURS = (KeyError, IndexError, TypeError, ValueError, AttributeError, ImportError)  # what else a file may lead to
SMALLEST = 2000  # vertices or hinges of a mesh; of fewer all is derived in no time


def stored_value(name: str, packages: tuple[str, ...], make: Callable[[Mesh], T], mesh: Mesh) -> T:
    """``make(mesh)``, of a mesh's points and triangles alone, from the disk where it has been made of these before.

    ``name``, ``packages``: as for ``stored``.
    """
    if mesh.vertex_count < SMALLEST:
        return make(mesh)
    return stored(name, packages, partial(make, mesh), mesh.points, mesh.triangles)


def stored(name: str, packages: tuple[str, ...], make: Callable[[], T], *parts: Any) -> T:
    """``make()``, from the disk where it has been made of these parts before.

    Args:
        name: what it is.
        packages: folders of ``warp_cloth`` on whose code it depends.
        make: what makes it.
        parts: what else it depends on, as for ``key_of``.
    """
    key, cache = key_of(name, packages, *parts), disk_cache()
    found = cache.read(key)
    if found is not None:
        with contextlib.suppress(*NOT_OURS):
            value: T = _unfolded(found.values["value"], found.arrays)
            return value
    made = make()
    arrays: dict[str, NDArray[Any]] = {}
    folded = _folded(made, arrays)
    cache.write(key, Entry(arrays, {"value": folded}))
    return made


def _folded(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """A value as JSON knows it, its arrays put into ``arrays``.

    Raises:
        TypeError: it holds something else than dataclasses, tuples, dictionaries by strings, frozen sets of integers,
            arrays and plain values.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) is tuple:
        return ["tuple", *(_folded(each, arrays) for each in value)]
    if type(value) is dict and all(type(key) is str for key in value):
        return ["dict", list(value), *(_folded(each, arrays) for each in value.values())]
    if type(value) is frozenset and all(type(each) is int for each in value):
        return ["set", *sorted(value)]
    if isinstance(value, np.ndarray | np.generic):
        name = f"{len(arrays)}"
        arrays[name] = np.asarray(value)
        return ["array" if isinstance(value, np.ndarray) else "number", name]
    kind = type(value)
    if is_dataclass(value) and kind.__module__.startswith(f"{PACKAGE}."):
        return [
            "data",
            kind.__module__,
            kind.__name__,
            *(_folded(getattr(value, f.name), arrays) for f in fields(value)),
        ]
    raise TypeError(f"a {kind.__name__} cannot be stored")


def _unfolded(folded: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """The value that was folded; nothing but dataclasses of this package is called.

    Raises:
        one of NOT_OURS: it was folded by somebody else.
    """
    if not isinstance(folded, list):
        return folded
    kind, *inner = folded
    if kind == "array":
        return arrays[inner[0]]
    if kind == "number":
        return arrays[inner[0]][()]
    if kind == "set":
        return frozenset(inner)
    if kind == "tuple":
        return tuple(_unfolded(each, arrays) for each in inner)
    if kind == "dict":
        return dict(zip(inner[0], (_unfolded(each, arrays) for each in inner[1:]), strict=True))
    module, name, *values = inner
    if kind != "data" or not module.startswith(f"{PACKAGE}."):
        raise ValueError(f"{module} is not of this package")
    own = getattr(import_module(module), name)
    if not (isinstance(own, type) and is_dataclass(own)):
        raise ValueError(f"{name} is no dataclass")
    return own(*(_unfolded(each, arrays) for each in values))
