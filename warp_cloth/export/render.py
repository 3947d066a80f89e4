"""Renders garments and avatar to an image in linear light, with Warp kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.compiling import load_modules
from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.export.surface import AVATAR_COLOUR, cloth_colour, in_bytes, linear, trim_colour, winds_outward
from warp_cloth.export.taps import OCCLUSION_STEPS, occlusion_taps, shadow_taps
from warp_cloth.kernels.avatar.raster import View, draw_depth, draw_triangle_ids
from warp_cloth.kernels.picture.shading import (
    Appearance,
    Surface,
    cast_shadows,
    light_pixels,
    resolve_pixels,
    sample_surface,
)
from warp_cloth.model.result import WornGarment

Vector = NDArray[np.float64]

SUPERSAMPLING = 2
INSIDE_REFLECTANCE = 0.6  # of a garment's inside, relative to its outside
UP = np.array((0.0, 1.0, 0.0))
KEY_LIGHT = (-0.50, 0.65, 0.65)  # direction to the light in a view's axes (right, up, toward): all views are lit alike
FILL_LIGHT = (0.80, 0.10, 0.45)


@dataclass(frozen=True)
class Subject:
    """Everything in the picture as one mesh on the device."""

    points: wp.array  # float32 [m], shape [V]
    normals: wp.array  # shape [V]
    triangles: wp.array  # shape [F, 3]
    owners: wp.array  # index into appearances of each triangle, shape [F]
    appearances: wp.array
    colours: wp.array  # reflectance in linear light, shape [V]
    low: Vector  # corners of the bounding box [m]
    high: Vector
    device: str

    @property
    def centre(self) -> Vector:
        return (self.low + self.high) / 2

    @property
    def extent(self) -> Vector:
        return self.high - self.low

    def painted(self, colours: Sequence[NDArray[np.float64]]) -> Subject:
        """A copy with the garments in these sRGB colours, shape [V, 3] each; the avatar keeps its own."""
        own = linear(np.concatenate(colours)).astype(np.float32)
        others = self.colours.numpy()[len(own) :]
        return replace(self, colours=wp.array(np.concatenate([own, others]), dtype=wp.vec3f, device=self.device))


def build_subject(garments: Sequence[WornGarment], avatar: Mesh | None, device: str) -> Subject:
    """Garments and avatar joined into one subject."""
    parts = [
        (worn.points, worn.mesh.triangles, np.tile(cloth_colour(index), (len(worn.points), 1)), INSIDE_REFLECTANCE)
        for index, worn in enumerate(garments)
    ]
    if avatar is not None:
        parts.append((avatar.points, avatar.triangles, np.tile(AVATAR_COLOUR, (len(avatar.points), 1)), 1.0))
    for index, worn in enumerate(garments):
        if worn.trims is not None:
            points, colour = worn.trims.at(worn.points), trim_colour(index)
            parts.append((points, worn.trims.triangles, np.tile(colour, (len(points), 1)), 1.0))
    starts = np.cumsum([0, *(len(points) for points, *_ in parts)]).tolist()
    points = np.concatenate([points for points, *_ in parts])
    triangles = [faces + start for (_, faces, *_), start in zip(parts, starts[:-1], strict=True)]
    owners = np.repeat(np.arange(len(parts)), [len(faces) for faces in triangles])

    def array(values: Any, dtype: Any) -> wp.array:
        return wp.array(values, dtype=dtype, device=device)

    return Subject(
        points=array(points.astype(np.float32), wp.vec3f),
        normals=array(np.concatenate([vertex_normals(p, faces) for p, faces, *_ in parts]), wp.vec3f),
        triangles=array(np.concatenate(triangles).astype(np.int32), wp.int32),
        owners=array(owners.astype(np.int32), wp.int32),
        appearances=array([shading_of(p, faces, inside) for p, faces, _, inside in parts], Appearance),
        colours=array(linear(np.concatenate([colour for _, _, colour, _ in parts])).astype(np.float32), wp.vec3f),
        low=points.min(axis=0),
        high=points.max(axis=0),
        device=device,
    )


def load_kernels(device: str) -> None:
    """Loads the picture's kernels: two threads must not load one module at the same time."""
    load_modules(picture_modules(), device)


def picture_modules() -> list[wp.Module]:
    """The kernel modules of a picture."""
    return [kernel.module for kernel in (draw_depth, draw_triangle_ids, sample_surface, cast_shadows, light_pixels)]


def shading_of(points: Vector, triangles: NDArray[np.int32], inside: float) -> Appearance:
    """Shading parameters of the two sides of a part."""
    appearance = Appearance()
    appearance.outside = 1.0 if winds_outward(points, triangles) else -1.0
    appearance.inside = inside
    return appearance


def vector(values: NDArray[Any]) -> wp.vec3f:
    return wp.vec3f(*values.tolist())


def view_axes(toward: Vector) -> tuple[Vector, Vector]:
    """Right and up axes of a view along -toward; ``toward`` is a unit vector, and not vertical."""
    right = np.cross(UP, toward)
    right /= np.linalg.norm(right)
    return right, np.cross(toward, right)


def view_from(toward: Vector, centre: Vector, pixel: float, columns: int, rows: int) -> View:
    """A view along -toward with ``centre`` in the middle; rows run upwards."""
    right, up = view_axes(toward)
    view = View()
    view.origin = vector(centre - 0.5 * pixel * ((columns - 1) * right + (rows - 1) * up))
    view.right, view.up, view.toward = vector(right), vector(up), vector(toward)
    view.pixel, view.columns, view.rows = pixel, columns, rows
    return view


def light_direction(light: Sequence[float], toward: Vector) -> Vector:
    """Unit vector to a light whose direction is given in a view's axes (right, up, toward)."""
    right, up = view_axes(toward)
    direction = light[0] * right + light[1] * up + light[2] * toward
    return direction / np.linalg.norm(direction)


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A view of a subject: visible triangles and the light on them, independent of colours; and its first colours."""

    view: View
    ids: wp.array  # triangle at every pixel (the number of triangles: none), shape [rows, columns]
    # Of the surface at every pixel that shows some; elsewhere it is whatever was in memory.
    light: wp.array  # shape [rows, columns]
    reflectance: wp.array  # in the subject's ``colours``, shape [rows, columns]
    colours: wp.array


def render_view(subject: Subject, toward: Vector, pixel: float, width: int, height: int) -> RenderedView:
    """The view along -toward in ``width`` by ``height`` pixels of size ``pixel`` [m]."""
    view = view_from(toward, subject.centre, pixel / SUPERSAMPLING, width * SUPERSAMPLING, height * SUPERSAMPLING)
    depth = depth_image(subject, view)
    key, fill = (light_direction(light, toward) for light in (KEY_LIGHT, FILL_LIGHT))
    key_size = int(np.ceil(np.linalg.norm(subject.extent) / pixel)) + 2
    key_view = view_from(key, subject.centre, pixel, key_size, key_size)
    key_depth = depth_image(subject, key_view)

    shape, device = depth.shape, subject.device
    ids = wp.full(shape, len(subject.triangles), dtype=wp.int32, device=device)
    inputs = [subject.points, subject.triangles, view, depth]
    wp.launch(draw_triangle_ids, len(subject.triangles), inputs=inputs, outputs=[ids], device=device)
    normal, reflectance = surface(subject, view, ids)
    lit = wp.empty(shape, dtype=wp.float32, device=device)
    taps = wp.array(shadow_taps(key_view.pixel), dtype=wp.vec2f, device=device)
    inputs = [depth, normal, view, key_view, key_depth, taps]
    wp.launch(cast_shadows, shape, inputs=inputs, outputs=[lit], device=device)
    light = wp.empty(shape, dtype=wp.vec3f, device=device)
    taps = wp.array(occlusion_taps(view.pixel), dtype=wp.vec2i, device=device)
    inputs = [depth, normal, lit, view, vector(key), vector(fill), taps, OCCLUSION_STEPS]
    wp.launch(light_pixels, shape, inputs=inputs, outputs=[light], device=device)
    return RenderedView(view, ids, light, reflectance, subject.colours)


def shaded(subject: Subject, rendered: RenderedView, background: Vector) -> NDArray[np.uint8]:
    """Image of a view of a subject in its own colours, in sRGB, shape [height, width, 3], top row first.

    ``background`` is linear light.
    """
    reflectance, (rows, columns) = rendered.reflectance, rendered.ids.shape
    if rendered.colours is not subject.colours:
        _, reflectance = surface(subject, rendered.view, rendered.ids)
    size = rows // SUPERSAMPLING, columns // SUPERSAMPLING
    image = wp.array(np.tile(in_bytes(background), (*size, 1)), dtype=wp.uint8, device=subject.device)
    inputs = [rendered.ids, len(subject.triangles), rendered.light, reflectance, vector(background), SUPERSAMPLING]
    wp.launch(resolve_pixels, size, inputs=inputs, outputs=[image], device=subject.device)
    found: NDArray[np.uint8] = image.numpy()
    return found


def surface(subject: Subject, view: View, ids: wp.array) -> tuple[wp.array, wp.array]:
    """Normal and reflectance of the triangles at a view's pixels; undefined where there is none."""
    outputs = [wp.empty(ids.shape, dtype=wp.vec3f, device=subject.device) for _ in range(2)]
    shown = Surface()
    for name in ("points", "normals", "colours", "triangles", "owners", "appearances"):
        setattr(shown, name, getattr(subject, name))
    wp.launch(sample_surface, ids.shape, inputs=[shown, view, ids], outputs=outputs, device=subject.device)
    normal, reflectance = outputs
    return normal, reflectance


def depth_image(subject: Subject, view: View) -> wp.array:
    """Depth of the nearest surface [m]; -inf where there is none."""
    depth = wp.full((view.rows, view.columns), -np.inf, dtype=wp.float32, device=subject.device)
    inputs = [subject.points, subject.triangles, view]
    wp.launch(draw_depth, len(subject.triangles), inputs=inputs, outputs=[depth], device=subject.device)
    return depth
