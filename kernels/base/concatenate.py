"""Concatenation of pieces of an array on its device, some of them several times."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def join_pieces(
    values: wp.array(dtype=wp.int32),  # four bytes each, whatever they hold
    pieces: wp.array(dtype=wp.vec4i),  # start in joined_out, start in values, length, increment
    indices: wp.int32,  # 1: the increment is subtracted from negative values, which are -1 - index
    joined_out: wp.array(dtype=wp.int32),
):
    """Copies pieces of an array, and adds each piece's increment to its values."""
    piece, at = wp.tid()
    begin = pieces[piece]
    if at < begin[2]:
        value = values[begin[1] + at]
        increment = begin[3]
        if indices != 0 and value < 0:
            increment = -increment
        joined_out[begin[0] + at] = value + increment
