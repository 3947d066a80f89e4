"""Distances along edges, and connected parts, of a graph that one thread walks through on the CPU."""

import warp as wp

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


@wp.func
def heap_push(
    distance: wp.float64,
    vertex: wp.int32,
    count: wp.int32,
    key_out: wp.array(dtype=wp.float64),  # distances in a heap, none over the two below it [m], shape [2 E + S]
    heap_out: wp.array(dtype=wp.int32),  # their vertices, shape [2 E + S]
):
    """Puts a vertex into a heap of ``count``."""
    place = count
    while place > 0:
        above = (place - 1) // 2
        if key_out[above] <= distance:
            break
        key_out[place] = key_out[above]
        heap_out[place] = heap_out[above]
        place = above
    key_out[place] = distance
    heap_out[place] = vertex


@wp.func
def heap_pop(count: wp.int32, key_out: wp.array(dtype=wp.float64), heap_out: wp.array(dtype=wp.int32)):
    """Takes the first out of a heap, of which ``count`` are left."""
    distance = key_out[count]
    vertex = heap_out[count]
    place = wp.int32(0)
    below = wp.int32(1)
    while below < count:
        if below + 1 < count and key_out[below + 1] < key_out[below]:
            below += 1
        if distance <= key_out[below]:
            break
        key_out[place] = key_out[below]
        heap_out[place] = heap_out[below]
        place = below
        below = 2 * place + 1
    key_out[place] = distance
    heap_out[place] = vertex


@wp.kernel
def measure_distances(
    row: wp.array(dtype=wp.int32),  # start of each vertex's neighbours, shape [V + 1]
    neighbours: wp.array(dtype=wp.int32),  # shape [2 E]
    edge: wp.array(dtype=wp.int32),  # edge to each neighbour, shape [2 E]
    length: wp.array(dtype=wp.float64),  # of edges [m], shape [E]
    sources: wp.array(dtype=wp.int32),  # shape [S]
    key_out: wp.array(dtype=wp.float64),  # scratch, shape [2 E + S]
    heap_out: wp.array(dtype=wp.int32),  # scratch, shape [2 E + S]
    distance_out: wp.array(dtype=wp.float64),  # all infinite; at the end from the nearest source [m], shape [V]
):
    """Distance along edges from the nearest source (Dijkstra, with a binary heap); launched for one thread.

    A vertex that is found again, nearer, stands in the heap twice, and is passed over the second time.
    """
    count = wp.int32(0)
    for n in range(sources.shape[0]):
        distance_out[sources[n]] = wp.float64(0.0)
        heap_push(wp.float64(0.0), sources[n], count, key_out, heap_out)
        count += 1
    while count > 0:
        near = key_out[0]
        vertex = heap_out[0]
        count -= 1
        heap_pop(count, key_out, heap_out)
        if near > distance_out[vertex]:
            continue
        for n in range(row[vertex], row[vertex + 1]):
            found = near + length[edge[n]]
            if found < distance_out[neighbours[n]]:
                distance_out[neighbours[n]] = found
                heap_push(found, neighbours[n], count, key_out, heap_out)
                count += 1


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
