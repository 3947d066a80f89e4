"""Orientation of garments: whether most of their area faces away from the body, or towards it."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.search import ContactSearch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

PROBE = wp.constant(wp.float64(5.0e-3))  # [m]; distance before and behind the cloth where that to the body is sampled
LEAST_AREA = wp.constant(wp.float64(1.0e-30))  # [m2]
AREA_UNIT = wp.constant(wp.float64(2.0**-48))  # [m2]; integers of it are summed, the same in any order


@functools.cache
def sides_kernel(precision: str) -> wp.Kernel:
    """Kernel ``weigh_sides``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def weigh_sides(
        state: State,
        search: ContactSearch,
        garment: wp.array(dtype=wp.int32),  # of each triangle, shape [F]
        body: MeshCollider,
        away_out: wp.array(dtype=wp.int64),  # area facing away less area facing the body, of each garment [AREA_UNIT]
    ):
        """Adds twice each triangle's area to its garment's if it faces away from the body, or subtracts it."""
        triangle = wp.tid()
        corners = search.triangles[triangle]
        a = position_of(state, corners[0])
        b = position_of(state, corners[1])
        c = position_of(state, corners[2])
        normal = wp.cross(b - a, c - a)
        area = wp.length(normal)
        step = normal * (PROBE / wp.max(area, LEAST_AREA))
        centre = (a + b + c) / wp.float64(3.0)
        before, behind = mesh_contact(body, centre + step), mesh_contact(body, centre - step)
        units = wp.int64(area / AREA_UNIT)
        if before[3] < behind[3]:
            units = -units
        if before[3] != behind[3]:
            wp.atomic_add(away_out, garment[triangle], units)

    return weigh_sides


@wp.kernel
def face_vertices(
    garment: wp.array(dtype=wp.int32),  # of each vertex, shape [V]
    away: wp.array(dtype=wp.int64),  # of each garment, as in weigh_sides
    outward_out: wp.array(dtype=wp.float32),  # 1, or -1 where the garment faces the body, shape [V]
):
    """Writes each vertex's orientation, that of its garment."""
    vertex = wp.tid()
    outward_out[vertex] = wp.where(away[garment[vertex]] >= wp.int64(0), 1.0, -1.0)
