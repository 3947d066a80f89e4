"""Grain: the direction of the warp in a garment's panels, by angles or by the colours of an image."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh

# 360 degrees of hue are 180 of the warp, whose two ends are alike: red 0, yellow 30, green 60, cyan 90,
# blue 120 and magenta 150 degrees. Below this saturation (of 255) a colour has no hue to speak of: 0 degrees.
DEGREES_PER_TURN = 180.0
LEAST_SATURATION = 26


@dataclass(frozen=True)
class Grain:
    """How far the warp is turned from the panels' +v, counter-clockwise as the panels are drawn [degrees].

    An image rotates it further, triangle by triangle, by the colour at its middle; it covers all texture coordinates,
    its top at their highest v.
    """

    degrees: float = 0.0
    panels: Mapping[str, float] = field(default_factory=dict)  # of single panels, by name, instead
    texture: Path | None = None

    def of_triangles(self, mesh: Mesh, key: str) -> NDArray[np.float64]:
        """The angle of each triangle [rad], shape [F]. ``key`` is the garment's scene table, for messages.

        Raises:
            InputError: it names a panel that the mesh lacks, or an image that cannot be used.
        """
        degrees = np.full(len(mesh.triangles), self.degrees)
        for name, angle in self.panels.items():
            if mesh.panels is None or name not in mesh.panel_names:
                known = f"there are {', '.join(mesh.panel_names)}" if mesh.panel_names else "it has no named panels"
                raise InputError(f"{key}.grain_panels", f'the mesh has no panel "{name}"', known)
            degrees[mesh.panels == mesh.panel_names.index(name)] = angle
        if self.texture is not None:
            degrees = degrees + self._painted(mesh, self.texture, key)
        return np.radians(degrees)

    def _painted(self, mesh: Mesh, path: Path, key: str) -> NDArray[np.float64]:
        if mesh.texcoords is None:
            raise InputError(f"{key}.grain_texture", "the mesh has no texture coordinates", "use grain_degrees")
        from PIL import Image  # which few garments need

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about damage outside the pixels, such as in metadata
                with Image.open(path) as image:
                    colours = np.asarray(image.convert("RGB").convert("HSV"), dtype=np.float64)
        except (Exception, MemoryError) as error:  # a damaged file makes Pillow raise anything
            problem = getattr(error, "strerror", None) or "is not a readable image"
            raise InputError(path, problem, "give a PNG whose hue is the direction of the warp") from None
        low, high = mesh.texcoords.min(axis=(0, 1)), mesh.texcoords.max(axis=(0, 1))
        place = (mesh.texcoords.mean(axis=1) - low) / np.maximum(high - low, np.finfo(float).tiny)
        size = np.array([colours.shape[1], colours.shape[0]])
        pixel = np.minimum((place * size).astype(int), size - 1)
        hue, saturation, _ = colours[size[1] - 1 - pixel[:, 1], pixel[:, 0]].T
        return np.where(saturation < LEAST_SATURATION, 0.0, hue / 255.0 * DEGREES_PER_TURN)
