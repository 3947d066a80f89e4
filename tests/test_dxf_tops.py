"""Tops as rooms cut them: peplums, ribs of sleeves, patches; and two garments in one file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, Point, band, half_body, length, line, trousers, tshirt, write
from test_dxf import boundary_loops, kinds

from warp_cloth.pattern import DraftOptions, load_pattern, read_drafted
from warp_cloth.pattern.kinds import named


def peplum(name: str, waist: float) -> Drafted:
    """A sixth of a ring on the fold, as long at its waist as half a bodice's hem."""
    radius = waist / (math.pi / 3)

    def arc(r: float) -> list[Point]:
        return [(r * math.sin(a), -r * math.cos(a)) for a in np.linspace(0.0, math.pi / 3, 20)]

    upper, lower = arc(radius), arc(radius + 16.0)
    edges = [lower, line(lower[-1], upper[-1]), upper[::-1], line(upper[0], lower[0])]
    return Drafted(name, edges, "1", (upper[0], lower[0]))


def test_a_peplum_is_sewn_to_the_waist(tmp_path: Path) -> None:
    bodice = [
        half_body(f"{face} Bodice", 24.0, 42.0, 8.5, depth, 19.0) for face, depth in (("Front", 9.5), ("Back", 2.5))
    ]
    pieces = [
        *bodice,
        *(
            peplum(f"{face} Peplum", length(each.edges[0]))
            for face, each in zip(("Front", "Back"), bodice, strict=True)
        ),
    ]
    path = write(tmp_path / "a.dxf", {"M": pieces})
    assert kinds(read_drafted(path)) == {"shoulder": 2, "side": 4, "waist": 2}
    assert boundary_loops(path, DraftOptions()) == 4


def test_garments_that_no_seam_joins_are_told(tmp_path: Path) -> None:
    notes = load_pattern(write(tmp_path / "a.dxf", {"M": [*tshirt(), *trousers()]}), edge=0.04).notes
    assert any('2 garments, those of "FRONT", "FRONT LEG"' in note for note in notes)
    assert not any(
        "garments" in note for note in load_pattern(write(tmp_path / "b.dxf", {"M": tshirt()}), edge=0.04).notes
    )


def test_a_rib_of_a_sleeve_is_its_cuff(tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": [*tshirt(), band("SLEEVE RIB", 28.0, 3.0, "2")]}))
    assert kinds(draft)["cuff"] == kinds(draft)["cuff ends"] == 2
    assert kinds(draft)["underarm"] == 2


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Sleeve Band", "cuff"),
        ("SLEEVE HEM BAND", "cuff"),
        ("Rib Sleeve", "sleeve"),
        ("HEM RIB", "hem_band"),
        ("胸袋", "none"),
        ("Knee Patch", "none"),
        ("Patchwork Front", "front"),
        ("Drawstring", "none"),
        ("Schößchen vorn", "skirt_front"),
        ("Back Peplum", "skirt_back"),
    ],
)
def test_names_of_what_is_sewn_to_tops(name: str, kind: str) -> None:
    assert named(name).kind == kind
