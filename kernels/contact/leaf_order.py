"""Puts leaves of trees in an order that keeps near what is near, on the device, where the cloth is.

Segments of leaves are halved across their longest side, all of a round at a time (Bentley 1975): what is sorted are
whole numbers, so that the order is the same on every device.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, place_function
from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.box_tree import FAR_OFF, WIDTH, team_lane, team_least
from warp_cloth.kernels.contact.search import ContactSearch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


_RANK = """
    const float given = value + 0.0f;  // of both zeros the positive one
    int bits;
    memcpy(&bits, &given, sizeof(bits));
    const unsigned int rising = bits < 0 ? ~(unsigned int)bits : (unsigned int)bits | 0x80000000u;
    return ((int64_t)segment << 32) | (int64_t)rising;
"""


@wp.func_native(_RANK)
def ranked_in(segment: int, value: wp.float32) -> wp.int64:
    """A number that grows with a segment's, and in a segment with a value."""
    ...


@functools.cache
def locate_kernel(precision: str) -> wp.Kernel:
    """Kernel ``locate_leaves``."""
    State, at = cloth_types(precision).State, place_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def locate_leaves(
        state: State,
        search: ContactSearch,
        place_out: wp.array(dtype=wp.vec3f),  # [m], shape [F + E + V]
    ):
        """Where the middle of each triangle is, then of each edge, then each vertex."""
        leaf = wp.tid()
        triangles, edges = search.triangles.shape[0], search.edges.shape[0]
        if leaf < triangles:
            corners = search.triangles[leaf]
            sum = at(state.position, corners[0]) + at(state.position, corners[1]) + at(state.position, corners[2])
            place_out[leaf] = wp.vec3f(sum / wp.float64(3.0))
        elif leaf < triangles + edges:
            ends = search.edges[leaf - triangles]
            sum = at(state.position, ends[0]) + at(state.position, ends[1])
            place_out[leaf] = wp.vec3f(sum / wp.float64(2.0))
        else:
            place_out[leaf] = wp.vec3f(at(state.position, leaf - triangles - edges))

    return locate_leaves


@wp.kernel
def span_segments(
    order: wp.array(dtype=wp.int32),  # leaves; -1: nothing, shape [N]
    place: wp.array(dtype=wp.vec3f),  # of each leaf [m]
    segment: wp.array(dtype=wp.int32),  # that each group of WIDTH belongs to, shape [N / WIDTH]
    span: wp.array2d(dtype=wp.float32),  # least coordinates, and the greatest's negatives [m], shape [segments, 6]
):
    """Widens the segments' boxes to what their leaves span."""
    at = wp.tid()
    leaf = order[at]
    low = wp.vec3f(FAR_OFF, FAR_OFF, FAR_OFF)
    negative = low
    if leaf >= 0:
        low = place[leaf]
        negative = -low
    low, negative = team_least(low), team_least(negative)
    if team_lane() == 0:
        for axis in range(3):
            wp.atomic_min(span, segment[at // WIDTH], axis, low[axis])
            wp.atomic_min(span, segment[at // WIDTH], 3 + axis, negative[axis])


@wp.kernel
def rank_leaves(
    order: wp.array(dtype=wp.int32),  # as of span_segments, as are the rest
    place: wp.array(dtype=wp.vec3f),
    segment: wp.array(dtype=wp.int32),
    span: wp.array2d(dtype=wp.float32),
    rank_out: wp.array(dtype=wp.int64),  # shape [N]
):
    """By what a leaf comes in its segment: where it is along the longest side; nothing comes last."""
    at = wp.tid()
    own = segment[at // WIDTH]
    longest = int(0)
    side = float(0.0)
    for axis in range(3):
        size = -span[own, 3 + axis] - span[own, axis]
        longest = wp.where(size > side, axis, longest)
        side = wp.max(size, side)
    along = FAR_OFF
    if order[at] >= 0:
        along = place[order[at]][longest]
    rank_out[at] = ranked_in(own, along)


@wp.kernel
def plant_leaves(
    order: wp.array(dtype=wp.int32),  # triangles, then edges and vertices, as trees hold them; -1: nothing
    search: ContactSearch,
    contact: ContactData,
    region_size: int,  # vertices of a region
):
    """Puts leaves in their trees, and vertices in their order and their regions. Where nothing is, any stands."""
    at = wp.tid()
    leaf = order[at]
    triangles, edges = search.triangles.shape[0], search.edges.shape[0]
    edge_at = at - search.corners.shape[0]
    vertex_at = edge_at - search.ends.shape[0]
    if edge_at < 0:
        search.triangle_tree.leaf[at] = leaf
        search.corners[at] = search.triangles[wp.where(leaf < 0, triangles - 1, leaf)]
    elif vertex_at < 0:
        edge = wp.where(leaf < 0, leaf, leaf - triangles)
        search.edge_tree.leaf[edge_at] = edge
        search.ends[edge_at] = search.edges[wp.where(leaf < 0, edges - 1, edge)]
    else:
        vertex = wp.where(leaf < 0, leaf, leaf - triangles - edges)
        search.vertex[vertex_at] = vertex
        if vertex >= 0:
            contact.region[vertex] = 1 + vertex_at // region_size
