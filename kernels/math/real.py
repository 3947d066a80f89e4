"""Square roots and quotients that round alike on the CPU and CUDA, without the branches that CUDA's own ones take.

CUDA rounds both correctly by an approximation and two corrections, and turns aside to a slow function where an operand
is so small that these would lose digits. What is smaller than any cloth has is zero here, on every device: no turning
aside, so that many vertices' square roots are under way at a time.

Products that are added are fused, rounded once, where that is written out here: both devices have instructions for it.
"""

import functools
from types import SimpleNamespace

import warp as wp

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


@wp.func_native(_ROOT)
def root(x: wp.float32) -> wp.float32:
    """Square root of x >= 0, correctly rounded; 0 below 4e-31."""
    ...


@wp.func_native("return sqrt(x);")
def root(x: wp.float64) -> wp.float64:  # noqa: F811
    """Square root in float64, which takes no such turns."""
    ...


@wp.func_native(_QUOTIENT)
def quotient(a: wp.float32, b: wp.float32) -> wp.float32:
    """a / b for 1e-36 < b < 1e13, correctly rounded; 0 where |a| is below 1e-24."""
    ...


@wp.func_native("return a / b;")
def quotient(a: wp.float64, b: wp.float64) -> wp.float64:  # noqa: F811
    """a / b in float64."""
    ...


_SIGNED_SUM = """
    const %(real)s way = back ? %(real)s(-1) : %(real)s(1);
#if defined(__CUDA_ARCH__)
    return {fma(load[0], way, sum[0]), fma(load[1], way, sum[1]), fma(load[2], way, sum[2]), sum[3] + load[3]};
#else
    return {sum[0] + load[0] * way, sum[1] + load[1] * way, sum[2] + load[2] * way, sum[3] + load[3]};
#endif
"""


@wp.func_native(_SIGNED_SUM % {"real": "wp::float32"})
def signed_sum(sum: wp.vec4f, load: wp.vec4f, back: int) -> wp.vec4f:
    """A sum of loads and one more, its force turned round where ``back`` is not 0; rounds as if multiplied by +-1."""
    ...


@wp.func_native(_SIGNED_SUM % {"real": "wp::float64"})
def signed_sum(sum: wp.vec4d, load: wp.vec4d, back: int) -> wp.vec4d:  # noqa: F811
    """The same in float64."""
    ...


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


@wp.func_native(_FUSED % _SINGLE)
def fused(a: wp.float32, b: wp.float32, c: wp.float32) -> wp.float32:
    """a b + c, rounded once."""
    ...


@wp.func_native(_FUSED % _DOUBLE)
def fused(a: wp.float64, b: wp.float64, c: wp.float64) -> wp.float64:  # noqa: F811
    """a b + c in float64, rounded once."""
    ...


@wp.func_native(_INNER % _SINGLE)
def inner(a: wp.vec3f, b: wp.vec3f) -> wp.float32:
    """Dot product; what is multiplied and added is rounded once."""
    ...


@wp.func_native(_INNER % _DOUBLE)
def inner(a: wp.vec3d, b: wp.vec3d) -> wp.float64:  # noqa: F811
    """Dot product in float64."""
    ...


@wp.func_native(_SCALED_SUM % _SINGLE)
def scaled_sum(a: wp.vec3f, b: wp.float32, c: wp.vec3f) -> wp.vec3f:
    """a b + c, each component rounded once."""
    ...


@wp.func_native(_SCALED_SUM % _DOUBLE)
def scaled_sum(a: wp.vec3d, b: wp.float64, c: wp.vec3d) -> wp.vec3d:  # noqa: F811
    """a b + c in float64."""
    ...


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
    return {which[0] > 0 ? above[0] : below[0], which[1] > 0 ? above[1] : below[1],
            which[2] > 0 ? above[2] : below[2], which[3] > 0 ? above[3] : below[3]};
#else
    typedef %(real)s Four __attribute__((ext_vector_type(4)));
    const Four w = {which[0], which[1], which[2], which[3]};
    const Four a = {above[0], above[1], above[2], above[3]};
    const Four b = {below[0], below[1], below[2], below[3]};
    const Four r = w > (Four)0 ? a : b;
    return {r[0], r[1], r[2], r[3]};
#endif
"""
_ROOTS = "const Four s = __builtin_elementwise_sqrt(v); const Four r = v < 4.0e-31f ? (Four)0.0f : s;"


@wp.func_native(_FOUR % {"cuda": _ROOT, "host": _ROOTS})
def roots(x: wp.vec4f) -> wp.vec4f:
    """``root`` of four."""
    ...


@wp.func_native("return {sqrt(x[0]), sqrt(x[1]), sqrt(x[2]), sqrt(x[3])};")
def roots(x: wp.vec4d) -> wp.vec4d:  # noqa: F811
    """``root`` of four in float64."""
    ...


@wp.func_native(_FOUR % {"cuda": "const float a = 1.0f, b = x;" + _QUOTIENT, "host": "const Four r = 1.0f / v;"})
def inverses(x: wp.vec4f) -> wp.vec4f:
    """``quotient`` of 1 and each of four."""
    ...


@wp.func_native("return {1.0 / x[0], 1.0 / x[1], 1.0 / x[2], 1.0 / x[3]};")
def inverses(x: wp.vec4d) -> wp.vec4d:  # noqa: F811
    """``quotient`` of 1 and each of four in float64."""
    ...


@wp.func_native(_CHOSEN % {"real": "float"})
def chosen(which: wp.vec4f, above: wp.vec4f, below: wp.vec4f) -> wp.vec4f:
    """Of four numbers those ``above`` where ``which`` is above 0, else those ``below``."""
    ...


@wp.func_native(_CHOSEN % {"real": "double"})
def chosen(which: wp.vec4d, above: wp.vec4d, below: wp.vec4d) -> wp.vec4d:  # noqa: F811
    """The same in float64."""
    ...


# Of eight at a time (kernels.math.packet) each component is eight adjacent numbers, which the CPU computes in one
# instruction, every one rounded as it is alone.
WIDTH = 8
EIGHT = "typedef %(real)s Eight __attribute__((ext_vector_type(8)));"


@functools.cache
def shaped(real: type, eight: bool) -> SimpleNamespace:
    """The types ``real``, ``vec3``, ``vec4`` and ``vec6`` of one or, ``eight``, of eight."""
    if eight:
        one, three, four, six = (wp.types.vector(length=count * WIDTH, dtype=real) for count in (1, 3, 4, 6))
        return SimpleNamespace(real=one, vec3=three, vec4=four, vec6=six)
    three, four = (wp.vec3f, wp.vec4f) if real is wp.float32 else (wp.vec3d, wp.vec4d)
    return SimpleNamespace(real=real, vec3=three, vec4=four, vec6=wp.types.vector(length=6, dtype=real))


def each(kind: type, code: str, names: str | list, single: str = "") -> str:
    """C++ that works ``code`` out of u, v, w for each component of what ``names`` name; of ``single`` there is one."""
    if kind in (wp.float32, wp.float64):
        return " ".join(f"auto {u} = {a};" for u, a in zip("uvwx", names, strict=False)) + f" return {code};"
    count, real = kind._length_, "float" if kind._wp_scalar_type_ is wp.float32 else "double"
    wide = count >= WIDTH
    step = WIDTH if wide else 1
    places = [f"{name}.c[0]" if name in single else f"{name}.c[k]" for name in names]
    if wide:
        read = "Eight {0}; __builtin_memcpy(&{0}, &{1}, sizeof(Eight));"
    else:
        read = "auto {0} = {1};"
        places = [name if name in single else place for name, place in zip(names, places, strict=True)]
    reads = " ".join(read.format(*pair) for pair in zip("uvwx", places, strict=False))
    write = "const Eight r = {0}; __builtin_memcpy(&result.c[k], &r, sizeof(Eight));" if wide else "result.c[k] = {0};"
    return f"""
    {EIGHT % {"real": real} if wide else ""}
    wp::vec_t<{count}, {real}> result;
    for (int k = 0; k < {count}; k += {step}) {{
        {reads}
        {write.format(code)}
    }}
    return result;
"""


_INNER_WIDE = "__builtin_elementwise_fma(u[2], v[2], __builtin_elementwise_fma(u[1], v[1], u[0] * v[0]))"
_WIDE = {  # root, quotient
    wp.float32: (
        "u < (decltype(u))4.0e-31f ? (decltype(u))0.0f : __builtin_elementwise_sqrt(u)",
        "__builtin_elementwise_abs(u) < (decltype(u))1.0e-24f ? (decltype(u))0.0f : u / v",
    ),
    wp.float64: ("__builtin_elementwise_sqrt(u)", "u / v"),
}


def of_threes(count: int, real: type, code: str) -> str:
    """C++ that works eight numbers ``code`` out of eight vectors of three each, u and v."""
    return f"""
    {EIGHT % {"real": "float" if real is wp.float32 else "double"}}
    Eight u[3], v[3];
    __builtin_memcpy(u, a.c, sizeof(u));
    __builtin_memcpy(v, b.c, sizeof(v));
    const Eight r[] = {{{code}}};
    wp::vec_t<{count * WIDTH}, {"float" if real is wp.float32 else "double"}> result;
    __builtin_memcpy(result.c, r, sizeof(r));
    return result;
"""


for _real in (wp.float32, wp.float64):
    _types = shaped(_real, True)
    _one, _three, _four = _types.real, _types.vec3, _types.vec4
    _root, _quotient = _WIDE[_real]

    @wp.func_native(of_threes(1, _real, _INNER_WIDE))
    def inner(a: _three, b: _three) -> _one:  # noqa: F811
        """Dot products of eight."""
        ...

    @wp.func_native(each(_three, "__builtin_elementwise_fma(u, v, w)", "abc", "b"))
    def scaled_sum(a: _three, b: _one, c: _three) -> _three:  # noqa: F811
        """a b + c of eight."""
        ...

    @wp.func_native(each(_one, "__builtin_elementwise_fma(u, v, w)", "abc"))
    def fused(a: _one, b: _one, c: _one) -> _one:  # noqa: F811
        """a b + c of eight."""
        ...

    @wp.func_native(each(_one, _quotient, "ab"))
    def quotient(a: _one, b: _one) -> _one:  # noqa: F811
        """Quotients of eight."""
        ...

    @wp.func_native(each(_one, _root, "x"))
    def root(x: _one) -> _one:  # noqa: F811
        """Square roots of eight."""
        ...

    @wp.func_native(each(_four, _root, "x"))
    def roots(x: _four) -> _four:  # noqa: F811
        """Square roots."""
        ...

    @wp.func_native(each(_four, "1 / u", "x"))
    def inverses(x: _four) -> _four:  # noqa: F811
        """1 / x."""
        ...

    @wp.func_native(each(_four, "u > (decltype(u))0 ? v : w", ["which", "above", "below"]))
    def chosen(which: _four, above: _four, below: _four) -> _four:  # noqa: F811
        """Those above where which is above 0, else those below."""
        ...
