"""Sparse matrices in compressed rows (CSR), whose products add every row in one fixed order."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.block import warp_size
from warp_cloth.kernels.base.reduction import add_in_lane_order
from warp_cloth.kernels.base.types import cloth_types


@functools.cache
def sparse_types(precision: str) -> SimpleNamespace:
    """Struct ``CsrMatrix``."""
    real = cloth_types(precision).real

    @wp.struct
    class CsrMatrix:
        """A sparse matrix in compressed rows; R rows, E entries."""

        start: wp.array(dtype=wp.int32)  # first entry of each row, and the entry count, shape [R + 1]
        column: wp.array(dtype=wp.int32)  # shape [E]
        value: wp.array(dtype=real)  # shape [E]

    return SimpleNamespace(CsrMatrix=CsrMatrix)


@wp.func
def add_row(sum: Any, matrix: Any, row: int, x: Any):
    """sum + sum_j P_ij x_j of displacements [m] or forces [N], added in the order of the row by a single thread.

    By fours, whose loads are issued together; ``matrix`` is a CsrMatrix.
    """
    start, last = matrix.start[row], matrix.start[row + 1]
    for entry in range(start, last - 3, 4):
        for i in range(4):
            sum += x[matrix.column[entry + i]] * matrix.value[entry + i]
    for entry in range(start + (last - start) // 4 * 4, last):
        sum += x[matrix.column[entry]] * matrix.value[entry]
    return sum


@wp.func
def add_row_by_warp(sum: Any, matrix: Any, row: int, x: Any, lane: int):
    """``add_row`` by a warp, all of whose threads must call it; x also of matrices."""
    last = matrix.start[row + 1]
    for first in range(matrix.start[row], last, warp_size()):
        term = type(sum)()
        if first + lane < last:
            term = x[matrix.column[first + lane]] * matrix.value[first + lane]
        sum = add_in_lane_order(sum, term, wp.min(last - first, warp_size()))
    return sum
