"""Depth peeling: every surface that rays along three axes cross, paired into intervals inside the avatar."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.depth import DEFAULT_PIXEL, image_shape, local_avatar
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.kernels.avatar import layers as kernels


@dataclass(frozen=True, eq=False)
class LayeredBuffers:
    """Three orthographic views of one avatar over one region, with all their layers."""

    pixel: float  # [m]
    origin: NDArray[np.float64]  # [m], shape [3]
    size: NDArray[np.float64]  # extent of the region [m], shape [3]
    views: tuple[kernels.LayeredView, ...]  # along x, y, z
    level = kernels.layered_level
    solid_type = kernels.LayeredSolid

    @property
    def device(self) -> wp.Device:
        return self.views[0].ends.device

    @cached_property
    def _counts(self) -> list[NDArray[np.int32]]:
        """Intervals under the pixels of each view; read where they are asked for, as a body in motion needs none."""
        return [view.count.numpy() for view in self.views]

    @property
    def layers(self) -> tuple[int, ...]:
        """Most intervals under a pixel, along x, y, z."""
        return tuple(max(int(count.max()), 0) for count in self._counts)

    @property
    def unbalanced(self) -> int:
        """Pixels, of all three views, whose surfaces do not pair up: the mesh does not enclose a solid."""
        return sum(int((count == kernels.UNBALANCED).sum()) for count in self._counts)

    @property
    def names(self) -> list[str]:
        """The buffers, for people."""
        return [f"{2 * count} layers along {axis}" for axis, count in zip("xyz", self.layers, strict=True)]

    def solid(self) -> kernels.LayeredSolid:
        """The kernels' view of these buffers; valid while this object lives."""
        solid = kernels.LayeredSolid()
        solid.origin = wp.vec3d(*self.origin)
        solid.pixel = self.pixel
        solid.along_x, solid.along_y, solid.along_z = self.views
        return solid


def build_layered_buffers(
    points: Points,
    triangles: Indices,
    lower: Points,
    upper: Points,
    pixel: float = DEFAULT_PIXEL,
    device: wp.DeviceLike = None,
) -> LayeredBuffers:
    """Draws all layers of the avatar's views along x, y and z over the box from ``lower`` to ``upper`` [m].

    Along its own direction each view sees the whole avatar, also what lies outside the box.
    """
    origin, size, local, faces = local_avatar(points, triangles, lower, upper, pixel, device)
    shapes = [image_shape(size[(axis + 1) % 3], size[(axis + 2) % 3], pixel) for axis in range(3)]
    views = [_draw(local, faces, axis, pixel, *shape) for axis, shape in enumerate(shapes)]
    return LayeredBuffers(pixel, origin, size, tuple(views))


def _draw(local: wp.array, faces: wp.array, axis: int, pixel: float, columns: int, rows: int) -> kernels.LayeredView:
    """One view: its surfaces counted, stored, then sorted and paired."""
    device = local.device
    pixels = columns * rows
    count = wp.zeros(pixels + 1, dtype=wp.int32, device=device)  # the last stays 0: there its scan has the total
    nowhere = wp.empty(0, dtype=wp.vec2f, device=device)
    start = wp.empty_like(count)
    image = kernels.LayerImage()
    image.axis, image.pixel, image.columns, image.rows = axis, pixel, columns, rows
    inputs = [local, faces, image, start]
    wp.launch(kernels.draw_layers, dim=len(faces), inputs=[*inputs, False], outputs=[count, nowhere], device=device)
    wp.utils.array_scan(count, start, inclusive=False)
    total = int(start[-1:].numpy()[0])
    surfaces = wp.empty(max(total, 1), dtype=wp.vec2f, device=device)
    count.zero_()
    wp.launch(kernels.draw_layers, dim=len(faces), inputs=[*inputs, True], outputs=[count, surfaces], device=device)
    wp.launch(kernels.pair_layers, dim=pixels, inputs=[start, surfaces, count], device=device)
    view = kernels.LayeredView()
    view.columns, view.rows = columns, rows
    view.start, view.count, view.ends = start, count[:pixels], surfaces
    return view
