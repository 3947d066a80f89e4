"""Seams beyond those of two edges: darts within a panel, layers of three panels or more, bands over a seam."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from test_pattern import EDGE, SAME, area_of, panel, sewn, specification, square, topology

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.pattern.assembly import sewn_mesh
from warp_cloth.pattern.garmentcode import read_specification


def fish_eye(bend: float = 0.0) -> dict[str, Any]:
    """A square of 30 cm with a dart within it, 4 cm wide and 16 long, as edges 4 to 7, clockwise from its upper tip."""
    dart = square()
    dart["vertices"] += [[15, 23], [17, 15], [15, 7], [13, 15]]
    dart["edges"] += [{"endpoints": [4 + n, 4 + (n + 1) % 4]} for n in range(4)]
    for edge in dart["edges"][4:] if bend else ():
        edge["curvature"] = {"type": "quadratic", "params": [[0.5, bend]]}
    return dart


@pytest.mark.parametrize("bend", [0.0, 0.1, -0.05])
def test_a_dart_within_a_panel_closes_to_two_cones(bend: float) -> None:
    mesh = sewn({"back": fish_eye(bend)}, [("back", 4, "back", 7), ("back", 5, "back", 6)])
    assert topology(mesh) == (1, 1)
    segment = bend * (0.02**2 + 0.08**2) / 3  # between a leg and its chord
    assert area_of(mesh) == pytest.approx(0.09 - 0.04 * 0.16 / 2 - 4 * segment, rel=1e-3)
    if bend:
        return
    # what a circle about a tip lacks of a full turn is the dart's angle there
    rest = mesh.texcoords
    assert rest is not None
    angle = np.zeros(mesh.vertex_count)
    for k in range(3):
        a, b = rest[:, (k + 1) % 3] - rest[:, k], rest[:, (k + 2) % 3] - rest[:, k]
        np.add.at(angle, mesh.triangles[:, k], np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)))
    lacking = np.sort(2 * np.pi - angle[np.abs(angle - 2 * np.pi) > 0.2])
    cone = 2 * math.atan2(2, 8)
    # at the square's corners and along its sides half a turn or more is lacking; at the waist there is too much
    np.testing.assert_allclose(lacking[lacking < 1.0], [-2 * cone, cone, cone], atol=1e-9)


def test_a_hole_that_is_sewn_otherwise_is_refused() -> None:
    for stitches in ([("back", 4, "back", 7)], [("back", 4, "back", 6), ("back", 5, "back", 7)]):
        with pytest.raises(InputError, match='the hole in panel "back" is not sewn up from one corner to another'):
            sewn({"back": fish_eye()}, stitches)


def sides_at(mesh: Mesh) -> Counter[int]:
    """How many edges have one triangle, two, three, ..."""
    sides = Counter(tuple(sorted((int(t[i]), int(t[(i + 1) % 3])))) for t in mesh.triangles for i in range(3))
    return Counter(sides.values())


@pytest.mark.parametrize(
    "stitches",
    [
        [("a", 1, "b", 3), ("a", 1, "c", 3)],
        [("a", 1, "b", 3), ("b", 3, "c", 3)],
        [("a", 1, "b", 3), ("b", 3, "c", 3), ("c", 3, "a", 1)],
    ],
    ids=["star", "chain", "ring"],
)
def test_three_panels_are_sewn_at_one_seam(stitches: list[Any]) -> None:
    side = square(30, translation=[30, 0, 0])
    mesh = sewn({"a": square(), "b": side, "c": square(30, translation=[30, 0, 2])}, stitches)
    count = sides_at(mesh)
    assert set(count) == {1, 2, 3}
    assert count[3] == 20  # 30 cm at 15 mm
    edges = sum(count.values())
    assert mesh.vertex_count - edges + mesh.triangle_count == 1  # three discs at one line
    assert area_of(mesh) == pytest.approx(0.27, rel=SAME)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_four_panels_sewn_each_to_the_next_are_layers_of_one_seam(order: tuple[int, ...]) -> None:
    panels = {name: square(30, translation=[30, 0, k]) for k, name in enumerate("bcd")}
    stitches = [("a", 1, "b", 3), ("b", 3, "c", 3), ("c", 3, "d", 3)]
    mesh = sewn({"a": square(), **panels}, [stitches[k] for k in order])
    assert sides_at(mesh)[4] == 20
    assert area_of(mesh) == pytest.approx(0.36, rel=SAME)


def test_a_dart_may_be_stated_twice() -> None:
    stitches = [("back", 4, "back", 7), ("back", 5, "back", 6), ("back", 7, "back", 4)]
    assert topology(sewn({"back": fish_eye()}, stitches)) == (1, 1)


def test_a_stitch_of_three_sides_sews_three_panels() -> None:
    panels = {name: square(30, translation=[x, 0, z]) for name, x, z in (("a", 0, 0), ("b", 30, 0), ("c", 30, 2))}
    tree = json.loads(specification(panels, []))
    tree["pattern"]["stitches"] = [[{"panel": name, "edge": edge} for name, edge in (("a", 1), ("b", 3), ("c", 3))]]
    mesh = sewn_mesh(read_specification("spec.json", json.dumps(tree).encode()), "spec", edge=EDGE)
    assert sides_at(mesh)[3] == 20


def test_a_layer_of_two_edges_is_cut_where_they_meet() -> None:
    lining = panel([[0, 0], [30, 0], [30, 30], [0, 30], [0, 12]], translation=[30, 0, 2])
    panels = {"a": square(), "b": square(30, translation=[30, 0, 0]), "c": lining}
    mesh = sewn(panels, [("a", 1, "b", 3), ("a", 1, "c", 3), ("a", 1, "c", 4)])
    assert set(sides_at(mesh)) == {1, 2, 3}
    assert area_of(mesh) == pytest.approx(0.27, rel=SAME)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_band_is_sewn_over_the_seam_of_two_panels(swapped: bool) -> None:
    skirt = {"left": square(30), "right": square(20, translation=[30, 10, 0])}
    band = panel([[0, 0], [50, 0], [50, 4], [0, 4]], translation=[0, 30, 0])
    stitches = [("band", 0, "right", 2), ("band", 0, "left", 2), ("left", 1, "right", 3)]
    mesh = sewn(dict(list(skirt.items())[:: -1 if swapped else 1]) | {"band": band}, stitches)
    assert set(sides_at(mesh)) == {1, 2}
    assert topology(mesh) == (1, 1)
    assert np.ptp(mesh.points, axis=0)[0] == pytest.approx(0.5)


@pytest.mark.parametrize("width", [52.5, 70.0])
def test_panels_side_by_side_are_gathered_and_no_layers(width: float) -> None:
    def skirt(x: float) -> dict[str, Any]:
        return panel([[0, 0], [width, 0], [width, 30], [0, 30]], translation=[x, -30, 0])

    panels = {"band": panel([[0, 0], [70, 0], [70, 4], [0, 4]]), "left": skirt(35 - width), "right": skirt(35)}
    stitches = [("band", 0, "left", 2), ("band", 0, "right", 2), ("left", 1, "right", 3)]
    if width < 56:
        assert set(sides_at(sewn(panels, stitches))) == {1, 2}
        return
    with pytest.raises(InputError, match="of 700 mm is sewn to 2 panels' edges of 700 and 700 mm"):
        sewn(panels, stitches)


def test_panels_that_are_neither_layers_nor_a_run_are_refused() -> None:
    panels = {"a": square(30), "b": square(10, translation=[30, 0, 0]), "c": square(60, translation=[30, 20, 0])}
    with pytest.raises(InputError, match="of 300 mm is sewn to 2 panels' edges of 100 and 600 mm"):
        sewn(panels, [("a", 1, "b", 3), ("a", 1, "c", 3)])
