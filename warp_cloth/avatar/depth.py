"""Depth buffers of the avatar: front, back and top views, drawn on the device over a region."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.kernels.avatar.depth import DepthSolid, extend_silhouette, sample_level, sample_plain, solid_level
from warp_cloth.kernels.avatar.raster import View, draw_depth

DEFAULT_PIXEL = 0.002  # [m]; fine enough for 0.2 mm on rounded limbs, 0.2 million pixels for a T-shirt
MOST_PIXELS = 2**27  # 512 MiB of float32 in each of five images
TOO_FINE = "set a larger pixel, or check the units of garment and avatar"
DEFAULT_REACH = 0.01  # [m]; contact happens at the offset, 3 mm: the rest is for the displacement of a step


def sampled(kernel: wp.Kernel, collider: object, points: Points, device: wp.DeviceLike) -> NDArray[np.float32]:
    """Runs a sampling kernel at points [m], shape [N, 3]: unit normal and signed distance [m], shape [N, 4]."""
    queries = wp.array(np.ascontiguousarray(points), dtype=wp.vec3d, device=device)
    found = wp.empty(len(queries), dtype=wp.vec4f, device=device)
    wp.launch(kernel, dim=len(queries), inputs=[collider, queries], outputs=[found], device=device)
    return found.numpy()


@dataclass(frozen=True, eq=False)
class PlainCollider:
    """The paper's query in depth buffers, not baked into a field."""

    solid: DepthSolid
    reach: float  # [m]
    bytes: int  # memory that queries read

    def sample(self, points: Points) -> NDArray[np.float32]:
        """Unit normal and signed distance at points [m], shape [N, 3]; shape [N, 4]. Far ones have no normal."""
        return sampled(sample_plain, self.solid, points, self.solid.front.device)


@dataclass(frozen=True, eq=False)
class DepthBuffers:
    """Three orthographic depth buffers of one avatar over one region; pixel (0, 0) is centred at ``origin``.

    Depths are float32, relative to ``origin``, along each view's direction to the viewer; empty pixels -inf.
    """

    pixel: float  # [m]
    origin: NDArray[np.float64]  # [m], shape [3]
    size: NDArray[np.float64]  # extent of the region [m], shape [3]
    front: wp.array  # greatest z [m], shape [rows along y, columns along x]
    back: wp.array  # greatest -z [m], same shape
    top: wp.array  # greatest y [m], shape [rows along z, columns along x]
    middle: wp.array  # mean of front and back surface, extended past the silhouette [m]
    bulge: wp.array  # half thickness squared, negative past the silhouette [m2]
    level = solid_level
    solid_type = DepthSolid

    @property
    def device(self) -> wp.Device:
        return self.front.device

    @property
    def names(self) -> list[str]:
        """The buffers, for people."""
        return ["front", "back", "top"]

    def solid(self) -> DepthSolid:
        """The kernels' view of these buffers; valid while this object lives."""
        solid = DepthSolid()
        solid.origin = wp.vec3d(*self.origin)
        solid.pixel = self.pixel
        solid.front, solid.back, solid.top = self.front, self.back, self.top
        solid.middle, solid.bulge = self.middle, self.bulge
        return solid

    def plain(self, reach: float = DEFAULT_REACH) -> PlainCollider:
        """The paper's own query in these buffers, to a distance of ``reach`` [m]; valid while this object lives."""
        solid = self.solid()
        solid.reach = reach
        return PlainCollider(solid, reach, sum(view.capacity for view in (self.front, self.back, self.top)))

    def levels(self, points: Points) -> NDArray[np.float32]:
        """Positive inside the solid that the buffers enclose, negative outside [m], shape [N]."""
        queries = wp.array(np.ascontiguousarray(points), dtype=wp.vec3d, device=self.device)
        found = wp.empty(len(queries), dtype=wp.float32, device=self.device)
        wp.launch(sample_level, dim=len(queries), inputs=[self.solid(), queries], outputs=[found], device=self.device)
        return found.numpy()


def contact_bounds(garment: Points, avatar: Points, margin: float) -> tuple[Points, Points]:
    """The region where they may collide: the intersection of both boxes, widened by ``margin``.

    All [m]; ``garment`` and ``avatar`` shape [N, 3], each corner returned shape [3].
    """
    lower = np.maximum(garment.min(axis=0), avatar.min(axis=0)) - margin
    upper = np.minimum(garment.max(axis=0), avatar.max(axis=0)) + margin
    return np.minimum(lower, upper), np.maximum(lower, upper)


def image_shape(width: float, height: float, pixel: float) -> tuple[int, int]:
    """Columns and rows of a view of this size [m]; raises InputError for an image that would fill all memory."""
    columns, rows = math.ceil(width / pixel) + 1, math.ceil(height / pixel) + 1
    if columns * rows > MOST_PIXELS:
        raise InputError("collision.pixel_mm", f"a depth buffer would have {columns:,} x {rows:,} pixels", TOO_FINE)
    return columns, rows


def local_avatar(
    points: Points, triangles: Indices, lower: Points, upper: Points, pixel: float, device: wp.DeviceLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], wp.array, wp.array]:
    """A box's origin and size [m], and the avatar's vertices relative to it [m] and triangles, on the device."""
    origin = np.asarray(lower, dtype=np.float64)
    size = np.maximum(np.asarray(upper, dtype=np.float64) - origin, pixel)
    local = wp.array((points - origin).astype(np.float32), dtype=wp.vec3f, device=device)
    return origin, size, local, wp.array(triangles, dtype=wp.int32, device=device)


def build_depth_buffers(
    points: Points,
    triangles: Indices,
    lower: Points,
    upper: Points,
    pixel: float = DEFAULT_PIXEL,
    device: wp.DeviceLike = None,
) -> DepthBuffers:
    """Draws the avatar's front, back and top views over the box from ``lower`` to ``upper`` [m].

    Along its own direction each view sees the whole avatar, also what lies outside the box.
    """
    origin, size, local, faces = local_avatar(points, triangles, lower, upper, pixel, device)
    columns, rows = image_shape(size[0], size[1], pixel)
    _, layers = image_shape(size[0], size[2], pixel)
    x, y, z = wp.vec3f(1.0, 0.0, 0.0), wp.vec3f(0.0, 1.0, 0.0), wp.vec3f(0.0, 0.0, 1.0)

    def draw(up: wp.vec3f, toward: wp.vec3f, row_count: int) -> wp.array:
        view = View()
        view.right, view.up, view.toward = x, up, toward
        view.pixel, view.columns, view.rows = pixel, columns, row_count
        depth = wp.full((row_count, columns), -np.inf, dtype=wp.float32, device=device)
        wp.launch(draw_depth, dim=len(triangles), inputs=[local, faces, view], outputs=[depth], device=device)
        return depth

    front, back, top = draw(y, z, rows), draw(y, wp.vec3f(0.0, 0.0, -1.0), rows), draw(z, y, layers)
    middle, bulge = wp.empty_like(front), wp.empty_like(front)
    wp.launch(extend_silhouette, dim=front.shape, inputs=[front, back], outputs=[middle, bulge], device=device)
    return DepthBuffers(pixel, origin, size, front, back, top, middle, bulge)
