"""Curves as rows of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def arc_lengths(curve: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of a curve, shape [N, D], up to each of its points [m], shape [N]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])


def resampled(curve: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """``count`` points at equal distances along a curve, shape [N, D], from its first to its last; shape [count, D]."""
    points = points_along(curve, np.linspace(0.0, arc_lengths(curve)[-1], count))
    points[0], points[-1] = curve[0], curve[-1]
    return points


def points_along(curve: NDArray[np.float64], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of a curve, shape [N, D], at ``distances`` along it, shape [M]; shape [M, D]."""
    lengths = arc_lengths(curve)
    return np.stack([np.interp(distances, lengths, column) for column in curve.T], axis=1)


def curve_point(curve: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    """The point of a curve, shape [N, 3], at a number between two of its rows', shape [3]."""
    row = np.arange(len(curve))
    return np.array([np.interp(at, row, curve[:, axis]) for axis in range(3)])
