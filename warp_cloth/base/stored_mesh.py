"""Meshes kept in the user's cache on disk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from warp_cloth.base.disk_cache import Entry, disk_cache, key_of
from warp_cloth.base.mesh import Mesh

LISTS = ("panel_names", "material_names", "notes")  # of a mesh; tuples, which JSON does not know


def stored_mesh(name: str, packages: tuple[str, ...], make: Callable[[], Mesh], *parts: Any) -> Mesh:
    """The mesh that code of these packages makes of these parts, from the disk where it has been made before.

    Args:
        name: what it is.
        packages: folders of ``warp_cloth``.
        make: makes a mesh without ``folds``.
        parts: what ``make`` depends on, as for ``key_of``.
    """
    return _mesh_of(disk_cache().entry(key_of(name, packages, *parts), lambda: _entry_of(make())))


def _entry_of(mesh: Mesh) -> Entry:
    if mesh.folds is not None:
        raise ValueError("a mesh with folds cannot be stored")
    values = {each.name: getattr(mesh, each.name) for each in fields(mesh)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    return Entry(arrays, {name: value for name, value in values.items() if name not in arrays and value is not None})


def _mesh_of(entry: Entry) -> Mesh:
    values: dict[str, Any] = {name: tuple(value) if name in LISTS else value for name, value in entry.values.items()}
    return Mesh(**{**values, **entry.arrays})
