"""Fronts of trousers and skirts with a pocket opening cut out of the corner between side and waist."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dxf_panelled import cut_at
from dxf_patterns import TRUE_SEAMS, Drafted, band, bezier, line, trousers, write
from test_dxf import boundary_loops, kinds
from test_dxf_leg_yokes import SEAMS, jeans

from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.drafted import drafted_pattern

CLOSED = 1e-3  # [m2] by which a front differs from one that was not cut


def cut_out(front: Drafted, is_curved: bool) -> Drafted:
    """The front without the corner above its pocket, the opening a curve like that of jeans, or a slash."""
    hem, side, waist, crotch, inseam = front.edges
    low, high = cut_at(side, 0.92 if is_curved else 0.84)[0], cut_at(waist, 0.45 if is_curved else 0.15)[1]
    a, b = low[-1], high[0]
    mouth = bezier(a, (a[0] - 5.0, a[1] + 0.3), (b[0], b[1] - 5.0), b) if is_curved else line(a, b)
    return replace(front, edges=[hem, low, mouth, high, crotch, inseam], notches=[])


@pytest.mark.parametrize("garment", ["jeans", "trousers"])
@pytest.mark.parametrize("is_curved", [True, False])
@pytest.mark.parametrize("is_mirrored", [True, False])
def test_a_pocket_opening_is_closed(garment: str, is_curved: bool, is_mirrored: bool, tmp_path: Path) -> None:
    """All seams are found then, and the corner is about where it was cut out."""
    front, *others = jeans() if garment == "jeans" else trousers()
    whole = read_drafted(write(tmp_path / "whole.dxf", {"M": [front, *others]}))
    cut = cut_out(front, is_curved)
    if is_mirrored:
        cut = replace(cut, edges=[[(-x, y) for x, y in edge[::-1]] for edge in cut.edges[::-1]])
    path = write(tmp_path / "cut.dxf", {"M": [cut, *others]})
    draft = read_drafted(path)
    assert kinds(draft) == (SEAMS if garment == "jeans" else TRUE_SEAMS["trousers"])
    assert any("a pocket opening is closed" in note for note in draft.notes)
    assert boundary_loops(path, DraftOptions()) == 3
    areas = [abs(drafted_pattern(each, None).panels[0].area) for each in (draft, whole)]
    assert areas[0] == pytest.approx(areas[1], abs=CLOSED)


def test_an_outline_that_fits_as_it_is_stays(tmp_path: Path) -> None:
    """Nothing is closed where the side is as long as the back's, or where no corner would make it so."""
    for pieces in (trousers(), jeans()):
        assert not any("pocket" in note for note in read_drafted(write(tmp_path / "a.dxf", {"M": pieces})).notes)
    front, back, waistband = trousers()
    longer = replace(back, edges=[[(x, y * 1.06) for x, y in edge] for edge in back.edges])
    draft = read_drafted(write(tmp_path / "b.dxf", {"M": [cut_out(front, True), longer, waistband]}))
    assert not any("pocket" in note for note in draft.notes)
    assert "outseam" not in kinds(draft)


@pytest.mark.parametrize("is_curved", [True, False])
@pytest.mark.parametrize("is_half", [True, False])
def test_those_of_a_skirt_are_closed_on_both_sides(is_curved: bool, is_half: bool, tmp_path: Path) -> None:
    """Before, the opening went into the side seam, at 0.88, and the waistband was left to the user."""
    side = bezier((26.0, 0.0), (26.0, 20.0), (25.0, 50.0), (17.0, 61.0))
    middle = line((0.0, 60.0), (0.0, 0.0))
    half = [line((0.0, 0.0), (26.0, 0.0)), side, line((17.0, 61.0), (0.0, 60.0)), middle]
    low, high = cut_at(side, 0.75)[0], cut_at(half[2], 0.3)[1]
    a, b = low[-1], high[0]
    mouth = bezier(a, (a[0] - 5.0, a[1] + 0.5), (b[0], b[1] - 6.0), b) if is_curved else line(a, b)
    on_fold = None if is_half else (middle[0], middle[1])
    front = Drafted("SKIRT FRONT", [half[0], low, mouth, high, middle], "2" if is_half else "1", on_fold)
    back = Drafted("SKIRT BACK", half, "1", (middle[0], middle[1]))
    path = write(tmp_path / "a.dxf", {"M": [front, back, band("WAISTBAND", 68.2, 4.0)]})
    draft = read_drafted(path)
    centre = {"centre front": 1} if is_half else {}
    assert kinds(draft) == {"side": 2, "waistband": 1, "waistband ends": 1, **centre}
    assert boundary_loops(path, DraftOptions()) == 2
