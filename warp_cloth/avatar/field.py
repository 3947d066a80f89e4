"""The depth buffers fused once into a signed distance field: what a garment touches while it relaxes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.depth import DEFAULT_REACH, TOO_FINE, DepthBuffers, sampled
from warp_cloth.avatar.layers import LayeredBuffers
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Points
from warp_cloth.kernels.avatar import sweep as kernels
from warp_cloth.kernels.avatar.bake import bake_kernels
from warp_cloth.kernels.avatar.field import ContactField, measure_slopes, sample_field

LEAST_SPACING = 0.0025  # [m]; a finer grid costs by the cube and more, and limbs are smooth at this size
MOST_NODES = 2**28  # 1 GiB of float32, of which building takes five
PIXELS_PER_SPACING = 2.5  # 5 mm grid from 2 mm pixels: the spline then evens out the pixels' stairs
MARGIN = 3  # spacings kept beyond reach, so that the spline's support is all real distance
ROUGH_SWEEPS = 5  # the projection wants 2.5 spacings and the neighbours around, at most 4.3
GRIDS_AT_ONCE = 4  # of its size that building a field holds at most
SWEEPS_PER_LOOK = 8  # sweeps between two looks at whether the inside still changes
TOUCH = 1e-3  # [m] beyond the contact offset: more than the certificate allows for
ROUNDED = 1.0 + 1e-5  # of slopes in float32
SWEEPS_AT_MOST = 512  # a body 2.5 m thick at 5 mm


@dataclass(frozen=True, eq=False)
class FieldBuild:
    """A contact field and what keeps its arrays alive."""

    field: ContactField  # for kernels
    values: wp.array  # B-spline coefficients of the signed distance [m], shape [nx, ny, nz]
    origin: NDArray[np.float64]  # node (0, 0, 0) [m], shape [3]
    spacing: float  # [m]
    reach: float  # [m]
    steepest: float  # slope that the distance has nowhere more of
    beyond: float  # distance that far nodes' surroundings have at least [m]

    @property
    def device(self) -> wp.Device:
        return self.values.device

    @property
    def bytes(self) -> int:
        """Memory that it reads."""
        return int(self.values.capacity)

    def touching(self, offset: float, lift: float = 0.0) -> ContactField:
        """The field for cloth that is met at this offset [m], some of it lifted farther: no normals beyond that."""
        field = ContactField()
        field.values, field.origin = self.values, wp.vec3d(*self.origin)
        field.spacing, field.reach = self.spacing, self.reach
        field.near = offset + lift + TOUCH
        field.steepest, field.beyond = self.steepest, self.beyond
        return field

    def sample(self, points: Points) -> NDArray[np.float32]:
        """Unit normal and signed distance at points [m], shape [N, 3]; shape [N, 4]. Far ones have no normal."""
        return sampled(sample_field, self.field, points, self.device)


def bake_modules(kind: type[DepthBuffers] | type[LayeredBuffers]) -> list[wp.Module]:
    """Kernel modules that fusing buffers of a kind launches from."""
    made = bake_kernels(kind.level, kind.solid_type)
    fused = [wp.get_module(kernels.__name__), measure_slopes.module]
    return [*fused, *(kernel.module for kernel in vars(made).values())]


def _active_blocks(surface: wp.array, radius: int, also: wp.array) -> wp.array:
    """First nodes of the blocks within ``radius`` blocks of the surface, and of those flagged in ``also``."""
    device = surface.device
    flag = wp.empty_like(surface)
    wp.launch(kernels.spread_blocks, dim=flag.shape, inputs=[surface, radius, also], outputs=[flag], device=device)
    place = wp.empty(flag.size, dtype=wp.int32, device=device)
    wp.utils.array_scan(flag.flatten(), place, inclusive=True)
    corner = wp.empty(int(place[-1:].numpy()[0]), dtype=wp.vec3i, device=device)
    wp.launch(kernels.list_blocks, dim=flag.shape, inputs=[flag, place], outputs=[corner], device=device)
    return corner


def _sweep(
    spacing: float, limits: tuple[float, float], corner: wp.array, fixed: wp.array, least: int, most: int
) -> wp.array:
    """Carries the distances of ``fixed`` on until nothing changes, in ``least`` to ``most`` sweeps."""
    device = fixed.device
    distance, distance_next = wp.clone(fixed), wp.clone(fixed)
    blocks = tuple(-(-count // kernels.BLOCK) for count in fixed.shape)
    moved = wp.full(blocks, 1, dtype=wp.int32, device=device)
    moved_next = wp.empty_like(moved)
    alive = wp.empty(1, dtype=wp.int32, device=device)
    dim = (len(corner), kernels.BLOCK)
    for sweep in range(1, most + 1):
        alive.zero_()
        moved_next.zero_()
        inputs = [spacing, *limits, corner, fixed, distance, moved]
        outputs = [distance_next, moved_next, alive]
        wp.launch(kernels.sweep_distance, dim=dim, inputs=inputs, outputs=outputs, device=device)
        distance, distance_next = distance_next, distance
        moved, moved_next = moved_next, moved
        if sweep >= least and sweep % SWEEPS_PER_LOOK == 0 and not alive.numpy()[0]:
            break
    return distance


def build_contact_field(
    buffers: DepthBuffers | LayeredBuffers, spacing: float | None = None, reach: float = DEFAULT_REACH
) -> FieldBuild:
    """Bakes the signed distance to the solid of ``buffers`` on a grid of ``spacing`` [m] over its region."""
    h = max(PIXELS_PER_SPACING * buffers.pixel, LEAST_SPACING) if spacing is None else spacing
    device = buffers.device
    bake = bake_kernels(buffers.level, buffers.solid_type)
    solid, offset = buffers.solid(), wp.vec3f()
    shape = tuple(max(math.floor(length / h) + 1, 3) for length in buffers.size)
    if math.prod(shape) > MOST_NODES:
        raise InputError("collision", f"the contact grid would have {math.prod(shape):,} nodes", TOO_FINE)
    block_shape = tuple(-(-count // kernels.BLOCK) for count in shape)

    side = wp.empty(shape, dtype=wp.float32, device=device)
    wp.launch(bake.mark_inside, dim=shape, inputs=[solid, h, offset], outputs=[side], device=device)
    inside = wp.empty(block_shape, dtype=wp.int32, device=device)
    surface = wp.empty_like(inside)
    wp.launch(kernels.mark_blocks, dim=block_shape, inputs=[side], outputs=[inside, surface], device=device)

    def measure(kernel: wp.Kernel, corner: wp.array, elsewhere: wp.array, given: wp.array) -> wp.array:
        measured = wp.clone(elsewhere)
        dim = (len(corner), kernels.BLOCK, kernels.BLOCK)
        inputs = [solid, h, offset, corner, given]
        wp.launch(kernel, dim=dim, inputs=inputs, outputs=[measured], device=device)
        return measured

    near = _active_blocks(surface, 1, surface)
    limit = reach + MARGIN * h
    crossed = measure(bake.measure_crossings, near, side, side)
    rough = _sweep(h, (ROUGH_SWEEPS * h, ROUGH_SWEEPS * h), near, crossed, least=ROUGH_SWEEPS, most=ROUGH_SWEEPS)
    del crossed  # grids are large: four at a time are what building a field takes (GRIDS_AT_ONCE)
    projected = measure(bake.project_distance, near, side, rough)
    del side, rough
    fixed = wp.clone(projected)
    dim = (len(near), kernels.BLOCK, kernels.BLOCK)
    wp.launch(kernels.limit_slopes, dim=dim, inputs=[h, near, projected], outputs=[fixed], device=device)
    del projected
    layers = math.ceil(limit / h)
    far = _active_blocks(surface, math.ceil(layers / kernels.BLOCK), inside)
    distance = _sweep(h, (math.inf, limit), far, fixed, least=layers, most=SWEEPS_AT_MOST)

    values = wp.empty_like(distance)
    wp.launch(
        kernels.prefilter_distance,
        dim=shape,
        inputs=[limit, MARGIN * h, distance],
        outputs=[values],
        device=device,
    )
    field = ContactField()
    field.values, field.origin = values, wp.vec3d(*buffers.origin)
    field.spacing, field.reach = h, reach
    field.near = math.inf
    return FieldBuild(field, values, buffers.origin, h, reach, *_slope_bounds(values, h, reach))


def _slope_bounds(values: wp.array, spacing: float, reach: float) -> tuple[float, float]:
    """The steepest slope, and the least distance where a node tells that all is beyond ``reach`` [m]."""
    slope = wp.zeros(3, dtype=wp.float32, device=values.device)
    wp.launch(measure_slopes, dim=values.shape[:2], inputs=[values], outputs=[slope], device=values.device)
    most = slope.numpy().astype(np.float64)
    # a point is at most half a spacing's weight away from its node along each axis, and that is told far by one spacing
    return float(np.linalg.norm(most)) / spacing * ROUNDED, min(reach, reach + spacing - 0.5 * float(most.sum()))
