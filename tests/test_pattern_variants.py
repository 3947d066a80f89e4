"""Specifications as other programs and models write them, left out or written otherwise: the same garment."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_fuzz_patterns import holds_its_promise
from test_pattern import area_of, topology
from test_pattern_refused import loaded, tube

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading.sizes import GUESS_NOTE, check_sizes

Change = Callable[[dict[str, Any]], Any]


def each_panel(change: Callable[[dict[str, Any]], None]) -> Change:
    def made(tree: dict[str, Any]) -> None:
        for panel in tree["pattern"]["panels"].values():
            change(panel)

    return made


def each_stitch(change: Callable[[list[Any]], Any]) -> Change:
    return lambda tree: tree["pattern"].update(stitches=[change(stitch) for stitch in tree["pattern"]["stitches"]])


def flipped_edges(panel: dict[str, Any]) -> None:
    panel["edges"][2]["endpoints"] = panel["edges"][2]["endpoints"][::-1]


def doubled_corners(panel: dict[str, Any]) -> None:
    corners = panel["vertices"]
    panel["vertices"] = [corner for pair in zip(corners, corners[1:] + corners[:1], strict=True) for corner in pair]
    for number, edge in enumerate(panel["edges"]):
        edge["endpoints"] = [2 * number, 2 * number + 1]


def named_axes(panel: dict[str, Any]) -> None:
    """Points as a writer of JavaScript has them."""
    panel["vertices"] = [{"x": x, "y": y} for x, y in panel["vertices"]]
    for key in ("translation", "rotation"):
        panel[key] = dict(zip("XYZ", panel[key], strict=True))


VARIANTS: dict[str, Change] = {
    "points with named axes": each_panel(named_axes),
    "panel_order and labels": lambda tree: tree["pattern"].update(panel_order=["front", "back"], new=None),
    "no wrapper": lambda tree: tree | tree.pop("pattern"),
    "a list of panels": lambda tree: tree["pattern"].update(
        panels=[{"name": name, **panel} for name, panel in tree["pattern"]["panels"].items()]
    ),
    "no rotation": each_panel(lambda panel: panel.pop("rotation")),
    "null curvature": each_panel(lambda panel: [edge.update(curvature=None) for edge in panel["edges"]]),
    "empty curvature": each_panel(lambda panel: [edge.update(curvature=[]) for edge in panel["edges"]]),
    "lines": each_panel(
        lambda panel: [edge.update(curvature={"type": "Line", "params": []}) for edge in panel["edges"]]
    ),
    "edges as pairs": each_panel(lambda panel: panel.update(edges=[edge["endpoints"] for edge in panel["edges"]])),
    "whole numbers as floats": each_panel(
        lambda panel: [edge.update(endpoints=[float(end) for end in edge["endpoints"]]) for edge in panel["edges"]]
    ),
    "corners in space": each_panel(lambda panel: panel.update(vertices=[[*xy, 0.0] for xy in panel["vertices"]])),
    "an edge that runs back": each_panel(flipped_edges),
    "corners for each edge": each_panel(doubled_corners),
    "stitches by number": lambda tree: tree["pattern"].update(
        stitches={str(n): stitch for n, stitch in enumerate(tree["pattern"]["stitches"])}
    ),
    "sides as pairs": each_stitch(lambda stitch: [[side["panel"], side["edge"]] for side in stitch]),
    "named sides": each_stitch(lambda stitch: {"from": stitch[0], "to": stitch[1], "label": "side"}),
    "a flag": each_stitch(lambda stitch: [*stitch, False]),
    "a null flag": each_stitch(lambda stitch: [*stitch, None]),
    "flags in a table": each_stitch(lambda stitch: [*stitch, {"right_wrong": False, "kind": "plain"}]),
    "edges as text": each_stitch(lambda stitch: [side | {"edge": str(side["edge"])} for side in stitch]),
    "one stitch of two edges": lambda tree: tree["pattern"].update(
        stitches=[[{"panel": "front", "edge": [1, 3]}, {"panel": "back", "edges": [2, 0]}]]
    ),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_is_the_same_garment(name: str, tmp_path: Path) -> None:
    plain = loaded(tube(), tmp_path)
    tree = tube()
    changed = VARIANTS[name](tree)
    mesh = loaded(changed if name == "no wrapper" else tree, tmp_path)
    assert topology(mesh) == (2, 0)
    assert area_of(mesh) == pytest.approx(area_of(plain), rel=1e-9)
    np.testing.assert_allclose(np.stack(mesh.bounds()), np.stack(plain.bounds()), atol=1e-12)
    holds_its_promise(mesh)


def test_edges_in_any_order_are_put_in_order_and_told(tmp_path: Path) -> None:
    tree = tube()
    front = tree["pattern"]["panels"]["front"]
    front["edges"] = [front["edges"][number] for number in (2, 0, 3, 1)]
    tree["pattern"]["stitches"] = [
        [{"panel": "front", "edge": 3}, {"panel": "back", "edge": 2}],
        [{"panel": "front", "edge": 2}, {"panel": "back", "edge": 0}],
    ]
    mesh = loaded(tree, tmp_path)
    assert topology(mesh) == (2, 0)
    assert mesh.notes == ('panel "front": its edges are not listed round the outline: put in order',)


def test_edges_are_sewn_by_their_labels(tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["panels"]["front"]["edges"][1]["label"] = "left"
    tree["pattern"]["stitches"][0][0]["edge"] = "left"
    assert topology(loaded(tree, tmp_path)) == (2, 0)


def test_a_bare_pair_of_control_points_is_a_cubic(tmp_path: Path) -> None:
    areas = []
    for bend in ([[0.3, 0.1], [0.7, 0.1]], {"type": "cubic", "params": [0.3, 0.1, 0.7, 0.1]}):
        tree = tube()
        tree["pattern"]["panels"]["front"]["edges"][0]["curvature"] = bend
        areas.append(area_of(loaded(tree, tmp_path)))
    assert areas[0] == areas[1]


def holed() -> dict[str, Any]:
    tree = tube()
    front = tree["pattern"]["panels"]["front"]
    front["vertices"] += [[10, 10], [20, 10], [20, 20], [10, 20]]
    front["edges"] += [{"endpoints": [4 + n, 4 + (n + 1) % 4]} for n in range(4)]
    return tree


def test_a_loop_within_the_outline_is_a_hole(tmp_path: Path) -> None:
    mesh = loaded(holed(), tmp_path)
    assert topology(mesh) == (3, -1)
    assert area_of(mesh) == pytest.approx(0.17, rel=1e-9)
    assert mesh.notes == ('panel "front": 1 of its loops are holes in it',)
    holds_its_promise(mesh)


def test_a_round_hole_keeps_its_area(tmp_path: Path) -> None:
    tree = holed()
    for edge in tree["pattern"]["panels"]["front"]["edges"][4:]:
        edge["curvature"] = {"type": "circle", "params": [5 * math.sqrt(2), 0, 1]}
    assert area_of(loaded(tree, tmp_path)) == pytest.approx(0.18 - math.pi * 0.05**2 * 2, rel=1e-6)


def test_what_sews_the_rim_of_a_hole_is_refused(tmp_path: Path) -> None:
    tree = holed()
    tree["pattern"]["stitches"][0][0]["edge"] = 5
    with pytest.raises(InputError, match='stitch 0: sews panel "front", edge 5, the rim of a hole'):
        loaded(tree, tmp_path)


def test_sides_of_two_and_three_edges_are_refused(tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["stitches"] = [[{"panel": "front", "edge": [0, 1]}, {"panel": "back", "edge": [0, 1, 2]}]]
    with pytest.raises(InputError, match="stitch 0: sews 2 edges to 3; name as many edges on either side"):
        loaded(json.loads(json.dumps(tree)), tmp_path)


def test_a_gown_wider_than_two_people_are_tall_fits_its_body() -> None:
    gown = Mesh("gown", np.array([[-2.3, 0.0, 0.0], [2.3, 0.0, 0.0], [0.0, 1.4, 0.0]]), np.array([[0, 1, 2]], np.int32))
    body = Mesh("body", np.array([[-0.4, 0.0, 0.0], [0.4, 0.0, 0.0], [0.0, 1.8, 0.0]]), np.array([[0, 1, 2]], np.int32))
    guessed = replace(body, notes=(f"{GUESS_NOTE} metres",))
    check_sizes([("garment", gown)], guessed)
    gathered = replace(gown, points=gown.points * [2.1, 1.0, 1.0])  # the lowest of five ruffled levels: 9.66 m
    check_sizes([("garment", gathered)], guessed)
    with pytest.raises(InputError, match="does not fit an avatar"):
        check_sizes([("garment", replace(gown, points=3.0 * gown.points))], guessed)
