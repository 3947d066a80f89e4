"""Symmetric 3x3 matrices as vec6 (xx, yy, zz, xy, xz, yz), of one value or of a packet."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.operators import add, mul, sub  # noqa: F401  what + - * below call for packets
from warp_cloth.kernels.math.packet import component, dot, symmetric, vector3, where_greater
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
    xy, xz, yz = component(n, 3), component(n, 4), component(n, 5)
    solvable = type(xy)(type(n[0])(SOLVABLE))
    xx, yy, zz = component(n, 0) + solvable, component(n, 1) + solvable, component(n, 2) + solvable
    c00 = yy * zz - yz * yz
    c01 = xz * yz - xy * zz
    c02 = xy * yz - xz * yy
    c11 = xx * zz - xz * xz
    c12 = xy * xz - xx * yz
    c22 = xx * yy - xy * xy
    return symmetric(c00, c11, c22, c01, c02, c12), xx * c00 + xy * c01 + xz * c02


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
def each_over(m: Any, size: Any):
    """m / size, by ``quotient``."""
    xx, yy, zz = quotient(component(m, 0), size), quotient(component(m, 1), size), quotient(component(m, 2), size)
    xy, xz, yz = quotient(component(m, 3), size), quotient(component(m, 4), size), quotient(component(m, 5), size)
    return symmetric(xx, yy, zz, xy, xz, yz)


@wp.func
def each_times(m: Any, size: Any):
    """m size."""
    xx, yy, zz = component(m, 0) * size, component(m, 1) * size, component(m, 2) * size
    return symmetric(xx, yy, zz, component(m, 3) * size, component(m, 4) * size, component(m, 5) * size)


@wp.func
def bounded_inverse(m: Any):
    """``inverse`` by ``quotient``, as fast as a GPU can, of what is as large as stiffnesses are."""
    trace = component(m, 0) + component(m, 1) + component(m, 2)
    zero, one = type(trace)(type(m[0])(0.0)), type(trace)(type(m[0])(1.0))
    mean = quotient(trace, type(trace)(type(m[0])(3.0)))
    cofactors, determinant = adjugate(each_over(m, where_greater(mean, zero, mean, one)))
    size = where_greater(determinant, zero, quotient(one, determinant * mean), zero)
    return each_times(cofactors, where_greater(mean, zero, size, zero))


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
