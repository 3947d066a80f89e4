"""Any file that claims to be a pattern: a sound garment or one line, never anything else."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from fuzzing import altered, damaged, kept
from hypothesis import example, given
from hypothesis import strategies as st

from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.rest import RestOptions, build_rest_geometry, rest_in_fabric
from warp_cloth.material.fabric import Fabric
from warp_cloth.pattern import load_pattern

EDGE = 0.03  # [m]; coarse, for speed


def sound() -> dict[str, Any]:
    """A pattern with every kind of curve, a dart, a gathered seam, a tube and an edge sewn to two."""
    front = {
        "translation": [0, 0, 10],
        "rotation": [0, 0, 0],
        "vertices": [[0, 0], [16, 0], [18, 12], [20, 0], [40, 0], [40, 50], [30, 60], [10, 60], [0, 50]],
        "edges": [
            {"endpoints": [0, 1]},
            {"endpoints": [1, 2]},
            {"endpoints": [2, 3]},
            {"endpoints": [3, 4]},
            {"endpoints": [4, 5], "curvature": {"type": "quadratic", "params": [[0.5, 0.05]]}},
            {"endpoints": [5, 6], "curvature": {"type": "cubic", "params": [[0.2, 0.1], [0.7, -0.1]]}},
            {"endpoints": [6, 7], "curvature": {"type": "circle", "params": [12, 0, 0]}},
            {"endpoints": [7, 8]},
            {"endpoints": [8, 0], "curvature": [0.5, 0.05]},
        ],
    }
    back = {
        "translation": [0, 0, -10],
        "rotation": [0, 10, 0],
        "vertices": [[0, 0], [0, 50], [10, 60], [40, 50], [42, 0]],
        "edges": [{"endpoints": [i, (i + 1) % 5]} for i in range(5)],
    }
    pairs = [("f", 1, "f", 2), ("f", 4, "b", 3), ("f", 8, "b", 0), ("b", 2, "f", 5), ("b", 2, "f", 6)]
    stitches: list[Any] = [[{"panel": a, "edge": i}, {"panel": b, "edge": j}] for a, i, b, j in pairs]
    return {
        "pattern": {"panels": {"f": front, "b": back}, "stitches": stitches},
        "properties": {"units_in_meter": 100, "curvature_coords": "relative"},
    }


def holds_its_promise(mesh: Mesh) -> None:
    """Finite, without unused vertices, two triangles at most at an edge and one on either side of it, with areas."""
    assert np.isfinite(mesh.points).all()
    assert np.isfinite(mesh.texcoords).all()  # type: ignore[arg-type]
    assert np.array_equal(np.unique(mesh.triangles), np.arange(mesh.vertex_count))
    start, end = mesh.triangles.ravel().astype(np.int64), np.roll(mesh.triangles, -1, axis=1).ravel().astype(np.int64)
    assert (start != end).all()
    assert len(np.unique(start * mesh.vertex_count + end)) == len(start)
    geometry = build_rest_geometry(mesh, RestOptions("uv", is_pattern=True))
    shape = rest_in_fabric(geometry, mesh.vertex_count, Fabric())
    assert np.isfinite(shape.edge_pull).all()


def check(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "any_specification.json"
        path.write_bytes(content)
        mesh = kept(lambda: load_pattern(path, edge=EDGE))
    if mesh is not None:
        holds_its_promise(mesh)


def test_the_undamaged_pattern_is_sound() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sound_specification.json"
        path.write_text(json.dumps(sound()))
        mesh = load_pattern(path, edge=EDGE)
    assert mesh.notes == ()
    holds_its_promise(mesh)


@pytest.mark.filterwarnings("error")
@given(content=damaged(json.dumps(sound()).encode()))
def test_a_damaged_file_is_a_sound_garment_or_one_line(content: bytes) -> None:
    check(content)


@pytest.mark.filterwarnings("error")
@given(tree=altered(sound()))
def test_an_altered_pattern_is_a_sound_garment_or_one_line(tree: Any) -> None:
    check(json.dumps(tree).encode())


COORDINATE = st.one_of(st.integers(0, 40), st.floats(0, 40), st.sampled_from((1e-6, 20.0, 20.0 + 1e-6)))
RATIO = st.floats(-2, 2)
BENDS = st.one_of(
    st.none(),
    st.none(),
    st.builds(lambda x, y: {"type": "quadratic", "params": [[x, y]]}, RATIO, RATIO),
    st.builds(lambda x, y, z, w: {"type": "cubic", "params": [[x, y], [z, w]]}, RATIO, RATIO, RATIO, RATIO),
    st.builds(
        lambda r, large, right: {"type": "circle", "params": [r, large, right]},
        st.floats(1, 60),
        st.booleans(),
        st.booleans(),
    ),
)


@st.composite
def patterns(draw: st.DrawFn) -> dict[str, Any]:
    """Panels of any corners and curves, and any stitches between them."""
    panels = {}
    for name in "abc"[: draw(st.integers(1, 3))]:
        corners = draw(st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=7))
        if draw(st.integers(0, 3)):  # often enough round their middle, so that the outline does not cross itself
            middle = np.mean(corners, axis=0)
            corners.sort(key=lambda p: (np.arctan2(p[1] - middle[1], p[0] - middle[0]), p))
        count = len(corners)
        edges: list[dict[str, Any]] = [{"endpoints": [i, (i + 1) % count]} for i in range(count)]
        for edge in edges:
            bend = draw(BENDS) if not draw(st.integers(0, 3)) else None
            edge |= {} if bend is None else {"curvature": bend}
        panels[name] = {
            "vertices": [list(corner) for corner in corners],
            "edges": edges,
            "translation": [draw(st.integers(-30, 30)) for _ in range(3)],
            "rotation": [draw(st.sampled_from((0, 90, 180, 17.3))) for _ in range(3)],
        }
    places = [{"panel": name, "edge": i} for name, panel in panels.items() for i in range(len(panel["edges"]))]
    side = st.sampled_from(places)
    ends = st.lists(st.tuples(side, side), max_size=4)
    stitches = [[*pair, *(["right_wrong"] * (draw(st.integers(0, 4)) == 0))] for pair in draw(ends)]
    return {"pattern": {"panels": panels, "stitches": stitches}, "properties": {"units_in_meter": 100}}


@pytest.mark.filterwarnings("error")
@given(tree=patterns())
@example(tree={"pattern": {"panels": {"a": {"vertices": [[0, 0], [0, 0]], "edges": []}}}})
def test_any_panels_and_stitches_are_a_sound_garment_or_one_line(tree: Any) -> None:
    check(json.dumps(tree).encode())
