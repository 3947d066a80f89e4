"""Bakes depth buffers into a signed distance field (SDF), which garments collide with while they relax."""

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

LEAST_SPACING = 0.0025  # [m]; cost grows at least with the cube of a finer grid, and limbs are smooth at this size
MOST_NODES = 2**28  # 1 GiB of float32, of which building takes five
PIXELS_PER_SPACING = 2.5  # 5 mm grid from 2 mm pixels: the spline then smooths the pixels' steps
MARGIN = 3  # spacings beyond reach, so that the spline's support is all real distance
ROUGH_SWEEPS = 5  # the projection needs 2.5 spacings and the neighbours around, at most 4.3
GRIDS_AT_ONCE = 4  # grids of the field's size in memory at most, while it is built
SWEEPS_PER_CHECK = 8  # sweeps between two checks whether the inside still changes
NORMALS_BEYOND = 1e-3  # [m] beyond the contact offset where normals are still computed: more than the certificate needs
ROUNDED = 1.0 + 1e-5  # factor for the rounding of float32 slopes
SWEEPS_AT_MOST = 512  # a body 2.5 m thick at 5 mm


@dataclass(frozen=True, eq=False)
class FieldBuild:
    """A contact field and what keeps its arrays alive."""

    field: ContactField  # for kernels
    values: wp.array  # B-spline coefficients of the signed distance [m], shape [nx, ny, nz]
    origin: NDArray[np.float64]  # node (0, 0, 0) [m], shape [3]
    spacing: float  # [m]
    reach: float  # [m]
    steepest: float  # upper bound of the distance's slope
    beyond: float  # lower bound of the distance round far nodes [m]

    @classmethod
    def of(
        cls,
        values: wp.array,
        origin: NDArray[np.float64],
        spacing: float,
        reach: float,
        steepest: float,
        beyond: float,
    ) -> FieldBuild:
        """The field of these values; arguments as above."""
        field = ContactField()
        field.values, field.origin = values, wp.vec3d(*origin)
        field.spacing, field.reach = spacing, reach
        field.near = math.inf
        return cls(field, values, origin, spacing, reach, steepest, beyond)

    @property
    def device(self) -> wp.Device:
        return self.values.device

    @property
    def bytes(self) -> int:
        """Memory that queries read."""
        return int(self.values.capacity)

    def limited_to(self, offset: float, lift: float = 0.0) -> ContactField:
        """The field for contact at this offset [m], or lifted farther: it computes no normals beyond that."""
        field = ContactField()
        field.values, field.origin = self.values, wp.vec3d(*self.origin)
        field.spacing, field.reach = self.spacing, self.reach
        field.near = offset + lift + NORMALS_BEYOND
        field.steepest, field.beyond = self.steepest, self.beyond
        return field

    def sample(self, points: Points) -> NDArray[np.float32]:
        """Unit normal and signed distance at points [m], shape [N, 3]; shape [N, 4]. Far ones have no normal."""
        return sampled(sample_field, self.field, points, self.device)


def bake_modules(kind: type[DepthBuffers] | type[LayeredBuffers]) -> list[wp.Module]:
    """Kernel modules needed to bake buffers of a kind."""
    bake = bake_kernels(kind.level, kind.solid_type)
    shared = [wp.get_module(kernels.__name__), measure_slopes.module]
    return [*shared, *(kernel.module for kernel in vars(bake).values())]


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
    """Extends the distances of ``fixed`` until nothing changes, in ``least`` to ``most`` sweeps.

    ``limits``: greatest depth and greatest distance outside that are needed [m].
    """
    device = fixed.device
    domain = kernels.SweepDomain()
    domain.spacing, (domain.limit_inside, domain.limit_outside) = spacing, limits
    domain.corner, domain.fixed = corner, fixed
    distance, distance_next = wp.clone(fixed), wp.clone(fixed)
    blocks = tuple(-(-count // kernels.BLOCK) for count in fixed.shape)
    changed = wp.full(blocks, 1, dtype=wp.int32, device=device)
    changed_next = wp.empty_like(changed)
    any_changed = wp.empty(1, dtype=wp.int32, device=device)
    dim = (len(corner), kernels.BLOCK)
    for sweep in range(1, most + 1):
        any_changed.zero_()
        changed_next.zero_()
        inputs, outputs = [domain, distance, changed], [distance_next, changed_next, any_changed]
        wp.launch(kernels.sweep_distance, dim=dim, inputs=inputs, outputs=outputs, device=device)
        distance, distance_next = distance_next, distance
        changed, changed_next = changed_next, changed
        if sweep >= least and sweep % SWEEPS_PER_CHECK == 0 and not any_changed.numpy()[0]:
            break
    return distance


def build_contact_field(buffers: DepthBuffers | LayeredBuffers, reach: float = DEFAULT_REACH) -> FieldBuild:
    """Bakes the signed distance to the solid of ``buffers`` on a grid over its region."""
    h = max(PIXELS_PER_SPACING * buffers.pixel, LEAST_SPACING)
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
    del crossed  # grids are large: at most GRIDS_AT_ONCE are in memory at a time
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
    return FieldBuild.of(values, buffers.origin, h, reach, *_slope_bounds(values, h, reach))


def _slope_bounds(values: wp.array, spacing: float, reach: float) -> tuple[float, float]:
    """The steepest slope, and the least distance [m] round a node whose value is beyond ``reach`` [m]."""
    slope = wp.zeros(3, dtype=wp.float32, device=values.device)
    wp.launch(measure_slopes, dim=values.shape[:2], inputs=[values], outputs=[slope], device=values.device)
    most = slope.numpy().astype(np.float64)
    # a point is at most half a spacing from its node along each axis, and only a node one spacing beyond reach is far
    return float(np.linalg.norm(most)) / spacing * ROUNDED, min(reach, reach + spacing - 0.5 * float(most.sum()))
