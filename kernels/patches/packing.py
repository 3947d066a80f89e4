"""Vertices in the order in which patches own them, so that what a patch reads and writes lies together.

A GPU reads and writes 16 bytes in one go, of neighbours side by side. So packed positions are first two coordinates of
each vertex, then the third ones of all; compliances first four numbers of each, then the last two of all; and
displacements have four numbers. Where cloth meets cloth many others read single positions, which then lie as ever.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element, put
from warp_cloth.kernels.base.active_set import active_element
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, rests
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  as in every file that has packets' words
from warp_cloth.kernels.math.packet import vector3, vector4
from warp_cloth.kernels.math.real import inner, root

_POINT = """
    typedef wp::vec_t<2, %(real)s> Pair;
    auto* data = reinterpret_cast<%(real)s*>(array.data);
    auto* pair = static_cast<Pair*>(__builtin_assume_aligned(data + 2 * index, 2 * sizeof(%(real)s)));
    auto* third = data + 2 * array.shape[0] + index;
"""
_READ_POINT = _POINT + "    const Pair first = *pair;\n    return {first[0], first[1], *third};"
_PUT_POINT = _POINT + "    *pair = Pair(value[0], value[1]);\n    *third = value[2];"

for _dtype, _real in ((wp.vec3f, "wp::float32"), (wp.vec3d, "wp::float64")):

    @wp.func_native(_READ_POINT % {"real": _real})
    def packed_point(array: wp.array(dtype=_dtype), index: int) -> _dtype:
        """One of the packed positions."""
        return array[index]

    @wp.func_native(_PUT_POINT % {"real": _real})
    def put_packed_point(array: wp.array(dtype=_dtype), index: int, value: _dtype):
        """Writes one of the packed positions."""
        array[index] = value


_SIX = """
    auto* data = reinterpret_cast<%(real)s*>(array.data);
    typedef wp::vec_t<4, %(real)s> Four;
    typedef wp::vec_t<2, %(real)s> Two;
    auto* four = static_cast<Four*>(__builtin_assume_aligned(data + 4 * index, 16));
    auto* two = static_cast<Two*>(__builtin_assume_aligned(data + 4 * array.shape[0] + 2 * index, sizeof(Two)));
"""
_READ_SIX = (
    _SIX
    + """
    wp::vec_t<6, %(real)s> value;
    for (int k = 0; k < 6; ++k)
        value.c[k] = k < 4 ? four->c[k] : two->c[k - 4];
    return value;
"""
)
_PUT_SIX = _SIX + "    *four = Four(value[0], value[1], value[2], value[3]);\n    *two = Two(value[4], value[5]);"

for _dtype, _real in ((wp.float32, "wp::float32"), (wp.float64, "wp::float64")):
    _six = wp.types.vector(length=6, dtype=_dtype)

    @wp.func_native(_READ_SIX % {"real": _real})
    def packed_six(array: wp.array(dtype=_six), index: int) -> _six:
        """The packed compliance of a vertex."""
        return array[index]

    @wp.func_native(_PUT_SIX % {"real": _real})
    def put_packed_six(array: wp.array(dtype=_six), index: int, value: _six):
        """Writes the packed compliance of a vertex."""
        array[index] = value


_FETCH_POINTS = """
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    const char* pairs = (const char*)array.data;
    const long long single = sizeof(array.data->c[0]), thirds = 2 * single * array.shape[0];
    const long long starts[] = {2 * single * first, thirds + single * first};
    for (int part = 0; part < 2; ++part) {
        const int skew = (int)((unsigned long long)(pairs + starts[part]) & 15);
        const int size = (2 - part) * (int)single * count + skew + 15 & -16;
        asm volatile("cp.async.bulk.prefetch.L2.global [%0], %1;" :: "l"(pairs + starts[part] - skew), "r"(size));
    }
#endif
"""

for _dtype in (wp.vec3f, wp.vec3d):

    @wp.func_native(_FETCH_POINTS)
    def fetch_points(array: wp.array(dtype=_dtype), first: int, count: int):
        """Prefetches so many packed positions, at least one."""
        ...


@wp.func
def sized(move: Any):
    """A displacement and how long it is [m]."""
    return vector4(move[0], move[1], move[2], root(inner(move, move)))


@wp.func
def first_three(four: Any):
    """The first three of four."""
    return vector3(four[0], four[1], four[2])


@functools.cache
def order_functions(precision: str, packed: bool, in_order: bool = True) -> SimpleNamespace:
    """Functions ``position_at``, ``displacement4_at``, ``displacement_at``, ``compliance_at``, and those that put.

    And ``move``, the type of displacements.

    ``packed``: whether positions are; ``in_order``: whether vertices lie in the patches' order, and displacements have
    four numbers.
    """
    types = cloth_types(precision)
    point, vec3, vec6, State = types.point, types.vec3, types.vec6, types.State
    stored = types.vec4 if in_order else vec3

    @wp.func
    def position_at(state: State, vertex: int):
        """Where a vertex is [m]."""
        if wp.static(packed):
            return packed_point(state.position, vertex)
        return element(state.position, vertex)

    @wp.func
    def displacement4_at(state: State, vertex: int):
        """What last moved a vertex, and how long it is [m]."""
        if wp.static(in_order):
            return element(state.displacement4, vertex)
        return sized(element(state.displacement, vertex))

    @wp.func
    def displacement_at(state: State, vertex: int):
        """What last moved a vertex [m]."""
        if wp.static(in_order):
            return first_three(element(state.displacement4, vertex))
        return element(state.displacement, vertex)

    @wp.func
    def put_displacement(move_out: wp.array(dtype=stored), vertex: int, move: vec3):
        """Writes what moves a vertex."""
        if wp.static(in_order):
            put(move_out, vertex, sized(move))
        else:
            put(move_out, vertex, move)

    @wp.func
    def put_position(position_out: wp.array(dtype=point), vertex: int, position: point):
        """Writes where a vertex is."""
        if wp.static(packed):
            put_packed_point(position_out, vertex, position)
        else:
            put(position_out, vertex, position)

    @wp.func
    def compliance_at(state: State, vertex: int):
        """A vertex's compliance."""
        if wp.static(packed):
            return packed_six(state.compliance, vertex)
        return state.compliance[vertex]

    @wp.func
    def put_compliance(compliance_out: wp.array(dtype=vec6), vertex: int, compliance: vec6):
        """Writes a vertex's compliance."""
        if wp.static(packed):
            put_packed_six(compliance_out, vertex, compliance)
        else:
            compliance_out[vertex] = compliance

    return SimpleNamespace(
        position_at=position_at, put_position=put_position, displacement4_at=displacement4_at,
        displacement_at=displacement_at, put_displacement=put_displacement, move=stored,
        compliance_at=compliance_at, put_compliance=put_compliance,
    )  # fmt: skip


@functools.cache
def packing_kernels(precision: str, accelerated: bool, packed: bool) -> SimpleNamespace:
    """Kernels ``pack_vertices`` and ``unpack_vertices``; ``accelerated``: vertices have a stiffness.

    ``packed``: as of ``order_functions``; if not, vertices are only put in order.
    Items that no longer iterate are left out, or their groups are. An item's vertices lie at the same places in both
    orders.
    """
    types = cloth_types(precision)
    point, real, vec3, Model, State = types.point, types.real, types.vec3, types.Model, types.State
    orders = order_functions(precision, packed)
    put_there, put_displacement, position_at, displacement_at = (
        orders.put_position, orders.put_displacement, orders.position_at, orders.displacement_at,
    )  # fmt: skip

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def pack_vertices(
        model: Model,
        state: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.active_set, of places
        order: wp.array(dtype=wp.int32),  # vertices as patches own them, shape [V]
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=orders.move),  # [m], shape [V]
        stiffness_out: wp.array(dtype=real),  # [N/m], shape [V]
    ):
        """Puts what iterations change in the patches' order."""
        place = active_element(groups, wp.tid())
        if place >= order.shape[0]:
            return
        vertex = element(order, place)
        if rests(model, place):
            return
        put_there(position_out, place, element(state.position, vertex))
        put_displacement(move_out, place, element(state.displacement, vertex))
        if wp.static(accelerated):
            put(stiffness_out, place, element(state.stiffness, vertex))

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def unpack_vertices(
        model: Model,
        packed: State,
        groups: wp.array(dtype=wp.int32),  # of kernels.base.active_set, of vertices
        rank: wp.array(dtype=wp.int32),  # where patches have each vertex, shape [V]
        position_out: wp.array(dtype=point),  # [m], shape [V]
        move_out: wp.array(dtype=vec3),  # [m], shape [V]
        stiffness_out: wp.array(dtype=real),  # [N/m], shape [V]
    ):
        """Puts it back in the garments' order."""
        vertex = active_element(groups, wp.tid())
        if vertex >= rank.shape[0]:
            return
        place = element(rank, vertex)
        if rests(model, vertex):
            return
        put(position_out, vertex, position_at(packed, place))
        put(move_out, vertex, displacement_at(packed, place))
        if wp.static(accelerated):
            put(stiffness_out, vertex, element(packed.stiffness, place))

    return SimpleNamespace(pack_vertices=pack_vertices, unpack_vertices=unpack_vertices)
