"""Forces patch by patch: a thread block works out all that meets at the vertices that it owns.

For CUDA. A block reads the vertices of its patch and those around into its own memory, works out there, one after
another, normals, edges and triangles, and sums what meets at each of its vertices in the order of the edges, then of
the triangles. That is the order of ``scatter``, and what borders on two patches is worked out in both from the same
numbers: so every way of cutting patches, and every device, gives the same bits. No atomics, one launch.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.arithmetic import signed_sum
from warp_cloth.kernels.block import (
    BESIDE,
    block_of,
    block_threads,
    lane_of,
    memory_functions,
    own_memory,
    wait_for_block,
)
from warp_cloth.kernels.cloth import MODULE_OPTIONS, Patch, Terms, cloth_types
from warp_cloth.kernels.forces import corner_function, edge_functions, triangle_functions

RANKS = 4  # of what meets at a vertex that share a word


@wp.struct
class PatchMemory:
    """Places in the block's memory; vectors of four reals unless said otherwise."""

    edge_load: int  # on each edge's first end, and nothing after the last
    corner_load: int  # on the triangles' first corners, the second, the third, and nothing after the last
    normal: int  # unit normal and inverse of twice the area [1/m2] of each triangle
    fold: int  # of three: turn [N], bound [N/m] and L^2 [m2] of each edge's hinge
    position: int  # of three, in the positions' own precision
    move: int  # of three


@wp.func
def packed(word: wp.uint64, place: int):
    """One of the four numbers below 65536 in a word."""
    return int((word >> wp.uint64(16 * place)) & wp.uint64(65535))


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
    patch.edge_slot_start = two[2]
    patch.edge_words = two[3]
    patch.triangle_start = three[0]
    patch.triangle_count = three[1]
    patch.normal_count = three[2]
    patch.slot_start = three[3]
    patch.words = four[0]
    patch.overflow = four[1]
    return patch


@functools.cache
def layout_function(precision: str, terms: Terms) -> wp.Function:
    """The function that lays out the block's memory; the host counts the same bytes."""
    real = 8 if precision == "float64" else 4
    point = 12 if precision == "float32" else 24

    @wp.func
    def patch_memory(patch: Patch):
        """Places in the block's memory; without threads, corners' loads come to lie where the vertices lay."""
        memory = PatchMemory()
        at = own_memory()
        if patch.overflow >= 0:
            at = patch.overflow | BESIDE
        if wp.static(terms.edges):
            memory.edge_load = at
            at += wp.static(4 * real) * (patch.edge_count + 1)
        if wp.static(terms.folds):
            memory.normal = at
            at += wp.static(4 * real) * patch.normal_count
        memory.corner_load = at
        if wp.static(terms.threads):
            at += wp.static(4 * real) * (3 * patch.triangle_count + 1)
        memory.position = at
        at += (wp.static(point) * patch.vertex_count + 7) & -8
        memory.move = at
        at += (wp.static(3 * real) * patch.vertex_count + 7) & -8
        if wp.static(terms.folds and not terms.threads):
            at = wp.max(at, memory.corner_load + wp.static(4 * real) * (3 * patch.triangle_count + 1))
        memory.fold = at
        return memory

    return patch_memory


@functools.cache
def patch_functions(precision: str, fourth: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``work_patch`` and ``vertex_load``, which sums a vertex' load once the whole block is through it.

    ``fits``: whether no patch is too large for a block's own memory.
    """
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    patch_memory = layout_function(precision, terms)
    read_4 = memory_functions(precision, fits).read_4
    read_vertices = _vertices_function(precision, fourth, fits)
    work_normals = _normals_function(precision, fits)
    work_edges = _edges_function(precision, fourth, terms, fits)
    work_triangles = _triangles_function(precision, fourth, terms, fits)

    @wp.func
    def work_patch(
        cloth: Cloth, patches: Patches, patch: Patch, beside: wp.array(dtype=wp.uint8), step: Step, lane: int
    ):
        """All that meets at the patch's vertices, in the block's memory; every thread of the block calls it."""
        memory = patch_memory(patch)
        read_vertices(cloth, patches, patch, beside, memory, lane)
        wait_for_block()
        if wp.static(terms.folds):
            work_normals(patches, patch, beside, memory, lane)
            wait_for_block()
        if wp.static(terms.folds or terms.edges):
            work_edges(patches, patch, beside, memory, step, lane)
            wait_for_block()
        if wp.static(terms.folds or terms.threads):
            work_triangles(patches, patch, beside, memory, step, lane)
            wait_for_block()
        return memory

    @wp.func
    def vertex_load(patches: Patches, patch: Patch, beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int):
        """Sum over the edges, then over the triangles at a vertex that the patch owns; what is not there is nothing."""
        load = vec4()
        if wp.static(terms.edges):
            for four in range(patch.edge_words):
                word = element(patches.edge_slot, patch.edge_slot_start + four * patch.owned_count + local)
                for rank in range(wp.static(RANKS)):
                    entry = packed(word, rank)
                    pull = read_4(beside, memory.edge_load + wp.static(4 * types.real_size) * (entry >> 1))
                    load = signed_sum(load, pull, entry & 1)  # from the edge's first end, or its second
        if wp.static(terms.folds or terms.threads):
            for four in range(patch.words):
                word = element(patches.slot, patch.slot_start + four * patch.owned_count + local)
                for rank in range(wp.static(RANKS)):
                    entry = packed(word, rank)
                    load += read_4(beside, memory.corner_load + wp.static(4 * types.real_size) * entry)
        return load

    return SimpleNamespace(work_patch=work_patch, vertex_load=vertex_load)


def _vertices_function(precision: str, fourth: str, fits: bool) -> wp.Function:
    types = cloth_types(precision)
    Cloth, Patches = types.Cloth, types.Patches
    functions = memory_functions(precision, fits)
    write_point, write_3 = functions.write_point, functions.write_3

    @wp.func
    def read_vertices(
        cloth: Cloth,
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        lane: int,
    ):
        """Brings the vertices that the patch needs into the block's memory."""
        local = int(lane)
        while local < patch.vertex_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
            write_point(beside, memory.position + wp.static(types.point_size) * local, element(cloth.position, vertex))
            if wp.static(fourth == "stiffness"):
                write_3(beside, memory.move + wp.static(3 * types.real_size) * local, element(cloth.move, vertex))
            local += block_threads()

    return read_vertices


def _normals_function(precision: str, fits: bool) -> wp.Function:
    types = cloth_types(precision)
    functions = memory_functions(precision, fits)
    read_point, write_4 = functions.read_point, functions.write_4
    triangle_normal = triangle_functions(precision, "none").triangle_normal

    @wp.func
    def work_normals(
        patches: types.Patches, patch: Patch, beside: wp.array(dtype=wp.uint8), memory: PatchMemory, lane: int
    ):
        """Normals of the patch's triangles and of those beyond its edges."""
        local = int(lane)
        while local < patch.normal_count:
            word = element(patches.corners, patch.triangle_start + local)
            origin = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 0))
            second = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 1))
            third = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 2))
            normal = triangle_normal(origin, second, third)
            write_4(beside, memory.normal + wp.static(4 * types.real_size) * local, normal)
            local += block_threads()

    return work_normals


def _edges_function(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    types = cloth_types(precision)
    vec2, vec3, vec4, Patches, Step = types.vec2, types.vec3, types.vec4, types.Patches, types.Step
    functions = memory_functions(precision, fits)
    read_point, read_3, read_4 = functions.read_point, functions.read_3, functions.read_4
    write_3, write_4 = functions.write_3, functions.write_4
    edge = edge_functions(precision, fourth, terms.angles)
    edge_span, edge_load, edge_fold = edge.edge_span, edge.edge_load, edge.edge_fold

    @wp.func
    def work_edges(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        lane: int,
    ):
        """Tensions and hinges of the patch's edges."""
        local = int(lane)
        while local < patch.edge_count:
            at = patch.edge_start + local
            word = element(patches.ends, at)
            law = vec4()
            if wp.static(terms.edges):
                law = element(patches.law, at)
            if wp.static(terms.folds and not terms.edges):
                law[3] = element(patches.fold, at)
            first, second = packed(word, 0), packed(word, 1)
            start = read_point(beside, memory.position + wp.static(types.point_size) * first)
            end = read_point(beside, memory.position + wp.static(types.point_size) * second)
            move_0 = vec3()
            move_1 = vec3()
            if wp.static(fourth == "stiffness"):
                move_0 = read_3(beside, memory.move + wp.static(3 * types.real_size) * first)
                move_1 = read_3(beside, memory.move + wp.static(3 * types.real_size) * second)
            span = edge_span(start, end, move_0, move_1)
            if wp.static(terms.edges):
                load = edge_load(span, vec3(law[0], law[1], law[2]), step)
                write_4(beside, memory.edge_load + wp.static(4 * types.real_size) * local, load)
            if wp.static(terms.folds):
                normal_0 = read_4(beside, memory.normal + wp.static(4 * types.real_size) * packed(word, 2))
                normal_1 = read_4(beside, memory.normal + wp.static(4 * types.real_size) * packed(word, 3))
                rest = vec2()
                if wp.static(terms.angles):
                    rest = element(patches.rest, at)
                fold = edge_fold(span, normal_0, normal_1, law[3], rest, step)
                write_3(beside, memory.fold + wp.static(3 * types.real_size) * local, fold)
            local += block_threads()
        if wp.static(terms.edges):
            if lane == 0:
                write_4(beside, memory.edge_load + wp.static(4 * types.real_size) * patch.edge_count, vec4())

    return work_edges


def _triangles_function(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    types = cloth_types(precision)
    vec3, vec4, Patches, Step, Sides = types.vec3, types.vec4, types.Patches, types.Step, types.Sides
    functions = memory_functions(precision, fits)
    read_point, read_3, read_4, write_4 = functions.read_point, functions.read_3, functions.read_4, functions.write_4
    triangle_sides = triangle_functions(precision, fourth).triangle_sides
    corner_loads = corner_function(precision, fourth, terms)
    point_size, size_3 = types.point_size, 3 * types.real_size

    @wp.func
    def side_fold(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, word: wp.uint64, side: int):
        """Hinge of a triangle's side, its turn as the triangle is wound."""
        fold = read_3(beside, memory.fold + wp.static(size_3) * packed(word, side))
        otherwise = (packed(word, 3) >> side) & 1
        return vec3(wp.where(otherwise == 1, -fold[0], fold[0]), fold[1], fold[2])

    @wp.func
    def sides_of(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, word: wp.uint64):
        """A triangle as it lies."""
        a, b, c = packed(word, 0), packed(word, 1), packed(word, 2)
        move_0, move_1, move_2 = vec3(), vec3(), vec3()
        if wp.static(fourth == "stiffness"):
            move_0 = read_3(beside, memory.move + wp.static(size_3) * a)
            move_1 = read_3(beside, memory.move + wp.static(size_3) * b)
            move_2 = read_3(beside, memory.move + wp.static(size_3) * c)
        origin = read_point(beside, memory.position + wp.static(point_size) * a)
        second = read_point(beside, memory.position + wp.static(point_size) * b)
        third = read_point(beside, memory.position + wp.static(point_size) * c)
        return triangle_sides(origin, second, third, move_0, move_1, move_2)

    @wp.func
    def work_triangles(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        lane: int,
    ):
        """What the hinges and threads of the patch's triangles do to their corners."""
        count = patch.triangle_count
        local = int(lane)
        while local < count:
            at = patch.triangle_start + local
            normal, slope, law = vec4(), vec4(), vec4()
            fold_0, fold_1, fold_2 = vec3(), vec3(), vec3()
            sides = Sides()
            if wp.static(terms.folds):
                word = element(patches.sides, at)
                normal = read_4(beside, memory.normal + wp.static(4 * types.real_size) * local)
                fold_0 = side_fold(beside, memory, word, 0)
                fold_1 = side_fold(beside, memory, word, 1)
                fold_2 = side_fold(beside, memory, word, 2)
            if wp.static(terms.threads):
                slope, law = element(patches.slope, at), element(patches.threads, at)
                sides = sides_of(beside, memory, element(patches.corners, at))
            first, second, third = corner_loads(normal, fold_0, fold_1, fold_2, sides, slope, law, step)
            place = memory.corner_load + wp.static(4 * types.real_size) * local
            write_4(beside, place, first)
            write_4(beside, place + wp.static(4 * types.real_size) * count, second)
            write_4(beside, place + wp.static(8 * types.real_size) * count, third)
            local += block_threads()
        if lane == 0:
            write_4(beside, memory.corner_load + wp.static(12 * types.real_size) * count, vec4())

    return work_triangles


@functools.cache
def gather_kernel(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Kernel:
    """Kernel ``gather_forces``; ``fourth`` is one of cloth.FOURTH_PARTS, ``fits`` as of ``patch_functions``."""
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    functions = patch_functions(precision, fourth, terms, fits)
    work_patch, vertex_load = functions.work_patch, functions.vertex_load

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def gather_forces(
        cloth: Cloth,
        patches: Patches,
        beside: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        thread = wp.tid()
        patch = patch_of(patches.patch, block_of(thread))
        if cloth.items[patch.item].active == 0:
            return
        lane = lane_of(thread)
        memory = work_patch(cloth, patches, patch, beside, step, lane)
        local = int(lane)
        while local < patch.owned_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
            load_out[vertex] = vertex_load(patches, patch, beside, memory, local)
            local += block_threads()

    return gather_forces
