"""Distances along edges, and connected parts, of a graph that one thread walks through on the CPU."""

import warp as wp

from warp_cloth.kernels.anatomy.heap import HeapState, put_nearer, take_nearest

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def link_vertices(
    edges: wp.array2d(dtype=wp.int32),  # their two vertices, shape [E, 2]
    place_out: wp.array(dtype=wp.int32),  # start of each vertex's neighbours; then their end, shape [V]
    neighbours_out: wp.array(dtype=wp.int32),  # shape [2 E]
    edge_out: wp.array(dtype=wp.int32),  # edge to each neighbour, shape [2 E]
):
    """Writes each edge into the rows of both its vertices; launched for one thread."""
    for edge in range(edges.shape[0]):
        for end in range(2):
            vertex = edges[edge, end]
            place = place_out[vertex]
            neighbours_out[place] = edges[edge, 1 - end]
            edge_out[place] = edge
            place_out[vertex] = place + 1


@wp.kernel
def measure_distances(
    row: wp.array(dtype=wp.int32),  # start of each vertex's neighbours, shape [V + 1]
    neighbours: wp.array(dtype=wp.int32),  # shape [2 E]
    edge: wp.array(dtype=wp.int32),  # edge to each neighbour, shape [2 E]
    length: wp.array(dtype=wp.float64),  # of edges [m], shape [E]
    sources: wp.array(dtype=wp.int32),  # shape [S]
    heap_out: HeapState,  # of V vertices; distances infinite, at the end from the nearest source [m]; places NOWHERE
):
    """Distance along edges from the nearest source (Dijkstra, with a binary heap); launched for one thread."""
    count = wp.int32(0)
    for n in range(sources.shape[0]):
        count = put_nearer(sources[n], wp.float64(0.0), count, heap_out)
    while count > 0:
        vertex = take_nearest(count, heap_out)
        count -= 1
        for n in range(row[vertex], row[vertex + 1]):
            found = heap_out.distance[vertex] + length[edge[n]]
            if found < heap_out.distance[neighbours[n]]:
                count = put_nearer(neighbours[n], found, count, heap_out)


@wp.func
def lowest_of(vertex: wp.int32, label_out: wp.array(dtype=wp.int32)) -> wp.int32:
    """The lowest vertex known of a part; on the way every other link is shortened."""
    here = vertex
    while label_out[here] != here:
        label_out[here] = label_out[label_out[here]]
        here = label_out[here]
    return here


@wp.kernel
def label_parts(
    edges: wp.array2d(dtype=wp.int32),  # shape [E, 2]
    label_out: wp.array(dtype=wp.int32),  # first each vertex itself, then the lowest of its part, shape [V]
):
    """The lowest vertex of each vertex's connected part; launched for one thread."""
    for edge in range(edges.shape[0]):
        a = lowest_of(edges[edge, 0], label_out)
        b = lowest_of(edges[edge, 1], label_out)
        label_out[wp.max(a, b)] = wp.min(a, b)
    for vertex in range(label_out.shape[0]):
        label_out[vertex] = label_out[label_out[vertex]]  # lower vertices are done


@wp.kernel
def find_nearest(
    points: wp.array(dtype=wp.vec3d),  # in the order of their place along an axis [m], shape [V]
    axis: wp.int32,
    queries: wp.array(dtype=wp.vec3d),  # [m], shape [Q]
    start: wp.array(dtype=wp.int32),  # point at or above each query along the axis, shape [Q]
    nearest_out: wp.array(dtype=wp.int32),  # shape [Q]
):
    """The nearest point to each query: up and down the axis until that alone is farther; the first of equals."""
    query = wp.tid()
    at = queries[query]
    least = wp.float64(wp.inf)
    found = wp.int32(-1)
    for way in range(2):
        n = start[query] - way
        while n >= 0 and n < points.shape[0]:
            along = points[n][axis] - at[axis]
            if along * along > least:
                break
            off = points[n] - at
            distance = off[0] * off[0] + off[1] * off[1] + off[2] * off[2]
            if distance < least or (distance == least and n < found):
                least = distance
                found = n
            n += 1 - 2 * way
    nearest_out[query] = found
