"""What the host plans patches by, and what acts in a cloth; needs no Warp, which processes that only load lack."""

from typing import NamedTuple

BLOCK_MEMORY = 36 * 1024  # [bytes] of a thread block; a core of a large GPU has room for six such blocks
BLOCKS_PER_CORE = 5  # that its registers are to suffice for: each fetches while others work
FEW = 264  # blocks, that a large GPU's cores work on by twos
RANKS = 8  # of what meets at a vertex that share a word


class Terms(NamedTuple):
    """What acts in a scene's cloth; the kernels are made for these."""

    edges: bool
    folds: bool
    threads: bool
    angles: bool = False  # folds that are not flat at rest
    pins: bool = False  # vertices that stay


def real_size(precision: str) -> int:
    """Bytes of a number that is no position."""
    return 8 if precision == "float64" else 4


def point_size(precision: str) -> int:
    """Bytes of a position."""
    return 12 if precision == "float32" else 24


def fold_numbers(terms: Terms) -> int:
    """How many numbers of an edge's hinge its triangles are told: those with threads know L^2 themselves."""
    return 2 if terms.threads else 3
