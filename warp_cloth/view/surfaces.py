"""What the browser draws: garments as bare vertices, or as glTF files where a map colours them."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.export.surface import Colour
from warp_cloth.view.picture import glb_bytes

FILES = 3  # in turn: one is being read, the one before it is shown, and the one before that until it is
FILE_SECONDS = 0.1  # between two files
READING_SECONDS = 0.3  # that a browser may take to read the last one


@dataclass
class _Surface:
    """The nodes of one surface: vertices in one colour, and files in turn."""

    plain: Any = None
    triangles: Indices | None = None  # of the plain one
    files: list[Any] = field(default_factory=list)
    newest: int = -1  # the file that was written last
    count: int = 0  # of files since the plain one was seen
    written: float | None = None  # when; None: it is all there is to see
    waiting: tuple[Points, Indices, NDArray[np.float64]] | None = None  # what came too soon after it


class Surfaces:
    """Keeps the scene's surfaces as they were last given; draws as little anew as it can.

    A browser takes new vertices where it draws them. A glTF file it must read first, and shows nothing meanwhile: so
    a file is shown when the next one is written, and taken away when the one after that is.
    """

    def __init__(self, server: Any) -> None:
        self._server = server
        self._surfaces: dict[str, _Surface] = {}

    def plain(self, name: str, points: Points, triangles: Indices, colour: Colour, *, closed: bool = False) -> None:
        """Shows a surface in one colour (sRGB, 0..1); of a closed one the inside is never seen."""
        surface = self._surfaces.setdefault(name, _Surface())
        vertices = np.ascontiguousarray(points, dtype=np.float32)
        with self._server.atomic():
            if surface.triangles is None or not np.array_equal(surface.triangles, triangles):
                red, green, blue = (round(255 * part) for part in colour)
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
        """Shows a surface in a colour for each vertex (linear light, shape [V, 3]), as soon as a browser can."""
        surface = self._surfaces.setdefault(name, _Surface())
        surface.waiting = points, triangles, shown
        self._write(name, surface)

    def settle(self) -> bool:
        """Writes and shows what came last, once a browser has had the time to read it; whether all is shown."""
        for name, surface in self._surfaces.items():
            self._write(name, surface)
            if surface.written is not None and time.perf_counter() - surface.written > READING_SECONDS:
                self._show(surface, (surface.newest,))
                surface.written = None
        return all(surface.written is None for surface in self._surfaces.values())

    def _write(self, name: str, surface: _Surface) -> None:
        """Writes what waits into the oldest file, unless that would be too soon."""
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
        """Shows these files and hides all else."""
        with self._server.atomic():
            for index, file in enumerate(surface.files):
                file.visible = index in which
            if surface.plain is not None:
                surface.plain.visible = False
