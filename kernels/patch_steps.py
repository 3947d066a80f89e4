"""What the threads of a block do for a patch of cloth, step by step: vertices, normals, edges, triangles.

What a step reads first it asks for before it waits for the step before, and what its next turn reads while it works.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.arithmetic import inner, root
from warp_cloth.kernels.block import block_threads, fetch_ahead, memory_functions, wait_for_block
from warp_cloth.kernels.cloth import BOUNDS, Patch, Terms, cloth_types
from warp_cloth.kernels.forces import corner_function, edge_functions, triangle_functions


@wp.struct
class PatchMemory:
    """Places in the block's memory; vectors of four reals unless said otherwise."""

    edge_load: int  # on each edge's first end, and nothing after the last
    corner_load: int  # on the triangles' first corners, the second, the third, and nothing after the last
    normal: int  # unit normal and inverse of twice the area [1/m2] of each triangle
    fold: int  # of three: turn [N], bound [N/m] and L^2 [m2] of each edge's hinge
    position: int  # of three, in the positions' own precision
    move: int  # and how long it is


_PACKED = """
    const unsigned int part = (unsigned int)(place < 2 ? word : word >> 32);
    return (int)(place & 1 ? part >> 16 : part & 65535u);
"""


@wp.func_native(_PACKED)
def packed(word: wp.uint64, place: int) -> int:
    """One of the four numbers below 65536 in a word."""
    ...


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
    patch.place = four[2]
    return patch


@functools.cache
def own_function(precision: str, in_order: bool) -> wp.Function:
    """The function that tells a patch's own vertices; ``in_order``: these lie in the patches' order."""
    Patches = cloth_types(precision).Patches

    @wp.func
    def own_vertex(patches: Patches, patch: Patch, local: int):
        """One of the vertices that a patch owns."""
        vertex = patch.place + local
        if wp.static(not in_order):
            vertex = element(patches.vertex, patch.vertex_start + local)
        return vertex

    return own_vertex


@functools.cache
def fetch_function(precision: str, terms: Terms) -> wp.Function:
    """The function that asks for the tables of all steps."""
    Patches = cloth_types(precision).Patches

    @wp.func
    def fetch_tables(patches: Patches, patch: Patch):
        """Asks for what later steps read, while the vertices are on their way."""
        if wp.static(terms.folds or terms.threads):
            fetch_ahead(patches.corners, patch.triangle_start, patch.normal_count, 4)
        if wp.static(terms.folds or terms.edges):
            fetch_ahead(patches.ends, patch.edge_start, patch.edge_count, 1)
        if wp.static(terms.edges):
            fetch_ahead(patches.law, patch.edge_start, patch.edge_count, 0)
        if wp.static(terms.folds and not terms.edges):
            fetch_ahead(patches.fold, patch.edge_start, patch.edge_count, 5)
        if wp.static(terms.folds):
            fetch_ahead(patches.sides, patch.triangle_start, patch.triangle_count, 5)
        if wp.static(terms.threads):
            fetch_ahead(patches.slope, patch.triangle_start, patch.triangle_count, 0)
            fetch_ahead(patches.threads, patch.triangle_start, patch.triangle_count, 2)
        if wp.static(terms.edges):
            fetch_ahead(patches.edge_slot, patch.edge_slot_start, patch.edge_words * patch.owned_count, 3)
        if wp.static(terms.folds or terms.threads):
            fetch_ahead(patches.slot, patch.slot_start, patch.words * patch.owned_count, 3)

    return fetch_tables


@functools.cache
def three_function(precision: str) -> wp.Function:
    """The function that takes the first three of four."""
    types = cloth_types(precision)

    @wp.func
    def first_three(four: types.vec4):
        """The first three of four."""
        return types.vec3(four[0], four[1], four[2])

    return first_three


@functools.cache
def vertices_step(precision: str, fourth: str, fits: bool, own_vertex: wp.Function) -> wp.Function:
    """The function that reads the vertices; ``own_vertex`` is that of ``own_function``."""
    types = cloth_types(precision)
    vec3, vec4, Cloth, Patches = types.vec3, types.vec4, types.Cloth, types.Patches
    functions = memory_functions(precision, fits)
    write_point, write_4 = functions.write_point, functions.write_4

    @wp.func
    def keep(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int, position: types.point, move: vec3):
        """Keeps a vertex in the block's memory."""
        write_point(beside, memory.position + wp.static(types.point_size) * local, position)
        if wp.static(fourth in BOUNDS):
            sized = vec4(move[0], move[1], move[2], root(inner(move, move)))
            write_4(beside, memory.move + wp.static(4 * types.real_size) * local, sized)

    @wp.func
    def vertex_at(patches: Patches, patch: Patch, local: int):
        """One of the vertices that a patch has; beyond the last, any."""
        vertex = own_vertex(patches, patch, wp.min(local, patch.owned_count - 1))
        if local >= patch.owned_count and local < patch.vertex_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
        return vertex

    @wp.func
    def read_vertices(
        cloth: Cloth,
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        lane: int,
    ):
        """Brings the vertices that the patch needs into the block's memory, two of each thread at a time."""
        local = int(lane)
        first, second = vertex_at(patches, patch, local), vertex_at(patches, patch, local + block_threads())
        while local < patch.vertex_count:
            other = local + block_threads()
            position, other_position = element(cloth.position, first), element(cloth.position, second)
            move = vec3()
            other_move = vec3()
            if wp.static(fourth in BOUNDS):
                move, other_move = element(cloth.move, first), element(cloth.move, second)
            keep(beside, memory, local, position, move)
            if other < patch.vertex_count:
                keep(beside, memory, other, other_position, other_move)
            local = other + block_threads()
            first, second = vertex_at(patches, patch, local), vertex_at(patches, patch, local + block_threads())

    return read_vertices


@functools.cache
def normals_step(precision: str, fits: bool) -> wp.Function:
    """The function that works out normals."""
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
        following = wp.uint64(0)
        if local < patch.normal_count:
            following = element(patches.corners, patch.triangle_start + local)
        wait_for_block()
        while local < patch.normal_count:
            word = following
            if local + block_threads() < patch.normal_count:
                following = element(patches.corners, patch.triangle_start + local + block_threads())
            origin = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 0))
            second = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 1))
            third = read_point(beside, memory.position + wp.static(types.point_size) * packed(word, 2))
            normal = triangle_normal(origin, second, third)
            write_4(beside, memory.normal + wp.static(4 * types.real_size) * local, normal)
            local += block_threads()

    return work_normals


@functools.cache
def edges_step(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out edges."""
    types = cloth_types(precision)
    vec2, vec3, vec4, Patches, Step = types.vec2, types.vec3, types.vec4, types.Patches, types.Step
    functions = memory_functions(precision, fits)
    read_point, read_4 = functions.read_point, functions.read_4
    write_3, write_4 = functions.write_3, functions.write_4
    edge = edge_functions(precision, fourth, terms.angles)
    edge_span, edge_load, edge_fold = edge.edge_span, edge.edge_load, edge.edge_fold
    first_three = three_function(precision)

    @wp.func
    def edge_table(patches: Patches, at: int):
        """An edge's word, its law and C of its hinge."""
        law = vec4()
        if wp.static(terms.edges):
            law = element(patches.law, at)
        if wp.static(terms.folds and not terms.edges):
            law[3] = element(patches.fold, at)
        return element(patches.ends, at), law

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
        next_word, next_law = wp.uint64(0), vec4()
        if local < patch.edge_count:
            next_word, next_law = edge_table(patches, patch.edge_start + local)
        wait_for_block()
        while local < patch.edge_count:
            at = patch.edge_start + local
            word, law = next_word, next_law
            if local + block_threads() < patch.edge_count:
                next_word, next_law = edge_table(patches, at + block_threads())
            first, second = packed(word, 0), packed(word, 1)
            start = read_point(beside, memory.position + wp.static(types.point_size) * first)
            end = read_point(beside, memory.position + wp.static(types.point_size) * second)
            move_0 = vec4()
            move_1 = vec4()
            if wp.static(fourth in BOUNDS):
                move_0 = read_4(beside, memory.move + wp.static(4 * types.real_size) * first)
                move_1 = read_4(beside, memory.move + wp.static(4 * types.real_size) * second)
            span = edge_span(start, end, first_three(move_0), first_three(move_1), move_0[3])
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


@functools.cache
def sides_functions(precision: str, fourth: str, fits: bool) -> SimpleNamespace:
    """Functions ``side_fold`` and ``sides_of``, which read what a triangle is worked out from."""
    types = cloth_types(precision)
    vec3 = types.vec3
    functions = memory_functions(precision, fits)
    read_point, read_3, read_4 = functions.read_point, functions.read_3, functions.read_4
    triangle_sides = triangle_functions(precision, fourth).triangle_sides
    point_size, size_3, size_4 = types.point_size, 3 * types.real_size, 4 * types.real_size
    first_three = three_function(precision)

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
        if wp.static(fourth in BOUNDS):
            move_0 = first_three(read_4(beside, memory.move + wp.static(size_4) * a))
            move_1 = first_three(read_4(beside, memory.move + wp.static(size_4) * b))
            move_2 = first_three(read_4(beside, memory.move + wp.static(size_4) * c))
        origin = read_point(beside, memory.position + wp.static(point_size) * a)
        second = read_point(beside, memory.position + wp.static(point_size) * b)
        third = read_point(beside, memory.position + wp.static(point_size) * c)
        return triangle_sides(origin, second, third, move_0, move_1, move_2)

    return SimpleNamespace(side_fold=side_fold, sides_of=sides_of)


@functools.cache
def triangles_step(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out triangles."""
    types = cloth_types(precision)
    vec3, vec4, Patches, Step, Sides = types.vec3, types.vec4, types.Patches, types.Step, types.Sides
    functions = memory_functions(precision, fits)
    read_4, write_4 = functions.read_4, functions.write_4
    sides_reading = sides_functions(precision, fourth, fits)
    side_fold, sides_of = sides_reading.side_fold, sides_reading.sides_of
    corner_loads = corner_function(precision, fourth, terms)

    @wp.func
    def triangle_table(patches: Patches, at: int):
        """The words of a triangle's sides and corners, as far as they are asked for."""
        sides, corners = wp.uint64(0), wp.uint64(0)
        if wp.static(terms.folds):
            sides = element(patches.sides, at)
        if wp.static(terms.threads):
            corners = element(patches.corners, at)
        return sides, corners

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
        next_sides, next_corners = wp.uint64(0), wp.uint64(0)
        if local < count:
            next_sides, next_corners = triangle_table(patches, patch.triangle_start + local)
        wait_for_block()
        while local < count:
            at = patch.triangle_start + local
            word, corners = next_sides, next_corners
            if local + block_threads() < count:
                next_sides, next_corners = triangle_table(patches, at + block_threads())
            normal, slope, law = vec4(), vec4(), vec4()
            fold_0, fold_1, fold_2 = vec3(), vec3(), vec3()
            sides = Sides()
            if wp.static(terms.folds):
                normal = read_4(beside, memory.normal + wp.static(4 * types.real_size) * local)
                fold_0 = side_fold(beside, memory, word, 0)
                fold_1 = side_fold(beside, memory, word, 1)
                fold_2 = side_fold(beside, memory, word, 2)
            if wp.static(terms.threads):
                slope, law = element(patches.slope, at), element(patches.threads, at)
                sides = sides_of(beside, memory, corners)
            first, second, third = corner_loads(normal, fold_0, fold_1, fold_2, sides, slope, law, step)
            place = memory.corner_load + wp.static(4 * types.real_size) * local
            write_4(beside, place, first)
            write_4(beside, place + wp.static(4 * types.real_size) * count, second)
            write_4(beside, place + wp.static(8 * types.real_size) * count, third)
            local += block_threads()
        if lane == 0:
            write_4(beside, memory.corner_load + wp.static(12 * types.real_size) * count, vec4())

    return work_triangles
