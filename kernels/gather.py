"""Forces patch by patch: a thread block works out all that meets at the vertices that it owns.

For CUDA. A block reads the vertices of its patch and those around into its own memory, works out there, one after
another, normals, edges and triangles, and sums what meets at each of its vertices in the order of the edges, then of
the triangles. That is the order of ``scatter``, and what borders on two patches is worked out in both from the same
numbers: so every way of cutting patches, and every device, gives the same bits. No atomics, one launch.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.cloth import MODULE_OPTIONS, Patch, Terms, cloth_types, rest_function
from warp_cloth.kernels.forces import edge_functions, triangle_functions

BLOCK_MEMORY = 47 * 1024  # [bytes]; CUDA gives a block 48 KiB without being asked, and Warp takes some of that
NO_SLOT = 65535

_BLOCK_MEMORY = """
#if defined(__CUDA_ARCH__)
    __shared__ __align__(16) unsigned char memory[%d];
    if (offset < 0)
        return (wp::uint64)memory;
#endif
    return (wp::uint64)(overflow.data + offset);
"""

_WAIT = """
#if defined(__CUDA_ARCH__)
    __syncthreads();
#endif
"""


@wp.func_native(_BLOCK_MEMORY % BLOCK_MEMORY)
def block_memory(overflow: wp.array(dtype=wp.uint8), offset: int) -> wp.uint64:
    """Address of the block's own memory, or of what it has in ``overflow`` where its patch is too large for that."""
    ...


@wp.func_native(_WAIT)
def wait_for_block():
    """Until all threads of the block have come here; on the CPU a block is one thread."""
    ...


@wp.func
def packed(word: wp.uint64, place: int):
    """One of the four numbers below 65536 in a word."""
    return int((word >> wp.uint64(16 * place)) & wp.uint64(65535))


# Warp reads and writes a vector number by number; a GPU moves 16 bytes at a time, in fewer turns at its banks.
_READ = {
    "float32": """
#if defined(__CUDA_ARCH__)
    float4 v = *reinterpret_cast<const float4*>(memory.data + index);
    return wp::vec_t<4, wp::float32>(v.x, v.y, v.z, v.w);
#else
    return memory.data[index];
#endif
""",
    "float64": """
#if defined(__CUDA_ARCH__)
    const double2* parts = reinterpret_cast<const double2*>(memory.data + index);
    double2 v = parts[0], w = parts[1];
    return wp::vec_t<4, wp::float64>(v.x, v.y, w.x, w.y);
#else
    return memory.data[index];
#endif
""",
}
_WRITE = {
    "float32": """
#if defined(__CUDA_ARCH__)
    *reinterpret_cast<float4*>(memory.data + index) = make_float4(value[0], value[1], value[2], value[3]);
#else
    memory.data[index] = value;
#endif
""",
    "float64": """
#if defined(__CUDA_ARCH__)
    double2* parts = reinterpret_cast<double2*>(memory.data + index);
    parts[0] = make_double2(value[0], value[1]);
    parts[1] = make_double2(value[2], value[3]);
#else
    memory.data[index] = value;
#endif
""",
}


@functools.cache
def memory_functions(precision: str) -> SimpleNamespace:
    """Functions ``read_vector`` and ``write_vector`` of vec4 arrays in the block's memory, which lie at 16 bytes."""
    vec4 = cloth_types(precision).vec4
    real = "float64" if precision == "float64" else "float32"

    @wp.func_native(_READ[real])
    def read_vector(memory: wp.array(dtype=vec4), index: int) -> vec4:
        """What an array holds."""
        ...

    @wp.func_native(_WRITE[real])
    def write_vector(memory: wp.array(dtype=vec4), index: int, value: vec4):
        """Lets an array hold it."""
        ...

    return SimpleNamespace(read_vector=read_vector, write_vector=write_vector)


@functools.cache
def layout_function(precision: str, terms: Terms) -> wp.Function:
    """The function that lays out the block's memory; the host counts the same bytes."""
    types = cloth_types(precision)
    real, point, vec3, vec4, PatchMemory = types.real, types.point, types.vec3, types.vec4, types.PatchMemory
    real_size = 8 if precision == "float64" else 4
    point_size = 12 if precision == "float32" else 24

    @wp.func
    def patch_memory(patch: Patch, overflow: wp.array(dtype=wp.uint8)):
        """The block's memory as arrays; without threads, what hinges do comes to lie where the vertices lay."""
        memory = PatchMemory()
        base = block_memory(overflow, patch.overflow)
        at = int(0)
        if wp.static(terms.folds):
            memory.normal = wp.array(ptr=base, shape=(patch.normal_count,), dtype=vec4)
            at += wp.static(4 * real_size) * patch.normal_count
        if wp.static(terms.edges):
            memory.edge_load = wp.array(ptr=base + wp.uint64(at), shape=(patch.edge_count,), dtype=vec4)
            at += wp.static(4 * real_size) * patch.edge_count
        if wp.static(terms.threads):
            memory.thread_load = wp.array(ptr=base + wp.uint64(at), shape=(3 * patch.triangle_count,), dtype=vec4)
            at += wp.static(12 * real_size) * patch.triangle_count
        if wp.static(terms.folds):
            memory.fold = wp.array(ptr=base + wp.uint64(at), shape=(patch.edge_count,), dtype=vec3)
            at = (at + wp.static(3 * real_size) * patch.edge_count + 7) // 8 * 8
        late = int(at)
        memory.position = wp.array(ptr=base + wp.uint64(at), shape=(patch.vertex_count,), dtype=point)
        at += wp.static(point_size) * patch.vertex_count
        memory.move = wp.array(ptr=base + wp.uint64(at), shape=(patch.vertex_count,), dtype=vec3)
        if wp.static(terms.threads):
            late = at + wp.static(3 * real_size) * patch.vertex_count
        if wp.static(terms.folds):
            memory.along = wp.array(ptr=base + wp.uint64(late), shape=(3 * patch.triangle_count,), dtype=real)
            late += wp.static(3 * real_size) * patch.triangle_count
            memory.part = wp.array(ptr=base + wp.uint64(late), shape=(3 * patch.triangle_count,), dtype=real)
        return memory

    return patch_memory


@functools.cache
def patch_functions(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    """Functions ``work_patch`` and ``vertex_load``, which sums a vertex' load once the whole block is through it."""
    types = cloth_types(precision)
    real, vec4, Cloth, Step = types.real, types.vec4, types.Cloth, types.Step
    Patches, PatchMemory = types.Patches, types.PatchMemory
    patch_memory = layout_function(precision, terms)
    read_vector = memory_functions(precision).read_vector
    work = _work_functions(precision, fourth, terms)
    read_vertices, work_normals = work.read_vertices, work.work_normals
    work_edges, work_triangles = work.work_edges, work.work_triangles
    fold_load = triangle_functions(precision, fourth).fold_load

    @wp.func
    def work_patch(
        cloth: Cloth, patches: Patches, patch: Patch, overflow: wp.array(dtype=wp.uint8), step: Step, lane: int
    ):
        """All that meets at the patch's vertices, in the block's memory; every thread of the block calls it."""
        memory = patch_memory(patch, overflow)
        read_vertices(cloth, patches, patch, memory, lane)
        wait_for_block()
        if wp.static(terms.folds):
            work_normals(patches, patch, memory, lane)
            wait_for_block()
        if wp.static(terms.folds or terms.edges):
            work_edges(patches, patch, memory, step, lane)
            wait_for_block()
        if wp.static(terms.folds or terms.threads):
            work_triangles(patches, patch, memory, step, lane)
            wait_for_block()
        return memory

    @wp.func
    def vertex_load(patches: Patches, patch: Patch, memory: PatchMemory, local: int):
        """Sum over the edges, then over the triangles at a vertex that the patch owns."""
        load = vec4()
        if wp.static(terms.edges):
            for rank in range(patch.edge_rank_count):
                entry = int(patches.edge_slot[patch.edge_slot_start + rank * patch.owned_count + local])
                if entry != wp.static(NO_SLOT):
                    pull = read_vector(memory.edge_load, entry >> 1)
                    way = real(1 - 2 * (entry & 1))  # from the edge's first end, or its second
                    load += vec4(pull[0] * way, pull[1] * way, pull[2] * way, pull[3])
        if wp.static(terms.folds or terms.threads):
            for rank in range(patch.rank_count):
                entry = int(patches.slot[patch.slot_start + rank * patch.owned_count + local])
                if entry != wp.static(NO_SLOT):
                    triangle = entry >> 2
                    corner = (entry & 3) * patch.triangle_count + triangle
                    if wp.static(terms.folds):
                        normal = read_vector(memory.normal, triangle)
                        load += fold_load(normal, memory.along[corner], memory.part[corner])
                    if wp.static(terms.threads):
                        load += read_vector(memory.thread_load, corner)
        return load

    return SimpleNamespace(work_patch=work_patch, vertex_load=vertex_load)


def _work_functions(precision: str, fourth: str, terms: Terms) -> SimpleNamespace:
    types = cloth_types(precision)
    vec2, vec3, Cloth, Step = types.vec2, types.vec3, types.Cloth, types.Step
    Patches, PatchMemory = types.Patches, types.PatchMemory
    edge, triangle = edge_functions(precision, fourth, terms.angles), triangle_functions(precision, fourth)
    edge_span, edge_load, edge_fold = edge.edge_span, edge.edge_load, edge.edge_fold
    triangle_sides, triangle_normal = triangle.triangle_sides, triangle.triangle_normal
    corner_folds, thread_loads = triangle.corner_folds, triangle.thread_loads
    functions = memory_functions(precision)
    read_vector, write_vector = functions.read_vector, functions.write_vector

    @wp.func
    def read_vertices(cloth: Cloth, patches: Patches, patch: Patch, memory: PatchMemory, lane: int):
        """Brings the vertices that the patch needs into the block's memory."""
        for local in range(lane, patch.vertex_count, wp.block_dim()):
            vertex = patches.vertex[patch.vertex_start + local]
            memory.position[local] = cloth.position[vertex]
            if wp.static(fourth == "stiffness"):
                memory.move[local] = cloth.move[vertex]

    @wp.func
    def triangle_corners(patches: Patches, at: int):
        """Corners of a triangle as the patch counts its vertices."""
        word = patches.corners[at]
        return wp.vec3i(packed(word, 0), packed(word, 1), packed(word, 2))

    @wp.func
    def work_normals(patches: Patches, patch: Patch, memory: PatchMemory, lane: int):
        """Normals of the patch's triangles and of those beyond its edges."""
        for local in range(lane, patch.normal_count, wp.block_dim()):
            corners = triangle_corners(patches, patch.triangle_start + local)
            write_vector(memory.normal, local, triangle_normal(memory.position, corners))

    @wp.func
    def work_edges(patches: Patches, patch: Patch, memory: PatchMemory, step: Step, lane: int):
        """Tensions and hinges of the patch's edges."""
        for local in range(lane, patch.edge_count, wp.block_dim()):
            at = patch.edge_start + local
            word = patches.ends[at]
            span = edge_span(memory.position, memory.move, packed(word, 0), packed(word, 1))
            if wp.static(terms.edges):
                write_vector(memory.edge_load, local, edge_load(span, patches.law[at], step))
            if wp.static(terms.folds):
                first = read_vector(memory.normal, packed(word, 2))
                second = read_vector(memory.normal, packed(word, 3))
                rest = vec2()
                if wp.static(terms.angles):
                    rest = patches.rest[at]
                memory.fold[local] = edge_fold(span, first, second, patches.fold[at], rest, step)

    @wp.func
    def side_fold(memory: PatchMemory, word: wp.uint64, side: int):
        """Hinge of a triangle's side, its turn as the triangle is wound."""
        fold = memory.fold[packed(word, side)]
        otherwise = (packed(word, 3) >> side) & 1
        return vec3(wp.where(otherwise == 1, -fold[0], fold[0]), fold[1], fold[2])

    @wp.func
    def work_triangles(patches: Patches, patch: Patch, memory: PatchMemory, step: Step, lane: int):
        """What the hinges and threads of the patch's triangles do to their corners."""
        count = patch.triangle_count
        for local in range(lane, count, wp.block_dim()):
            at = patch.triangle_start + local
            if wp.static(terms.folds):
                word = patches.sides[at]
                fold_0, fold_1, fold_2 = (
                    side_fold(memory, word, 0),
                    side_fold(memory, word, 1),
                    side_fold(memory, word, 2),
                )
                along, part = corner_folds(memory.normal[local][3], fold_0, fold_1, fold_2)
                for corner in range(3):
                    memory.along[corner * count + local] = along[corner]
                    memory.part[corner * count + local] = part[corner]
            if wp.static(terms.threads):
                sides = triangle_sides(memory.position, memory.move, triangle_corners(patches, at))
                first, second, third = thread_loads(sides, patches.slope[at], patches.threads[at], step)
                write_vector(memory.thread_load, local, first)
                write_vector(memory.thread_load, count + local, second)
                write_vector(memory.thread_load, 2 * count + local, third)

    return SimpleNamespace(
        read_vertices=read_vertices, work_normals=work_normals, work_edges=work_edges, work_triangles=work_triangles
    )


@functools.cache
def gather_kernel(precision: str, fourth: str, terms: Terms) -> wp.Kernel:
    """Kernel ``gather_forces``; ``fourth`` is one of cloth.FOURTH_PARTS."""
    types = cloth_types(precision)
    vec4, Cloth, Step, Patches = types.vec4, types.Cloth, types.Step, types.Patches
    functions = patch_functions(precision, fourth, terms)
    work_patch, vertex_load = functions.work_patch, functions.vertex_load
    rests = rest_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def gather_forces(
        cloth: Cloth,
        patches: Patches,
        overflow: wp.array(dtype=wp.uint8),  # memory of patches that are too large for a block's own
        step: Step,
        load_out: wp.array(dtype=vec4),  # force [N] and the fourth part, shape [V]
    ):
        """Sums the forces that meet at each vertex."""
        number, lane = wp.tid()
        patch = patches.patch[number]
        if rests(cloth, patches.vertex[patch.vertex_start]):
            return
        memory = work_patch(cloth, patches, patch, overflow, step, lane)
        for local in range(lane, patch.owned_count, wp.block_dim()):
            load_out[patches.vertex[patch.vertex_start + local]] = vertex_load(patches, patch, memory, local)

    return gather_forces
