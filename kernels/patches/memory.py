"""A patch of cloth in shared memory: its layout there, access to it, and what is prefetched from its tables."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.block import OVERFLOW, fetch_ahead, fetches, memory_functions, own_memory_function
from warp_cloth.kernels.base.options import RANKS, KernelOptions, Terms, block_for, fold_numbers
from warp_cloth.kernels.base.types import Patch, cloth_types
from warp_cloth.kernels.math.real import inner
from warp_cloth.kernels.patches.packing import fetch_points

SLOTS_WARP, NEXT_WARP = wp.constant(1), wp.constant(2)  # which of a block's last warps prefetches what


@wp.struct
class PatchMemory:
    """Places in the block's memory; vectors of four reals unless said otherwise."""

    edge_load: int  # on each edge's first end, and nothing after the last
    corner_load: int  # on the triangles' first corners, the second, the third, and nothing after the last
    normal: int  # unit normal and inverse of twice the area [1/m2] of each triangle
    fold: int  # of ``fold_numbers``: torque over L [N], bound [N/m] and L^2 [m2] of each edge's hinge
    position: int  # two coordinates of each vertex, in the positions' own precision
    third: int  # the third ones
    move: int  # and how long it is


@wp.func
def words_of(ranks: int):
    """Words of RANKS numbers that so many take."""
    return (ranks + wp.static(RANKS - 1)) >> wp.static(RANKS.bit_length() - 1)


@wp.func
def patch_of(patches: wp.array(dtype=wp.vec4i), number: int):
    """A patch, which is read in four pieces."""
    one, two = element(patches, 4 * number), element(patches, 4 * number + 1)
    three, four = element(patches, 4 * number + 2), element(patches, 4 * number + 3)
    patch = Patch()
    patch.vertex_start = one[0]
    patch.vertex_count = one[1]
    patch.owned_count = one[2]
    patch.item = one[3]
    patch.edge_start = two[0]
    patch.edge_count = two[1]
    patch.constants_start = two[2]
    patch.constants_count = two[3]
    patch.triangle_start = three[0]
    patch.triangle_count = three[1]
    patch.normal_count = three[2]
    patch.slot_start = three[3]
    patch.ranks = four[0]
    patch.overflow = four[1]
    patch.place = four[2]
    patch.tile_count = four[3]
    return patch


@wp.func
def skips_patch(active: int, patch: Patch, first: int, second: int):
    """Whether a patch's item is at rest; the last two are vertices.

    The answer depends on all that is loaded first, none of it ever negative: else a compiler would put off the other
    loads, for which threads would wait once more.
    """
    return wp.min(active - 1, first | second | patch.edge_start | patch.triangle_start) < 0


@functools.cache
def stride_function(terms: Terms) -> wp.Function:
    """The function that tells after how many loads of first corners the second ones come."""

    @wp.func
    def corner_stride(patch: Patch):
        """As many as there are normals, each of which a first corner's load replaces."""
        count = patch.triangle_count
        if wp.static(terms.folds):
            count = patch.normal_count
        return count

    return corner_stride


@functools.cache
def layout_function(options: KernelOptions) -> wp.Function:
    """The function that lays out the block's memory; the host counts the same bytes."""
    terms, fits = options.terms, options.fits
    types, own_memory = cloth_types(options.precision), own_memory_function(block_for(options.paired).memory)
    size_4, wide = 4 * types.real_size, types.point_size // 3
    corner_stride = stride_function(terms)

    @wp.func
    def patch_memory(patch: Patch):
        """Places in the block's memory. Corners' loads come to lie where normals lay, without yarns vertices, too."""
        memory = PatchMemory()
        at = own_memory()
        if wp.static(not fits):
            if patch.overflow >= 0:
                at = patch.overflow | OVERFLOW
        if wp.static(terms.edges):
            memory.edge_load = at
            at += wp.static(size_4) * (patch.edge_count + 1)
        memory.normal = at
        memory.corner_load = at
        if wp.static(terms.folds or terms.yarns):
            at += wp.static(size_4) * corner_stride(patch)
        others = at + wp.static(size_4) * (2 * patch.triangle_count + 1)
        if wp.static(terms.yarns):
            at = others
        memory.move = at
        at += wp.static(size_4) * patch.vertex_count
        memory.position = at
        at += (wp.static(2 * wide) * patch.vertex_count + 15) & -16
        memory.third = at + wp.static(wide) * (patch.place & 1)  # as they lie in the patches' order
        at += (wp.static(wide) * (patch.vertex_count + 1) + 15) & -16
        if wp.static(terms.folds and not terms.yarns):
            at = wp.max(at, others)
        memory.fold = at
        return memory

    return patch_memory


@functools.cache
def context_type(precision: str) -> type:
    """The struct of what a thread needs to work on its block's patch."""
    types = cloth_types(precision)

    @wp.struct
    class PatchContext:
        """A thread of a block that works on a patch: the patch, its tables, and where the block's memory holds it."""

        patches: types.Patches
        patch: Patch
        memory: PatchMemory
        overflow: wp.array(dtype=wp.uint8)  # memory of patches that are too large for a block's own
        step: types.Step
        lane: int  # the thread's number in its block

    return PatchContext


@functools.cache
def context_function(options: KernelOptions) -> wp.Function:
    """The function that makes a ``PatchContext``."""
    types, Context = cloth_types(options.precision), context_type(options.precision)
    patch_memory = layout_function(options)

    @wp.func
    def patch_context(
        step: types.Step, patches: types.Patches, patch: Patch, overflow: wp.array(dtype=wp.uint8), lane: int
    ):
        """A thread's context in a block that works on this patch."""
        context = Context()
        context.patches = patches
        context.patch = patch
        context.memory = patch_memory(patch)
        context.overflow = overflow
        context.step = step
        context.lane = lane
        return context

    return patch_context


@functools.cache
def access_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``row_at``, ``put_row``, ``point_at``, ``put_point``: what the block's memory holds, by its number.

    A row is a vec4; ``PatchMemory`` has where the first of its kind lies. ``fits`` as of ``memory_functions``.
    """
    types, Context = cloth_types(precision), context_type(precision)
    size_4, wide, memory = 4 * types.real_size, types.point_size // 3, memory_functions(precision, fits)

    @wp.func
    def row_at(context: Context, rows: int, number: int):
        """One of the rows that begin at a place."""
        return memory.read_4(context.overflow, rows + wp.static(size_4) * number)

    @wp.func
    def put_row(context: Context, rows: int, number: int, row: types.vec4):
        """Writes one of the rows that begin at a place."""
        memory.write_4(context.overflow, rows + wp.static(size_4) * number, row)

    @wp.func
    def point_at(context: Context, local: int):
        """Where a vertex is [m]."""
        pair = context.memory.position + wp.static(2 * wide) * local
        return memory.read_point(context.overflow, pair, context.memory.third + wp.static(wide) * local)

    @wp.func
    def put_point(context: Context, local: int, position: types.point):
        """Writes where a vertex is."""
        pair = context.memory.position + wp.static(2 * wide) * local
        memory.write_point(context.overflow, pair, context.memory.third + wp.static(wide) * local, position)

    return SimpleNamespace(row_at=row_at, put_row=put_row, point_at=point_at, put_point=put_point)


@functools.cache
def fold_functions(precision: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``fold_at`` and ``put_fold``: hinges of edges (elements.edge.edge_fold) in the block's memory."""
    types, Context = cloth_types(precision), context_type(precision)
    vec2, vec3, numbers, memory = types.vec2, types.vec3, fold_numbers(terms), memory_functions(precision, fits)
    size = numbers * types.real_size

    @wp.func
    def fold_at(context: Context, edge: int, along: vec3):
        """An edge's hinge; ``along`` the edge, where that is known."""
        place = context.memory.fold + wp.static(size) * edge
        fold = vec3()
        if wp.static(numbers == 2):
            two = memory.read_2(context.overflow, place)
            fold = vec3(two[0], two[1], inner(along, along))
        else:
            fold = memory.read_3(context.overflow, place)
        return fold

    @wp.func
    def put_fold(context: Context, edge: int, fold: vec3):
        """Writes an edge's hinge for its triangles, where cloth bends."""
        if wp.static(terms.folds):
            place = context.memory.fold + wp.static(size) * edge
            if wp.static(numbers == 2):
                memory.write_2(context.overflow, place, vec2(fold[0], fold[1]))
            else:
                memory.write_3(context.overflow, place, fold)

    return SimpleNamespace(fold_at=fold_at, put_fold=put_fold)


@functools.cache
def fetch_function(options: KernelOptions) -> wp.Function:
    """The function that prefetches the tables of all steps."""
    terms, paired = options.terms, options.paired
    Patches = cloth_types(options.precision).Patches
    slots_warp = SLOTS_WARP if paired else wp.constant(0)  # where the next patch is prefetched, too, warps share that

    @wp.func
    def fetch_slots(patches: Patches, patch: Patch):
        """Prefetches what vertices sum."""
        if wp.static(terms.edges):
            fetch_ahead(patches.edge_slot, patch.slot_start, words_of(patch.ranks) * patch.owned_count, 3)
        if wp.static(terms.folds or terms.yarns):
            fetch_ahead(patches.slot, patch.slot_start, words_of(patch.ranks) * patch.owned_count, 3)

    @wp.func
    def fetch_steps(patches: Patches, patch: Patch):
        """Prefetches the tables of edges and triangles."""
        if wp.static(terms.folds or terms.yarns):
            fetch_ahead(patches.corners, patch.triangle_start, patch.normal_count, 4)
        if wp.static(terms.folds or terms.edges):
            fetch_ahead(patches.ends, patch.edge_start, patch.edge_count, 1)
        if wp.static(terms.edges):
            fetch_ahead(patches.edge_constants, patch.constants_start, patch.constants_count, 0)
        if wp.static(terms.folds and not terms.edges):
            fetch_ahead(patches.hinge_stiffness, patch.constants_start, patch.constants_count, 5)
        if wp.static(terms.folds and not paired):
            fetch_ahead(patches.sides, patch.triangle_start, patch.triangle_count, 5)
        if wp.static(terms.yarns):
            fetch_ahead(patches.slope, patch.triangle_start, patch.triangle_count, 0)
            fetch_ahead(patches.yarns, patch.triangle_start, patch.triangle_count, 2)

    @wp.func
    def fetch_tables(patches: Patches, patch: Patch):
        """Prefetches what later steps read, while the vertices are being loaded."""
        if fetches(0):
            fetch_steps(patches, patch)
        if fetches(slots_warp):
            fetch_slots(patches, patch)

    return fetch_tables


@wp.func
def next_patch(patches: Any, number: int):
    """The patch that a GPU turns to when it is through with a block's; of the last ones none, which has no vertices."""
    upcoming = Patch()
    last = patches.patch.shape[0] // 4 - 1
    if number + patches.ahead <= last:
        upcoming = patch_of(patches.patch, number + patches.ahead)
        fetch_ahead(patches.patch, 4 * wp.min(number + 2 * patches.ahead, last), 4, 0)
    return upcoming


@wp.func
def fetch_next(patches: Any, state: Any, upcoming: Patch):
    """Prefetches what a block reads first of its next patch, while it works on others: by then it is known where."""
    if upcoming.owned_count > 0:
        owned = upcoming.owned_count
        fetch_ahead(patches.vertex, upcoming.vertex_start + owned, upcoming.vertex_count - owned, 0)
        fetch_points(state.position, upcoming.place, upcoming.owned_count)
        fetch_ahead(state.displacement4, upcoming.place, upcoming.owned_count, 0)
