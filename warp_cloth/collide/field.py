"""The depth buffers fused once into a signed distance field: what a garment touches while it relaxes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.collide.depth import DepthBuffers
from warp_cloth.kernels import field as kernels

PIXELS_PER_SPACING = 2.5  # 5 mm grid from 2 mm pixels: the spline then evens out the pixels' stairs
DEFAULT_REACH = 0.01  # [m]; contact happens at the offset, 3 mm: the rest is room to move in one step
MARGIN = 3  # spacings kept beyond reach, so that the spline's support is all real distance
SWEEPS_PER_LOOK = 8  # sweeps between two looks at whether the inside still changes
SWEEPS_AT_MOST = 512  # a body 2.5 m thick at 5 mm


@dataclass(frozen=True, eq=False)
class FieldBuild:
    """A contact field and what keeps its arrays alive."""

    field: kernels.ContactField  # for kernels
    values: wp.array  # B-spline coefficients of the signed distance [m], shape [nx, ny, nz]
    origin: NDArray[np.float64]  # node (0, 0, 0) [m], shape [3]
    spacing: float  # [m]
    reach: float  # [m]

    @property
    def device(self) -> wp.Device:
        return self.values.device


def _listed(flag: wp.array) -> wp.array:
    """Ids of the set flags, ascending."""
    place = wp.empty_like(flag)
    wp.utils.array_scan(flag, place, inclusive=True)
    count = int(place[-1:].numpy()[0])
    ids = wp.empty(count, dtype=wp.int32, device=flag.device)
    wp.launch(kernels.list_flagged, dim=len(flag), inputs=[flag, place], outputs=[ids], device=flag.device)
    return ids


def _sweep(
    spacing: float, blocks: wp.vec3i, ids: wp.array, fixed: wp.array, count: int, until_still: bool
) -> wp.array:
    """Carries the distances of ``fixed`` on, ``count`` sweeps, and then until the inside is still if asked."""
    device = fixed.device
    distance, spare = wp.clone(fixed), wp.clone(fixed)
    changed = wp.zeros(1, dtype=wp.int32, device=device)
    done = 0
    while done < SWEEPS_AT_MOST:
        wp.launch(
            kernels.sweep_distance,
            dim=(len(ids), kernels.BLOCK**3),
            inputs=[spacing, blocks, ids, fixed, distance],
            outputs=[spare, changed],
            device=device,
        )
        distance, spare = spare, distance
        done += 1
        if done >= count and not until_still:
            break
        if done >= count and done % SWEEPS_PER_LOOK == 0:
            if not changed.numpy()[0]:
                break
            changed.zero_()
        elif done < count or done % SWEEPS_PER_LOOK < SWEEPS_PER_LOOK - 1:
            changed.zero_()
    return distance


def build_contact_field(
    buffers: DepthBuffers, spacing: float | None = None, reach: float = DEFAULT_REACH
) -> FieldBuild:
    """Bakes the signed distance to the solid of ``buffers`` on a grid of ``spacing`` [m] over the same region."""
    h = PIXELS_PER_SPACING * buffers.pixel if spacing is None else spacing
    device = buffers.device
    solid, offset = buffers.solid(), wp.vec3f()
    shape = tuple(max(int(math.floor(length / h)) + 1, 3) for length in buffers.size)
    block_shape = tuple(-(-count // kernels.BLOCK) for count in shape)
    blocks = wp.vec3i(*block_shape)

    side = wp.empty(shape, dtype=wp.float32, device=device)
    wp.launch(kernels.mark_inside, dim=shape, inputs=[solid, h, offset], outputs=[side], device=device)
    inside = wp.empty(block_shape, dtype=wp.int32, device=device)
    surface = wp.empty_like(inside)
    wp.launch(kernels.mark_blocks, dim=block_shape, inputs=[side], outputs=[inside, surface], device=device)

    def active(radius: int, also: wp.array) -> wp.array:
        flag = wp.empty(math.prod(block_shape), dtype=wp.int32, device=device)
        wp.launch(
            kernels.spread_blocks,
            dim=block_shape,
            inputs=[surface, radius, also],
            outputs=[flag],
            device=device,
        )
        return _listed(flag)

    def measure(kernel: wp.Kernel, ids: wp.array, given: wp.array) -> wp.array:
        measured = wp.clone(side)
        dim = (len(ids), kernels.BLOCK**3)
        wp.launch(
            kernel, dim=dim, inputs=[solid, h, offset, blocks, ids, given], outputs=[measured], device=device
        )
        return measured

    near = active(1, surface)
    rough = _sweep(h, blocks, near, measure(kernels.measure_crossings, near, side), 4, until_still=False)
    fixed = measure(kernels.project_distance, near, rough)
    limit = reach + MARGIN * h
    layers = math.ceil(limit / h)
    far = active(math.ceil(layers / kernels.BLOCK), inside)
    distance = _sweep(h, blocks, far, fixed, layers, until_still=True)

    values = wp.empty_like(distance)
    wp.launch(
        kernels.prefilter_distance, dim=shape, inputs=[limit, distance], outputs=[values], device=device
    )
    field = kernels.ContactField()
    field.values, field.origin = values, wp.vec3d(*buffers.origin)
    field.spacing, field.reach = h, reach
    return FieldBuild(field, values, buffers.origin, h, reach)
