"""Kernels that work on some of many vertices, edges or triangles: those of the groups that are listed for them."""

import warp as wp

GROUP = 256  # neighbours


@wp.func
def listed(groups: wp.array(dtype=wp.int32), thread: int):
    """What a thread works on, which may be beyond the last one; where no groups are listed, on all, in order."""
    if groups.shape[0] == 0:
        return thread
    return wp.static(GROUP) * groups[thread // wp.static(GROUP)] + thread % wp.static(GROUP)
