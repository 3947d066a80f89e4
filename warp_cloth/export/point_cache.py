"""Intermediate shapes as point caches (PC2), which follow a mesh of the same vertices in most 3-D programs.

Own code: no kept library on the package index writes PC2, or Alembic. The format is a header of 32 bytes and positions.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.trims import TRIMS
from warp_cloth.export.files import whole_file
from warp_cloth.export.surface import require_sound
from warp_cloth.model.result import WornGarment

HEADER = struct.Struct("<12siiffi")  # signature, version, points, first frame, frames from sample to sample, samples
SIGNATURE, VERSION = b"POINTCACHE2\0", 1
FIRST_FRAME = 1.0  # as in a stage
BODY = "avatar"  # in the name of the body's file


def write_point_caches(
    path: Path, *, garments: Sequence[WornGarment], others: Mapping[str, NDArray[np.float32]] = MappingProxyType({})
) -> list[Path]:
    """Writes the frames of each garment [m], y up, float32 shape [N, V, 3] after the header; returns their paths.

    These are ``path`` with the garment's name added to its stem. A garment without frames has its worn shape only.
    Its trims, an object of their own in other files, have a cache of their own. ``others`` are frames of other meshes
    by name.
    """
    require_sound(garments, None)
    shapes = {}
    for worn in garments:
        shapes[worn.name] = cloth = worn.points[None] if worn.frames is None else worn.frames
        if worn.trims is not None:
            shapes[f"{worn.name}_{TRIMS}"] = np.stack([worn.trims.at(points) for points in cloth])
    paths = []
    for name, frames in {**others, **shapes}.items():
        target = path.with_name(f"{path.stem}_{name}.pc2")
        with whole_file(target) as place, place.open("wb") as file:
            file.write(HEADER.pack(SIGNATURE, VERSION, frames.shape[1], FIRST_FRAME, 1.0, len(frames)))
            file.write(np.ascontiguousarray(frames, dtype="<f4").tobytes())
        paths.append(target)
    return paths
