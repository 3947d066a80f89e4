"""Active set: kernels pass over groups of neighbouring elements, those of items that still iterate."""

import warp as wp

GROUP = 256  # neighbouring elements


@wp.func
def active_element(groups: wp.array(dtype=wp.int32), thread: int):
    """Element of a thread, by the list of active groups; may be beyond the last one. An empty list means all."""
    if groups.shape[0] == 0:
        return thread
    return wp.static(GROUP) * groups[thread // wp.static(GROUP)] + thread % wp.static(GROUP)
