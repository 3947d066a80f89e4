"""Shortest ways over the cells of a grid, which one thread walks through on the CPU."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

NOWHERE = wp.constant(-1)


@wp.struct
class WayState:
    """Cells that are reached; N cells, numbered along the last axis first."""

    distance: wp.array(dtype=wp.float64)  # from the start, infinite where not reached, shape [N]
    before: wp.array(dtype=wp.int32)  # the cell before on the best way; NOWHERE: none, shape [N]
    heap: wp.array(dtype=wp.int32)  # cells still to be left, none nearer than the one above it, shape [N]
    place: wp.array(dtype=wp.int32)  # of each cell in the heap; NOWHERE: it is not there, shape [N]


@wp.func
def place_in_heap(cell: wp.int32, place: wp.int32, ways_out: WayState):
    """Puts a cell into a place of the heap."""
    ways_out.heap[place] = cell
    ways_out.place[cell] = place


@wp.func
def move_up(cell: wp.int32, place: wp.int32, ways_out: WayState):
    """Puts a cell into the heap at ``place``, or above it."""
    here = place
    distance = ways_out.distance[cell]
    while here > 0:
        above = (here - 1) // 2
        other = ways_out.heap[above]
        if ways_out.distance[other] <= distance:
            break
        place_in_heap(other, here, ways_out)
        here = above
    place_in_heap(cell, here, ways_out)


@wp.func
def take_nearest(count: wp.int32, ways_out: WayState):
    """Takes the nearest cell out of a heap of ``count``, and returns it."""
    nearest = ways_out.heap[0]
    ways_out.place[nearest] = NOWHERE
    cell = ways_out.heap[count - 1]
    distance = ways_out.distance[cell]
    here = wp.int32(0)
    below = wp.int32(1)
    while below < count - 1:
        if below + 1 < count - 1:
            if ways_out.distance[ways_out.heap[below + 1]] < ways_out.distance[ways_out.heap[below]]:
                below += 1
        if distance <= ways_out.distance[ways_out.heap[below]]:
            break
        place_in_heap(ways_out.heap[below], here, ways_out)
        here = below
        below = 2 * here + 1
    if count > 1:
        place_in_heap(cell, here, ways_out)
    return nearest


@wp.kernel
def find_ways(
    cost: wp.array3d(dtype=wp.float64),  # of a way through each cell, per length; infinite: it is not free
    step_length: wp.array3d(dtype=wp.float64),  # half the distance to each neighbour [m], shape [3, 3, 3]
    start: wp.int32,
    ends: wp.array(dtype=wp.int32),  # shape [E]
    ways_out: WayState,  # distances infinite, else NOWHERE
):
    """The best ways from a cell to others, over 26 neighbours (Dijkstra); launched for one thread.

    Ends when all ``ends`` are reached. Of equally good ways a cell is reached by the one from the lowest cell.
    """
    left = ends.shape[0]
    ways_out.distance[start] = wp.float64(0.0)
    place_in_heap(start, 0, ways_out)
    count = wp.int32(1)
    while count > 0 and left > 0:
        cell = take_nearest(count, ways_out)
        count -= 1
        for n in range(ends.shape[0]):
            if ends[n] == cell:
                left -= 1
        z = cell % cost.shape[2]
        y = (cell // cost.shape[2]) % cost.shape[1]
        x = cell // (cost.shape[2] * cost.shape[1])
        distance = ways_out.distance[cell]
        for i in range(wp.max(x - 1, 0), wp.min(x + 2, cost.shape[0])):
            for j in range(wp.max(y - 1, 0), wp.min(y + 2, cost.shape[1])):
                for k in range(wp.max(z - 1, 0), wp.min(z + 2, cost.shape[2])):
                    other = (i * cost.shape[1] + j) * cost.shape[2] + k
                    found = distance + step_length[i - x + 1, j - y + 1, k - z + 1] * (cost[x, y, z] + cost[i, j, k])
                    if other == cell or not wp.isfinite(found):
                        continue
                    if found < ways_out.distance[other]:
                        ways_out.distance[other] = found
                        ways_out.before[other] = cell
                        place = ways_out.place[other]
                        if place == NOWHERE:
                            place = count
                            count += 1
                        move_up(other, place, ways_out)
                    elif found == ways_out.distance[other] and cell < ways_out.before[other]:
                        ways_out.before[other] = cell
