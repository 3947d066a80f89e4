"""Bands of one panel that a specification places flat start as rings where they are sewn on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warp_cloth.base.mesh import Mesh
from warp_cloth.pattern import load_pattern

HALF, HIGH = 25.0, 40.0  # [cm] of a tube's width, and its height
BEFORE, BEHIND = 20.0, -18.0


def panel(vertices: list[list[float]], translation: list[float], rotation: list[float] | None = None) -> dict[str, Any]:
    edges = [{"endpoints": [n, (n + 1) % len(vertices)]} for n in range(len(vertices))]
    return {
        "vertices": vertices,
        "edges": edges,
        "translation": translation,
        "rotation": rotation or [0.0, 0.0, 0.0],
    }


def rectangle(width: float, height: float) -> list[list[float]]:
    return [[-width / 2, 0.0], [width / 2, 0.0], [width / 2, height], [-width / 2, height]]


def stitch(one: str, edge: int, other: str, its_edge: int) -> list[dict[str, Any]]:
    return [{"panel": one, "edge": edge}, {"panel": other, "edge": its_edge}]


def banded(edge: int, translation: list[float], rotation: list[float] | None = None) -> dict[str, Any]:
    """A tube of two panels, and a band of one whose ``edge`` is sewn round its top; its ends are sewn together."""
    panels = {
        "front": panel(rectangle(2 * HALF, HIGH), [0.0, 60.0, BEFORE]),
        "back": panel(rectangle(2 * HALF, HIGH), [0.0, 60.0, BEHIND]),
        "band": panel(rectangle(4 * HALF, 6.0), translation, rotation),
    }
    stitches = [stitch("front", k, "back", k) for k in (1, 3)] + [stitch("band", 1, "band", 3)]
    stitches += [stitch("band", edge, face, 2) for face in ("front", "back")]
    return {"pattern": {"panels": panels, "stitches": stitches}, "properties": {"units_in_meter": 100}}


def made(tree: dict[str, Any], folder: Path) -> Mesh:
    path = folder / "banded_specification.json"
    path.write_text(json.dumps(tree))
    return load_pattern(path, edge=0.02)


def of_band(mesh: Mesh) -> np.ndarray:
    return np.asarray(mesh.points[np.unique(mesh.triangles[mesh.panels == mesh.panel_names.index("band")])])


PLACES = {
    "in front": (0, [0.0, 100.0, 24.0], None),
    "upside down": (2, [0.0, 100.0, 24.0], None),
    "across": (0, [0.0, 100.0, 0.0], [0.0, 90.0, 0.0]),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_flat_band_starts_round_what_it_is_sewn_to(place: str, tmp_path: Path) -> None:
    mesh = made(banded(*PLACES[place]), tmp_path)
    band = of_band(mesh)
    assert [note for note in mesh.notes if "it starts as a ring" in note]
    assert band[:, 1].min() == pytest.approx(1.0)  # on the tube,
    assert band[:, 1].max() == pytest.approx(1.06)  # and as high as it is cut
    rim = band[band[:, 1] > 1.05]
    assert (rim[:, 2] > 0.19).sum() > 15  # before and behind
    assert (rim[:, 2] < -0.17).sum() > 15
    assert np.ptp(rim[:, 0]) == pytest.approx(0.5, abs=0.03)


def test_a_band_that_is_sewn_flat_stays_where_it_is_placed(tmp_path: Path) -> None:
    tree = banded(*PLACES["in front"])
    tree["pattern"]["stitches"] = [each for each in tree["pattern"]["stitches"] if each[0]["panel"] != "band"]
    tree["pattern"]["stitches"] += [stitch("band", 0, "front", 2)]
    band = of_band(made(tree, tmp_path))
    assert np.median(band[:, 2]) == pytest.approx(0.24)


def test_on_a_disc_that_lies_flat_a_band_stands_on_the_side_where_it_is_placed(tmp_path: Path) -> None:
    inner, outer = 13.0, 40.0
    slit = 1e-3  # [rad]
    corners = [[0.0, -inner], [0.0, -outer], [0.0, outer]]
    corners += [[-slit * outer, -outer], [-slit * inner, -inner], [0.0, inner]]
    skirt = panel(corners, [0.0, 100.0, 0.0], [-90.0, 0.0, 0.0])
    for edge, radius, left in ((1, outer, 1), (2, outer, 1), (4, inner, 0), (5, inner, 0)):
        skirt["edges"][edge]["curvature"] = {"type": "circle", "params": [radius, 0, left]}
    panels = {"skirt": skirt, "band": panel(rectangle(80.0, 4.0), [0.0, 103.0, 20.0])}
    stitches = [stitch("skirt", 0, "skirt", 3), stitch("band", 1, "band", 3)]
    stitches += [stitch("band", 0, "skirt", edge) for edge in (4, 5)]
    tree = {"pattern": {"panels": panels, "stitches": stitches}, "properties": {"units_in_meter": 100}}
    band = of_band(made(tree, tmp_path))
    assert (band[:, 1].min(), band[:, 1].max()) == (pytest.approx(1.0, abs=1e-3), pytest.approx(1.04, abs=1e-3))
    assert np.hypot(band[:, 0], band[:, 2]) == pytest.approx(0.13, abs=2e-3)


@pytest.mark.parametrize(("width", "kept"), [(10.0, False), (30.0, True)])
def test_a_small_panel_that_is_sewn_to_nothing_is_left_out(width: float, kept: bool, tmp_path: Path) -> None:
    tree = banded(*PLACES["in front"])
    pocket = {"pocket": panel(rectangle(width, 14.0), [0.0, 70.0, 26.0])}
    tree["pattern"]["panels"] = pocket | tree["pattern"]["panels"]
    mesh = made(tree, tmp_path)
    assert ("pocket" in mesh.panel_names) == kept
    assert bool([note for note in mesh.notes if "sewn to nothing" in note]) != kept
    assert [note for note in mesh.notes if "it starts as a ring" in note]
