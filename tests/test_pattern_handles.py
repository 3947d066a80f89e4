"""Which way round, and in which order, panels are sewn whose places do not tell: as a ball with openings."""

from __future__ import annotations

from typing import Any

import pytest
from test_pattern import panel, sewn, specification, topology

from warp_cloth.pattern.garmentcode import read_specification
from warp_cloth.pattern.handles import handle_count
from warp_cloth.pattern.sewing import seams_of

EDGE = 0.03  # [m]
SIDES = (1, 3)  # of a rectangle: right and left as drawn


def rectangle(half: float, low: float, high: float, depth: float, **more: Any) -> dict[str, Any]:
    """In front of the body or behind it, drawn as seen from the front: edges bottom, right, top, left [cm]."""
    corners = [[-half, low], [half, low], [half, high], [-half, high]]
    return panel(corners, translation=[0, 0, depth], **more)


def turned_loop(drawn: dict[str, Any]) -> dict[str, Any]:
    """The same panel, its outline listed the other way round: edge k becomes edge 3 - k."""
    return drawn | {"edges": [{"endpoints": edge["endpoints"][::-1]} for edge in drawn["edges"][::-1]]}


def handles(panels: dict[str, Any], stitches: list[Any]) -> int:
    pattern = read_specification("spec.json", specification(panels, stitches))
    return handle_count(pattern, seams_of(pattern))


def tiers(depth: float) -> tuple[dict[str, Any], list[Any]]:
    """A top of 15 cm with two gathered tiers, each side seam far shorter than front and back are apart."""
    rows = [(25.0, 100.0, 115.0), (37.0, 80.0, 98.0), (55.0, 60.0, 78.0)]
    panels = {f"{face}{k}": rectangle(*row, z) for k, row in enumerate(rows) for face, z in (("f", depth), ("b", -20))}
    stitches = [(f"f{k}", side, f"b{k}", side) for k in range(3) for side in SIDES]
    return panels, [*stitches, *((f"{face}{k}", 0, f"{face}{k + 1}", 2) for face in "fb" for k in (0, 1))]


def test_tiers_are_sewn_the_right_way_up_however_far_front_and_back_are_apart() -> None:
    """Each side seam's ends are 1.06 times nearer the right way: too little to tell, but the other has handles."""
    panels, stitches = tiers(25.0)
    assert topology(sewn(panels, stitches, EDGE)) == (2, 0)
    assert handles(panels, stitches) == 0
    turned = {name: turned_loop(each) if name.startswith("b") else each for name, each in panels.items()}
    swapped = [(one, 3 - i if one[0] == "b" else i, other, 3 - j if other[0] == "b" else j)
               for one, i, other, j in stitches]  # fmt: skip
    assert topology(sewn(turned, swapped, EDGE)) == (2, 0)


@pytest.mark.parametrize("high", [5.0, 10.0])
@pytest.mark.parametrize("is_turned", [False, True])
def test_a_low_band_of_front_and_back_is_not_turned_over(high: float, is_turned: bool) -> None:
    """A bandeau of which the top is to stay the top: no handle tells, but how its panels lie to each other."""
    back = rectangle(20, 100, 100 + high, -25)
    panels = {"f": rectangle(20, 100, 100 + high, 25), "b": turned_loop(back) if is_turned else back}
    stitches = [("f", side, "b", 3 - side if is_turned else side) for side in SIDES]
    pattern = read_specification("spec.json", specification(panels, stitches))
    assert [seam.reverse for seam in seams_of(pattern)] == [is_turned, is_turned]


def quarters(order: list[str], sewn_at: int = 0) -> tuple[dict[str, Any], list[Any]]:
    """A skirt of four panels below a waistband of one, which lies flat in front of the body."""
    panels = {f"{face}{side}": panel(
        [[x, 60], [x + 22, 60], [x + 20, 98], [x + 2, 98]], translation=[0, 0, z]
    ) for face, z in (("f", 22), ("b", -20)) for side, x in (("l", 0), ("r", -22))}  # fmt: skip
    panels["band"] = rectangle(36, 99, 103, 24)
    stitches = [("fl", 3, "fr", 1), ("bl", 3, "br", 1), ("fl", 1, "bl", 1), ("fr", 3, "br", 3)]
    return panels, [*stitches, *(("band", sewn_at, each, 2) for each in order), ("band", 1, "band", 3)]


@pytest.mark.parametrize("order", [["fr", "fl", "bl", "br"], ["bl", "fr", "br", "fl"]])
def test_a_waistband_is_sewn_to_panels_in_the_order_in_which_they_are_sewn_to_each_other(order: list[str]) -> None:
    """As the band is placed, front and back lie at the same places along it."""
    panels, stitches = quarters(order)
    assert topology(sewn(panels, stitches, EDGE)) == (2, 0)
    pattern = read_specification("spec.json", specification(panels, stitches))
    met = sorted((seam.pieces[0].low, pattern.panels[seam.pieces[1].side.panel].name) for seam in seams_of(pattern)
                 if pattern.panels[seam.pieces[0].side.panel].name == "band" != pattern.panels[
                     seam.pieces[1].side.panel].name)  # fmt: skip
    names = [name for _, name in met]
    start = names.index("fr")
    assert [*names[start:], *names[:start]] in (["fr", "fl", "bl", "br"], ["fr", "br", "bl", "fl"])


def test_a_waistband_is_sewn_over_darts_and_sides() -> None:
    """Six runs of two panels: on each panel darts part them, between the panels the side seams."""
    corners: list[list[float]] = [
        [-40, 45],
        [40, 45],
        [29, 98],
        [15, 98],
        [12, 84],
        [9, 98],
        [-9, 98],
        [-12, 84],
        [-15, 98],
        [-29, 98],
    ]
    panels = {name: panel(corners, translation=[0, 0, z]) for name, z in (("f", 22), ("b", -20))}
    panels["band"] = rectangle(44, 99, 103, 24)
    stitches: list[Any] = [("f", 1, "b", 1), ("f", 9, "b", 9), ("band", 1, "band", 3)]
    for name in "fb":
        stitches += [(name, 3, name, 4), (name, 6, name, 7), *(("band", 0, name, edge) for edge in (2, 5, 8))]
    assert topology(sewn(panels, stitches, EDGE)) == (2, 0)
    assert handles(panels, stitches) == 0


def test_handles_are_counted() -> None:
    """Two squares sewn at two edges are a band; with all four edges sewn a ball; sewn crosswise, a torus."""
    panels = {"f": rectangle(20, 100, 140, 20), "b": rectangle(20, 100, 140, -20)}
    assert handles(panels, [("f", 1, "b", 1), ("f", 3, "b", 3)]) == 0
    assert handles(panels, [("f", k, "b", k) for k in range(4)]) == 0
    assert handles(panels, [("f", k, "b", (k + 2) % 4) for k in range(4)]) == 2
