"""Cuts of edges that several joints share: each piece is sewn to whole pieces of all layers."""

from __future__ import annotations

import pytest

from warp_cloth.pattern.shared_cuts import LEAST, Pair, shared_cuts
from warp_cloth.pattern.specification import Side

A, B, C, D = (Side(panel, 0) for panel in range(4))


def length(_: Side) -> float:
    return 1.0  # [m]


def whole(one: Side, other: Side) -> list[Pair]:
    return [((one, 0.0, 1.0), (other, 0.0, 1.0))]


def test_edges_sewn_once_stay_as_they_are() -> None:
    pairs = [whole(A, B), [((C, 0.0, 0.3), (D, 0.6, 1.0)), ((C, 0.3, 1.0), (D, 0.0, 0.6))]]
    assert shared_cuts(pairs, length) == pairs


def test_a_cut_of_one_layer_cuts_the_others_from_the_other_end() -> None:
    halves = [((A, 0.0, 0.25), (C, 0.0, 1.0)), ((A, 0.25, 1.0), (D, 0.0, 1.0))]
    first, second = shared_cuts([whole(A, B), halves], length)
    assert first == [((A, 0.0, 0.25), (B, 0.75, 1.0)), ((A, 0.25, 1.0), (B, 0.0, 0.75))]
    assert second == halves


@pytest.mark.parametrize("apart", [0.5 * LEAST, 2.0 * LEAST])
def test_cuts_that_are_all_but_one_are_one(apart: float) -> None:
    one = [((A, 0.0, 0.5), (B, 0.5, 1.0)), ((A, 0.5, 1.0), (B, 0.0, 0.5))]
    at = 0.5 + apart
    other = [((A, 0.0, at), (C, 1.0 - at, 1.0)), ((A, at, 1.0), (C, 0.0, 1.0 - at))]
    found = shared_cuts([one, other], length)
    ends = [{span[1:] for pair in own for span in pair if span[0] == A} for own in found]
    assert ends[0] == ends[1]
    assert len(ends[0]) == (2 if apart < LEAST else 3)


def test_the_last_millimetres_of_an_edge_are_sewn_to_its_last_piece() -> None:
    at = 1.0 - 0.5 * LEAST
    short = [((A, 0.0, at), (C, 0.0, 1.0)), ((A, at, 1.0), (D, 0.0, 1.0))]
    found = shared_cuts([whole(A, B), short], length)
    assert all(low < 1.0 for own in found for pair in own for _, low, _ in pair)
