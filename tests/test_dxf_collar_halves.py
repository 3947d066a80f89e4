"""Collars of two halves that meet behind are made whole; halves are no layers of each other."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import Drafted, Point, line, middle, write
from dxf_shirts import camp_shirt
from test_dxf import kinds

from warp_cloth.pattern import read_drafted


def half_of(collar: Drafted, quantity: str = "2", slant: float = 0.0) -> Drafted:
    """The half of a collar at x > 0; ``slant``: its end behind leans by this much [cm]."""
    inner, end, outer, _ = collar.edges
    low, high = middle(inner), middle(outer)
    right: list[Point] = [(0.0, low[1]), *(point for point in inner if point[0] > 1e-6)]
    above: list[Point] = [*(point for point in outer if point[0] > 1e-6), (slant, high[1])]
    return Drafted(collar.name, [right, end, above, line(above[-1], right[0])], quantity)


@pytest.mark.parametrize("mirrored", [False, True])
def test_two_halves_of_a_collar_are_made_whole(mirrored: bool, tmp_path: Path) -> None:
    """They were sewn to nothing, or called layers of one collar."""
    *rest, collar = camp_shirt()
    whole = read_drafted(write(tmp_path / "a.dxf", {"M": [*rest, collar]}))
    half = half_of(collar)
    if mirrored:
        half = Drafted(half.name, [[(-x, y) for x, y in edge[::-1]] for edge in half.edges[::-1]], half.quantity)
    draft = read_drafted(write(tmp_path / "b.dxf", {"M": [*rest, half]}))
    assert kinds(draft) == kinds(whole)
    assert kinds(draft)["collar"] == 1
    assert 'piece "COLLAR" is half a collar, cut twice: made whole at its end behind' in draft.notes


def test_a_half_whose_end_behind_is_not_told_is_left_as_it_is(tmp_path: Path) -> None:
    *rest, collar = camp_shirt()
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*rest, half_of(collar, slant=1.0)]}))
    assert sum(part.kind == "collar" for part in draft.parts) == 2
    assert not any("layers of one collar" in note for note in draft.notes)
