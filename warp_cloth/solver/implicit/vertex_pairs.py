"""Adjacency of the stiffness matrix: pairs of vertices that share an element, and these elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.options import SpringField
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.model.model import ClothModel

HINGE_SIDES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
TRIANGLE_SIDES = ((0, 1), (1, 2), (2, 0))


@dataclass(frozen=True, eq=False)
class PairTable:
    """N pairs i < j, and the rows of the stiffness matrix that they make, on the device."""

    pairs: Any  # kernels.elements.stiffness Pairs
    ends: Indices  # on the host, shape [N, 2]
    start: wp.array  # first entry of each row, shape [V + 1]
    neighbour: wp.array  # column of each entry, the pair's other vertex, shape [2 N]


def build_pairs(model: ClothModel) -> PairTable:
    """All pairs of a model's vertices that share an edge that pulls, a hinge or a woven triangle."""
    count = model.vertex_count
    edges = model.edges.ends.numpy().astype(np.int64)
    pulling = np.flatnonzero(model.edges.spring.numpy()[:, SpringField.PULL] > 0.0)
    hinges = _corners(model.hinges, 4)
    woven = _corners(model.weave, 3)
    keys = [_keys(edges[pulling], count)]
    hinge_keys, hinge_codes = _element_pairs(hinges, HINGE_SIDES, count, 16)
    weave_keys, weave_codes = _element_pairs(woven, TRIANGLE_SIDES, count, 3)
    unique = np.unique(np.concatenate([*keys, hinge_keys, weave_keys]))
    ends = np.stack([unique // count, unique % count], axis=1)

    def upload(array: NDArray[Any], dtype: Any = wp.int32) -> wp.array:
        return wp.array(np.ascontiguousarray(array, dtype=np.int32), dtype=dtype, device=model.device)

    edge = np.full(len(unique), -1)
    edge[np.searchsorted(unique, keys[0])] = pulling
    pairs = stiffness_types(model.precision).Pairs()
    pairs.edge = upload(edge)
    for name, element_keys, codes in (("hinge", hinge_keys, hinge_codes), ("weave", weave_keys, weave_codes)):
        start, order = ragged_rows(np.searchsorted(unique, element_keys), len(unique))
        setattr(pairs, f"{name}_start", upload(start))
        setattr(pairs, name, upload(codes[order]))
    owner = np.concatenate([ends[:, 0], ends[:, 1]])
    start, order = ragged_rows(owner, count)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    pairs.slot = upload(place.reshape(2, -1).T, wp.vec2i)
    neighbour = np.concatenate([ends[:, 1], ends[:, 0]])[order]
    return PairTable(pairs, ends.astype(np.int32), upload(start), upload(neighbour))


def _corners(elements: Any, width: int) -> NDArray[np.int64]:
    if elements is None:
        return np.zeros((0, width), dtype=np.int64)
    return np.asarray(elements.corners.numpy(), dtype=np.int64).reshape(-1, width)


def _keys(ends: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return np.asarray(np.minimum(ends[:, 0], ends[:, 1]) * count + np.maximum(ends[:, 0], ends[:, 1]))


def _element_pairs(
    corners: NDArray[np.int64], sides: tuple[tuple[int, int], ...], count: int, codes: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Key of every side of every element, lower vertex first, and its code in ``Pairs``."""
    keys, names = [], []
    numbers = np.arange(len(corners))
    for place, (a, b) in enumerate(sides):
        first, second = corners[:, a], corners[:, b]
        keys.append(_keys(np.stack([first, second], axis=1), count))
        swapped = first > second
        name = np.where(swapped, 4 * b + a, 4 * a + b) if codes == 16 else np.full(len(corners), place)
        names.append(codes * numbers + name)
    if not keys:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    # by element, so that every pair adds its elements in their order
    return np.stack(keys, axis=1).ravel(), np.stack(names, axis=1).ravel()
