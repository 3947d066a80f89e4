"""Surfaces in the browser: plain ones as vertices, coloured ones as glTF files (double buffering)."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.export.surface import Colour
from warp_cloth.view.picture import glb_bytes

FILES = 3  # used in rotation: one is being read, the one before it is shown, as is the one before that until then
FILE_SECONDS = 0.1  # between two files, at least
READING_SECONDS = 0.3  # that a browser may need to read a file


@dataclass
class _Surface:
    """The scene nodes of one surface: a plain mesh, and files used in rotation."""

    plain: Any = None
    triangles: Indices | None = None  # of the plain one
    files: list[Any] = field(default_factory=list)
    newest: int = -1  # index of the file written last
    count: int = 0  # files since the plain mesh was shown
    written: float | None = None  # time of the last file [s]; None: it is shown already
    waiting: tuple[Points, Indices, NDArray[np.float64]] | None = None  # a shape that came too soon after that


class Surfaces:
    """Keeps the scene's surfaces up to date, and redraws as little as possible.

    A browser updates vertices in place. A glTF file it must read first, and it shows nothing meanwhile: so a file is
    shown when the next one is written, and hidden when the one after that is.
    """

    def __init__(self, server: Any) -> None:
        self._server = server
        self._surfaces: dict[str, _Surface] = {}

    def plain(self, name: str, points: Points, triangles: Indices, colour: Colour, *, closed: bool = False) -> None:
        """Shows a surface in one colour (sRGB, 0..1); the inside of a ``closed`` one is not drawn."""
        surface = self._surfaces.setdefault(name, _Surface())
        vertices = np.ascontiguousarray(points, dtype=np.float32)
        with self._server.atomic():
            if surface.triangles is None or not np.array_equal(surface.triangles, triangles):
                red, green, blue = (round(255 * channel) for channel in colour)
                surface.plain = self._server.scene.add_mesh_simple(
                    f"/{name}/plain",
                    vertices,
                    triangles.astype(np.uint32),
                    color=(red, green, blue),
                    side="front" if closed else "double",
                )
                surface.triangles = triangles.copy()
            else:
                surface.plain.vertices = vertices
            surface.plain.visible = True
            for file in surface.files:
                file.visible = False
        surface.written = surface.waiting = None
        surface.count = 0

    def coloured(self, name: str, points: Points, triangles: Indices, shown: NDArray[np.float64]) -> None:
        """Shows a surface in a colour per vertex (linear light, shape [V, 3]), as soon as a browser can."""
        surface = self._surfaces.setdefault(name, _Surface())
        surface.waiting = points, triangles, shown
        self._write(name, surface)

    def settle(self) -> bool:
        """Writes and shows the latest shapes, once a browser has had time to read them; whether all are shown."""
        for name, surface in self._surfaces.items():
            self._write(name, surface)
            if surface.written is not None and time.perf_counter() - surface.written > READING_SECONDS:
                self._show(surface, (surface.newest,))
                surface.written = None
        return all(surface.written is None for surface in self._surfaces.values())

    def _write(self, name: str, surface: _Surface) -> None:
        """Writes the waiting shape into the oldest file, unless that would be too soon."""
        now = time.perf_counter()
        if surface.waiting is None or (surface.written is not None and now - surface.written < FILE_SECONDS):
            return
        before, surface.newest = surface.newest, (surface.newest + 1) % FILES
        if surface.written is not None:
            self._show(surface, (before, (before - 1) % FILES)[: surface.count])
        data, surface.waiting, surface.written = glb_bytes(*surface.waiting), None, now
        surface.count += 1
        if len(surface.files) <= surface.newest:
            path = f"/{name}/file_{surface.newest}"
            surface.files.append(self._server.scene.add_glb(path, data, visible=False))
        else:
            with self._server.atomic():
                surface.files[surface.newest].visible = False
                surface.files[surface.newest].glb_data = data

    def _show(self, surface: _Surface, which: tuple[int, ...]) -> None:
        """Shows these files and hides everything else of the surface."""
        with self._server.atomic():
            for index, file in enumerate(surface.files):
                file.visible = index in which
            if surface.plain is not None:
                surface.plain.visible = False
