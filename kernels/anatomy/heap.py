"""A binary heap of numbers by their distance, none nearer than the one above it, for one thread on the CPU."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

NOWHERE = wp.constant(-1)


@wp.struct
class HeapState:
    """N numbers, from 0, and which of them are in the heap."""

    distance: wp.array(dtype=wp.float64)  # shape [N]
    heap: wp.array(dtype=wp.int32)  # those in the heap, nearest first, shape [N]
    place: wp.array(dtype=wp.int32)  # of each in the heap; NOWHERE: it is not there, shape [N]


@wp.func
def place_in_heap(number: wp.int32, place: wp.int32, heap_out: HeapState):
    """Puts a number into a place of the heap."""
    heap_out.heap[place] = number
    heap_out.place[number] = place


@wp.func
def put_nearer(number: wp.int32, distance: wp.float64, count: wp.int32, heap_out: HeapState):
    """Gives a number a shorter distance, in a heap of ``count``; returns how many are in it then."""
    heap_out.distance[number] = distance
    here = heap_out.place[number]
    size = count
    if here == NOWHERE:
        here = count
        size = count + 1
    while here > 0:
        above = (here - 1) // 2
        other = heap_out.heap[above]
        if heap_out.distance[other] <= distance:
            break
        place_in_heap(other, here, heap_out)
        here = above
    place_in_heap(number, here, heap_out)
    return size


@wp.func
def take_nearest(count: wp.int32, heap_out: HeapState):
    """Takes the nearest number out of a heap of ``count``, and returns it."""
    nearest = heap_out.heap[0]
    heap_out.place[nearest] = NOWHERE
    number = heap_out.heap[count - 1]
    distance = heap_out.distance[number]
    here = wp.int32(0)
    below = wp.int32(1)
    while below < count - 1:
        if below + 1 < count - 1:
            if heap_out.distance[heap_out.heap[below + 1]] < heap_out.distance[heap_out.heap[below]]:
                below += 1
        if distance <= heap_out.distance[heap_out.heap[below]]:
            break
        place_in_heap(heap_out.heap[below], here, heap_out)
        here = below
        below = 2 * here + 1
    if count > 1:
        place_in_heap(number, here, heap_out)
    return nearest
