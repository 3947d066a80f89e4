"""Which pairs of cloth blocks of threads look at and press, as kernels.contact.narrow_phase_queue shares them out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.kernels.base.block import BLOCK_THREADS
from warp_cloth.kernels.contact.arrays import ON_EDGE, REGIONS
from warp_cloth.kernels.contact.narrow_phase_queue import ROUNDS
from warp_cloth.kernels.contact.squeeze import PARALLEL
from warp_cloth.study.asked import SECTOR, Arrays, Numbers
from warp_cloth.study.traffic import SEVERAL, Chain, Uses

TEAM = 32  # threads that go together, and pairs next to each other that a block takes
CORNERS = 4
LOOKED = 16 * ROUNDS  # bytes of a thread: when the pairs that it looked at ahead may be near, and their regions
INSTRUCTION = 1 << 20  # the first number of those that stand for a block


def presses(uses: Uses) -> bool:
    """Whether a kernel presses pairs."""
    return any(name.endswith(".due") and name in chain for name, chains in uses.written.items() for chain in chains)


def chosen_pairs(arrays: Arrays, contact: str, chain: Chain, found: int) -> Numbers:
    """The pairs that a chain is for, of so many: all, those looked at, or those that press."""
    lean, due, way, stride, turn = (
        arrays[f"{contact}.{each}"].numpy() for each in ("lean", "due", "way", "stride", "turn")
    )
    pair = np.arange(min(found, len(due)))
    if f"{contact}.due" in chain:
        pair = come_pairs(
            arrays, contact, pair, way[0] + stride[turn[0] & 1]
        )  # as kernels.contact.arrays's region_gone
    if f"{contact}.lean" in chain:
        pair = pair[lean[pair].any(axis=1)]
        if f"{contact}.due" in chain and SEVERAL not in chain:  # what turns edges away from each other
            pair = pair[(due[pair] & 1) == int(ON_EDGE)]
            pair = pair[nearly_parallel(arrays, contact, pair)]
    return pair


def come_pairs(arrays: Arrays, contact: str, pair: Numbers, gone: Numbers) -> Numbers:
    """Those of some pairs that come due when their regions have gone so far."""
    due, regions = (arrays[f"{contact}.{each}"].numpy()[pair] for each in ("due", "regions"))
    return pair[due <= gone[four_regions(regions)].sum(axis=1)]


def near_pairs(arrays: Arrays, contact: str, pair: Numbers) -> Numbers:
    """Those of the pairs that have come due whose room is narrowed: others turn out to be far, and are due later on.

    Such as were due in the last iteration already, and are so still.
    """
    return come_pairs(arrays, contact, pair, arrays[f"{contact}.way"].numpy()[0])


def nearly_parallel(arrays: Arrays, contact: str, pair: Numbers) -> NDArray[np.bool_]:
    """Whether pairs of edges turn, by kernels.contact.squeeze's ``share``."""
    positions = next(array for name, array in arrays.items() if name.endswith(".position")).numpy()
    ends = positions[arrays[f"{contact}.corners"].numpy()[pair]].astype(np.float64)
    one, other = ends[:, 1] - ends[:, 0], ends[:, 3] - ends[:, 2]
    square = (np.cross(one, other) ** 2).sum(axis=1)
    return np.asarray(square < PARALLEL * (one**2).sum(axis=1) * (other**2).sum(axis=1))


def four_regions(words: NDArray[np.uint64]) -> Numbers:
    """The regions in each word of kernels.contact.arrays's pair_regions, shape [N, 4]."""
    shift = np.array([0, 16, 32, 48], dtype=np.uint64)
    return ((words[:, None] >> shift) & np.uint64(REGIONS - 1)).astype(np.int64)


def block_of_pairs(pair: Numbers, blocks: int) -> Numbers:
    """Which of so many blocks takes each pair."""
    return pair // TEAM % max(blocks, 1)


def looked_at(found: int, room: int, blocks: int) -> int:
    """How many pairs blocks look at: in the first turn before they know how many there are."""
    return min(max(found, ROUNDS * BLOCK_THREADS * max(blocks, 1)), room)


def stores(block: Numbers, on_edge: NDArray[np.bool_]) -> Numbers:
    """Numbers of the instructions by which queued pairs are stored, those of one together, in the order of pairs."""
    number = np.empty(len(block), dtype=np.int64)
    for sort in (False, True):
        of = np.flatnonzero(on_edge == sort)
        of = of[np.argsort(block[of], kind="stable")]
        counts = np.bincount(block[of])
        place = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)  # in its block's queue
        number[of] = (2 * (place // TEAM) + sort) * (1 + block.max(initial=0)) + block[of]
    return INSTRUCTION + number


def packets(instruction: Numbers, element: Numbers, size: int) -> int:
    """How many sectors instructions send that add to elements of so many bytes, as one adds once to each element."""
    elements = 1 + int(element.max(initial=0))
    keys, often = np.unique(instruction * elements + element, return_counts=True)
    sector = keys // elements * elements + keys % elements * size // SECTOR
    first = np.flatnonzero(np.diff(sector, prepend=-1))
    return int(np.maximum.reduceat(often, first).sum()) if len(first) else 0


def unregistered(spilled: int, threads: int, found: int, edges: int) -> int:
    """Bytes that so many threads store of what registers do not hold, of so many pairs found and edges pressed.

    What a thread has looked at ahead it keeps so while it presses, from its first look on and anew in every turn; what
    else has no room in registers is for a pair of edges, on which it works longest.
    """
    looked = min(LOOKED, spilled)
    turns = -(-found // max(ROUNDS * threads, 1))
    return looked * threads * (1 + turns) + (spilled - looked) * edges if found else 0
