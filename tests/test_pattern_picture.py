"""The drawing of a pattern: true sizes, all edges, and the same curves in SVG."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image
from test_fuzz_patterns import sound
from test_pattern import panel, specification, square
from typer.testing import CliRunner

from warp_cloth.cli.main import app
from warp_cloth.export.pattern_picture import pattern_svg
from warp_cloth.pattern.garmentcode import read_specification

SVG = "{http://www.w3.org/2000/svg}"


def drawn(data: bytes) -> ElementTree.Element:
    return ElementTree.fromstring(pattern_svg(read_specification("spec.json", data)))


def test_a_square_is_drawn_in_millimetres() -> None:
    page = drawn(specification({"a": square(30.0)}, []))
    paths = [each.attrib["d"].split() for each in page.iter(f"{SVG}path")][:4]
    lengths = [np.hypot(float(d[4]) - float(d[1]), float(d[5]) - float(d[2])) for d in paths]
    np.testing.assert_allclose(lengths, 300.0, atol=0.01)
    assert page.attrib["width"] == "380.00mm"  # with a margin on either side
    assert page.attrib["viewBox"].split()[2] == "380.00"


def test_every_kind_of_curve_is_drawn_as_itself() -> None:
    page = drawn(json.dumps(sound()).encode())
    letters = [each.attrib["d"].split()[3] for each in page.iter(f"{SVG}path")]
    assert {letter: letters.count(letter) for letter in "AQC"} == {"A": 1, "Q": 2, "C": 1}


def test_an_arc_bulges_to_its_own_side() -> None:
    half = panel([[0, 0], [20, 0], [20, 10], [0, 10]])
    half["edges"][0]["curvature"] = {"type": "circle", "params": [15, 0, 1]}  # below the edge, away from the panel
    path = next(drawn(specification({"a": half}, [])).iter(f"{SVG}path")).attrib["d"].split()
    start, end, sweep = np.array(path[1:3], float), np.array(path[9:11], float), path[8]
    assert start[0] < end[0]
    assert sweep == "0"  # from left to right, SVG's sweep 0 bulges down


def test_edges_and_stitches_are_numbered_and_names_escaped() -> None:
    page = drawn(specification({'<a&"b">': square(), "c": square()}, [('<a&"b">', 1, "c", 3)]))
    texts = [each.text for each in page.iter(f"{SVG}text")]
    assert '<a&"b">' in texts
    assert texts.count("1:0") == 1
    assert texts.count("3:0") == 1
    assert texts.count("2") == 2


def test_the_command_writes_both_files(tmp_path: Path) -> None:
    path = tmp_path / "dress_specification.json"
    path.write_text(json.dumps(sound()))
    done = CliRunner().invoke(app, ["pattern", str(path), "--out", str(tmp_path / "out"), "--edge-mm", "30"])
    assert done.exit_code == 0
    assert done.stdout.startswith("dress: 2 panels, 5 seams, ")
    assert Image.open(tmp_path / "out" / "dress_pattern.png").size[0] > 500
    ElementTree.parse(tmp_path / "out" / "dress_pattern.svg")


def test_a_spoiled_pattern_leaves_nothing_behind(tmp_path: Path) -> None:
    path = tmp_path / "dress_specification.json"
    path.write_text("{}")
    done = CliRunner().invoke(app, ["pattern", str(path), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()
