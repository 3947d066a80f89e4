"""First signed distances of a depth-buffer solid on a grid: crossings of grid lines, then projection along normals."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.avatar.sweep import BLOCK, UNKNOWN, neighbour, node_position, smooth_gradient

# The same bits on CPU and CUDA. Loops are not unrolled: unrolled, a kernel would hold some 500 copies of a level and
# take a minute and a half to compile instead of half a second.
BAKE_OPTIONS = {"enable_backward": False, "fuse_fp": False, "max_unroll": 1}
BISECTIONS = wp.constant(8)  # halvings of one spacing: 5 mm become 0.02 mm
NEAR = wp.constant(wp.float32(2.5))  # spacings within which distances are measured along the normal


def bake_kernels(level: wp.Function, solid_type: type) -> SimpleNamespace:
    """Kernels ``mark_inside``, ``measure_crossings``, ``project_distance`` for a solid.

    Args:
        level: (solid, local position [m]) -> positive inside, negative outside, zero on the surface.
        solid_type: the struct of ``solid``.
    """
    return SimpleNamespace(
        mark_inside=mark_inside_kernel(level, solid_type),
        measure_crossings=measure_crossings_kernel(level, solid_type),
        project_distance=project_distance_kernel(level, solid_type),
    )


@functools.cache
def surface_fraction_function(level: wp.Function, solid_type: type) -> wp.Function:
    """Function ``surface_fraction``; arguments as in ``bake_kernels``."""

    @wp.func
    def surface_fraction(solid: solid_type, a: wp.vec3f, b: wp.vec3f, inside: bool) -> float:
        """Where in (0, 1) between a and b the solid's surface lies, by bisection; ``inside``: whether a is inside."""
        low = float(0.0)
        high = float(1.0)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            if (level(solid, a + middle * (b - a)) > 0.0) == inside:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    return surface_fraction


@functools.cache
def mark_inside_kernel(level: wp.Function, solid_type: type) -> wp.Kernel:
    """Kernel ``mark_inside``; arguments as in ``bake_kernels``."""

    @wp.kernel(module="unique", module_options=BAKE_OPTIONS)
    def mark_inside(
        solid: solid_type,
        spacing: float,  # [m]
        offset: wp.vec3f,  # node (0, 0, 0) in the solid's frame [m]
        distance_out: wp.array3d(dtype=wp.float32),  # -UNKNOWN inside, +UNKNOWN outside [m], shape [nx, ny, nz]
    ):
        """Marks on which side of the solid's surface every node is."""
        i, j, k = wp.tid()
        inside = level(solid, node_position(spacing, offset, i, j, k)) > 0.0
        distance_out[i, j, k] = wp.where(inside, -UNKNOWN, UNKNOWN)

    return mark_inside


@functools.cache
def measure_crossings_kernel(level: wp.Function, solid_type: type) -> wp.Kernel:
    """Kernel ``measure_crossings``; arguments as in ``bake_kernels``."""
    surface_fraction = surface_fraction_function(level, solid_type)

    @wp.func
    def crossing_distance(
        solid: solid_type,
        spacing: float,
        offset: wp.vec3f,
        side: wp.array3d(dtype=wp.float32),
        i: int,
        j: int,
        k: int,
    ) -> float:
        """First signed distance of a node next to the surface, from where its grid lines cross the surface [m].

        1 / d^2 = 1 / dx^2 + 1 / dy^2 + 1 / dz^2 with the nearest crossing along each axis: exact for a plane that
        crosses all three. +-UNKNOWN where none is crossed.
        """
        here = side[i, j, k]
        p = node_position(spacing, offset, i, j, k)
        total = float(0.0)
        for axis in range(3):
            nearest = float(2.0)
            for direction in range(2):
                step = wp.vec3i(0, 0, 0)
                step[axis] = 2 * direction - 1
                if neighbour(side, i + step[0], j + step[1], k + step[2], here) * here < 0.0:
                    end = node_position(spacing, offset, i + step[0], j + step[1], k + step[2])
                    nearest = wp.min(nearest, surface_fraction(solid, p, end, here < 0.0))
            if nearest < 1.5:
                total += 1.0 / (nearest * nearest)
        if total > 0.0:
            return wp.sign(here) * spacing / wp.sqrt(total)
        return here

    @wp.kernel(module="unique", module_options=BAKE_OPTIONS)
    def measure_crossings(
        solid: solid_type,
        spacing: float,  # [m]
        offset: wp.vec3f,  # node (0, 0, 0) in the solid's frame [m]
        corner: wp.array(dtype=wp.vec3i),  # first node of the active blocks, shape [N]
        side: wp.array3d(dtype=wp.float32),  # signs of the nodes, shape [nx, ny, nz]
        distance_out: wp.array3d(dtype=wp.float32),  # signed distance of nodes next to the surface, else ``side`` [m]
    ):
        """First distances next to the surface. Threads [N, BLOCK, BLOCK]: lines of one block along z."""
        block, a, b = wp.tid()
        i = corner[block][0] + a
        j = corner[block][1] + b
        if i < side.shape[0] and j < side.shape[1]:
            for k in range(corner[block][2], wp.min(corner[block][2] + BLOCK, side.shape[2])):
                distance_out[i, j, k] = crossing_distance(solid, spacing, offset, side, i, j, k)

    return measure_crossings


@functools.cache
def project_distance_kernel(level: wp.Function, solid_type: type) -> wp.Kernel:
    """Kernel ``project_distance``; arguments as in ``bake_kernels``."""
    surface_fraction = surface_fraction_function(level, solid_type)

    @wp.func
    def projected_distance(
        solid: solid_type,
        spacing: float,
        offset: wp.vec3f,
        distance: wp.array3d(dtype=wp.float32),
        i: int,
        j: int,
        k: int,
    ) -> float:
        """Signed distance of an inner node to the surface along the smoothed normal [m].

        The crossing is sought within one spacing of the distance so far, then within half and a quarter; where there
        is none (a feature thinner than the grid resolves) that distance stays.
        """
        here = distance[i, j, k]
        gradient = smooth_gradient(distance, i, j, k)
        length = wp.length(gradient)
        if length < 0.5 * spacing:
            return here
        p = node_position(spacing, offset, i, j, k)
        normal = gradient / length
        stride = float(spacing)
        for _ in range(3):
            outer = p - (here - stride) * normal
            inner = p - (here + stride) * normal
            if level(solid, outer) <= 0.0 and level(solid, inner) > 0.0:
                found = here + stride * (2.0 * surface_fraction(solid, outer, inner, False) - 1.0)
                return wp.where(found * here > 0.0, found, here)
            stride *= 0.5
        return here

    @wp.kernel(module="unique", module_options=BAKE_OPTIONS)
    def project_distance(
        solid: solid_type,
        spacing: float,  # [m]
        offset: wp.vec3f,  # node (0, 0, 0) in the solid's frame [m]
        corner: wp.array(dtype=wp.vec3i),  # first node of the active blocks, shape [N]
        distance: wp.array3d(dtype=wp.float32),  # signed distance so far [m], shape [nx, ny, nz]
        distance_out: wp.array3d(dtype=wp.float32),  # signed distance near the surface, else +-UNKNOWN [m]
    ):
        """Measures distances near the surface again, along the smoothed normal. Threads [N, BLOCK, BLOCK]."""
        block, a, b = wp.tid()
        i = corner[block][0] + a
        j = corner[block][1] + b
        nx = distance.shape[0]
        ny = distance.shape[1]
        nz = distance.shape[2]
        if i >= nx or j >= ny:
            return
        for k in range(corner[block][2], wp.min(corner[block][2] + BLOCK, nz)):
            here = distance[i, j, k]
            if wp.abs(here) > NEAR * spacing:
                distance_out[i, j, k] = wp.sign(here) * UNKNOWN
            elif i > 0 and j > 0 and k > 0 and i < nx - 1 and j < ny - 1 and k < nz - 1:
                distance_out[i, j, k] = projected_distance(solid, spacing, offset, distance, i, j, k)
            else:
                distance_out[i, j, k] = here

    return project_distance
