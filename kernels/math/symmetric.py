"""Symmetric 3 x 3 matrices, stored as vec6: xx, yy, zz, xy, xz, yz."""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.types import cloth_types


@functools.cache
def matrix_type(precision: str) -> type:
    """The type ``mat3``, a 3 x 3 matrix."""
    mat3: type = wp.types.matrix(shape=(3, 3), dtype=cloth_types(precision).real)
    return mat3


@functools.cache
def symmetric_matrix_functions(precision: str) -> SimpleNamespace:
    """Functions ``upper_triangle`` and ``full_matrix``: from mat3 to vec6, and back."""
    vec6, mat3 = cloth_types(precision).vec6, matrix_type(precision)

    @wp.func
    def upper_triangle(m: mat3):
        """The upper triangle of a matrix, as a symmetric one's vec6."""
        return vec6(m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])

    @wp.func
    def full_matrix(m: vec6):
        """The whole of a symmetric matrix."""
        return mat3(m[0], m[3], m[4], m[3], m[1], m[5], m[4], m[5], m[2])

    return SimpleNamespace(upper_triangle=upper_triangle, full_matrix=full_matrix)
