"""Search for pairs of cloth that are near each other, and for cloth that crosses: refit, broad phase, narrow phase."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp

from warp_cloth.base.compiling import in_blocks
from warp_cloth.contact.arrays import build_trees, search_arrays
from warp_cloth.contact.box_tree import block_count, candidate_lists
from warp_cloth.contact.crossing import Sheets
from warp_cloth.contact.leaf_order import LeafOrder
from warp_cloth.contact.sheets import SheetKind
from warp_cloth.contact.untangling import sheet_untangling
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.contact.box_tree import WIDTH
from warp_cloth.kernels.contact.broad_phase import LEAF_LISTS, LIST_LAUNCH
from warp_cloth.kernels.contact.crossing_search import crossing_groups_kernel, crossing_list_kernels
from warp_cloth.kernels.contact.pairs import near_groups_kernel, near_list_kernels
from warp_cloth.kernels.contact.search import open_seams_kernel, refit_kernel, refit_top, start_kernel
from warp_cloth.kernels.contact.stick_memory import StickMemory
from warp_cloth.kernels.contact.untangle import clear_tangles, exclude_tangled, finish_kernel, layers_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.model.permutation import Permutation

TRAVERSAL_THREADS = 64  # in a block that traverses a tree: some teams take far longer than others
# Capacity of a GPU's candidate lists, for each group of leaves and for each leaf: several times what sewn cloth needs;
# crumpled cloth may need more.
GROUP_CANDIDATES = 32
LEAF_CANDIDATES = 8
GROUP_LIST_THREADS = 2**18  # that process the first of these lists, at most
LEAF_LIST_THREADS = 2**17  # that process the second, at most: as many as a large GPU runs at a time
REFIT_THREADS = 1024  # in a block that refits a tree


class PairSearch:
    """The search over a model's garments. It only launches kernels; nothing waits for the device."""

    def __init__(
        self,
        model: ClothModel,
        sheets: Sheets,
        garments: Sequence[Garment],
        kinds: Sequence[SheetKind],
        permutation: Permutation,
    ) -> None:
        """On Warp's default device, that of the model."""
        precision = model.precision
        self._sheets, self._device = sheets, wp.get_device(model.device)
        self.geometry = search_arrays(sheets, garments, kinds, permutation)  # kernels.contact.search ContactSearch
        self.untangling = sheet_untangling(sheets, garments, permutation)
        self.leaf_order = LeafOrder(precision, *build_trees(self.geometry, self.untangling, sheets, kinds, permutation))
        self.memory = StickMemory()
        self.near_candidates, self.crossing_candidates = self._candidates(), self._candidates()
        # a GPU searches for crossings and for pairs at the same time
        self.side_stream = wp.Stream(self._device) if self._device.is_cuda else None
        self._count_open_seams = open_seams_kernel(precision)
        self._start = start_kernel(precision, model.patches is not None)
        self._refit = in_blocks(refit_kernel(precision), REFIT_THREADS)
        self._near_groups = in_blocks(near_groups_kernel(precision), TRAVERSAL_THREADS)
        self._crossing_groups = in_blocks(crossing_groups_kernel(precision), TRAVERSAL_THREADS)
        self._near_lists, self._crossing_lists = near_list_kernels(precision), crossing_list_kernels(precision)
        self._separate_layers, self._finish = layers_kernel(precision), finish_kernel(precision)

    def _candidates(self) -> Any:
        """Lists of candidates; of no capacity on the CPU, where one thread does everything in turn."""
        leaves = len(self._sheets.edges) + self._sheets.vertex_count
        if not self._device.is_cuda:
            leaves = 0
        return candidate_lists(GROUP_CANDIDATES * -(-leaves // int(WIDTH)), LEAF_CANDIDATES * leaves)

    def kernels(self) -> list[wp.Kernel]:
        """Every kernel that a search may launch."""
        found = [self._near_groups, self._crossing_groups]  # first, as they take the longest to compile
        found += [self._count_open_seams, self._start, self._refit, refit_top]  # the last for high trees
        if self.near_candidates.group.size:
            found += [*self._near_lists, *self._crossing_lists]
        found += [clear_tangles, self._separate_layers, self._finish, exclude_tangled]
        return [*found, *self.leaf_order.kernels()]

    def allocate_pairs(self, contact: Any, capacity: int) -> None:
        """Gives contact (kernels.contact.arrays ContactData) an empty list of so many pairs."""
        pairs, memory, device = contact.pairs, self.memory, self._device
        pairs.corners = wp.zeros(capacity, dtype=wp.vec4i, device=device)
        pairs.kind = wp.zeros(capacity, dtype=wp.int32, device=device)
        pairs.stick = wp.zeros(capacity, dtype=wp.vec4f, device=device)
        pairs.due = wp.zeros(capacity, dtype=wp.int64, device=device)
        pairs.regions = wp.zeros(capacity, dtype=wp.uint64, device=device)
        self.memory = memory = StickMemory()
        entries = 2 << capacity.bit_length()  # at most half full, mostly far less
        memory.search = wp.ones(1, dtype=wp.int64, device=device)
        memory.entry = wp.zeros(entries, dtype=wp.int64, device=device)
        memory.corners, memory.kind, memory.stick = (
            wp.zeros_like(of) for of in (pairs.corners, pairs.kind, pairs.stick)
        )

    def order_leaves(self, state: Any, contact: Any) -> None:
        """Orders the trees' leaves by where the cloth is now; the next crossing search is for all."""
        self.geometry.whole.fill_(1)
        self.leaf_order.apply(state, self.geometry, contact)

    def count_open_seams(self, state: Any, count: wp.array) -> None:
        """Counts the edges that span seams yet to close."""
        count.zero_()
        self._launch(self._count_open_seams, len(self._sheets.edges), [state, self.geometry, count])

    def run(self, state: Any, contact: Any, *, untangle: bool, layered: bool) -> None:
        """Lists the pairs; with ``untangle`` also finds crossings, and the shifts that undo them."""
        size = max(self._sheets.vertex_count, len(contact.pairs.corners))
        self._launch(self._start, size, [state, contact, self.memory, self.near_candidates])
        self.refit(state, contact)
        if not untangle:
            self.list_near(state, contact)
            return
        with wp.ScopedStream(self.side_stream):
            self._untangle(state, contact, layered=layered)
        self.list_near(state, contact)
        if self.side_stream is not None:
            wp.get_stream(self._device).wait_stream(self.side_stream)
        self._launch(exclude_tangled, len(contact.pairs.corners), [self.geometry, contact])

    def refit(self, state: Any, contact: Any, *, clear: bool = True) -> None:
        """Refits the trees to where the garments are; ``clear`` empties the pair list."""
        edge_tree, triangle_tree = self.geometry.edge_tree, self.geometry.triangle_tree
        threads = REFIT_THREADS if self._device.is_cuda else 1
        blocks = block_count(edge_tree) + block_count(triangle_tree)
        inputs = [state, self.geometry, contact, self.memory, int(clear)]
        self._launch(self._refit, threads * blocks, inputs, threads)
        if max(edge_tree.levels, triangle_tree.levels) > 3:
            self._launch(refit_top, threads * 2, [self.geometry], threads)

    def list_near(self, state: Any, contact: Any) -> None:
        """Lists the pairs that are near, once the trees are refitted."""
        geometry = self.geometry
        inputs = [state, geometry, contact, self.memory, self.near_candidates]
        self._launch_teams(self._near_groups, geometry.edge_tree.leaf.size + geometry.vertex.size, inputs)
        self._launch_lists(self._near_lists, inputs)

    def find_crossings(self, state: Any, contact: Any, *, layered: bool) -> None:
        """Finds crossings once the trees are refitted; ``layered``: also the nearest other layer of each vertex."""
        geometry, untangling, candidates = self.geometry, self.untangling, self.crossing_candidates
        self._launch(clear_tangles, self._sheets.vertex_count, [geometry, untangling, candidates])
        leaves = geometry.edge_tree.leaf.size + geometry.triangle_tree.leaf.size
        leaves += geometry.vertex.size if layered else 0
        inputs = [state, geometry, contact, untangling, candidates]
        self._launch_teams(self._crossing_groups, leaves, inputs)
        self._launch_lists(self._crossing_lists, inputs)

    def _untangle(self, state: Any, contact: Any, *, layered: bool) -> None:
        """Finds crossings, and the shifts that undo them."""
        self.find_crossings(state, contact, layered=layered)
        inputs, vertices = [state, self.geometry, contact, self.untangling], self._sheets.vertex_count
        if layered:
            self._launch(self._separate_layers, vertices, inputs)
        self._launch(self._finish, vertices, inputs)

    def _launch_teams(self, kernel: wp.Kernel, leaves: int, inputs: list[Any]) -> None:
        """Launches a team for each group of leaves."""
        threads = leaves if self._device.is_cuda else leaves // int(WIDTH)
        self._launch(kernel, threads, inputs, TRAVERSAL_THREADS)

    def _launch_lists(self, kernels: tuple[wp.Kernel, wp.Kernel], inputs: list[Any]) -> None:
        """Launches the kernels that process the candidate lists, of groups and of leaves, where there are any."""
        groups, leaves = self.near_candidates.group.size, self.near_candidates.leaf.size
        if groups:
            threads = min(int(WIDTH) * groups, GROUP_LIST_THREADS)
            self._launch(kernels[0], threads, [*inputs, threads])
            each = int(WIDTH) * int(LEAF_LISTS)  # a team for every list
            threads = min(-(-leaves // each) * each, LEAF_LIST_THREADS)
            self._launch(kernels[1], threads, [*inputs, threads])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any], block: int = LIST_LAUNCH[0]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._device, block_dim=block)
