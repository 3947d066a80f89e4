"""Words that the laws of cloth are written in.

They mean the same for a number, a vector of three (in space) or of four (of threads), and for eight of these at a time:
each of their components is then eight numbers that lie together, which the CPU works out in one go, every one rounded
as it is alone.
"""

import warp as wp

from warp_cloth.kernels.math.real import WIDTH, each, of_threes, shaped

_JOINED = """
    wp::vec_t<%(count)d, %(real)s> result;
    const wp::vec_t<8, %(real)s> parts[] = {%(names)s};
    __builtin_memcpy(result.c, parts, sizeof(parts));
    return result;
"""
_SIX = """
    wp::vec_t<6, %(real)s> result;
    const %(real)s parts[] = {%(names)s};
    for (int k = 0; k < 6; ++k)
        result.c[k] = parts[k];
    return result;
"""
_PART = "wp::vec_t<8, %(real)s> part; __builtin_memcpy(part.c, &a.c[8 * place], sizeof(part.c)); return part;"
_SPREAD = """
    wp::vec_t<24, %(real)s> result;
    for (int k = 0; k < 24; ++k)
        result.c[k] = b[k / 8];
    return result;
"""
_ANY = """
    bool any = false;
    for (int k = 0; k < 8; ++k)
        any |= a.c[k] > b.c[k];
    return any;
"""
_CROSS = "u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]"

for _real, _name in ((wp.float32, "float"), (wp.float64, "double")):
    for _wide in (False, True):
        _types = shaped(_real, _wide)
        _one, _three, _four = _types.real, _types.vec3, _types.vec4
        for _kind in (_one, _three, _four, _types.vec6):

            @wp.func_native(each(_kind, "u + v", "ab"))
            def sums(a: _kind, b: _kind) -> _kind:
                """a + b."""
                ...

            @wp.func_native(each(_kind, "u - v", "ab"))
            def differences(a: _kind, b: _kind) -> _kind:
                """a - b."""
                ...

            @wp.func_native(each(_kind, "-u", "a"))
            def opposite(a: _kind) -> _kind:
                """-a."""
                ...

            @wp.func_native(each(_kind, "u * b", "a"))
            def times(a: _kind, b: _real) -> _kind:
                """Number by number a times the same b."""
                ...

        for _kind in (_one, _four):

            @wp.func_native(each(_kind, "u * v", "ab"))
            def products(a: _kind, b: _kind) -> _kind:
                """Number by number a times b."""
                ...

            @wp.func_native(each(_kind, "__builtin_elementwise_abs(u)" if _wide else "wp::abs(u)", "a"))
            def sizes(a: _kind) -> _kind:
                """|a|."""
                ...

            @wp.func_native(each(_kind, "u > v ? u : v", "ab"))
            def most(a: _kind, b: _kind) -> _kind:
                """The larger of a and b."""
                ...

            @wp.func_native(each(_kind, "u < v ? u : v", "ab"))
            def least(a: _kind, b: _kind) -> _kind:
                """The smaller of a and b."""
                ...

            @wp.func_native(each(_kind, "(decltype(u))b", "a"))
            def alike(a: _kind, b: _real) -> _kind:
                """As many numbers b as a has."""
                ...

            if _real is wp.float64:

                @wp.func_native(each(_kind, "(decltype(u))(double)b", "a"))
                def alike(a: _kind, b: wp.float32) -> _kind:
                    """As many of a number that a kernel names."""
                    ...

        @wp.func_native(each(_three, "u * v", "ab", "b"))
        def scaled(a: _three, b: _one) -> _three:
            """Vectors a times numbers b."""
            ...

        for _kind in (_one, _three):

            @wp.func_native(each(_kind, "u > v ? w : x", ["a", "b", "yes", "no"], "ab"))
            def above(a: _one, b: _one, yes: _kind, no: _kind) -> _kind:
                """One thing where a > b, else the other."""
                ...

        _told = {"real": _name, "count": 3 * WIDTH, "names": "a, b, c"}

        @wp.func_native(_JOINED % _told if _wide else "return {a, b, c};")
        def three(a: _one, b: _one, c: _one) -> _three:
            """A vector of three."""
            ...

        _told = {"real": _name, "count": 4 * WIDTH, "names": "a, b, c, d"}

        @wp.func_native(_JOINED % _told if _wide else "return {a, b, c, d};")
        def four(a: _one, b: _one, c: _one, d: _one) -> _four:
            """A vector of four."""
            ...

        _told = {"real": _name, "count": 6 * WIDTH, "names": "a, b, c, d, e, f"}

        @wp.func_native(_JOINED % _told if _wide else _SIX % _told)
        def six(a: _one, b: _one, c: _one, d: _one, e: _one, f: _one) -> _types.vec6:
            """A symmetric matrix: xx, yy, zz, xy, xz, yz."""
            ...

        for _kind in (_three, _four, _types.vec6):

            @wp.func_native(_PART % _told if _wide else "return a.c[place];")
            def part(a: _kind, place: int) -> _one:
                """A component."""
                ...

        @wp.func_native(_SPREAD % _told if _wide else "return b;")
        def spread(a: _one, b: shaped(_real, False).vec3) -> _three:
            """As many vectors b as a has numbers."""
            ...

        @wp.func_native(of_threes(3, _real, _CROSS) if _wide else "return wp::cross(a, b);")
        def cross(a: _three, b: _three) -> _three:
            """Cross product, nothing of it fused."""
            ...

        @wp.func_native(
            of_threes(1, _real, "u[0] * v[0] + u[1] * v[1] + u[2] * v[2]") if _wide else "return wp::dot(a, b);"
        )
        def dot(a: _three, b: _three) -> _one:
            """Dot product, nothing of it fused."""
            ...

        @wp.func_native(_ANY if _wide else "return a > b;")
        def any_above(a: _one, b: _one) -> bool:
            """Whether any a > b."""
            ...
