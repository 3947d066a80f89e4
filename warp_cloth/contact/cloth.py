"""Cloth on cloth: its pairs, the search for what is near, and what sets it going."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider
from warp_cloth.contact.arrays import (
    contact_arrays,
    lay_out_trees,
    per_vertex,
    search_arrays,
    thicknesses,
)
from warp_cloth.contact.box_tree import block_count, lists_of
from warp_cloth.contact.facing import Facing
from warp_cloth.contact.leaf_order import Planting
from warp_cloth.contact.sheets import SheetKind, sheets_of
from warp_cloth.contact.untangling import sheet_untangling
from warp_cloth.garment.part import GarmentPart
from warp_cloth.kernels.base.block import BLOCK_THREADS, FEW_PER_CORE
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.contact.box_tree import WIDTH
from warp_cloth.kernels.contact.broad_phase import LISTING, PARTS
from warp_cloth.kernels.contact.crossing_search import crossing_groups_kernel, crossing_leaves_kernel, crossings_kernel
from warp_cloth.kernels.contact.force import press_kernel
from warp_cloth.kernels.contact.narrow_phase_queue import ROUNDS
from warp_cloth.kernels.contact.pairs import groups_kernel, leaves_kernel, pairs_kernel
from warp_cloth.kernels.contact.search import box_kernel, box_rest, open_kernel, start_kernel
from warp_cloth.kernels.contact.search_trigger import weigh_asked
from warp_cloth.kernels.contact.stick_memory import LeanMemory
from warp_cloth.kernels.contact.sums import add_kernel
from warp_cloth.kernels.contact.untangle import forget_tangles, layers_kernel, settle_kernel, spare_tangled
from warp_cloth.model.model import ClothModel
from warp_cloth.model.permutation import Numbering

log = logging.getLogger(__name__)

# How much farther than the thickness pairs are looked for: room to move between two searches. A share of the edges,
# so that it names few more pairs than one would see, and at least two thicknesses.
SKIN_OF_EDGE = 0.35
SKIN_OF_THICKNESS = 2.0
# Each vertex has a skin of its own that wears off till the next search: what moves fastest half of that room, others as
# much less as they move, but no less than this share.
LARGEST_SKIN = 0.5
LEAST_SKIN = 0.3
# Of the skin: pairs within it are looked at in every iteration, and no move is longer than about half of it and the
# thickness; less once forces have balanced, when moves are short.
FAR_SHARE = 0.06
NEARER_SHARE = 0.005
PAIRS_PER_VERTEX = 3  # to begin with; a T-shirt on a body needs less once it is sewn
# Iterations between two looks at whether cloth has moved so far that what is near changed. What is being untangled
# changes with every step, but not by much in four; with ten some tangles never come undone.
LOOK_EVERY = 5
LOOK_SETTLED = 20
# A few vertices that have used up their skins stay where they are till so many iterations after the last search, fewer
# before forces have balanced: then there is another. Few: this share of all, in all iterations till a look.
PATIENCE, PATIENCE_SETTLED = 20, 60
MANY = 0.01
LOOK_UNTANGLING = 4
LOOKING = 64  # threads in a block that walks a tree: some take far longer than others
# Room in a GPU's lists of what meets, for each group of leaves and for each leaf: several times what sewn cloth needs,
# whose crumples may meet more
GROUPS_MET = 32
LEAVES_MET = 8
FINDING = 2**18  # threads that go through the first of these lists, at most
LOOKING_CLOSELY = 2**17  # threads that go through the second, at most: as many as a large GPU works on at a time
PRESSING = 384  # blocks that press pairs, at most: the same
MANY_MORE = 1.25  # times as many pairs as few are, before they no longer count as few
LEAST_PRESSING = 64  # blocks, at least, that press while others move vertices, if there are pairs for so many
BOXING = 1024  # threads in a block that boxes what is in a tree
CROSSINGS = 3  # numbers of which crossings are the sum
STRIDE_SHARE = 0.1  # of thickness and skin: longest untangling shift in an iteration


class ClothContact:
    """Contact of a model's garments with themselves and each other.

    ``data`` is the kernels' view. Until ``awaken`` it lets everything pass, and launches nothing.
    """

    def __init__(
        self,
        model: ClothModel,
        parts: Sequence[GarmentPart],
        kinds: Sequence[SheetKind],
        body: ExactCollider | None = None,
    ) -> None:
        self._model, self._device = model, wp.get_device(model.device)
        self.sheets = sheets_of(parts)
        patches = model.patches
        self._numbering = Numbering(None) if patches is None else patches.numbering
        none = wp.empty(0, dtype=wp.int32, device=model.device)
        self._order = none if patches is None else patches.order
        self.state_now: Callable[[], Any] = lambda: model.state  # as contact numbers its vertices, where they are now
        self._thickness = thicknesses(kinds)
        lengths = np.concatenate([part.rest.edge_length for part in parts])
        thickest = float(self._thickness.max())
        skin = max(SKIN_OF_EDGE * float(np.median(lengths)), SKIN_OF_THICKNESS * thickest)
        self.least_skin = LEAST_SKIN * skin  # [m]; how far what stands still may go till the next search
        self._skin = skin  # [m]
        self.awake = False
        self.few_pairs = True  # whether a block on each core sees all pairs at once, as far as is known
        # open seams or pairs, and crossings, once they have come to the host
        self._noted = wp.zeros(1 + CROSSINGS, dtype=wp.int32, device="cpu", pinned=self._device.is_cuda)
        self._kept: list[wp.array] = []  # what ``note`` saw of pairs
        self.settled = False  # whether forces have balanced
        self.untangles = True  # whether searches look for what crosses, too
        in_order = model.patches is not None
        self._start, self._boxes = start_kernel(model.precision, in_order), box_kernel(model.precision)
        self._count_open = open_kernel(model.precision)
        self._groups, self._leaves = groups_kernel(model.precision), leaves_kernel(model.precision)
        self._pairs = pairs_kernel(model.precision)
        self._crossing_groups = crossing_groups_kernel(model.precision)
        self._crossing_leaves = crossing_leaves_kernel(model.precision)
        self._part_crossings, self._part_layers = crossings_kernel(model.precision), layers_kernel(model.precision)
        self._settle = settle_kernel(model.precision)
        self._press = press_kernel(model.precision, Accumulate.STIFFNESS, in_order)
        self._measure = press_kernel(model.precision, Accumulate.MAGNITUDE, in_order)
        self._add = add_kernel(model.precision)
        with wp.ScopedDevice(model.device):
            self.data = contact_arrays(self.sheets, parts, kinds, self._numbering)
            self.data.least_skin, self.data.most_skin = self.least_skin, LARGEST_SKIN * skin
            self._tell_patience()
            self._hold_pairs(self.data, PAIRS_PER_VERTEX * self.sheets.vertex_count)
            self._search = search_arrays(self.sheets, parts, kinds, self._numbering)
            self._untangling = sheet_untangling(self.sheets, parts, self._numbering)
            self._untangling.layer = wp.array(self._by_vertex([kind.layer for kind in kinds]), dtype=wp.int32)
            self._untangling.stride = STRIDE_SHARE * (thickest + skin)
            self.facing = None if body is None else Facing(model.precision, self.sheets, self._numbering, body)
            self._open = wp.zeros(1, dtype=wp.int32)
            trees = lay_out_trees(self._search, self._untangling, self.sheets, kinds, self._numbering)
            self._planting = Planting(model.precision, *trees)
            self._near_met, self._crossing_met = self._lists(), self._lists()
        self._aside = wp.Stream(self._device) if self._device.is_cuda else None  # to look for what crosses meanwhile
        self.layered = len({(kind.item, kind.layer) for kind in kinds}) > len({kind.item for kind in kinds})

    def _by_vertex(self, values: Sequence[float]) -> NDArray[Any]:
        """What each garment has, of each vertex as contact numbers them."""
        return self._numbering.rows(per_vertex(self.sheets, values))

    @property
    def look_every(self) -> int:
        """Iterations between two looks at whether it is time for a search."""
        if self.untangles:
            return LOOK_UNTANGLING
        return LOOK_SETTLED if self.settled else LOOK_EVERY

    def _hold_pairs(self, data: Any, capacity: int) -> None:
        data.corners = wp.zeros(capacity, dtype=wp.vec4i, device=self._model.device)
        data.kind = wp.zeros(capacity, dtype=wp.int32, device=self._model.device)
        data.lean = wp.zeros(capacity, dtype=wp.vec4f, device=self._model.device)
        data.due = wp.zeros(capacity, dtype=wp.int64, device=self._model.device)
        data.regions = wp.zeros(capacity, dtype=wp.uint64, device=self._model.device)
        memory = self._memory = LeanMemory()
        places = 2 << capacity.bit_length()  # at most half full, mostly far less
        memory.search = wp.ones(1, dtype=wp.int64, device=self._model.device)
        memory.place = wp.zeros(places, dtype=wp.int64, device=self._model.device)
        memory.corners, memory.kind, memory.lean = (wp.zeros_like(of) for of in (data.corners, data.kind, data.lean))

    def _lists(self) -> Any:
        """Of what meets; of no room on the CPU, where one thread does everything in turn."""
        leaves = len(self.sheets.edges) + self.sheets.vertex_count
        if not self._device.is_cuda:
            leaves = 0
        return lists_of(GROUPS_MET * -(-leaves // int(WIDTH)), LEAVES_MET * leaves)

    def kernels(self) -> list[wp.Kernel]:
        """Every kernel that contact launches."""
        found = [self._count_open, self._start, self._boxes, self._groups, self._crossing_groups]
        found.append(box_rest)  # for high trees
        if self._near_met.group.size:
            found += [self._leaves, self._pairs, self._crossing_leaves, self._part_crossings]
        untangling = [forget_tangles, self._part_layers, self._settle, spare_tangled]
        pressing = [weigh_asked, self._press, self._measure, self._add]
        facing = [] if self.facing is None else self.facing.kernels()
        return [*found, *untangling, *pressing, *facing, *self._planting.kernels()]

    def awaken(self) -> None:
        """From now on garments meet."""
        self.awake = True
        self.settled = False
        self.data.skin.fill_(self.least_skin)
        self._look_within(FAR_SHARE)
        self._search.whole.fill_(1)
        state = self.state_now()
        self._planting.plant(state, self._search, self.data)
        self.search(state)
        if self.grow():
            self.search(state)

    def _look_within(self, share: float) -> None:
        self.data.margin = share * self._skin
        self.data.far = self.data.margin + float(self._thickness.min())
        self._tell_patience()

    def _tell_patience(self) -> None:
        self.data.ahead = LOOK_SETTLED if self.settled else LOOK_EVERY
        self.data.patience = PATIENCE_SETTLED if self.settled else PATIENCE
        self.data.many = int(MANY * self.data.ahead * self.sheets.vertex_count)

    def settle(self, *, balanced: bool) -> bool:
        """Looks at fewer pairs in every iteration once forces have ``balanced``; whether that changes anything."""
        if not self.awake or self.settled == balanced:
            return False
        self.settled = balanced
        self._look_within(NEARER_SHARE if balanced else FAR_SHARE)
        self.data.moved.fill_(1)  # what was left alone may be nearer than is now left alone
        return True

    def face(self, outward: Sequence[float]) -> None:
        """Says of each garment whether its triangles face away from the body, 1, or to it, -1."""
        self._untangling.outward.assign(self._by_vertex(outward).astype(np.float32))

    def face_from_body(self) -> None:
        """The same, where there is a body, by where most of a garment's area faces. Does not wait for the device."""
        if self.facing is not None:
            self.facing.tell(self.state_now(), self._search, self._untangling.outward)

    def lift(self, height: float) -> None:
        """Keeps each layer this much farther from the avatar [m] than the one inside it."""
        layers = self._untangling.layer.numpy()
        self.data.lift.assign((layers * height).astype(np.float32))

    def grow(self) -> bool:
        """Makes room for every pair that the last search found; whether it had to. Waits for the device."""
        found = int(self.data.count.numpy()[0])
        self._tell_pairs(found)
        if found <= len(self.data.corners):
            return False
        self._hold_pairs(self.data, 2 * found)
        self.data.moved.fill_(1)
        log.info("room for %d pairs of cloth near cloth", 2 * found)
        return True

    def _tell_pairs(self, found: int) -> None:
        at_once = ROUNDS * BLOCK_THREADS * int(self._device.sm_count)
        self.few_pairs = found <= (MANY_MORE * at_once if self.few_pairs else at_once)

    def note_open(self) -> None:
        """Keeps how many edges span seams that have yet to close, for ``open_noted``. Does not wait for the device."""
        self._open.zero_()
        self._launch(self._count_open, len(self.sheets.edges), [self.state_now(), self._search, self._open])
        wp.copy(self._noted, self._open)

    def open_noted(self) -> int:
        """What ``note_open`` counted, once that has come to the host."""
        return int(self._noted.numpy()[0])

    def note(self, *, whole: bool) -> None:
        """Keeps how many pairs there are, for ``share_noted``; ``whole``: the pairs, too, for ``put_back``.

        Does not wait for the device.
        """
        kept, pairs = self._kept, self._measured()
        wp.copy(self._noted, self.data.count, count=1)
        if whole:
            if not kept or len(kept[0]) < len(pairs[0]):
                kept = self._kept = [wp.empty_like(of) for of in pairs]
            for to, of in zip(kept, pairs, strict=True):
                wp.copy(to, of, count=len(of))

    def put_back(self) -> None:
        """Makes the pairs again what ``note`` saw, when that has come to the host, as far as forces hang on them."""
        if self._kept:
            for to, of in zip(self._measured(), self._kept, strict=True):
                wp.copy(to, of, count=min(len(to), len(of)))
            self.data.count.fill_(int(self._noted.numpy()[0]))
            self.data.sum.zero_()  # nobody takes what is pressed at pinned vertices but a measurement

    def _measured(self) -> list[wp.array]:
        """What ``measure`` reads of pairs; when one is due tells of which kind it is."""
        return [self.data.corners, self.data.kind, self.data.lean, self.data.due]

    def share_noted(self) -> float:
        """Share of the room for pairs that ``note`` saw taken, or wanted, once that has come to the host."""
        found = int(self._noted.numpy()[0])
        self._tell_pairs(found)
        return found / len(self.data.corners)

    def note_crossings(self) -> None:
        """Keeps what crosses, for ``crossings_noted``. Does not wait for the device.

        What did at the last search; where searches no longer look for that, what does now.
        """
        self._search.whole.fill_(1)
        if not self.untangles:
            state = self.state_now()
            self._box(state, anew=False)
            self._look_for_crossings(state, layered=False)
        wp.copy(self._noted, self._untangling.count, dest_offset=1, count=CROSSINGS)

    def crossings_noted(self) -> int:
        """Crossings, and vertices tangled or on the wrong side of a layer, once that has come to the host."""
        return int(self._noted.numpy()[1:].sum())

    def search_where_due(self, state: Any) -> None:
        """Looks for pairs anew where something moved too far since the last search; decided on the device.

        While what crosses is to be undone it always has: all falls, too.
        """
        if self.untangles:
            self.search(state)
        else:
            self._launch(weigh_asked, 1, [self.data])
            wp.capture_if(self.data.moved, on_true=self.search, state=state)

    def search(self, state: Any) -> None:
        """Looks for pairs, and for what crosses while that is to be undone: a GPU for both at a time."""
        found, size = self.data, max(self.sheets.vertex_count, len(self.data.corners))
        self._launch(self._start, size, [state, found, self._memory, self._near_met])
        self._box(state)
        if not self.untangles:
            self._list_near(state)
            return
        with wp.ScopedStream(self._aside):
            self._untangle(state)
        self._list_near(state)
        if self._aside is not None:
            wp.get_stream(self._device).wait_stream(self._aside)
        self._launch(spare_tangled, len(found.corners), [self._search, found])

    @contextmanager
    def one_thread_at_a_time(self) -> Iterator[None]:
        """Has what crosses be looked for before what is near, for as long as this lasts."""
        aside, self._aside = self._aside, None
        try:
            yield
        finally:
            self._aside = aside

    def _list_near(self, state: Any) -> None:
        """Lists the pairs of what is near."""
        given = self._search
        inputs = [state, given, self.data, self._memory, self._near_met]
        self._launch_teams(self._groups, given.edge_tree.leaf.size + given.vertex.size, inputs)
        self._launch_lists(self._leaves, self._pairs, inputs)

    def _launch_teams(self, kernel: wp.Kernel, leaves: int, inputs: list[Any]) -> None:
        """Launches a team for each group of leaves."""
        threads = leaves if self._device.is_cuda else leaves // int(WIDTH)
        self._launch(kernel, threads, inputs, LOOKING)

    def _launch_lists(self, by_group: wp.Kernel, by_leaf: wp.Kernel, inputs: list[Any]) -> None:
        """Launches what goes through the lists of what meets, where there are any."""
        groups, leaves = self._near_met.group.size, self._near_met.leaf.size
        if groups:
            threads = min(int(WIDTH) * groups, FINDING)
            self._launch(by_group, threads, [*inputs, threads])
            each = int(WIDTH) * int(PARTS)  # a team for every part
            threads = min(-(-leaves // each) * each, LOOKING_CLOSELY)
            self._launch(by_leaf, threads, [*inputs, threads])

    def _box(self, state: Any, *, anew: bool = True) -> None:
        """Brings the trees up to where garments are; ``anew``: for a search that lists all pairs anew."""
        search = self._search
        threads = BOXING if self._device.is_cuda else 1
        blocks = block_count(search.edge_tree) + block_count(search.triangle_tree)
        self._launch(self._boxes, threads * blocks, [state, search, self.data, self._memory, int(anew)], threads)
        if max(search.edge_tree.levels, search.triangle_tree.levels) > 3:
            self._launch(box_rest, threads * 2, [search], threads)

    def _untangle(self, state: Any) -> None:
        """Looks for what crosses, and which way undoes that."""
        given, found, untangling = self._search, self.data, self._untangling
        vertices = self.sheets.vertex_count
        self._look_for_crossings(state, layered=self.layered)
        if self.layered:
            self._launch(self._part_layers, vertices, [state, given, found, untangling])
        self._launch(self._settle, vertices, [state, given, found, untangling])

    def _look_for_crossings(self, state: Any, *, layered: bool) -> None:
        """Looks for what crosses, and where garments are ``layered``, for what of others is nearest to each vertex."""
        given, found, untangling, met = self._search, self.data, self._untangling, self._crossing_met
        self._launch(forget_tangles, self.sheets.vertex_count, [given, untangling, met])
        leaves = given.edge_tree.leaf.size + given.triangle_tree.leaf.size + (given.vertex.size if layered else 0)
        asked = [state, given, found, untangling, met]
        self._launch_teams(self._crossing_groups, leaves, asked)
        self._launch_lists(self._crossing_leaves, self._part_crossings, asked)

    def press(self, step: Any, state: Any) -> None:
        """Sums what the known pairs do to their vertices, for the next move."""
        self._launch_press(self._press, step, state)

    def press_along(self, waiting: int) -> int:
        """How many blocks are to press pairs in the launch of so many others that move vertices, and wait for them."""
        self.data.waiting = waiting
        cores = int(self._device.sm_count)
        room = cores * FEW_PER_CORE - waiting  # that work at the same time
        wanted = -(-len(self.data.corners) // BLOCK_THREADS)
        if 0 < cores <= waiting and self.few_pairs:  # more blocks would hold up the others on every core
            wanted = min(wanted, cores)
        self.data.pressing = min(wanted, max(room, LEAST_PRESSING)) if self.awake else 0
        return int(self.data.pressing)

    def _launch_press(self, kernel: wp.Kernel, step: Any, state: Any) -> None:
        blocks, threads = 1, 1
        if self._device.is_cuda:
            blocks, threads = min(-(-len(self.data.corners) // BLOCK_THREADS), PRESSING), BLOCK_THREADS
        self._launch(kernel, blocks * threads, [state, step, self.data, blocks], threads)

    def measure(self, step: Any, load: wp.array) -> None:
        """Adds the same to a certificate's load: forces as they stand, and their sizes."""
        if self.awake:
            self._launch_press(self._measure, step, self.state_now())
            self._launch(self._add, self.sheets.vertex_count, [self.data, self._order, load])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any], block: int = LISTING[0]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device, block_dim=block)
