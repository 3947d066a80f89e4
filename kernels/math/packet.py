"""The vocabulary of the laws: what they say besides operators, for one value and for a packet of eight alike."""

import warp as wp

from warp_cloth.kernels.math.lanes import WIDTH, elementwise, lane_types, reference, vectorwise
from warp_cloth.kernels.math.operators import OPERATORS

_JOINED = """
    wp::vec_t<%(count)d, %(real)s> result;
    const wp::vec_t<8, %(real)s> components[] = {%(names)s};
    __builtin_memcpy(result.c, components, sizeof(components));
    return result;
"""
_SYMMETRIC = """
    wp::vec_t<6, %(real)s> result;
    const %(real)s components[] = {%(names)s};
    for (int k = 0; k < 6; ++k)
        result.c[k] = components[k];
    return result;
"""
_COMPONENT = (
    "wp::vec_t<8, %(real)s> result; __builtin_memcpy(result.c, &a.c[8 * place], sizeof(result.c)); return result;"
)
_BROADCAST = """
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


def _tagged(code: str) -> str:
    """C++ whose hash holds the operators that are used with it."""
    return f"{code} // operators {OPERATORS}\n"


for _real, _name in ((wp.float32, "float"), (wp.float64, "double")):
    for _lanes in (1, WIDTH):
        _types, _wide = lane_types(_real, _lanes), _lanes > 1
        _one, _three, _four, _six = _types.real, _types.vec3, _types.vec4, _types.vec6

        for _kind in (_one, _four):

            @wp.func_native(_tagged(elementwise(_kind, "__builtin_elementwise_abs(u)" if _wide else "wp::abs(u)", "a")))
            def absolute(a: _kind) -> _kind:
                """|a|."""
                ...

            reference(absolute, lambda a: abs(a))

            @wp.func_native(_tagged(elementwise(_kind, "u > v ? u : v", "ab")))
            def maximum(a: _kind, b: _kind) -> _kind:
                """The larger of a and b."""
                ...

            reference(maximum, lambda a, b: (a > b) * a + (a <= b) * b)

            @wp.func_native(_tagged(elementwise(_kind, "u < v ? u : v", "ab")))
            def minimum(a: _kind, b: _kind) -> _kind:
                """The smaller of a and b."""
                ...

            reference(minimum, lambda a, b: (a < b) * a + (a >= b) * b)

        for _kind in (_one, _three):

            @wp.func_native(_tagged(elementwise(_kind, "-u", "a")))
            def negative(a: _kind) -> _kind:
                """-a; Warp's own minus of a number is 0 - a, which loses the sign of zero."""
                ...

            @wp.func_native(_tagged(elementwise(_kind, "u > v ? w : x", ["a", "b", "yes", "no"], "ab")))
            def where_greater(a: _one, b: _one, yes: _kind, no: _kind) -> _kind:
                """``yes`` where a > b, else ``no``."""
                ...

            reference(negative, lambda a: -a)
            reference(where_greater, lambda a, b, yes, no: (a > b) * yes + (a <= b) * no)

        _words = {"real": _name, "count": 3 * WIDTH, "names": "a, b, c"}

        @wp.func_native(_tagged(_JOINED % _words if _wide else "return {a, b, c};"))
        def vector3(a: _one, b: _one, c: _one) -> _three:
            """The vector (a, b, c)."""
            ...

        reference(vector3, lambda a, b, c: [a, b, c])

        _words = {"real": _name, "count": 4 * WIDTH, "names": "a, b, c, d"}

        @wp.func_native(_tagged(_JOINED % _words if _wide else "return {a, b, c, d};"))
        def vector4(a: _one, b: _one, c: _one, d: _one) -> _four:
            """The vector (a, b, c, d)."""
            ...

        reference(vector4, lambda a, b, c, d: [a, b, c, d])

        _words = {"real": _name, "count": 6 * WIDTH, "names": "a, b, c, d, e, f"}

        @wp.func_native(_tagged(_JOINED % _words if _wide else _SYMMETRIC % _words))
        def symmetric(a: _one, b: _one, c: _one, d: _one, e: _one, f: _one) -> _six:
            """A symmetric matrix: xx, yy, zz, xy, xz, yz."""
            ...

        reference(symmetric, lambda a, b, c, d, e, f: [a, b, c, d, e, f])

        for _kind in (_three, _four, _six):

            @wp.func_native(_tagged(_COMPONENT % _words if _wide else "return a.c[place];"))
            def component(a: _kind, place: int) -> _one:
                """a[place]."""
                ...

            reference(component, lambda a, place: a[place])

        @wp.func_native(_tagged(_BROADCAST % _words if _wide else "return b;"))
        def broadcast(like: _one, b: lane_types(_real).vec3) -> _three:
            """The vector b in as many lanes as ``like`` has."""
            ...

        reference(broadcast, lambda like, b: [b[0] + 0 * like, b[1] + 0 * like, b[2] + 0 * like])

        @wp.func_native(_tagged(vectorwise(3, _real, _CROSS) if _wide else "return wp::cross(a, b);"))
        def cross(a: _three, b: _three) -> _three:
            """Cross product, nothing of it fused."""
            ...

        reference(cross, lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

        @wp.func_native(
            _tagged(
                vectorwise(1, _real, "u[0] * v[0] + u[1] * v[1] + u[2] * v[2]") if _wide else "return wp::dot(a, b);"
            )
        )
        def dot(a: _three, b: _three) -> _one:
            """Dot product, nothing of it fused."""
            ...

        reference(dot, lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2])

        @wp.func_native(_tagged(_ANY if _wide else "return a > b;"))
        def any_greater(a: _one, b: _one) -> bool:
            """Whether a > b in any lane."""
            ...

        reference(any_greater, lambda a, b: (a > b).any())
