"""What the host plans patches by, and what acts in a cloth; needs no Warp, which processes that only load lack."""

from typing import NamedTuple

BLOCK_MEMORY = 36 * 1024  # [bytes] of a thread block; a core of a large GPU has room for six such blocks
BLOCK_THREADS = 192  # that work on a patch
BLOCKS_PER_CORE = 5  # that its registers are to suffice for: each fetches while others work
FEW = 264  # blocks, that a large GPU's cores work on by twos
SLOTS = 3  # edges that a thread takes at most with its two triangles
# How an edge lies that is a side of these triangles a, b, c and b, a, d: numbers of its side (0: no edge), and bits.
SIDE_BC, SIDE_CA, SIDE_AD, SIDE_DB, SIDE_AB = 1, 2, 3, 4, 5
CODE_BACK, CODE_AFTER = 8, 16  # runs against its triangle's winding; its triangle is the hinge's second one
CODE_TURN_0, CODE_TURN_1 = 5, 7  # two bits from these on: at which corner the mesh's first and second triangle starts
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
