"""Cloth contact of a model's garments: when it begins, what it searches for, and its forces."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import ExactCollider
from warp_cloth.base.compiling import in_blocks
from warp_cloth.contact.arrays import contact_arrays, per_vertex, thicknesses
from warp_cloth.contact.facing import Facing
from warp_cloth.contact.search import PairSearch
from warp_cloth.contact.sheets import SheetKind, sheets_of
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.base.block import BLOCK_THREADS, FEW_PER_CORE
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.contact.broad_phase import LIST_LAUNCH
from warp_cloth.kernels.contact.force import force_kernel
from warp_cloth.kernels.contact.narrow_phase_queue import ROUNDS
from warp_cloth.kernels.contact.search_trigger import decide_search
from warp_cloth.kernels.contact.sums import add_load_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.model.permutation import Permutation

log = logging.getLogger(__name__)

# Search margin (skin): how much farther than the thickness pairs are searched for, so that cloth has room to move
# between two searches. A fraction of the edges, so that few pairs are listed that never come near, and at least two
# thicknesses.
SKIN_OF_EDGE = 0.35
SKIN_OF_THICKNESS = 2.0
# Each vertex has a skin of its own, used up until the next search: the fastest half of that margin, others as much less
# as they move, but no less than this fraction.
LARGEST_SKIN = 0.5
LEAST_SKIN = 0.3
# Fractions of the skin: pairs within this margin are active in every iteration, and no move is longer than about half
# of it and the thickness; smaller once forces have balanced, when moves are short.
ACTIVE_MARGIN = 0.06
ACTIVE_MARGIN_SETTLED = 0.005
ACTIVE_MARGIN_IMPLICIT = 1.0  # of implicit steps, which are long: every listed pair is active
PAIRS_PER_VERTEX = 3  # initial capacity; a T-shirt on a body needs less once it is sewn
# Iterations between two checks whether a search is due. While cloth is untangled there is a search at every check:
# crossings change with every step, but not by much in four; with ten some tangles never come undone.
CHECK_INTERVAL = 5
CHECK_INTERVAL_SETTLED = 20
CHECK_INTERVAL_UNTANGLING = 4
# A few vertices that have used up their skins stay where they are until this many iterations after the last search;
# fewer before forces have balanced. Few: this fraction of all, summed over the iterations between two checks.
LONGEST_WAIT, LONGEST_WAIT_SETTLED = 20, 60
REQUEST_LIMIT = 0.01
FORCE_BLOCKS = 384  # most blocks of a launch for contact forces: as many as a large GPU runs at a time
MANY_MORE = 1.25  # pairs that were few are many only beyond this factor on their limit (hysteresis)
LEAST_FORCE_BLOCKS = 64  # least blocks for contact forces in a launch that also moves vertices, given so many pairs
CROSSING_COUNTS = 4  # Untangling.count; crossings are the sum of the first three
SHIFT_FRACTION = 0.1  # of thickness and skin: longest untangling shift in an iteration


class ClothContact:
    """Contact of a model's garments with themselves and each other.

    ``data`` is the kernels' ContactData. A ``state`` is kernels.base.types State, its vertices numbered as in ``data``
    (Relaxation.contact_state). Until ``awaken`` it lets everything pass, and launches nothing.
    """

    def __init__(
        self,
        model: ClothModel,
        garments: Sequence[Garment],
        kinds: Sequence[SheetKind],
        body: ExactCollider | None = None,
    ) -> None:
        self._model, self._device = model, wp.get_device(model.device)
        self.sheets = sheets_of(garments)
        patches = model.patches
        self._permutation = Permutation(None) if patches is None else patches.permutation
        none = wp.empty(0, dtype=wp.int32, device=model.device)
        self.order = none if patches is None else patches.order
        self._thickness = thicknesses(kinds)
        lengths = np.concatenate([garment.rest.edge_length for garment in garments])
        thickest = float(self._thickness.max())
        skin = max(SKIN_OF_EDGE * float(np.median(lengths)), SKIN_OF_THICKNESS * thickest)
        self.least_skin = LEAST_SKIN * skin  # [m]; of a vertex at rest
        self._skin = skin  # [m]
        self.awake = False
        self.few_pairs = True  # whether a block on each core checks all pairs at once, by the last count
        self.settled = False  # whether forces have balanced
        self.implicit_steps = False  # whether iterations are implicit steps, which are long and few
        self.untangles = True  # whether searches also find and undo crossings
        self.layered = len({kind.layer for kind in kinds}) > 1
        self.sews = not all(garment.is_modelled for garment in garments)
        # read-back: the count of open seams or of pairs, then those of crossings
        self._counts = wp.zeros(1 + CROSSING_COUNTS, dtype=wp.int32, device="cpu", pinned=self._device.is_cuda)
        self._saved_pairs: list[wp.array] = []
        in_order = patches is not None
        self._forces, self._measured_forces = (
            in_blocks(force_kernel(model.precision, accumulate, in_order), BLOCK_THREADS)
            for accumulate in (Accumulate.STIFFNESS, Accumulate.MAGNITUDE)
        )
        self._add_load = add_load_kernel(model.precision)
        with wp.ScopedDevice(model.device):
            skins = self.least_skin, LARGEST_SKIN * skin
            self.data = contact_arrays(self.sheets, garments, kinds, self._permutation, skins)
            self._set_trigger()
            self.pair_search = PairSearch(model, self.sheets, garments, kinds, self._permutation)
            self.pair_search.allocate_pairs(self.data, PAIRS_PER_VERTEX * self.sheets.vertex_count)
            self.untangling = self.pair_search.untangling
            self.untangling.layer = wp.array(self._by_vertex([kind.layer for kind in kinds]), dtype=wp.int32)
            self.untangling.longest_shift = SHIFT_FRACTION * (thickest + skin)
            self.facing = None if body is None else Facing(model.precision, self.sheets, self._permutation, body)
            self._open_seams = wp.zeros(1, dtype=wp.int32)

    def _by_vertex(self, values: Sequence[float]) -> NDArray[Any]:
        """A value of each garment, for each vertex as numbered in ``data``."""
        return self._permutation.rows(per_vertex(self.sheets, values))

    @property
    def check_interval(self) -> int:
        """Iterations between two checks whether a search is due."""
        if self.untangles:
            return CHECK_INTERVAL_UNTANGLING
        if self.implicit_steps:
            return 1
        return CHECK_INTERVAL_SETTLED if self.settled else CHECK_INTERVAL

    def kernels(self) -> list[wp.Kernel]:
        """Every kernel that contact may launch."""
        facing = [] if self.facing is None else self.facing.kernels()
        forces = [decide_search, self._forces, self._measured_forces, self._add_load]
        return [*self.pair_search.kernels(), *forces, *facing]

    def awaken(self, state: Any) -> None:
        """Starts contact: from now on garments collide."""
        self.awake = True
        self.settled = False
        self.data.trigger.skin.fill_(self.least_skin)
        self._set_active_margin()
        self.pair_search.order_leaves(state, self.data)
        self.search(state)
        if self.grow():
            self.search(state)

    def _set_active_margin(self) -> None:
        model = self.data.model
        fraction = ACTIVE_MARGIN_SETTLED if self.settled else ACTIVE_MARGIN
        if self.implicit_steps:
            fraction = ACTIVE_MARGIN_IMPLICIT
        model.active_margin = fraction * self._skin
        model.active_distance = model.active_margin + float(self._thickness.min())
        self._set_trigger()

    def _set_trigger(self) -> None:
        model = self.data.model
        model.check_interval = CHECK_INTERVAL_SETTLED if self.settled else CHECK_INTERVAL
        model.longest_wait = LONGEST_WAIT_SETTLED if self.settled else LONGEST_WAIT
        if self.implicit_steps:
            model.check_interval = model.longest_wait = 1
        model.request_limit = int(REQUEST_LIMIT * model.check_interval * self.sheets.vertex_count)

    def settle(self, *, balanced: bool) -> bool:
        """Keeps fewer pairs active once forces have ``balanced``; whether that changes anything."""
        if not self.awake or self.settled == balanced:
            return False
        self.settled = balanced
        if self.implicit_steps:
            return False
        self._renew_active_margin()
        return True

    def expect_implicit_steps(self, implicit: bool) -> None:
        """Sets whether implicit steps follow: with every listed pair active, and searches as soon as one is due."""
        self.implicit_steps = implicit
        self._renew_active_margin()

    def _renew_active_margin(self) -> None:
        self._set_active_margin()
        self.data.trigger.due.fill_(1)  # skipped pairs may be nearer than the new margin allows

    def face(self, outward: Sequence[float]) -> None:
        """Sets for each garment whether its triangles face away from the body, 1, or towards it, -1."""
        self.untangling.outward.assign(self._by_vertex(outward).astype(np.float32))

    def face_from_body(self, state: Any) -> None:
        """The same by where most of a garment's area faces, if there is a body. Does not wait for the device."""
        if self.facing is not None:
            self.facing.update(state, self.pair_search.geometry, self.untangling.outward)

    def lift(self, height: float) -> None:
        """Keeps each layer this much farther from the avatar [m] than the one inside it."""
        layers = self.untangling.layer.numpy()
        self.data.model.lift.assign((layers * height).astype(np.float32))

    def grow(self) -> bool:
        """Enlarges the pair list if the last search found more than it holds; whether it did. Waits for the device."""
        found = int(self.data.pairs.count.numpy()[0])
        self._set_few_pairs(found)
        if found <= len(self.data.pairs.corners):
            return False
        self.pair_search.allocate_pairs(self.data, 2 * found)
        self.data.trigger.due.fill_(1)
        log.info("capacity for %d contact pairs", 2 * found)
        return True

    def _set_few_pairs(self, found: int) -> None:
        at_once = ROUNDS * BLOCK_THREADS * int(self._device.sm_count)
        self.few_pairs = found <= (MANY_MORE * at_once if self.few_pairs else at_once)

    # Read-backs: a method copies to the host without waiting, and another returns the value once the copy is complete.

    def read_open_seams(self, state: Any) -> None:
        """Starts counting the edges that span seams yet to close, for ``open_seams``."""
        self.pair_search.count_open_seams(state, self._open_seams)
        wp.copy(self._counts, self._open_seams)

    def open_seams(self) -> int:
        """The count of ``read_open_seams``."""
        return int(self._counts.numpy()[0])

    def read_pairs(self, *, save: bool) -> None:
        """Starts reading the number of pairs, for ``pair_fill``; ``save`` also saves them, for ``restore_pairs``."""
        saved, pairs = self._saved_pairs, self._pairs_in_forces()
        wp.copy(self._counts, self.data.pairs.count, count=1)
        if save:
            if not saved or len(saved[0]) < len(pairs[0]):
                saved = self._saved_pairs = [wp.empty_like(of) for of in pairs]
            for to, of in zip(saved, pairs, strict=True):
                wp.copy(to, of, count=len(of))

    def restore_pairs(self) -> None:
        """Restores the pairs that ``read_pairs`` saved, as far as forces depend on them."""
        if self._saved_pairs:
            for to, of in zip(self._pairs_in_forces(), self._saved_pairs, strict=True):
                wp.copy(to, of, count=min(len(to), len(of)))
            self.data.pairs.count.fill_(int(self._counts.numpy()[0]))
            self.data.sums.load.zero_()  # at pinned vertices only a measurement resets it

    def _pairs_in_forces(self) -> list[wp.array]:
        """The pairs' arrays that ``measure`` reads; ``due`` holds a pair's kind."""
        pairs = self.data.pairs
        return [pairs.corners, pairs.kind, pairs.stick, pairs.due]

    def pair_fill(self) -> float:
        """Number of pairs found over the list's capacity, at the last ``read_pairs``."""
        found = int(self._counts.numpy()[0])
        self._set_few_pairs(found)
        return found / len(self.data.pairs.corners)

    def read_crossings(self, state: Any) -> None:
        """Starts reading the crossings of the last search, for ``crossings``; or of now, where searches find none."""
        self.pair_search.geometry.whole.fill_(1)
        if not self.untangles:
            self.pair_search.refit(state, self.data, clear=False)
            self.pair_search.find_crossings(state, self.data, layered=False)
        wp.copy(self._counts, self.untangling.count, dest_offset=1, count=CROSSING_COUNTS)

    def crossings(self) -> int:
        """Crossings plus vertices tangled or on the wrong side of a layer, at the last ``read_crossings``."""
        return int(self._counts.numpy()[1:-1].sum())

    def layers_apart(self) -> bool:
        """Whether no cloth crosses another layer or is on its wrong side, at the last ``read_crossings``."""
        _, _, beyond, _, between = self._counts.numpy().tolist()
        return bool(beyond + between == 0)

    def search_where_due(self, state: Any) -> None:
        """Searches for pairs where something has moved too far since the last search; the device decides.

        While crossings are to be undone it always searches: then all cloth still falls.
        """
        if self.untangles:
            self.search(state)
        else:
            self._launch(decide_search, 1, [self.data])
            wp.capture_if(self.data.trigger.due, on_true=self.search, state=state)

    def search(self, state: Any) -> None:
        """Searches for pairs, and for crossings while they are to be undone."""
        self.pair_search.run(state, self.data, untangle=self.untangles, layered=self.layered)

    @contextmanager
    def searches_in_sequence(self) -> Iterator[None]:
        """Searches for crossings before pairs instead of at the same time, within this context."""
        stream, self.pair_search.side_stream = self.pair_search.side_stream, None
        try:
            yield
        finally:
            self.pair_search.side_stream = stream

    def add_forces(self, step: Any, state: Any) -> None:
        """Sums the pairs' forces at their vertices, for the next move."""
        self._launch_forces(self._forces, step, state)

    def add_load(self, load: wp.array) -> None:
        """Adds the sums at the vertices to their load, and resets them."""
        self._launch(self._add_load, self.sheets.vertex_count, [self.data, self.order, load])

    def divide_blocks(self, moving: int) -> int:
        """How many blocks compute contact forces in a launch whose other ``moving`` blocks wait for them."""
        self.data.blocks.move_count = moving
        cores = int(self._device.sm_count)
        free = cores * FEW_PER_CORE - moving  # blocks that can run at the same time
        wanted = -(-len(self.data.pairs.corners) // BLOCK_THREADS)
        if 0 < cores <= moving and self.few_pairs:  # more blocks would hold up the others on every core
            wanted = min(wanted, cores)
        self.data.blocks.force_count = min(wanted, max(free, LEAST_FORCE_BLOCKS)) if self.awake else 0
        return int(self.data.blocks.force_count)

    def _launch_forces(self, kernel: wp.Kernel, step: Any, state: Any) -> None:
        blocks, threads = 1, 1
        if self._device.is_cuda:
            wanted = -(-len(self.data.pairs.corners) // BLOCK_THREADS)
            blocks, threads = min(wanted, FORCE_BLOCKS), BLOCK_THREADS
        self._launch(kernel, blocks * threads, [state, step, self.data, blocks], threads)

    def measure(self, state: Any, step: Any, load: wp.array) -> None:
        """Adds contact to a certificate's load: forces as they are now, and their magnitudes."""
        if self.awake:
            self._launch_forces(self._measured_forces, step, state)
            self.add_load(load)

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any], block: int = LIST_LAUNCH[0]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device, block_dim=block)
