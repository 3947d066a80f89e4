"""SIMD packets in memory: how eight consecutive elements, or what they refer to, are loaded, added and stored.

A packet of vectors holds the first components of all eight, then the second ones, and so on. Elements follow one
another in their arrays, from ``first`` on; their places are the indices that these hold: the ends of edges, the corners
or the sides of triangles. ``lanes`` are bits: of which elements something is stored.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.types import rests
from warp_cloth.kernels.math.lanes import WIDTH as EIGHT
from warp_cloth.kernels.math.lanes import lane_types

WIDTH = wp.constant(EIGHT)

# x, four vectors of two fours each, transposed into y
_SHUFFLES = """
        const Eight a = __builtin_shufflevector(x[0], x[1], 0, 8, 1, 9, 4, 12, 5, 13);
        const Eight b = __builtin_shufflevector(x[2], x[3], 0, 8, 1, 9, 4, 12, 5, 13);
        const Eight d = __builtin_shufflevector(x[0], x[1], 2, 10, 3, 11, 6, 14, 7, 15);
        const Eight e = __builtin_shufflevector(x[2], x[3], 2, 10, 3, 11, 6, 14, 7, 15);
        const Eight y[] = {
            __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15),
            __builtin_shufflevector(d, e, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(d, e, 2, 3, 10, 11, 6, 7, 14, 15)};
"""
# rows, eight vectors of four components, transposed into c, four packets; and back
_TRANSPOSED = (
    """
    typedef %(real)s Eight __attribute__((ext_vector_type(8)));
    Eight c[4];
    {
        Eight x[4];
        for (int k = 0; k < 4; ++k)
            x[k] = __builtin_shufflevector(rows[k], rows[k + 4], 0, 1, 2, 3, 4, 5, 6, 7);
"""
    + _SHUFFLES
    + """
        __builtin_memcpy(c, y, sizeof(c));
    }
"""
)
_TRANSPOSE_BACK = (
    """
    typedef %(real)s Row __attribute__((ext_vector_type(4)));
    typedef %(real)s Eight __attribute__((ext_vector_type(8)));
    auto transpose_back = [](const %(real)s* from, Row* rows) {
        Eight x[4];
        __builtin_memcpy(x, from, sizeof(x));
"""
    + _SHUFFLES
    + """
        for (int k = 0; k < 4; ++k) {
            rows[k] = __builtin_shufflevector(y[k], y[k], 0, 1, 2, 3);
            rows[k + 4] = __builtin_shufflevector(y[k], y[k], 4, 5, 6, 7);
        }
    };
"""
)
_TYPES = """
    typedef %(stored)s Stored __attribute__((ext_vector_type(4)));
    typedef %(real)s Row __attribute__((ext_vector_type(4)));
"""
_ROWS = (
    _TYPES
    + """
    %(at)s
    Row rows[8];
    for (int lane = 0; lane < 8; ++lane) {
        const int place = %(place)s;
        Stored element = {};
        __builtin_memcpy(&element, array.data + place, sizeof(array.data[0]));
        rows[lane] = __builtin_convertvector(element, Row);
    }
"""
    + _TRANSPOSED
    + """
    wp::vec_t<%(count)d, %(real)s> packet;
    __builtin_memcpy(packet.c, c, sizeof(packet));
    return packet;
"""
)
_SIDES = (
    _TYPES
    + """
    %(at)s
    Row rows[8];
    for (int lane = 0; lane < 8; ++lane) {
        Stored start = {}, end = {};
        __builtin_memcpy(&start, array.data + at[lane][from_], sizeof(array.data[0]));
        __builtin_memcpy(&end, array.data + at[lane][to], sizeof(array.data[0]));
        rows[lane] = __builtin_convertvector(end - start, Row);
    }
"""
    + _TRANSPOSED
    + """
    wp::vec_t<24, %(real)s> packet;
    __builtin_memcpy(packet.c, c, sizeof(packet));
    return packet;
"""
)
_PUT_NUMBERS = """
    for (int lane = 0; lane < 8; ++lane)
        array.data[first + lane] = lanes >> lane & 1 ? a.c[lane] : array.data[first + lane];
"""
_MOVE = (
    _TRANSPOSE_BACK
    + """
    typedef %(stored)s Stored __attribute__((ext_vector_type(4)));
    %(real)s columns[32] = {}, momenta[32] = {};
    __builtin_memcpy(columns, a.c, sizeof(a));
    __builtin_memcpy(momenta, b.c, sizeof(b));
    Row rows[8], momentum[8];
    transpose_back(columns, rows);
    transpose_back(momenta, momentum);
    for (int lane = 0; lane < 8; ++lane)
        if (lanes >> lane & 1) {
            Stored there = {};
            __builtin_memcpy(&there, &position.data[first + lane], sizeof(position.data[0]));
            there += __builtin_convertvector(rows[lane], Stored);
            __builtin_memcpy(&position.data[first + lane], &there, sizeof(position.data[0]));
            __builtin_memcpy(&move.data[first + lane], &momentum[lane], sizeof(move.data[0]));
        }
"""
)
_NUMBERS = """
    wp::vec_t<8, %(real)s> packet;
    __builtin_memcpy(packet.c, array.data + first, sizeof(packet));
    return packet;
"""
_SIGNS = """
    const auto* const at = places.data + first;
    wp::vec_t<8, %(real)s> signs;
    for (int lane = 0; lane < 8; ++lane)
        signs.c[lane] = at[lane][which] < 0 ? -1 : 1;
    return signs;
"""
_ADD = (
    _TRANSPOSE_BACK
    + """
    const auto* const at = places.data + first;
    Row rows[%(stride)d][8];
    %(transposed)s
    for (int lane = 0; lane < 8; ++lane)
        if (lanes >> lane & 1)
            for (int k = 0; k < %(stride)d; ++k) {
                auto* const sum = &array.data[at[lane][k]];
                Row now;
                __builtin_memcpy(&now, sum, sizeof(now));
                now += rows[k][lane];
                __builtin_memcpy(sum, &now, sizeof(now));
            }
"""
)
_ADD_PAIRS = (
    _TRANSPOSE_BACK
    + """
    const auto* const at = places.data + first;
    Row rows[6][8];
    %(transposed)s
    for (int lane = 0; lane < 8; ++lane)
        if (lanes >> lane & 1)
            for (int k = 0; k < 3; ++k) {
                auto* const sum = &array.data[at[lane][k]];
                Row now;
                __builtin_memcpy(&now, sum, sizeof(now));
                now = (now + rows[k][lane]) + rows[3 + k][lane];
                __builtin_memcpy(sum, &now, sizeof(now));
            }
"""
)
_PUT = (
    _TRANSPOSE_BACK
    + """
    Row rows[8];
    transpose_back(a.c, rows);
    for (int lane = 0; lane < 8; ++lane)
        __builtin_memcpy(&array.data[first + lane], &rows[lane], sizeof(array.data[0]));
"""
)
_SIX = (
    _TYPES
    + """
    wp::vec_t<48, %(real)s> packet;
    Row rows[8];
    for (int from = 0; from < 3; from += 2) {  // components 2 to 5 after 0 to 3
        for (int lane = 0; lane < 8; ++lane)
            __builtin_memcpy(&rows[lane], &array.data[first + lane].c[from], sizeof(Row));
"""
    + _TRANSPOSED
    + """
        __builtin_memcpy(&packet.c[8 * from], c, sizeof(c));
    }
    return packet;
"""
)
_AT = "const auto* const at = places.data + first;"

for _real, _name in ((wp.float32, "float"), (wp.float64, "double")):
    _types, _alone = lane_types(_real, EIGHT), lane_types(_real)
    _one, _three, _four = _types.real, _types.vec3, _types.vec4

    @wp.func_native(_NUMBERS % {"real": _name})
    def load_packet(array: wp.array(dtype=_real), first: int) -> _one:
        """Eight consecutive numbers."""
        return array[first]

    for _dtype, _result in ((_alone.vec3, _three), (_alone.vec4, _four)):
        _words = {"stored": _name, "real": _name, "count": _result._length_}

        @wp.func_native(_ROWS % {**_words, "at": "", "place": "first + lane"})
        def load_packet(array: wp.array(dtype=_dtype), first: int) -> _result:  # noqa: F811
            """Eight consecutive vectors."""
            return array[first]

        @wp.func_native(_ROWS % {**_words, "at": _AT, "place": "at[lane][which]"})
        def load_packet_at(
            array: wp.array(dtype=_dtype), places: wp.array(dtype=wp.vec2i), first: int, which: int
        ) -> _result:
            """The vectors at one of two places of each of eight elements."""
            return array[places[first][which]]

    @wp.func_native(_SIX % {"stored": _name, "real": _name})
    def load_packet(array: wp.array(dtype=_alone.vec6), first: int) -> _types.vec6:  # noqa: F811
        """Eight consecutive symmetric matrices."""
        return array[first]

    _words = {"stored": _name, "real": _name, "count": 4 * EIGHT, "at": _AT}

    @wp.func_native(_ROWS % {**_words, "place": "wp::max(at[lane][which], -1 - at[lane][which])"})
    def load_packet_signed(
        array: wp.array(dtype=_alone.vec4), places: wp.array(dtype=wp.vec3i), first: int, which: int
    ) -> _four:
        """The vectors at one of three places of each of eight elements; place p may be stored as -1 - p."""
        return array[places[first][which]]

    @wp.func_native(_SIGNS % {"real": _name})
    def load_signs(like: _one, places: wp.array(dtype=wp.vec3i), first: int, which: int) -> _one:
        """-1 where a place is stored as -1 - p, else 1."""
        return places[first][which]

    for _dtype, _stored in ((_alone.vec3, _name), *(((wp.vec3d, "double"),) if _real is wp.float32 else ())):
        for _kind in (wp.vec2i, wp.vec3i):

            @wp.func_native(_SIDES % {"stored": _stored, "real": _name, "at": _AT})
            def load_sides(
                like: _real,
                array: wp.array(dtype=_dtype),
                places: wp.array(dtype=_kind),
                first: int,
                from_: int,
                to: int,
            ) -> _three:
                """The differences from one place to another of eight elements, subtracted in the array's precision."""
                return array[places[first][to]]

        @wp.func_native(_MOVE % {"stored": _stored, "real": _name})
        def move_packet(
            position: wp.array(dtype=_dtype),
            move: wp.array(dtype=_alone.vec3),
            first: int,
            lanes: int,
            a: _three,
            b: _three,
        ):
            """Adds displacements a to the points of some lanes, and stores b as their last ones."""
            position[first] = position[first]
            move[first] = move.dtype()

    @wp.func_native(_PUT_NUMBERS)
    def store_lanes(array: wp.array(dtype=_real), first: int, lanes: int, a: _one):
        """Stores the numbers of some lanes."""
        array[first] = array.dtype(0.0)

    @wp.func_native("__builtin_memset(array.data + first, 0, 8 * sizeof(array.data[0]));")
    def store_zeros(array: wp.array(dtype=_alone.vec4), first: int):
        """Stores eight zero vectors."""
        array[first] = array.dtype()

    _transposed = [f"transpose_back({name}.c, rows[{k}]);" for k, name in enumerate("abcdef")]

    @wp.func_native(_ADD % {"real": _name, "stride": 2, "transposed": " ".join(_transposed[:2])})
    def add_packets(
        array: wp.array(dtype=_alone.vec4), places: wp.array(dtype=wp.vec2i), first: int, lanes: int, a: _four, b: _four
    ):
        """Adds a and b at the two places of each element in ``lanes``, element by element."""
        array[places[first][0]] = array[places[first][0]]

    @wp.func_native(_ADD % {"real": _name, "stride": 3, "transposed": " ".join(_transposed[:3])})
    def add_packets(  # noqa: F811
        array: wp.array(dtype=_alone.vec4),
        places: wp.array(dtype=wp.vec3i),
        first: int,
        lanes: int,
        a: _four,
        b: _four,
        c: _four,
    ):
        """Likewise a, b and c at three places."""
        array[places[first][0]] = array[places[first][0]]

    @wp.func_native(_ADD_PAIRS % {"real": _name, "transposed": " ".join(_transposed)})
    def add_packet_pairs(  # ten arguments: C++ takes packets only one by one
        array: wp.array(dtype=_alone.vec4),
        places: wp.array(dtype=wp.vec3i),
        first: int,
        lanes: int,
        a: _four,
        b: _four,
        c: _four,
        d: _four,
        e: _four,
        f: _four,
    ):
        """Adds a and then d at the first of three places, b and e at the second, c and f at the third."""
        array[places[first][0]] = array[places[first][0]]

    @wp.func_native(_PUT % {"real": _name})
    def store_packet(array: wp.array(dtype=_alone.vec4), first: int, a: _four):
        """Stores eight consecutive vectors."""
        array[first] = array.dtype()


@wp.func_native("return __builtin_ctz(lanes);")
def first_lane(lanes: int) -> int:
    """The first of some lanes."""
    ...


@wp.func
def first_of_packet(number: int, count: int) -> int:
    """The first element of a packet; the last one overlaps the one before, to end with the last of ``count``."""
    return wp.min(WIDTH * number, count - WIDTH)


@wp.func
def active_lanes(model: Any, places: Any, number: int):
    """Bits of a packet's elements that belong to items that iterate, and not to the packet before."""
    first = first_of_packet(number, places.shape[0])
    lanes = 255 & ~((1 << (WIDTH * number - first)) - 1)
    if model.items.shape[0] == 1:
        return wp.where(model.items[0].active == 0, 0, lanes)
    for lane in range(WIDTH):
        if rests(model, element(places, first + lane)[0]):
            lanes &= ~(1 << lane)
    return lanes
