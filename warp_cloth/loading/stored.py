"""Meshes of files, from the user's cache on disk where a file of this content has been loaded before."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from warp_cloth.base import mesh_formats
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.stored_mesh import stored_mesh
from warp_cloth.loading.load import content, load_mesh

SMALLEST, LARGEST = 1 << 17, 1 << 26  # [bytes] of a file: others are read in no time, or are too large to be kept
PACKAGES = ("loading", "base")  # whose code a mesh depends on


def load_mesh_once(path: Path, **named: Any) -> Mesh:
    """``load_mesh``, from the disk where it has loaded the same before; arguments and errors are those."""
    path = Path(path)
    try:
        worth_it = path.suffix.lower() in mesh_formats.PLAIN and SMALLEST <= os.stat(path).st_size <= LARGEST
    except (OSError, ValueError):  # told when it is read
        worth_it = False
    if not worth_it:
        return load_mesh(path, **named)
    data = content(path)
    parts = hashlib.blake2b(data).hexdigest(), str(path), sorted(named.items())
    return stored_mesh("loaded", PACKAGES, lambda: load_mesh(path, **named, data=data), *parts)
