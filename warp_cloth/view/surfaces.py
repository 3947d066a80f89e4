"""What the browser draws: garments as bare vertices, or as glTF files where a map colours them."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.export.surface import Colour
from warp_cloth.mesh import Indices, Points
from warp_cloth.view.picture import glb_bytes

READING_SECONDS = 0.15  # that a browser may take to read a glTF file before it is shown


@dataclass
class _Surface:
    """The nodes of one surface: vertices in one colour, and two files in turn."""

    plain: Any = None
    files: list[Any] = field(default_factory=list)
    back: int = 0  # which file is written next
    written: float | None = None  # when the file behind was; None: it is shown already
    triangles: Indices | None = None


class Surfaces:
    """Keeps the scene's surfaces as they were last given; draws as little anew as it can.

    A browser takes new vertices where it draws them. A glTF file it must read first, and shows nothing meanwhile: so
    there are two, and the one just read is shown while the next is written.
    """

    def __init__(self, server: Any) -> None:
        self._server = server
        self._surfaces: dict[str, _Surface] = {}

    def plain(self, name: str, points: Points, triangles: Indices, colour: Colour) -> None:
        """Shows a surface in one colour (sRGB, 0..1)."""
        surface = self._surfaces.setdefault(name, _Surface())
        vertices = np.ascontiguousarray(points, dtype=np.float32)
        with self._server.atomic():
            if surface.triangles is None or not np.array_equal(surface.triangles, triangles):
                red, green, blue = (round(255 * part) for part in colour)
                surface.plain = self._server.scene.add_mesh_simple(
                    f"/{name}/plain", vertices, triangles.astype(np.uint32), color=(red, green, blue), side="double"
                )
                surface.triangles = triangles.copy()
            else:
                surface.plain.vertices = vertices
            surface.plain.visible = True
            for file in surface.files:
                file.visible = False
        surface.written = None

    def coloured(self, name: str, points: Points, triangles: Indices, shown: NDArray[np.float64]) -> None:
        """Shows a surface in a colour for each vertex (linear light, shape [V, 3]) once the browser has read it."""
        surface = self._surfaces.setdefault(name, _Surface())
        self._swap(surface)
        data = glb_bytes(points, triangles, shown)
        if len(surface.files) < 2:
            path = f"/{name}/file_{len(surface.files)}"
            surface.back = len(surface.files)
            surface.files.append(self._server.scene.add_glb(path, data, visible=False))
        else:
            surface.files[surface.back].glb_data = data
        surface.written = time.perf_counter()

    def settle(self) -> bool:
        """Shows what was written last, once a browser has had the time to read it; whether all is shown."""
        waiting = [s for s in self._surfaces.values() if s.written is not None]
        for surface in waiting:
            if surface.written is not None and time.perf_counter() - surface.written > READING_SECONDS:
                self._swap(surface)
        return not any(surface.written is not None for surface in waiting)

    def _swap(self, surface: _Surface) -> None:
        """Shows the file behind in place of whatever is shown."""
        if surface.written is None:
            return
        with self._server.atomic():
            for index, file in enumerate(surface.files):
                file.visible = index == surface.back
            if surface.plain is not None:
                surface.plain.visible = False
        surface.back = 1 - surface.back
        surface.written = None
