"""What the threads of a block do for a patch of cloth, step by step: vertices, normals, edges, triangles.

What a step reads first it asks for before it waits for the step before, and what its next turn reads while it works.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.access import element
from warp_cloth.kernels.arithmetic import inner
from warp_cloth.kernels.block import memory_functions, patch_threads
from warp_cloth.kernels.cloth import BOUNDS, Patch, cloth_types
from warp_cloth.kernels.edge import edge_functions
from warp_cloth.kernels.forces import corner_function, triangle_functions
from warp_cloth.kernels.limits import Terms, fold_numbers
from warp_cloth.kernels.packing import order_functions, three_function
from warp_cloth.kernels.patch_memory import PatchMemory, stride_function

_PACKED = """
    const unsigned int part = (unsigned int)(place < 2 ? word : word >> 32);
    return (int)(place & 1 ? part >> 16 : part & 65535u);
"""


@wp.func_native(_PACKED)
def packed(word: wp.uint64, place: int) -> int:
    """One of the four numbers below 65536 in a word."""
    ...


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
def point_functions(precision: str, fits: bool) -> SimpleNamespace:
    """Functions ``point_at`` and ``put_point`` of a patch's vertices in the block's memory."""
    types = cloth_types(precision)
    wide, functions = types.point_size // 3, memory_functions(precision, fits)
    read_point, write_point = functions.read_point, functions.write_point

    @wp.func
    def point_at(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int):
        """Where a vertex is [m]."""
        return read_point(beside, memory.position + wp.static(2 * wide) * local, memory.third + wp.static(wide) * local)

    @wp.func
    def put_point(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int, position: types.point):
        """Keeps where a vertex is."""
        write_point(
            beside, memory.position + wp.static(2 * wide) * local, memory.third + wp.static(wide) * local, position
        )

    return SimpleNamespace(point_at=point_at, put_point=put_point)


@functools.cache
def vertices_step(precision: str, fourth: str, fits: bool, in_order: bool) -> SimpleNamespace:
    """Functions ``own_vertex``, ``two_vertices`` and ``read_vertices``."""
    types = cloth_types(precision)
    Cloth, Patches = types.Cloth, types.Patches
    own_vertex = own_function(precision, in_order)
    order = order_functions(precision, in_order)
    position_at, sized_move = order.position_at, order.sized_move
    put_point, write_4 = point_functions(precision, fits).put_point, memory_functions(precision, fits).write_4

    @wp.func
    def keep(cloth: Cloth, beside: wp.array(dtype=wp.uint8), memory: PatchMemory, local: int, vertex: int):
        """Keeps a vertex in the block's memory."""
        position = position_at(cloth, vertex)
        if wp.static(fourth in BOUNDS):
            write_4(beside, memory.move + wp.static(4 * types.real_size) * local, sized_move(cloth, vertex))
        put_point(beside, memory, local, position)

    @wp.func
    def vertex_at(patches: Patches, patch: Patch, local: int):
        """One of the vertices that a patch has; beyond the last, any."""
        vertex = own_vertex(patches, patch, wp.min(local, patch.owned_count - 1))
        if local >= patch.owned_count and local < patch.vertex_count:
            vertex = element(patches.vertex, patch.vertex_start + local)
        return vertex

    @wp.func
    def two_vertices(patches: Patches, patch: Patch, local: int):
        """The vertices that a thread brings in a turn."""
        return vertex_at(patches, patch, local), vertex_at(patches, patch, local + patch_threads())

    @wp.func
    def read_vertices(
        cloth: Cloth,
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        lane: int,
        first: int,
        second: int,
    ):
        """Brings the vertices that the patch needs into the block's memory, two of each thread at a time.

        The last two are of ``two_vertices``, which is called as early as may be.
        """
        local = int(lane)
        while local < patch.vertex_count:
            other = local + patch_threads()
            keep(cloth, beside, memory, local, first)
            if other < patch.vertex_count:
                keep(cloth, beside, memory, other, second)
            local = other + patch_threads()
            first, second = two_vertices(patches, patch, local)

    return SimpleNamespace(own_vertex=own_vertex, two_vertices=two_vertices, read_vertices=read_vertices)


@functools.cache
def normals_step(precision: str, fits: bool) -> wp.Function:
    """The function that works out normals."""
    types = cloth_types(precision)
    functions = memory_functions(precision, fits)
    point_at, write_4 = point_functions(precision, fits).point_at, functions.write_4
    triangle_normal = triangle_functions(precision, "none").triangle_normal

    @wp.func
    def work_normals(
        patches: types.Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        lane: int,
        first: wp.uint64,
    ):
        """Normals of the patch's triangles and of those beyond its edges; ``first``: corners of a thread's first."""
        local = int(lane)
        following = first
        while local < patch.normal_count:
            word = following
            if local + patch_threads() < patch.normal_count:
                following = element(patches.corners, patch.triangle_start + local + patch_threads())
            origin = point_at(beside, memory, packed(word, 0))
            second = point_at(beside, memory, packed(word, 1))
            third = point_at(beside, memory, packed(word, 2))
            normal = triangle_normal(origin, second, third)
            write_4(beside, memory.normal + wp.static(4 * types.real_size) * local, normal)
            local += patch_threads()

    return work_normals


@functools.cache
def edge_table_function(precision: str, terms: Terms) -> wp.Function:
    """The function that reads what a patch's tables tell of an edge."""
    types = cloth_types(precision)

    @wp.func
    def edge_table(patches: types.Patches, at: int):
        """An edge's word, its law and C of its hinge."""
        law = types.vec4()
        if wp.static(terms.edges):
            law = element(patches.law, at)
        if wp.static(terms.folds and not terms.edges):
            law[3] = element(patches.fold, at)
        return element(patches.ends, at), law

    return edge_table


@functools.cache
def edges_step(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out edges."""
    types = cloth_types(precision)
    vec2, vec3, vec4, Patches, Step = types.vec2, types.vec3, types.vec4, types.Patches, types.Step
    functions = memory_functions(precision, fits)
    point_at, read_4 = point_functions(precision, fits).point_at, functions.read_4
    write_2, write_3, write_4 = functions.write_2, functions.write_3, functions.write_4
    edge = edge_functions(precision, fourth, terms.angles)
    edge_span, edge_load, edge_fold = edge.edge_span, edge.edge_load, edge.edge_fold
    first_three, edge_table = three_function(precision), edge_table_function(precision, terms)

    @wp.func
    def work_edges(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        lane: int,
        first_word: wp.uint64,
        first_law: vec4,
    ):
        """Tensions and hinges of the patch's edges; the last two are of the thread's first edge."""
        local = int(lane)
        next_word, next_law = first_word, first_law
        while local < patch.edge_count:
            at = patch.edge_start + local
            word, law = next_word, next_law
            if local + patch_threads() < patch.edge_count:
                next_word, next_law = edge_table(patches, at + patch_threads())
            first, second = packed(word, 0), packed(word, 1)
            start = point_at(beside, memory, first)
            end = point_at(beside, memory, second)
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
                if wp.static(fold_numbers(terms) == 2):
                    write_2(beside, memory.fold + wp.static(2 * types.real_size) * local, vec2(fold[0], fold[1]))
                else:
                    write_3(beside, memory.fold + wp.static(3 * types.real_size) * local, fold)
            local += patch_threads()
        if wp.static(terms.edges):
            if lane == 0:
                write_4(beside, memory.edge_load + wp.static(4 * types.real_size) * patch.edge_count, vec4())

    return work_edges


@functools.cache
def sides_functions(precision: str, fourth: str, terms: Terms, fits: bool) -> SimpleNamespace:
    """Functions ``side_fold`` and ``sides_of``, which read what a triangle is worked out from."""
    types = cloth_types(precision)
    vec3 = types.vec3
    functions = memory_functions(precision, fits)
    point_at, read_4 = point_functions(precision, fits).point_at, functions.read_4
    read_2, read_3 = functions.read_2, functions.read_3
    triangle_sides = triangle_functions(precision, fourth).triangle_sides
    numbers, size_4 = fold_numbers(terms), 4 * types.real_size
    first_three = three_function(precision)

    @wp.func
    def side_fold(beside: wp.array(dtype=wp.uint8), memory: PatchMemory, word: wp.uint64, side: int, along: vec3):
        """Hinge of a triangle's side, its turn as the triangle is wound; ``along`` it, where that is known."""
        place = memory.fold + wp.static(numbers * types.real_size) * packed(word, side)
        fold = vec3()
        if wp.static(numbers == 2):
            two = read_2(beside, place)
            fold = vec3(two[0], two[1], inner(along, along))
        else:
            fold = read_3(beside, place)
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
        origin = point_at(beside, memory, a)
        second = point_at(beside, memory, b)
        third = point_at(beside, memory, c)
        return triangle_sides(origin, second, third, move_0, move_1, move_2)

    return SimpleNamespace(side_fold=side_fold, sides_of=sides_of)


@functools.cache
def triangle_table_function(precision: str, terms: Terms) -> wp.Function:
    """The function that reads what a patch's tables tell of a triangle."""

    @wp.func
    def triangle_table(patches: cloth_types(precision).Patches, at: int):
        """The words of a triangle's sides and corners, as far as they are asked for."""
        sides, corners = wp.uint64(0), wp.uint64(0)
        if wp.static(terms.folds):
            sides = element(patches.sides, at)
        if wp.static(terms.threads):
            corners = element(patches.corners, at)
        return sides, corners

    return triangle_table


@functools.cache
def triangles_step(precision: str, fourth: str, terms: Terms, fits: bool) -> wp.Function:
    """The function that works out triangles."""
    types = cloth_types(precision)
    vec3, vec4, Patches, Step, Sides = types.vec3, types.vec4, types.Patches, types.Step, types.Sides
    functions = memory_functions(precision, fits)
    read_4, write_4 = functions.read_4, functions.write_4
    sides_reading = sides_functions(precision, fourth, terms, fits)
    side_fold, sides_of = sides_reading.side_fold, sides_reading.sides_of
    corner_loads, corner_stride = corner_function(precision, fourth, terms), stride_function(terms)
    triangle_table = triangle_table_function(precision, terms)

    @wp.func
    def work_triangles(
        patches: Patches,
        patch: Patch,
        beside: wp.array(dtype=wp.uint8),
        memory: PatchMemory,
        step: Step,
        lane: int,
        first_sides: wp.uint64,
        first_corners: wp.uint64,
    ):
        """What hinges and threads of the patch's triangles do to their corners; the last two are of the first one."""
        count = patch.triangle_count
        others = memory.corner_load + wp.static(4 * types.real_size) * corner_stride(patch)
        local = int(lane)
        next_sides, next_corners = first_sides, first_corners
        while local < count:
            at = patch.triangle_start + local
            word, corners = next_sides, next_corners
            if local + patch_threads() < count:
                next_sides, next_corners = triangle_table(patches, at + patch_threads())
            normal, slope, law = vec4(), vec4(), vec4()
            fold_0, fold_1, fold_2 = vec3(), vec3(), vec3()
            sides = Sides()
            if wp.static(terms.threads):
                slope, law = element(patches.slope, at), element(patches.threads, at)
                sides = sides_of(beside, memory, corners)
            if wp.static(terms.folds):
                normal = read_4(beside, memory.normal + wp.static(4 * types.real_size) * local)
                fold_0 = side_fold(beside, memory, word, 0, sides.side_0)
                fold_1 = side_fold(beside, memory, word, 1, sides.side_2)
                fold_2 = side_fold(beside, memory, word, 2, sides.side_1)
            first, second, third = corner_loads(normal, fold_0, fold_1, fold_2, sides, slope, law, step)
            write_4(beside, memory.corner_load + wp.static(4 * types.real_size) * local, first)
            write_4(beside, others + wp.static(4 * types.real_size) * local, second)
            write_4(beside, others + wp.static(4 * types.real_size) * (count + local), third)
            local += patch_threads()
        if lane == 0:
            write_4(beside, others + wp.static(8 * types.real_size) * count, vec4())

    return work_triangles
