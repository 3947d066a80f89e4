"""Skirts of rectangles, gathered to a waistband or bodice; shaped ones are not gathered so far unasked."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import Drafted, band, half_body, line, write
from test_dxf import kinds

from warp_cloth.pattern import read_drafted

WAIST = 76.0  # [cm]


def skirt(waist: float, hem: float) -> list[Drafted]:
    """A front and a back whose waists are this much of the waistband together."""
    top, low = 0.25 * WAIST * waist, 0.25 * WAIST * hem
    edges = [line((-low, 0.0), (low, 0.0)), line((low, 0.0), (top, 60.0)), line((top, 60.0), (-top, 60.0))]
    edges.append(line((-top, 60.0), (-low, 0.0)))
    return [Drafted(f"SKIRT {face}", edges) for face in ("FRONT", "BACK")]


@pytest.mark.parametrize(
    ("waist", "hem", "count"),
    [(1.0, 1.3, 1), (1.5, 1.5, 1), (2.0, 2.0, 1), (3.0, 3.2, 1), (4.0, 4.0, 0), (2.0, 2.8, 0)],
)
def test_a_skirt_as_wide_at_its_waist_as_at_its_hem_is_gathered(
    waist: float, hem: float, count: int, tmp_path: Path
) -> None:
    """To a third at most; of a shaped skirt a band of half its length may be half of it."""
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*skirt(waist, hem), band("WAISTBAND", WAIST, 4.0)]}))
    assert kinds(draft)["waistband"] == kinds(draft)["waistband ends"] == count


def test_a_skirt_is_gathered_to_a_bodice(tmp_path: Path) -> None:
    bodice = [
        half_body(f"{face} BODICE", 0.25 * WAIST, 44.0, 8.5, depth, 17.0)
        for face, depth in (("FRONT", 9.0), ("BACK", 2.5))
    ]
    for full, count in ((3.0, 2), (4.0, 0)):
        draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*bodice, *skirt(full, full)]}))
        assert kinds(draft)["waist"] == count
