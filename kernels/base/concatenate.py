"""Puts pieces of an array end to end, some of them several times, where the array is."""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.kernel
def join_pieces(
    words: wp.array(dtype=wp.int32),
    pieces: wp.array(dtype=wp.vec4i),
    turns: wp.int32,
    joined_out: wp.array(dtype=wp.int32),
):
    """Copies words of four bytes; of each piece where it begins in both, how many they are, and what is added to them.

    With ``turns``, what is added to numbers is taken away from negative ones.
    """
    piece, word = wp.tid()
    begin = pieces[piece]
    if word < begin[2]:
        value = words[begin[1] + word]
        start = begin[3]
        if turns != 0 and value < 0:
            start = -start
        joined_out[begin[0] + word] = value + start
