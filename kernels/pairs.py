"""What a thread does for its item: two triangles that share an edge, or a single one (patches.triangle_pairs).

Triangles are a, b, c and b, a, d, each wound like that. What a thread has read of their vertices serves both normals,
the edges that it works out and what the triangles do to their corners. Where every item has a thread of its own, this
keeps that while the block waits; else it is worked out again.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.bending import unit_normal
from warp_cloth.kernels.block import memory_functions, patch_threads
from warp_cloth.kernels.cloth import BOUNDS, Patch, cloth_types, difference_function, takes_exact_stretch
from warp_cloth.kernels.limits import (
    CODE_AFTER,
    CODE_BACK,
    CODE_TURN_0,
    CODE_TURN_1,
    SIDE_AD,
    SIDE_BC,
    SIDE_CA,
    SIDE_DB,
    Terms,
)
from warp_cloth.kernels.packing import three_function
from warp_cloth.kernels.patch_memory import PatchMemory
from warp_cloth.kernels.patch_steps import (
    edge_function,
    edge_table_function,
    packed,
    point_functions,
)
from warp_cloth.kernels.patch_triangles import corners_function, triangle_table_function


def keeps_items(precision: str, fourth: str, terms: Terms, fits: bool) -> bool:
    """Whether threads keep what they know of their items: each has one, and what it keeps is all that is asked for."""
    return fits and terms.folds and not (terms.threads and takes_exact_stretch(precision, fourth))


@functools.cache
def item_type(precision: str) -> type:
    """The struct of what a thread knows of its item."""
    types = cloth_types(precision)

    @wp.struct
    class PatchItem:
        """An item, its triangles' sides as these are wound [m] and their normals (``triangle_normal``)."""

        vertices: wp.uint64
        first_word: wp.uint64  # of the edges that the item takes besides the one that its triangles share
        law: types.vec4  # of that edge
        first_law: types.vec4  # and of the first of the others
        side_ab: types.vec3
        side_bc: types.vec3
        side_ca: types.vec3
        side_ad: types.vec3
        side_db: types.vec3
        normal_0: types.vec4
        normal_1: types.vec4

    return PatchItem


@functools.cache
def turn_functions(precision: str) -> SimpleNamespace:
    """Functions ``first_of`` and ``last_of`` of a triangle's three sides, as the mesh begins it."""
    vec3 = cloth_types(precision).vec3

    @wp.func
    def first_of(turn: int, one: vec3, two: vec3, three: vec3):
        """The side that starts at the triangle's first corner."""
        return wp.where(turn == 0, one, wp.where(turn == 1, two, three))

    @wp.func
    def last_of(turn: int, one: vec3, two: vec3, three: vec3):
        """The side that ends there, from there."""
        return -wp.where(turn == 0, three, wp.where(turn == 1, one, two))

    return SimpleNamespace(first_of=first_of, last_of=last_of)


@functools.cache
def item_functions(precision: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``asked_item``, ``lying_item``, ``item_side``, ``turn_0``, ``turn_1``."""
    types = cloth_types(precision)
    vec3, vec4, Patches, PatchItem = types.vec3, types.vec4, types.Patches, item_type(precision)
    point_at, difference = point_functions(precision, fits).point_at, difference_function(precision)
    turns = turn_functions(precision)
    first_of, last_of = turns.first_of, turns.last_of

    @wp.func
    def asked_item(patches: Patches, patch: Patch, local: int):
        """What tables tell of an item; beyond the last one, of any."""
        at = patch.edge_start + wp.max(wp.min(local, patch.item_count - 1), 0)
        item = PatchItem()
        item.vertices = element(patches.ends, at)
        item.first_word = element(patches.ends, at + patch.item_count)
        return item

    @wp.func
    def turn_0(item: PatchItem):
        """At which of a, b, c the mesh's first triangle begins."""
        return (packed(item.first_word, 3) >> wp.static(CODE_TURN_0)) & 3

    @wp.func
    def turn_1(item: PatchItem):
        """At which of b, a, d its second one begins."""
        return (packed(item.first_word, 3) >> wp.static(CODE_TURN_1)) & 3

    @wp.func
    def normal_of(turn: int, one: vec3, two: vec3, three: vec3):
        """``triangle_normal`` of a triangle with these sides."""
        normal, inverse = unit_normal(first_of(turn, one, two, three), last_of(turn, one, two, three))
        return vec4(normal[0], normal[1], normal[2], inverse)

    @wp.func
    def lying_item(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, asked: PatchItem):
        """An item as it lies."""
        item = PatchItem()
        item.vertices = asked.vertices
        item.first_word = asked.first_word
        a = point_at(beside, memory, packed(item.vertices, 0))
        b = point_at(beside, memory, packed(item.vertices, 1))
        c = point_at(beside, memory, packed(item.vertices, 2))
        d = point_at(beside, memory, packed(item.vertices, 3))
        item.side_ab = difference(b, a)
        item.side_bc = difference(c, b)
        item.side_ca = difference(a, c)
        item.side_ad = difference(d, a)
        item.side_db = difference(b, d)
        item.normal_0 = normal_of(turn_0(item), item.side_ab, item.side_bc, item.side_ca)
        item.normal_1 = normal_of(turn_1(item), -item.side_ab, item.side_ad, item.side_db)
        return item

    @wp.func
    def item_side(item: PatchItem, code: int):
        """The side that an edge is, as the edge runs."""
        which = code & 7
        side = wp.where(which == wp.static(SIDE_BC), item.side_bc, item.side_ab)
        side = wp.where(which == wp.static(SIDE_CA), item.side_ca, side)
        side = wp.where(which == wp.static(SIDE_AD), item.side_ad, side)
        side = wp.where(which == wp.static(SIDE_DB), item.side_db, side)
        return wp.where((code & wp.static(CODE_BACK)) != 0, -side, side)

    return SimpleNamespace(
        asked_item=asked_item, lying_item=lying_item, item_side=item_side, turn_0=turn_0, turn_1=turn_1
    )


@functools.cache
def item_normals_step(precision: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out items as they lie."""
    types = cloth_types(precision)
    Patches, PatchItem, size_4 = types.Patches, item_type(precision), 4 * types.real_size
    functions, write_4 = item_functions(precision, terms, fits), memory_functions(precision, fits).write_4
    asked_item, lying_item = functions.asked_item, functions.lying_item

    @wp.func
    def put_normals(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, patch: Patch, local: int, item: PatchItem):
        """Keeps an item's normals for others."""
        write_4(beside, memory.normal + wp.static(size_4) * local, item.normal_0)
        if local < patch.triangle_count - patch.item_count:
            write_4(beside, memory.normal + wp.static(size_4) * (patch.item_count + local), item.normal_1)

    @wp.func
    def work_item_normals(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        lane: int,
        asked: PatchItem,
    ):
        """Normals of the items' triangles; returns the thread's item as it lies, ``asked`` of ``asked_item``."""
        item = PatchItem()
        if wp.static(fits):
            item = lying_item(beside, memory, asked)
            if lane < patch.item_count:
                put_normals(beside, memory, patch, lane, item)
        else:
            local = int(lane)
            while local < patch.item_count:
                put_normals(beside, memory, patch, local, lying_item(beside, memory, asked_item(patches, patch, local)))
                local += patch_threads()
        return item

    return work_item_normals


@functools.cache
def item_edges_step(precision: str, fourth: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``asked_laws`` and ``work_item_edges``."""
    types = cloth_types(precision)
    vec4, Patches, Step, PatchItem = types.vec4, types.Patches, types.Step, item_type(precision)
    functions, read_4 = item_functions(precision, terms, fits), memory_functions(precision, fits).read_4
    asked_item, lying_item, item_side = functions.asked_item, functions.lying_item, functions.item_side
    work_edge, edge_table = edge_function(precision, fourth, terms, fits), edge_table_function(precision, terms)

    @wp.func
    def asked_laws(patches: Patches, patch: Patch, local: int, item: PatchItem):
        """An item, and of its first edges how they pull and bend; beyond the last item any."""
        at = patch.edge_start + wp.max(wp.min(local, patch.item_count - 1), 0)
        _vertices, law = edge_table(patches, at)
        _first, first_law = edge_table(patches, at + patch.item_count)
        item.law = law
        item.first_law = first_law
        return item

    @wp.func
    def taken_edge(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        local: int,
        item: PatchItem,
        word: wp.uint64,
        law: vec4,
    ):
        """An edge that an item takes; where it takes none, no one looks what comes of it."""
        code = packed(word, 3)
        which = code & 7
        on_second = which == wp.static(SIDE_AD) or which == wp.static(SIDE_DB)
        own = wp.where(on_second, item.normal_1, item.normal_0)
        across = read_4(beside, memory.normal + wp.static(4 * types.real_size) * packed(word, 2))
        after = (code & wp.static(CODE_AFTER)) != 0
        first, second = wp.where(after, across, own), wp.where(after, own, across)
        side = item_side(item, code)
        work_edge(
            patches, patch, beside, memory, step, local, packed(word, 0), packed(word, 1), side, first, second, law
        )

    @wp.func
    def edges_of(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        local: int,
        item: PatchItem,
    ):
        """Tensions and hinges of an item's edges; where its triangles share none, no one looks what comes of it."""
        other = patch.item_count + local
        another = patch.item_count + other
        word, law = edge_table(patches, patch.edge_start + another)
        a, b = packed(item.vertices, 0), packed(item.vertices, 1)
        work_edge(
            patches, patch, beside, memory, step, local, a, b, item.side_ab, item.normal_0, item.normal_1, item.law
        )
        taken_edge(patches, patch, beside, memory, step, other, item, item.first_word, item.first_law)
        taken_edge(patches, patch, beside, memory, step, another, item, word, law)

    @wp.func
    def work_item_edges(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        lane: int,
        item: PatchItem,
    ):
        """Edges of the patch's items; the last is the thread's own, with ``asked_laws``."""
        if wp.static(fits):
            if lane < patch.item_count:
                edges_of(patches, patch, beside, memory, step, lane, item)
        else:
            local = int(lane)
            while local < patch.item_count:
                lying = lying_item(beside, memory, asked_item(patches, patch, local))
                edges_of(patches, patch, beside, memory, step, local, asked_laws(patches, patch, local, lying))
                local += patch_threads()

    return SimpleNamespace(asked_laws=asked_laws, work_item_edges=work_item_edges)


@functools.cache
def item_corners_step(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out what the triangles of items that are kept do."""
    types = cloth_types(precision)
    vec3, vec4, Patches, Step = types.vec3, types.vec4, types.Patches, types.Step
    PatchItem, Sides, size_4 = item_type(precision), types.Sides, 4 * types.real_size
    functions, turns = item_functions(precision, terms, fits), turn_functions(precision)
    turn_0, turn_1, first_of, last_of = functions.turn_0, functions.turn_1, turns.first_of, turns.last_of
    read_4, first_three = memory_functions(precision, fits).read_4, three_function(precision)
    put_corners, triangle_table = (
        corners_function(precision, fourth, terms, fits),
        triangle_table_function(precision, terms),
    )

    @wp.func
    def move_at(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int):
        """What last moved a vertex [m]."""
        return first_three(read_4(beside, memory.move + wp.static(size_4) * local))

    @wp.func
    def kept_corners(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        triangle: int,
        normal: vec4,
        turn: int,
        one: vec3,
        two: vec3,
        three: vec3,
        word: wp.uint64,
        corners: wp.uint64,
    ):
        """What a triangle with these sides does to its corners."""
        sides = Sides()
        if wp.static(terms.threads):
            sides.side_1 = first_of(turn, one, two, three)
            sides.side_2 = last_of(turn, one, two, three)
            sides.side_0 = first_of(turn, two, three, one)
        if wp.static(terms.threads and fourth in BOUNDS):
            origin = move_at(beside, memory, packed(corners, 0))
            sides.change_1 = move_at(beside, memory, packed(corners, 1)) - origin
            sides.change_2 = move_at(beside, memory, packed(corners, 2)) - origin
        put_corners(patches, patch, beside, memory, step, triangle, normal, sides, word)

    @wp.func
    def work_item_corners(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        local: int,
        item: PatchItem,
        word: wp.uint64,
        corners: wp.uint64,
    ):
        """What an item's triangles do to their corners; the last two are ``triangle_table`` of the first one."""
        other = patch.item_count + local
        paired = other < patch.triangle_count
        next_word, next_corners = wp.uint64(0), wp.uint64(0)
        if paired:
            next_word, next_corners = triangle_table(patches, patch.triangle_start + other)
        ab, bc, ca, ad, db = item.side_ab, item.side_bc, item.side_ca, item.side_ad, item.side_db
        kept_corners(
            patches, patch, beside, memory, step, local, item.normal_0, turn_0(item), ab, bc, ca, word, corners
        )
        if paired:
            kept_corners(
                patches, patch, beside, memory, step, other, item.normal_1, turn_1(item), -ab, ad, db,
                next_word, next_corners,
            )  # fmt: skip

    return work_item_corners
