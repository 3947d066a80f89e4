"""Contact fields kept in the user's cache on disk, with the audit that chose them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.field import FieldBuild
from warp_cloth.base.disk_cache import Entry, disk_cache, key_of

PACKAGES = ("avatar", "kernels/avatar", "kernels/math", "kernels/base", "base")  # whose code a field depends on
FIGURES = ("spacing", "reach", "steepest", "beyond")  # of a FieldBuild


@dataclass(frozen=True, eq=False)
class StoredField:
    """A field, how many coarser drawings were not accurate enough, and the report on it."""

    field: FieldBuild
    rejected: int
    report: dict[str, Any]


def field_key(*parts: Any) -> str:
    """The key of a field that depends on these parts, as for ``key_of``."""
    return key_of("field", PACKAGES, wp.config.version, *parts)


def read_field(key: str, device: str) -> StoredField | None:
    """The field of a key, on a device; None where it is not known."""
    entry = disk_cache().read(key)
    if entry is None:
        return None
    arrays = entry.arrays
    nodes = np.full(arrays["shape"], arrays["far"][0])
    nodes.reshape(-1)[np.unpackbits(arrays["is_near"], count=nodes.size).view(np.bool_)] = arrays["near"]
    values = wp.array(nodes, dtype=wp.float32, device=device)
    figures = {name: entry.values[name] for name in FIGURES}
    field = FieldBuild.of(values, arrays["origin"], **figures)
    return StoredField(field, entry.values["rejected"], entry.values["report"])


def write_field(key: str, stored: StoredField) -> None:
    """Keeps a field: the nodes that differ from the first one, which is far from the body as most are."""
    field = stored.field
    nodes = field.values.numpy()
    flat = nodes.reshape(-1)
    is_near = flat.view(np.uint32) != flat[:1].view(np.uint32)  # by bits
    arrays = {
        "shape": np.array(nodes.shape),
        "far": flat[:1],
        "is_near": np.packbits(is_near),
        "near": flat[is_near],
        "origin": field.origin,
    }
    figures = {name: getattr(field, name) for name in FIGURES}
    disk_cache().write(key, Entry(arrays, {**figures, "rejected": stored.rejected, "report": stored.report}))
