"""Meshes that a caller holds in memory are written to a file, once: all else knows of files only."""

from __future__ import annotations

import functools
import hashlib
import tempfile
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError


class MeshLike(Protocol):
    """A mesh, as trimesh has it."""

    vertices: Any  # [m] or another unit, shape [V, 3]
    faces: Any  # shape [F, 3]


Held = MeshLike | tuple[Any, Any]  # a mesh in memory, or its vertices and faces

MOST_BYTES = 4 << 30
WANTED = "give vertices, shape [V, 3], and faces, shape [F, 3]"


def in_file(value: Any, name: str, stem: str = "mesh") -> Any:
    """The file of a mesh that is held in memory; anything else unchanged.

    Args:
        value: an object with ``vertices`` and ``faces``, as trimesh has them, or a tuple of these; texture coordinates
            in ``visual.uv``, one for each vertex, are its panels.
        name: of the argument, for messages.
        stem: of the file's name.

    Raises:
        InputError: the arrays are no mesh.
    """
    if isinstance(value, tuple) and len(value) == 2:
        vertices, faces, uv = *value, None
    elif is_held(value):
        vertices, faces, uv = value.vertices, value.faces, getattr(getattr(value, "visual", None), "uv", None)
    else:
        return value
    points = _array(vertices, name, "vertices", (3,), np.float64)
    corners = _array(faces, name, "faces", (3, 4), np.int64)
    drawn = None if uv is None else _array(uv, name, "texture coordinates", (2,), np.float64)
    if drawn is not None and len(drawn) != len(points):
        raise InputError(name, f"{len(drawn)} texture coordinates for {len(points)} vertices", "give one for each")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        wrong = corners.min() if corners.min() < 0 else corners.max()
        raise InputError(name, f"a face names vertex {wrong} of {len(points)}", "count vertices from 0")
    return _written(_obj(points, corners, drawn), stem)


def is_held(value: Any) -> bool:
    """Whether a value is a mesh in memory."""
    return hasattr(value, "vertices") and hasattr(value, "faces")


def _array(values: Any, name: str, what: str, widths: tuple[int, ...], kind: type) -> NDArray[Any]:
    try:
        array = np.asarray(values)
        is_number = np.issubdtype(array.dtype, np.integer if kind is np.int64 else np.number)
    except ValueError:
        raise InputError(name, f"its {what} are no array", WANTED) from None
    if array.ndim != 2 or array.shape[1] not in widths or not (is_number or not array.size):
        raise InputError(name, f"its {what} are of shape {list(array.shape)}, {array.dtype}", WANTED)
    return array.astype(kind)


def _obj(points: NDArray[np.float64], corners: NDArray[np.int64], uv: NDArray[np.float64] | None) -> bytes:
    """The text of an OBJ file from which the same float64 are read."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [] if uv is None else [f"vt {u!r} {v!r}" for u, v in uv.tolist()]
    corner = "{0}" if uv is None else "{0}/{0}"
    lines += ["f " + " ".join(corner.format(vertex + 1) for vertex in face) for face in corners.tolist()]
    return "\n".join([*lines, ""]).encode()


def _written(text: bytes, stem: str) -> Path:
    """A file of this text, the same one for the same text, which caches know again."""
    folder = Path(_folder().name)
    path = folder / hashlib.sha256(text).hexdigest()[:16] / f"{stem}.obj"
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(text)
        _trim(folder)
    return path


def _trim(folder: Path) -> None:
    """Removes the oldest files, down to half of MOST_BYTES, where there are more: a process may go on for days."""
    files = sorted(((each.stat(), each) for each in folder.glob("*/*")), key=lambda found: -found[0].st_mtime_ns)
    held = np.cumsum([found.st_size for found, _ in files])
    if held[-1] > MOST_BYTES:
        for _, path in files[max(int(np.searchsorted(held, MOST_BYTES // 2)), 1) :]:
            path.unlink()


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """A folder that goes with this process."""
    return tempfile.TemporaryDirectory(prefix="warp_cloth_meshes_")
