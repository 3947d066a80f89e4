"""Facings: pieces that lie behind the edge of another one, whose outline they repeat round a corner."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Floats

REPEATED = 3e-3  # [m] by which the repeated outline is off at most
LEAST_REPEATED = 0.15  # [m] of outline
LEAST_LINE = 0.1  # across over along, of the repeated outline: a straight line is repeated by many
SAME_LENGTH = 0.01  # relative, of repeated edges
SAMPLES = 9  # of each edge


def is_facing(edges: Sequence[Chain], other: Sequence[Chain]) -> bool:
    """Whether a piece repeats two edges of another one that follow each other, as drawn or turned over.

    Args:
        edges: of the piece, counter-clockwise.
        other: of the larger piece.
    """
    turned = [Chain(edge.points * (-1.0, 1.0)).reversed for edge in edges[::-1]]
    return any(_repeats(each, other) for each in (edges, turned))


def _repeats(edges: Sequence[Chain], other: Sequence[Chain]) -> bool:
    for k in range(len(edges)):
        own = edges[k - 1], edges[k]
        if own[0].length + own[1].length < LEAST_REPEATED:
            continue
        for m in range(len(other)):
            pair = other[m - 1], other[m]
            alike = (abs(a.length - b.length) <= SAME_LENGTH * b.length for a, b in zip(own, pair, strict=True))
            if all(alike) and _is_laid_on(_points(own), _points(pair)):
                return True
    return False


def _points(pair: Sequence[Chain]) -> Floats:
    at = np.linspace(0.0, 1.0, SAMPLES)
    return np.concatenate([edge.at(at) for edge in pair])


def _is_laid_on(one: Floats, other: Floats) -> bool:
    """Whether points, turned and moved, lie on others; both bent enough to tell."""
    a, b = one - one.mean(axis=0), other - other.mean(axis=0)
    spread = np.linalg.svd(b, compute_uv=False)
    if spread[1] < LEAST_LINE * spread[0]:
        return False
    x, y = float((a * b).sum()), float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    cosine, sine = np.array([x, y]) / max(float(np.hypot(x, y)), 1e-300)
    laid = a @ np.array([[cosine, sine], [-sine, cosine]])
    return bool(np.hypot(*(laid - b).T).max() <= REPEATED)
