"""Square roots and quotients that round alike on the CPU and CUDA, without the branches that CUDA's own ones take.

CUDA rounds both correctly by an approximation and two corrections, and turns aside to a slow function where an operand
is so small that these would lose digits. What is smaller than any cloth has is zero here, on every device: no turning
aside, so that many vertices' square roots are under way at a time.
"""

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
