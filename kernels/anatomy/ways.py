"""Shortest ways over the cells of a grid, which one thread walks through on the CPU."""

import warp as wp

from warp_cloth.kernels.anatomy.heap import HeapState, put_nearer, take_nearest

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def find_ways(
    cost: wp.array3d(dtype=wp.float64),  # of a way through each cell, per length; infinite: it is not free
    step_length: wp.array3d(dtype=wp.float64),  # half the distance to each neighbour [m], shape [3, 3, 3]
    start: wp.int32,
    ends: wp.array(dtype=wp.int32),  # shape [E]
    heap_out: HeapState,  # of N cells, numbered along the last axis first; distances infinite, places NOWHERE
    before_out: wp.array(dtype=wp.int32),  # the cell before on the best way; first NOWHERE, shape [N]
):
    """The best ways from a cell to others, over 26 neighbours (Dijkstra); launched for one thread.

    Ends when all ``ends`` are reached. Of equally good ways a cell is reached by the one from the lowest cell.
    """
    left = ends.shape[0]
    count = put_nearer(start, wp.float64(0.0), 0, heap_out)
    while count > 0 and left > 0:
        cell = take_nearest(count, heap_out)
        count -= 1
        for n in range(ends.shape[0]):
            if ends[n] == cell:
                left -= 1
        z = cell % cost.shape[2]
        y = (cell // cost.shape[2]) % cost.shape[1]
        x = cell // (cost.shape[2] * cost.shape[1])
        distance = heap_out.distance[cell]
        for i in range(wp.max(x - 1, 0), wp.min(x + 2, cost.shape[0])):
            for j in range(wp.max(y - 1, 0), wp.min(y + 2, cost.shape[1])):
                for k in range(wp.max(z - 1, 0), wp.min(z + 2, cost.shape[2])):
                    other = (i * cost.shape[1] + j) * cost.shape[2] + k
                    found = distance + step_length[i - x + 1, j - y + 1, k - z + 1] * (cost[x, y, z] + cost[i, j, k])
                    if other == cell or not wp.isfinite(found):
                        continue
                    if found < heap_out.distance[other]:
                        before_out[other] = cell
                        count = put_nearer(other, found, count, heap_out)
                    elif found == heap_out.distance[other] and cell < before_out[other]:
                        before_out[other] = cell
