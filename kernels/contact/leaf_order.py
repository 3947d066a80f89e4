"""Leaf order: a spatial order of the trees' leaves, computed on the device from where the cloth is.

Segments of leaves are halved across their longest side, all segments of a round at once (k-d tree, Bentley 1975). The
sort keys are integers, so the order is the same on every device.
"""

import functools

import warp as wp

from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.box_tree import EMPTY_BOUND, WIDTH, team_lane, team_min
from warp_cloth.kernels.contact.search import ContactSearch

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


_KEY = """
    const float key = value + 0.0f;  // -0 becomes +0
    int bits;
    memcpy(&bits, &key, sizeof(bits));
    const unsigned int rising = bits < 0 ? ~(unsigned int)bits : (unsigned int)bits | 0x80000000u;
    return ((int64_t)segment << 32) | (int64_t)rising;
"""


@wp.func_native(_KEY)
def segment_key(segment: int, value: wp.float32) -> wp.int64:
    """A sort key: by segment, then by value."""
    ...


@functools.cache
def locate_kernel(precision: str) -> wp.Kernel:
    """Kernel ``locate_leaves``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def locate_leaves(
        state: State,
        search: ContactSearch,
        place_out: wp.array(dtype=wp.vec3f),  # [m], shape [F + E + V]
    ):
        """Writes the centre of each triangle, then of each edge, then each vertex."""
        leaf = wp.tid()
        triangles, edges = search.triangles.shape[0], search.edges.shape[0]
        if leaf < triangles:
            corners = search.triangles[leaf]
            sum = position_of(state, corners[0]) + position_of(state, corners[1]) + position_of(state, corners[2])
            place_out[leaf] = wp.vec3f(sum / wp.float64(3.0))
        elif leaf < triangles + edges:
            ends = search.edges[leaf - triangles]
            sum = position_of(state, ends[0]) + position_of(state, ends[1])
            place_out[leaf] = wp.vec3f(sum / wp.float64(2.0))
        else:
            place_out[leaf] = wp.vec3f(position_of(state, leaf - triangles - edges))

    return locate_leaves


@wp.kernel
def span_segments(
    order: wp.array(dtype=wp.int32),  # leaves; -1: none, shape [N]
    place: wp.array(dtype=wp.vec3f),  # of each leaf [m]
    segment: wp.array(dtype=wp.int32),  # of each group of WIDTH, shape [N / WIDTH]
    span_out: wp.array2d(dtype=wp.float32),  # least and negative greatest coordinates [m], shape [segments, 6]
):
    """Extends the segments' boxes to their leaves."""
    at = wp.tid()
    leaf = order[at]
    low = wp.vec3f(EMPTY_BOUND, EMPTY_BOUND, EMPTY_BOUND)
    negative = low
    if leaf >= 0:
        low = place[leaf]
        negative = -low
    low, negative = team_min(low), team_min(negative)
    if team_lane() == 0:
        for axis in range(3):
            wp.atomic_min(span_out, segment[at // WIDTH], axis, low[axis])
            wp.atomic_min(span_out, segment[at // WIDTH], 3 + axis, negative[axis])


@wp.kernel
def rank_leaves(
    order: wp.array(dtype=wp.int32),  # this and the next three as in span_segments
    place: wp.array(dtype=wp.vec3f),
    segment: wp.array(dtype=wp.int32),
    span: wp.array2d(dtype=wp.float32),
    key_out: wp.array(dtype=wp.int64),  # shape [N]
):
    """Sort key of a leaf in its segment: its coordinate along the longest side; empty leaves come last."""
    at = wp.tid()
    own = segment[at // WIDTH]
    longest = int(0)
    side = float(0.0)
    for axis in range(3):
        size = -span[own, 3 + axis] - span[own, axis]
        longest = wp.where(size > side, axis, longest)
        side = wp.max(size, side)
    along = EMPTY_BOUND
    if order[at] >= 0:
        along = place[order[at]][longest]
    key_out[at] = segment_key(own, along)


@wp.kernel
def store_leaves(
    order: wp.array(dtype=wp.int32),  # triangles, then edges, then vertices, in tree order; -1: none
    search: ContactSearch,
    contact: ContactData,
    region_size: int,  # vertices of a region
):
    """Stores leaves in their trees, and vertices in their order and regions. An empty leaf refers to the last one."""
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
            contact.bounds.region[vertex] = 1 + vertex_at // region_size
