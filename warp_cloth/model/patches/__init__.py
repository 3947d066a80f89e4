"""Cloth cut into patches, each for a block of threads: which elements each has, how they lie in memory."""
