"""Which way garments face: whether most of their area faces away from the body, or to it."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.search import ContactSearch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

FEELER = wp.constant(wp.float64(5.0e-3))  # [m]; how far before and behind the cloth its distance from the body is asked
LEAST_AREA = wp.constant(wp.float64(1.0e-30))  # [m2]
AREA_UNIT = wp.constant(wp.float64(2.0**-48))  # [m2]; whole numbers of it are summed, the same in every order


@functools.cache
def sides_kernel(precision: str) -> wp.Kernel:
    """Kernel ``weigh_sides``."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def weigh_sides(
        state: State,
        search: ContactSearch,
        garment: wp.array(dtype=wp.int32),  # of each triangle, shape [F]
        body: MeshCollider,
        away: wp.array(dtype=wp.int64),  # of each garment [AREA_UNIT]
    ):
        """Adds twice each triangle's area to what faces away from the body, or takes it off where it faces the body."""
        triangle = wp.tid()
        corners = search.triangles[triangle]
        a = at(state.position, corners[0])
        b = at(state.position, corners[1])
        c = at(state.position, corners[2])
        normal = wp.cross(b - a, c - a)
        area = wp.length(normal)
        step = normal * (FEELER / wp.max(area, LEAST_AREA))
        centre = (a + b + c) / wp.float64(3.0)
        before, behind = mesh_contact(body, centre + step), mesh_contact(body, centre - step)
        share = wp.int64(area / AREA_UNIT)
        if before[3] < behind[3]:
            share = -share
        if before[3] != behind[3]:
            wp.atomic_add(away, garment[triangle], share)

    return weigh_sides


@wp.kernel
def face_vertices(
    garment: wp.array(dtype=wp.int32),  # of each vertex, shape [V]
    away: wp.array(dtype=wp.int64),  # of each garment, of weigh_sides
    outward_out: wp.array(dtype=wp.float32),  # 1, or -1 for what faces the body, shape [V]
):
    """Tells vertices which way their garment faces."""
    vertex = wp.tid()
    outward_out[vertex] = wp.where(away[garment[vertex]] >= wp.int64(0), 1.0, -1.0)
