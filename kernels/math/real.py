"""Square roots, quotients and fused products that round alike on the CPU and CUDA, for one value and for a packet.

CUDA's own float32 square root and division branch to a slow function where an operand is so small that their
approximation and two corrections would lose digits. Here what is smaller than any cloth has is zero, on every device:
without that branch many vertices' square roots are under way at a time.

A product that is added is fused (rounded once) only where that is written out here: both devices have an instruction.
What runs is the C++; after it stands what it computes, in Python, for tests/test_arithmetic.py.
"""

import ctypes

import warp as wp

from warp_cloth.kernels.math.lanes import WIDTH, elementwise, lane_types, reference, vectorwise


def single(value: float) -> float:
    """The float32 nearest to a value: what a float64 computation takes where float32 and it go by the same constant."""
    return ctypes.c_float(value).value


_ROOT = """
#if defined(__CUDA_ARCH__)
    float inverse;
    asm("rsqrt.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(x));
    float root = __fmul_rn(x, inverse);
    root = __fmaf_rn(__fmaf_rn(-root, root, x), __fmul_rn(0.5f, inverse), root);
#else
    float root = sqrtf(x);
#endif
    return x < 4.0e-31f ? 0.0f : root;
"""

_QUOTIENT = """
#if defined(__CUDA_ARCH__)
    float inverse;
    asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(b));
    inverse = __fmaf_rn(inverse, __fmaf_rn(inverse, -b, 1.0f), inverse);
    float quotient = __fmul_rn(a, inverse);
    quotient = __fmaf_rn(inverse, __fmaf_rn(quotient, -b, a), quotient);
#else
    float quotient = a / b;
#endif
    return fabsf(a) < 1.0e-24f ? 0.0f : quotient;
"""


for _real, _root, _quotient in ((wp.float32, _ROOT, _QUOTIENT), (wp.float64, "return sqrt(x);", "return a / b;")):

    @wp.func_native(_root)
    def root(x: _real) -> _real:
        """Square root of x >= 0, correctly rounded; in float32 0 below 4e-31."""
        ...

    @wp.func_native(_quotient)
    def quotient(a: _real, b: _real) -> _real:
        """a / b, in float32 for 1e-36 < b < 1e13, correctly rounded; there 0 where |a| is below 1e-24."""
        ...


reference(root, lambda x: x**0.5 * (x >= 4.0e-31))
reference(quotient, lambda a, b: a / b * (abs(a) >= 1.0e-24))

_SIGNED_SUM = """
    const %(real)s sign = back ? %(real)s(-1) : %(real)s(1);
#if defined(__CUDA_ARCH__)
    return {fma(load[0], sign, sum[0]), fma(load[1], sign, sum[1]), fma(load[2], sign, sum[2]), sum[3] + load[3]};
#else
    return {sum[0] + load[0] * sign, sum[1] + load[1] * sign, sum[2] + load[2] * sign, sum[3] + load[3]};
#endif
"""


for _real, _four in (("wp::float32", wp.vec4f), ("wp::float64", wp.vec4d)):

    @wp.func_native(_SIGNED_SUM % {"real": _real})
    def signed_sum(sum: _four, load: _four, back: int) -> _four:
        """A sum of loads and one more, its force reversed where ``back`` is not 0; rounds as if multiplied by +-1."""
        ...


reference(signed_sum, lambda sum, load, back: sum + load * [1 - 2 * back, 1 - 2 * back, 1 - 2 * back, 1])


_FUSED = """
#if defined(__CUDA_ARCH__)
    return %(cuda)s(a, b, c);
#else
    return %(host)s(a, b, c);
#endif
"""
_INNER = """
#if defined(__CUDA_ARCH__)
    return %(cuda)s(a[2], b[2], %(cuda)s(a[1], b[1], a[0] * b[0]));
#else
    return %(host)s(a[2], b[2], %(host)s(a[1], b[1], a[0] * b[0]));
#endif
"""
_SCALED_SUM = """
#if defined(__CUDA_ARCH__)
    return {%(cuda)s(a[0], b, c[0]), %(cuda)s(a[1], b, c[1]), %(cuda)s(a[2], b, c[2])};
#else
    return {%(host)s(a[0], b, c[0]), %(host)s(a[1], b, c[1]), %(host)s(a[2], b, c[2])};
#endif
"""
_SINGLE = {"cuda": "__fmaf_rn", "host": "__builtin_fmaf"}
_DOUBLE = {"cuda": "__fma_rn", "host": "__builtin_fma"}

for _real, _three, _fma in ((wp.float32, wp.vec3f, _SINGLE), (wp.float64, wp.vec3d, _DOUBLE)):

    @wp.func_native(_FUSED % _fma)
    def fused(a: _real, b: _real, c: _real) -> _real:
        """a b + c, rounded once."""
        ...

    @wp.func_native(_INNER % _fma)
    def inner(a: _three, b: _three) -> _real:
        """Dot product; what is multiplied and added is rounded once."""
        ...

    @wp.func_native(_SCALED_SUM % _fma)
    def scaled_sum(a: _three, b: _real, c: _three) -> _three:
        """a b + c, each component rounded once."""
        ...

    @wp.func_native("return which > 0 ? yes : no;")
    def where_positive(which: _real, yes: _real, no: _real) -> _real:
        """``yes`` where ``which`` > 0, else ``no``."""
        ...


reference(fused, lambda a, b, c: a * b + c)
reference(inner, lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
reference(scaled_sum, lambda a, b, c: a * b + c)
reference(where_positive, lambda which, yes, no: (which > 0) * yes + (which <= 0) * no)


# four at a time: the CPU has instructions for that
_FOUR = """
#if defined(__CUDA_ARCH__)
    auto one = [](float x) -> float { %(cuda)s };
    return {one(x[0]), one(x[1]), one(x[2]), one(x[3])};
#else
    typedef float Four __attribute__((ext_vector_type(4)));
    const Four v = {x[0], x[1], x[2], x[3]};
    %(host)s
    return {r[0], r[1], r[2], r[3]};
#endif
"""
_CHOSEN = """
#if defined(__CUDA_ARCH__)
    return {which[0] > 0 ? yes[0] : no[0], which[1] > 0 ? yes[1] : no[1],
            which[2] > 0 ? yes[2] : no[2], which[3] > 0 ? yes[3] : no[3]};
#else
    typedef %(real)s Four __attribute__((ext_vector_type(4)));
    const Four w = {which[0], which[1], which[2], which[3]};
    const Four a = {yes[0], yes[1], yes[2], yes[3]};
    const Four b = {no[0], no[1], no[2], no[3]};
    const Four r = w > (Four)0 ? a : b;
    return {r[0], r[1], r[2], r[3]};
#endif
"""
_ROOTS = "const Four s = __builtin_elementwise_sqrt(v); const Four r = v < 4.0e-31f ? (Four)0.0f : s;"


_RECIPROCALS = {"cuda": "const float a = 1.0f, b = x;" + _QUOTIENT, "host": "const Four r = 1.0f / v;"}
_ROOTS_64 = "return {sqrt(x[0]), sqrt(x[1]), sqrt(x[2]), sqrt(x[3])};"
_RECIPROCALS_64 = "return {1.0 / x[0], 1.0 / x[1], 1.0 / x[2], 1.0 / x[3]};"

for _four, _roots, _reciprocals in (
    (wp.vec4f, _FOUR % {"cuda": _ROOT, "host": _ROOTS}, _FOUR % _RECIPROCALS),
    (wp.vec4d, _ROOTS_64, _RECIPROCALS_64),
):

    @wp.func_native(_roots)
    def root(x: _four) -> _four:
        """``root`` of four."""
        ...

    @wp.func_native(_reciprocals)
    def reciprocal(x: _four) -> _four:
        """``quotient`` of 1 and each of four."""
        ...


reference(reciprocal, lambda x: 1 / x)


for _name, _four in (("float", wp.vec4f), ("double", wp.vec4d)):

    @wp.func_native(_CHOSEN % {"real": _name})
    def where_positive(which: _four, yes: _four, no: _four) -> _four:
        """``yes`` where ``which`` > 0, else ``no``, of each of four."""
        ...


_INNER_PACKET = "__builtin_elementwise_fma(u[2], v[2], __builtin_elementwise_fma(u[1], v[1], u[0] * v[0]))"
_PACKETS = {  # root, quotient
    wp.float32: (
        "u < (decltype(u))4.0e-31f ? (decltype(u))0.0f : __builtin_elementwise_sqrt(u)",
        "__builtin_elementwise_abs(u) < (decltype(u))1.0e-24f ? (decltype(u))0.0f : u / v",
    ),
    wp.float64: ("__builtin_elementwise_sqrt(u)", "u / v"),
}

for _real in (wp.float32, wp.float64):
    _types = lane_types(_real, WIDTH)
    _one, _three, _four = _types.real, _types.vec3, _types.vec4
    _root, _quotient = _PACKETS[_real]

    @wp.func_native(vectorwise(1, _real, _INNER_PACKET))
    def inner(a: _three, b: _three) -> _one:
        """Dot products of a packet."""
        ...

    @wp.func_native(elementwise(_three, "__builtin_elementwise_fma(u, v, w)", "abc", "b"))
    def scaled_sum(a: _three, b: _one, c: _three) -> _three:
        """a b + c of a packet."""
        ...

    @wp.func_native(elementwise(_one, "__builtin_elementwise_fma(u, v, w)", "abc"))
    def fused(a: _one, b: _one, c: _one) -> _one:
        """a b + c of a packet."""
        ...

    @wp.func_native(elementwise(_one, _quotient, "ab"))
    def quotient(a: _one, b: _one) -> _one:
        """a / b of a packet."""
        ...

    for _kind in (_one, _four):

        @wp.func_native(elementwise(_kind, _root, "x"))
        def root(x: _kind) -> _kind:
            """Square root of a packet."""
            ...

        @wp.func_native(elementwise(_kind, "u > (decltype(u))0 ? v : w", ["which", "yes", "no"]))
        def where_positive(which: _kind, yes: _kind, no: _kind) -> _kind:
            """``yes`` where ``which`` > 0, else ``no``, of a packet."""
            ...

    @wp.func_native(elementwise(_four, "1 / u", "x"))
    def reciprocal(x: _four) -> _four:
        """1 / x of a packet."""
        ...
