"""Bytes that a launch moves, in the sectors that memory and caches hand out: from its arrays and what is in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.avatar.field import ContactField
from warp_cloth.kernels.base.options import block_for
from warp_cloth.kernels.base.types import Patch
from warp_cloth.kernels.contact.arrays import ON_EDGE
from warp_cloth.kernels.contact.box_tree import WIDTH
from warp_cloth.solver.forces import patch_threads
from warp_cloth.study.asked import SECTOR, STORED, THREADS, Part, ranges
from warp_cloth.study.caches import core_bytes, spilled_bytes
from warp_cloth.study.gathered import gathered_work
from warp_cloth.study.launches import Launch
from warp_cloth.study.listed import groups_that_go_on, work_on_lists
from warp_cloth.study.pressed import (
    CORNERS,
    block_of_pairs,
    chosen_pairs,
    looked_at,
    near_pairs,
    packets,
    stores,
    unregistered,
)
from warp_cloth.study.traffic import ANY, FROM, REGIONS, SEVERAL, Chain, Uses

ITEMS = "item_count"  # which take, with what is left over, all edges or triangles that a patch has
LAWS = "law_start"  # from which on edges find how they pull and bend, in any order
OF_ITEMS = {"edge_start": "edge_count", "triangle_start": "triangle_count", LAWS: "law_count"}
PATCHES, PATCH_WIDTH = "patches.patch", 16  # kernels.base.types's Patch, one after another, and the numbers of each
TABLE_NODES = 3  # along each axis of a table, that a thread reads round its place
AT_A_TIME = 1 << 16  # vertices whose places in a table are looked up together

BLOCKS, STORES = "blocks", "stores"  # by which those are told apart that share what they ask for

Keys = NDArray[np.int64]
BLOCK = 1 << 36  # in a key that stands for a sector of an array and the block that asks for it


def moved_bytes(launch: Launch, uses: Uses) -> tuple[int, int]:
    """Bytes that a launch moves to and from memory, and between the last cache and the cores.

    In memory each sector counts once: whoever asks for it again finds it in the cache. Of the cache every block of
    threads asks by itself, so that what lies between two patches is asked for twice; and where a core's own cache does
    not hold what its patches have read, in every loop over a patch again. What registers do not hold goes there, too:
    counted once for each vertex, for each leaf of groups that meet, and as ``unregistered`` says.
    """
    return _Moved(launch, uses).total()


class _Moved:
    """What one launch moves."""

    def __init__(self, launch: Launch, uses: Uses) -> None:
        self._launch, self._uses, self._arrays = launch, uses, launch.arrays()
        self._device = next(iter(self._arrays.values())).device
        self._patch: dict[str, Keys] = {}
        self._vertex = np.zeros(0, dtype=np.int64)  # the patches' vertices
        positions = (len(of) for name, of in self._arrays.items() if name.endswith(".position"))
        self._vertices = max(positions, default=launch.threads)
        if PATCHES in self._arrays:
            rows = self._arrays[PATCHES].numpy().reshape(-1, PATCH_WIDTH).astype(np.int64)
            self._patch = {name: rows[:, at] for at, name in enumerate(Patch.vars)}
            self._vertex = self._arrays["patches.vertex"].numpy().astype(np.int64)
        paired = bool(self._patch.get(ITEMS, np.zeros(0)).any())
        self._block = block_for(paired)
        self._threads = patch_threads(launch.kernel, paired) if self._patch else self._block.threads
        self._cores = max(self._device.sm_count, 1) if self._device.is_cuda else self._launch.threads
        self._known: dict[Any, dict[str, Keys]] = {}  # sectors by loop, of arrays that are used alike
        self._listed = work_on_lists(self._arrays, uses.read, uses.written, launch.threads)
        self._gathered = gathered_work(launch, self._arrays, uses) if self._device.is_cuda else {}

    def total(self) -> tuple[int, int]:
        """Bytes to and from memory, and between the last cache and the cores."""
        memory = once = again = of_patches = written = 0
        for used in (self._uses.read, self._uses.written):
            for name in sorted(used.keys() & self._arrays.keys()):
                loops = self._loops(name, used[name], by=STORES if used is self._uses.written else BLOCKS)
                asked = _distinct(np.concatenate(list(loops.values())))
                memory += _distinct_sectors(asked)
                if used is self._uses.written:
                    written += len(asked) + self._added_one_by_one(name)
                    if name in self._uses.raised:
                        written += self._raised(name)
                    if name in self._uses.answered:
                        once, again = once + len(asked), again + len(asked)
                else:
                    once += len(asked)
                    again += sum(len(keys) for keys in loops.values())
                    of_patches += int((asked < BLOCK * len(self._patch.get("place", ()))).sum())
        read = once if self._holds(of_patches) else again
        return SECTOR * memory, SECTOR * (read + written) + self._unregistered()

    def _unregistered(self) -> int:
        """Bytes of what registers do not hold: for each vertex, pair, or leaf."""
        spilled = spilled_bytes(self._launch.command, self._device.alias)
        turns = min(self._vertices, self._launch.threads)
        for name, chains in self._uses.read.items():
            chain = next(iter(chains))
            if name.endswith(".corners") and any(each.endswith(".due") for each in chain):
                found = self._known_of(name, chain)
                pairs = chosen_pairs(self._arrays, _owner(name), chain, found)
                edges = int((self._arrays[f"{_owner(name)}.due"].numpy()[pairs] & 1 == int(ON_EDGE)).sum())
                threads = self._launch.threads - self._threads * len(self._patch.get("place", ()))
                return unregistered(spilled, threads, found, edges)
            if name.endswith(".group") and name in self._arrays and self._device.is_cuda:
                turns = int(WIDTH) * int(groups_that_go_on(self._arrays).sum())
        return spilled * turns

    def _added_one_by_one(self, name: str) -> int:
        """Sectors beyond one of each: no core's cache takes several numbers of a row, or additions to one, together."""
        array = self._arrays[name]
        if len(array) != self._vertices or self._listed or STORED + name in self._gathered:
            return 0
        chains, of_pairs = self._uses.written[name], self._chains_of_pairs(name)
        columns = array.size // len(array)
        size = columns * wp.types.type_size_in_bytes(array.dtype)
        rows = [len(self._sectors(name, chain, "", by=STORES)) for chain in of_pairs]
        sent = [
            packets(*self._of_pairs(name, _owner(name), chain, self._known_of(name, chain), by=STORES), size)
            for chain in of_pairs
        ]
        others = self._loops(name, chains - set(of_pairs), by=STORES) if columns > 1 and chains - set(of_pairs) else {}
        return columns * sum(sent) - max(rows, default=0) + (columns - 1) * sum(map(len, others.values()))

    def _chains_of_pairs(self, name: str) -> list[Chain]:
        """Those in which pairs that press add to an array."""
        if name not in self._uses.summed:
            return []
        return [chain for chain in self._uses.written[name] if any(each.endswith(".due") for each in chain)]

    def _raised(self, name: str) -> int:
        """Sectors that warps send, which raise a table's numbers, one for each region, for the vertices of a patch."""
        if not self._patch or not self._device.is_cuda:
            return 0
        block, vertex = self._vertices_by_block()
        local = np.arange(len(block)) - np.searchsorted(block, block)
        region = self._arrays[f"{_owner(name)}.region"].numpy()[vertex].astype(np.int64)
        size = wp.types.type_size_in_bytes(self._arrays[name].dtype)
        return packets(block * self._threads + local // int(WIDTH), region, size)

    def _of_regions(self, name: str, size: int, *, by: str) -> Keys:
        """The sectors of a table with a number for each region: blocks that press read it, the first one writes."""
        count = self._launch.arguments[_owner(name)].region_count
        blocks = self._launch.threads // self._threads - len(self._patch.get("place", ()))
        blocks = 1 if by == STORES else max(min(blocks, self._cores), 1)
        return _keys(np.repeat(np.arange(blocks), count), np.tile(np.arange(count), blocks), size)

    def _holds(self, sectors: int) -> bool:
        """Whether cores' own caches hold so many sectors, all that patches read, till they are asked for again.

        Blocks that work at the same time share a core's cache, from which their own memory takes room. What pairs ask
        for twice their neighbours in a block's queue ask for, at the same time.
        """
        if not self._patch or not self._device.is_cuda:
            return True
        patches, blocks = len(self._patch["place"]), max(self._launch.threads // self._threads, 1)
        _, most = self._launch.kernel.options.get("launch_bounds") or (0, self._block.per_core)
        together = min(-(-blocks // self._device.sm_count), most)
        room = core_bytes(self._device.alias) - together * self._block.memory
        return SECTOR * sectors * together <= room * patches

    def _loops(self, name: str, chains: set[Chain], *, by: str = BLOCKS) -> dict[str, Keys]:
        """The sectors of an array that each block asks for in some chains, by the loop that asks."""
        array = self._arrays[name]
        packed = name in self._uses.packed
        # what lists and meshes lead to differs from array to array
        own = name if self._listed or self._gathered.keys() & {name, STORED + name} else ""
        asked = frozenset(chains), frozenset(self._uses.picked.get(name, ())), own, by
        start = self._uses.starts.get(name, "")
        alike = *asked, start, array.dtype, array.shape, packed
        if array.ndim > 2 or alike not in self._known:
            found: dict[str, list[Keys]] = {}
            for chain in chains:
                loop = next((each for each in reversed(chain) if each in self._patch), "")
                if loop == ITEMS or (loop and start == LAWS):
                    loop = OF_ITEMS.get(start, loop)
                if not loop and self._patch and len(array) == self._vertices and not self._counters(chain):
                    loop = "owned_count"  # each thread its own
                if loop or len(chains) == 1 or not start:  # else what a loop's first turn uses, asked for early
                    found.setdefault(loop, []).append(self._sectors(name, chain, loop, by=by))
            self._known[alike] = {loop: _distinct(np.concatenate(keys)) for loop, keys in found.items()}
        return self._known[alike]

    def _sectors(self, name: str, chain: Chain, loop: str, *, by: str) -> Keys:
        """The sectors of an array that each block asks for in a chain."""
        array = self._arrays[name]
        size = wp.types.type_size_in_bytes(array.dtype)
        if array.ndim > 1 and len(array) == self._vertices:
            size *= array.size // len(array)  # a row for each vertex
        elif REGIONS in chain:
            return self._of_regions(name, size, by=by)
        elif array.ndim > 1:
            return self._looked_up(name, size)
        wanted = STORED + name if by == STORES else name
        if self._listed:  # what is not among it only those ask for that find the lists full
            led = self._listed.get(wanted, self._listed.get(name))
            return _keys(*led, size) if led is not None else np.zeros(0, dtype=np.int64)
        if wanted in self._gathered:
            return self._elements(name, *self._gathered[wanted], size)
        counters = self._counters(chain)
        known = self._known_of(name, chain)
        start = self._uses.starts.get(name, "")
        if not known or any(map(self._never, chain)):
            return np.zeros(0, dtype=np.int64)
        if loop and start:
            return _keys(*self._ranges(chain, loop, start, len(array)), size)
        if loop and len(array) == self._vertices:
            block, vertex = self._vertices_by_block(loop)
            if by == STORES and self._chains_of_pairs(name):  # what pairs left there is taken, and only that
                added = np.zeros(self._vertices, dtype=bool)
                for each in self._chains_of_pairs(name):
                    added[self._of_pairs(name, _owner(name), each, self._known_of(name, each), by=STORES)[1]] = True
                block, vertex = block[added[vertex]], vertex[added[vertex]]
            return self._elements(name, block, vertex, size)
        if counters and not loop:
            owner = _owner(counters[0])
            if f"{owner}.due" in self._arrays:
                return _keys(*self._of_pairs(name, owner, chain, known, by=by), size)
            return _keys(np.arange(min(known, len(array))) // THREADS, np.arange(min(known, len(array))), size)
        if len(array) * size <= SECTOR:  # which every block asks for
            return np.arange(max(len(self._patch.get("place", ())), -(-self._launch.threads // THREADS))) * BLOCK
        return _keys(np.arange(len(array)) // THREADS, np.arange(len(array)), size)

    def _counters(self, chain: Chain) -> list[str]:
        """Of a chain those on the device, which bound what is for pairs and not for a patch."""
        return [each for each in chain if each.endswith(".count") and each in self._arrays]

    def _known_of(self, name: str, chain: Chain) -> int:
        """How many elements counters on the device bound; 1 where there are none."""
        counts = [self._arrays[each].numpy() for each in self._counters(chain)]
        if len(counts) == 1 and len(counts[0]) > 1:  # kernels.contact.broad_phase's: groups, then leaves in parts
            return int(counts[0][0] if name.endswith(".group") else counts[0][1:].sum())
        return min((int(count.max()) for count in counts), default=1)

    def _never(self, each: str) -> bool:
        """Whether a part of a chain is a member of structs that is not above zero in any of them."""
        array, _, member = each.rpartition(".")
        if array not in self._arrays or member not in getattr(self._arrays[array].dtype, "vars", {}):
            return False
        return not (self._arrays[array].numpy()[member] > 0).any()

    def _ranges(self, chain: Chain, loop: str, start: str, end: int) -> Part:
        """Patches, and the part of a table that ends at ``end`` that each goes over."""
        first = self._patch[start]
        if SEVERAL in chain:  # several for each: the whole part, which ends where the next one begins
            count, order = np.empty_like(first), np.argsort(first, kind="stable")
            count[order] = np.diff(first[order], append=end)
            return ranges(first, count)
        beyond = sum(self._patch[each] for each in self._patch if FROM + each in chain)
        if loop == "normal_count":  # an item's normals are worked out from what its edges' table tells of its vertices
            beyond = beyond + np.where(self._patch[ITEMS] > 0, self._patch["triangle_count"], 0)
        return ranges(first + beyond, self._patch[loop] - beyond)

    def _elements(self, name: str, block: Keys, vertex: Keys, size: int) -> Keys:
        """The sectors of what an array has of vertices."""
        if name not in self._uses.packed:
            return _keys(block, vertex, size)
        behind = -(-size * self._vertices * 2 // 3 // SECTOR)  # two thirds of each, and then the last third of all
        return _distinct(
            np.concatenate([_keys(block, vertex, size * 2 // 3), _keys(block, vertex, size // 3) + behind])
        )

    def _vertices_by_block(self, loop: str = "owned_count") -> Part:
        """Blocks, and the vertices that each goes over."""
        if not self._patch:
            return np.arange(self._vertices) // THREADS, np.arange(self._vertices)
        block, place = ranges(self._patch["vertex_start"], self._patch[loop])
        return block, self._vertex[place]

    def _of_pairs(self, name: str, contact: str, chain: Chain, found: int, *, by: str) -> Part:
        """Blocks, or single stores, and the pairs, or their vertices, that each goes over.

        Blocks that press work all at once, and those of one core share its cache: they count as one. No core's cache
        puts together what several stores write, and pairs that go together are not neighbours.
        """
        array, room = self._arrays[name], len(self._arrays[f"{contact}.corners"])
        others = len(self._patch.get("place", ()))  # blocks, which work on patches
        blocks = self._launch.threads // self._threads - others
        if name in self._uses.ahead and self._device.is_cuda and f"{contact}.due" not in chain:
            pair = np.arange(looked_at(found, room, blocks))
        else:
            pair = chosen_pairs(self._arrays, contact, chain, found)
        block = others + (block_of_pairs(pair, blocks) if by == STORES else block_of_pairs(pair, blocks) % self._cores)
        if by == STORES and f"{contact}.due" in chain:
            block = stores(block, self._arrays[f"{contact}.due"].numpy()[pair] & 1 == int(ON_EDGE))
            if name in (f"{contact}.due", f"{contact}.room"):
                near = np.isin(pair, near_pairs(self._arrays, contact, pair))
                here = near if name == f"{contact}.room" else ~near
                pair, block = pair[here], block[here]
        if len(array) == room:
            return block, pair
        if len(array) != self._vertices:  # a hash table
            return block, pair * (len(array) // room)
        picked = self._uses.picked.get(name, {ANY})
        which = list(range(CORNERS)) if ANY in picked else sorted(picked)
        apart = np.array(which) if by == STORES else np.zeros(len(which), dtype=np.int64)  # one corner after another
        corners = self._arrays[f"{contact}.corners"].numpy()[pair][:, which]
        return (CORNERS * block[:, None] + apart).ravel(), corners.ravel().astype(np.int64)

    def _looked_up(self, name: str, size: int) -> Keys:
        """The sectors of a table that vertices look up by place."""
        array = self._arrays[name]
        block, vertex = self._vertices_by_block()
        clear = next((of for each, of in self._arrays.items() if each.endswith(".clear")), None)
        if clear is not None:  # only of what may have come near
            looks = clear.numpy()[vertex] == 0.0
            block, vertex = block[looks], vertex[looks]
        fields = self._launch.arguments.get(name.partition(".")[0])
        if not isinstance(fields, wp.array) or fields.dtype is not ContactField:
            nodes = np.arange(min(TABLE_NODES**array.ndim * len(vertex), array.size))
            return _keys(nodes // THREADS, nodes, size)
        field = np.frombuffer(fields[:1].numpy().tobytes(), dtype=ContactField.numpy_dtype())[0]
        which, positions = next(each for each in self._arrays.items() if each[0].endswith(".position"))
        place = positions.numpy()
        if which in self._uses.packed:
            pairs, thirds = np.split(place.ravel(), [2 * len(place)])
            place = np.column_stack([pairs.reshape(-1, 2), thirds])
        found = [
            _keys(*field_nodes(field, array.numpy(), block[some], place[vertex[some]]), size)
            for some in np.array_split(np.arange(len(vertex)), -(-len(vertex) // AT_A_TIME))
        ]
        return _distinct(np.concatenate(found))


def field_nodes(field: Any, values: NDArray[np.float32], block: Keys, points: NDArray[Any]) -> Part:
    """Blocks, and the nodes of a field's ``values`` that ``field_contact`` reads at each point."""
    shape = np.array(values.shape)
    node = np.floor((points - field["origin"]) / field["spacing"] + 0.5).astype(np.int64)
    inside = ((node >= 1) & (node <= shape - 2)).all(axis=1)
    block, node = block[inside], node[inside]
    middle = np.ravel_multi_index(tuple(node.T), values.shape)
    near = values.ravel()[middle] <= field["reach"] + field["spacing"]
    step = np.arange(-1, 2)
    rows = (step[:, None] * shape[1] + step).ravel() * shape[2]
    ends = np.array([-1, 1])  # of the three nodes of a row, that the middle one lies between
    read = middle[near, None] + np.add.outer(rows, ends).ravel()
    first = middle[:, None] + ends
    blocks = np.concatenate([np.repeat(block, len(ends)), np.repeat(block[near], read.shape[1])])
    return blocks, np.concatenate([first.ravel(), read.ravel()])


def _owner(name: str) -> str:
    """The struct that an array lies in."""
    return name.rpartition(".")[0]


def _keys(block: Keys, element: Keys, size: int) -> Keys:
    """Sectors in which elements of so many bytes lie, each once for every block."""
    first, last = element * size // SECTOR, (element * size + size - 1) // SECTOR
    if (last > first).any():
        first, block = np.stack([first, last], axis=1).ravel(), np.repeat(block, 2)
    return _distinct(block * BLOCK + first)


def _distinct(keys: Keys) -> Keys:
    """Keys without doubles, in order."""
    if (keys[1:] < keys[:-1]).any():
        keys = np.sort(keys)
    return keys[np.diff(keys, prepend=-1) != 0]


def _distinct_sectors(keys: Keys) -> int:
    """How many sectors of an array the keys stand for, whoever asks."""
    sectors = keys % BLOCK
    found = np.zeros(int(sectors.max(initial=-1)) + 1, dtype=bool)
    found[sectors] = True
    return int(found.sum())
