"""Spoiled patterns: one line that names file, panel and edge, or a repair that is told."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal
from test_pattern import BACK, FRONT, panel, square, stitch_of, topology

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.pattern import load_pattern
from warp_cloth.pattern.garmentcode import read_specification
from warp_cloth.scene import load_scene

Spoil = Callable[[dict[str, Any]], None]


def tube() -> dict[str, Any]:
    """A sound tube of two panels."""
    stitches = [stitch_of(("front", 1, "back", 2)), stitch_of(("front", 3, "back", 0))]
    panels = json.loads(json.dumps({"front": FRONT, "back": BACK}))
    return {"pattern": {"panels": panels, "stitches": stitches}, "properties": {"units_in_meter": 100}}


def loaded(tree: Any, folder: Path) -> Mesh:
    path = folder / "tube_specification.json"
    path.write_text(tree if isinstance(tree, str) else json.dumps(tree))
    return load_pattern(path, edge=0.015)


def front(**values: Any) -> Spoil:
    return lambda tree: tree["pattern"]["panels"]["front"].update(values)


def edge(number: int, **values: Any) -> Spoil:
    return lambda tree: tree["pattern"]["panels"]["front"]["edges"][number].update(values)


def sew(*stitches: Any) -> Spoil:
    return lambda tree: tree["pattern"].update(stitches=[stitch_of(stitch) for stitch in stitches])


def circle(*params: Any) -> Spoil:
    return edge(1, curvature={"type": "circle", "params": list(params)})


def many_panels(tree: dict[str, Any]) -> None:
    tree["pattern"]["panels"] = {str(i): {} for i in range(100_000)}


def cyclic(tree: dict[str, Any]) -> None:
    tree["pattern"]["panels"] |= {"third": square(translation=[40, 0, 0]), "fourth": square(translation=[40, 0, 9])}
    sew(("front", 1, "back", 2), ("back", 2, "third", 3), ("third", 3, "fourth", 1), ("fourth", 1, "front", 1))(tree)


def crossed(tree: dict[str, Any]) -> None:
    front(vertices=[[0, 0], [30, 30], [30, 0], [0, 31]])(tree)
    sew()(tree)


REFUSED: dict[str, tuple[Spoil, str]] = {
    "no pattern": (lambda tree: tree.pop("pattern"), 'is not a GarmentCode specification: it has no "pattern"'),
    "no panels": (lambda tree: tree["pattern"].update(panels={}), "pattern.panels: there are no panels"),
    "a panel missing": (
        lambda tree: tree["pattern"]["panels"].pop("back"),
        'stitch 0: panel "back" is not in the pattern; add the panel, or remove the stitch',
    ),
    "an edge that is not there": (
        sew(("front", 1, "back", 7)),
        'stitch 0: panel "back" has no edge 7; its edges are 0 to 3',
    ),
    "a negative edge": (sew(("front", -1, "back", 2)), 'panel "front" has no edge -1'),
    "a huge edge": (sew(("front", 10**30, "back", 2)), 'panel "front" has no edge'),
    "NaN": (front(vertices=[[0, 0], [float("nan"), 0], [30, 30]]), 'panel "front": vertices: nan is not a usable'),
    "1e300": (front(translation=[1e300, 0, 0]), 'panel "front": translation: 1e+300 is not a usable number'),
    "an endless number": (front(translation=[10**400, 0, 0]), 'panel "front": translation: inf is not a usable number'),
    "text for a number": (front(rotation=["x", 0, 0]), "panel \"front\": rotation: 'x' is not a number"),
    "a vertex that is not there": (edge(2, endpoints=[2, 9]), 'panel "front", edge 2: ends at vertex 9, but'),
    "an open outline": (edge(2, endpoints=[2, 0]), 'panel "front", edge 3: starts at vertex 3, but edge 2 ends at'),
    "an outline that crosses itself": (
        crossed,
        'panel "front", edges 0 and 2: the outline crosses or touches itself',
    ),
    "no area": (front(vertices=[[0, 0], [10, 0], [20, 0], [30, 0]]), 'panel "front": has no area'),
    "units of 1": (
        lambda tree: tree["properties"].update(units_in_meter=1),
        'panel "front": is 30 m across, as units_in_meter = 1; a panel is 5 mm to 20 m; 100 means centimetres',
    ),
    "units of 0": (lambda tree: tree["properties"].update(units_in_meter=0), "0 is not a unit of length"),
    "100,000 panels": (many_panels, "pattern.panels: 100,000 panels are more than the 1,000 that a garment may have"),
    "cyclic stitches": (cyclic, "are each sewn to several edges"),
    "an edge sewn to itself and to another": (
        sew(("front", 1, "front", 1), ("front", 1, "back", 2)),
        "is sewn to itself and to others",
    ),
    "three sheets at a seam": (
        sew(("front", 1, "back", 2), ("front", 1, "back", 0)),
        'stitches 0, 1: panel "front", edge 1 is sewn to 2 edges that do not follow each other in one panel',
    ),
    "a circle without a radius": (circle(0, 0, 0), "a circle's radius of 0 mm is impossible"),
    "an unknown curve": (edge(1, curvature={"type": "spline", "params": []}), "curvature of type 'spline' is unknown"),
    "too few handles": (edge(1, curvature={"type": "cubic", "params": [[0, 0]]}), "a cubic curve has 2 control"),
    "far handles": (edge(1, curvature=[1e6, 0]), 'panel "front", edge 1: has control points far from the panel'),
    "a name that is no text": (
        lambda tree: tree["pattern"]["panels"].update({"\ud800": square()}),
        "its name is empty or no valid text",
    ),
    "a stitch of one": (lambda tree: tree["pattern"].update(stitches=[[{}]]), "stitch 0: is not a pair of edges"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_spoiled_pattern_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    spoil, said = REFUSED[name]
    tree = tube()
    spoil(tree)
    line = str(refusal(loaded, tree, tmp_path))
    assert line.startswith(f"{tmp_path / 'tube_specification.json'}: ")
    assert said in line


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("{", "is not JSON"),
        ("[" * 100_000, "cannot be read as JSON"),
        ('{"pattern": {"panels": {"a": {}, "a": {}}}}', '"a" is stated twice in one table'),
        ("3", "is not a GarmentCode specification"),
        ('{"pattern": {"panels": ' + "9" * 5000 + "}}", "cannot be read as JSON"),
    ],
)
def test_a_file_that_is_none_is_refused_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        loaded(text, tmp_path)


def test_a_missing_file_is_refused_with_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "shirt_specification.json").write_text("{}")
    with pytest.raises(InputError, match=r"no such file; did you mean shirt_specification\.json"):
        load_pattern(tmp_path / "shirts_specification.json", edge=0.015)


def test_an_edge_without_length_is_dropped_and_told(tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["panels"]["front"] = panel([[0, 0], [30, 0], [30, 30], [0, 30], [0, 1e-6]], translation=[0, 0, 10])
    mesh = loaded(tree, tmp_path)
    assert topology(mesh) == (2, 0)
    assert mesh.notes == ('panel "front", edge 4 has no length (under 0.01 mm): dropped',)


@pytest.mark.parametrize("gap", [0.03, 0.2])
def test_a_short_edge_that_is_not_sewn_is_dropped_and_the_seams_keep_their_lengths(tmp_path: Path, gap: float) -> None:
    """The side seams of a skirt that end 0.3 mm above its hem."""
    tree = tube()
    front = panel([[0, 0], [30, 0], [30, gap], [30, 30], [0, 30], [0, gap]], translation=[0, 0, 10])
    tree["pattern"]["panels"]["front"] = front
    tree["pattern"]["stitches"] = []
    sew(("front", 2, "back", 2), ("front", 4, "back", 0))(tree)
    path = tmp_path / "skirt_specification.json"
    path.write_text(json.dumps(tree))
    pattern = read_specification(str(path), path.read_bytes())
    front_side = pattern.panels[0].edges[pattern.stitches[0].sides[0].edge].curve
    assert front_side.length == pytest.approx(0.3 - 0.01 * gap)
    assert len(pattern.panels[0].edges) == (4 if gap < 0.1 else 6)
    mesh = load_pattern(path, edge=0.03)
    assert topology(mesh) == (2, 0)
    told = [f'panel "front", edge {edge} is 0.3 mm long and not sewn: dropped' for edge in (1, 5)]
    assert list(mesh.notes) == (told if gap < 0.1 else [])


def test_an_edge_without_length_that_is_sewn_is_refused(tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["panels"]["front"] = panel([[0, 0], [30, 0], [30, 30], [0, 30], [0, 1e-6]])
    sew(("front", 4, "back", 2))(tree)
    with pytest.raises(InputError, match='stitch 0: sews panel "front", edge 4, which has no length'):
        loaded(tree, tmp_path)


def test_a_radius_that_is_too_short_is_half_a_circle_and_told(tmp_path: Path) -> None:
    tree = tube()
    circle(10, 0, 1)(tree)
    assert "half a circle instead" in loaded(tree, tmp_path).notes[0]


def test_a_stitch_that_is_stated_twice_is_dropped_and_told(tmp_path: Path) -> None:
    tree = tube()
    sew(("front", 1, "back", 2), ("front", 3, "back", 0), ("back", 2, "front", 1))(tree)
    mesh = loaded(tree, tmp_path)
    assert topology(mesh) == (2, 0)
    assert mesh.notes == ("stitch 2 sews the same edges as stitch 0: dropped",)


def test_units_and_placement_that_are_not_stated_are_told(tmp_path: Path) -> None:
    tree = tube()
    del tree["properties"]
    del tree["pattern"]["panels"]["back"]["translation"]
    notes = loaded(tree, tmp_path).notes
    assert notes[0] == "units_in_meter not stated: centimetres assumed, as GarmentCode's"
    assert notes[1] == 'panel "back" has no translation and starts at the origin'


@pytest.mark.parametrize(("unit", "per_cm"), [("millimetres", 10.0), ("metres", 0.01)])
@pytest.mark.parametrize("properties", [None, {"units_in_meter": None}])
def test_a_unit_that_is_not_stated_is_found_by_the_size(
    unit: str, per_cm: float, properties: object, tmp_path: Path
) -> None:
    """Millimetres were meshed ten times too large; metres refused, as panels of 5 mm."""
    stated, tree = loaded(tube(), tmp_path), tube()
    for drawn in tree["pattern"]["panels"].values():
        for key in ("vertices", "translation"):
            drawn[key] = (per_cm * np.array(drawn[key])).tolist()
    tree["properties"] = properties
    found = loaded(tree, tmp_path)
    np.testing.assert_allclose(found.points, stated.points, atol=1e-9)
    assert found.notes[0] == f"units_in_meter not stated: {unit} assumed, as its panels are then some 0.30 m long"


@pytest.mark.parametrize("empty", [None, {}, {"vertices": [], "edges": [], "translation": [0, 0, 0]}])
def test_an_empty_panel_is_left_out_and_told(empty: object, tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["panels"]["ghost"] = empty
    assert loaded(tree, tmp_path).notes == ('panel "ghost" is empty: left out',)


def test_an_edge_from_a_vertex_to_itself_is_dropped_and_told(tmp_path: Path) -> None:
    tree = tube()
    tree["pattern"]["panels"]["front"]["edges"].append({"endpoints": [0, 0]})
    assert loaded(tree, tmp_path).notes == ('panel "front", edge 4 starts and ends at one vertex: dropped',)


def test_one_specification_in_a_list_is_read_and_several_are_refused(tmp_path: Path) -> None:
    assert loaded([tube()], tmp_path).notes == ("is a list of one specification: that one is read",)
    with pytest.raises(InputError, match="is a list of 2 tables, not one specification; write a file for each"):
        loaded([tube(), tube()], tmp_path)


def test_a_pattern_given_as_a_scene_says_what_to_write(tmp_path: Path) -> None:
    path = tmp_path / "tube_specification.json"
    path.write_text(json.dumps(tube()))
    with pytest.raises(InputError, match="if it is a pattern, say what it is worn on"):
        load_scene(path)
