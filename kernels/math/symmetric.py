"""Symmetric 3x3 matrices as vec6 (xx, yy, zz, xy, xz, yz), of one value or of a packet."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  what + - * below call for packets
from warp_cloth.kernels.math.packet import component, dot, symmetric, vector3
from warp_cloth.kernels.math.real import quotient

SOLVABLE = wp.constant(1.0e-6)  # of a matrix' mean diagonal; keeps one with a direction that nothing resists solvable


@wp.func
def symmetric_times(m: Any, v: Any):
    """m v."""
    row_0 = vector3(component(m, 0), component(m, 3), component(m, 4))
    row_1 = vector3(component(m, 3), component(m, 1), component(m, 5))
    row_2 = vector3(component(m, 4), component(m, 5), component(m, 2))
    return vector3(dot(row_0, v), dot(row_1, v), dot(row_2, v))


@wp.func
def outer(size: Any, u: Any):
    """size u u^T."""
    x, y, z = component(u, 0), component(u, 1), component(u, 2)
    size_x, size_y = size * x, size * y
    return symmetric(size_x * x, size_y * y, size * z * z, size_x * y, size_x * z, size_y * z)


@wp.func
def mixed_outer(size: Any, u: Any, v: Any):
    """size (u v^T + v u^T)."""
    u_x, u_y, u_z = component(u, 0), component(u, 1), component(u, 2)
    v_x, v_y, v_z = component(v, 0), component(v, 1), component(v, 2)
    twice = size * type(size)(2.0)
    return symmetric(
        twice * u_x * v_x, twice * u_y * v_y, twice * u_z * v_z,
        size * (u_x * v_y + u_y * v_x), size * (u_x * v_z + u_z * v_x), size * (u_y * v_z + u_z * v_y),
    )  # fmt: skip


@wp.func
def multiple_of_unit(size: Any):
    """size times the unit matrix."""
    zero = type(size)(0.0)
    return symmetric(size, size, size, zero, zero, zero)


@wp.func
def adjugate(n: Any):
    """Cofactors of n + SOLVABLE I, and its determinant."""
    solvable = type(n[0])(SOLVABLE)
    xx = n[0] + solvable
    yy = n[1] + solvable
    zz = n[2] + solvable
    c00 = yy * zz - n[5] * n[5]
    c01 = n[4] * n[5] - n[3] * zz
    c02 = n[3] * n[5] - n[4] * yy
    c11 = xx * zz - n[4] * n[4]
    c12 = n[3] * n[4] - xx * n[5]
    c22 = xx * yy - n[3] * n[3]
    return type(n)(c00, c11, c22, c01, c02, c12), xx * c00 + n[3] * c01 + n[4] * c02


@wp.func
def inverse(m: Any):
    """m^-1, by cofactors of m over its mean diagonal; zero where m is."""
    zero, one = type(m[0])(0.0), type(m[0])(1.0)
    mean = (m[0] + m[1] + m[2]) / type(m[0])(3.0)
    result = type(m)()
    if mean > zero:
        cofactors, determinant = adjugate(m / mean)
        if determinant > zero:
            result = cofactors * (one / (determinant * mean))
    return result


@wp.func
def bounded_inverse(m: Any):
    """``inverse`` by ``quotient``, as fast as a GPU can, of what is as large as stiffnesses are."""
    zero, one = type(m[0])(0.0), type(m[0])(1.0)
    mean = (m[0] + m[1] + m[2]) / type(m[0])(3.0)
    result = type(m)()
    if mean > zero:
        n = type(m)(
            quotient(m[0], mean), quotient(m[1], mean), quotient(m[2], mean),
            quotient(m[3], mean), quotient(m[4], mean), quotient(m[5], mean),
        )  # fmt: skip
        cofactors, determinant = adjugate(n)
        if determinant > zero:
            result = cofactors * quotient(one, determinant * mean)
    return result


@functools.cache
def matrix_type(precision: str) -> type:
    """The type ``mat3``, a 3 x 3 matrix."""
    mat3: type = wp.types.matrix(shape=(3, 3), dtype=cloth_types(precision).real)
    return mat3


@wp.func
def upper_triangle(m: Any):
    """The upper triangle of a matrix, as a symmetric one's vec6."""
    return symmetric(m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])


@wp.func
def full_matrix(m: Any):
    """The whole of a symmetric matrix."""
    return wp.matrix_from_rows(vector3(m[0], m[3], m[4]), vector3(m[3], m[1], m[5]), vector3(m[4], m[5], m[2]))
