"""Any scene, --set, fabric: understood, or refused with one line; and what is understood fits to finite numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from fuzzing import NUMBERS, altered, damaged, kept
from hypothesis import assume, event, example, given
from hypothesis import strategies as st
from meshfiles import ball, sheet, write_obj
from typer.testing import CliRunner

from warp_cloth.base.mesh import Mesh
from warp_cloth.cli.main import app
from warp_cloth.export import save, stage
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import BOUNDS, Fabric, resolve_fabric
from warp_cloth.material.laboratory import KEYS as LABORATORY
from warp_cloth.scene import Scene, load_scene

SCENE = """
name = "one"
[[garment]]
mesh = "sheet.obj"
units = "m"
rest = "mesh"
fabric = {name = "jersey", weight = 0.2, bending = 1e-6}
grain_degrees = 10
pin = [{vertices = [0, 1]}, {box = [[-1, 0, -1], [1, 3, 1]]}, {loop = "top"}]
[[garment]]
shape = {kind = "square", side = 0.5, vertices_per_side = 5, plane = "vertical", height = 1.5}
fabric = "denim.toml"
[avatar]
mesh = "ball.obj"
friction = 0.5
[collision]
avatar = "depth"
pixel_mm = 20
offset_mm = 3
[solver]
method = "accelerated"
iterations = 20
tolerance_mm = 1.0
residual = 0.01
residual_p99 = 0.05
precision = "mixed"
cap = 1e-3
"""
TREE: dict[str, Any] = {
    "name": "one",
    "garment": [
        {
            "shape": {"kind": "square", "side": 0.5, "vertices_per_side": 4, "plane": "vertical", "height": 1.5},
            "fabric": {"name": "jersey", "weight": 0.2, "bending": 1e-6},
            "grain_degrees": 10,
            "pin": [{"vertices": [0, 1]}, {"box": [[-1, 1.4, -1], [1, 2, 1]]}],
        }
    ],
    "avatar": {"shape": {"kind": "sphere", "radius": 0.2, "centre": [0, 1.2, -0.3], "edge_mm": 100}, "friction": 0.5},
    "collision": {"avatar": "depth", "pixel_mm": 20, "offset_mm": 3},
    "solver": {"method": "accelerated", "iterations": 20, "precision": "mixed", "cap": 1e-3},
}
FABRIC = """
base = "jersey"
weight_gsm = 160
emt_warp_percent = 16
emt_weft_percent = 30
shear_G = 0.6
bending_B_warp = 0.02
bending_length_weft_mm = 12
thickness_mm = 0.7
friction = 0.35
source = "nowhere"
"""
MOST_VERTICES = 12  # a side of a square, and edges of 5 cm on a sphere: larger ones are slow, not strange
PATHS = ("garment", "garment.fabric", "garment.shape", "garment.pin", "garment[0]", "garment[1]", "garment[0].pin[0]",
         "avatar", "avatar.shape", "collision", "solver", "")  # fmt: skip
NAMES = ("mesh", "shape", "kind", "prim", "units", "rest", "uv_units", "fabric", "grain_degrees", "grain_panels.sleeve",
         "grain_texture", "pin", "vertices", "box", "loop", "friction", "avatar", "pixel_mm", "offset_mm", "cloth",
         "method", "iterations", "tolerance_mm", "residual", "precision", "cap", "name", "weight", "stretch", "shear",
         "emt_percent", "side", "vertices_per_side", "radius", "centre", "garment", "")  # fmt: skip
VALUES = (*NUMBERS, "denim", "depth", "mesh", "uv", "[]", "{}", "[1, 2]", "[[0,0,0],[1,1,1]]", '"a"', "{kind='square'}",
          "{kind='sphere'}", "{vertices=[0]}", "[{}]", "1979-05-27", "0.5", "inf", "-nan", "'x'\n[solver]")  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def place() -> Iterator[Path]:
    """A folder with what the scenes name, and the current one."""
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        folder = Path(name)
        write_obj(folder / "sheet.obj", *sheet())
        write_obj(folder / "ball.obj", *ball())
        (folder / "denim.toml").write_text(FABRIC)
        patch.chdir(folder)
        for module, name in ((save, "write_preview"), (stage, "write_stage")):  # which take most of the time
            patch.setattr(module, name, lambda path, *_, **__: path.touch())
        yield folder


def is_resolved(scene: Scene) -> None:
    """Every number of a scene is finite, and the scene can be written down."""
    assert len(scene.garments) >= 1
    json.dumps(scene.settings(), allow_nan=False)


@pytest.mark.filterwarnings("error")
@given(content=damaged(SCENE.encode()))
def test_a_damaged_scene_file_is_a_scene_or_one_line(place: Path, content: bytes) -> None:
    (place / "scene.toml").write_bytes(content)
    scene = kept(lambda: load_scene("scene.toml"))
    if scene is not None:
        is_resolved(scene)


@pytest.mark.filterwarnings("error")
@given(tree=altered(TREE))
def test_an_altered_scene_is_a_scene_or_one_line(tree: dict[str, Any]) -> None:
    scene = kept(lambda: load_scene(tree))
    if scene is not None:
        is_resolved(scene)


KEYS = st.builds(lambda path, name: f"{path}.{name}".strip("."), st.sampled_from(PATHS), st.sampled_from(NAMES))
OVERRIDES = st.one_of(
    st.builds(lambda key, value: f"{key}={value}", KEYS, st.sampled_from(VALUES) | st.text(max_size=8)),
    st.text(max_size=12),
    st.builds(lambda key, value: f"{key}={value}", st.text(max_size=6), st.sampled_from(VALUES)),
)


@pytest.mark.filterwarnings("error")
@given(overrides=st.lists(OVERRIDES, min_size=1, max_size=3), several=st.booleans())
def test_any_set_is_a_scene_or_one_line(place: Path, overrides: list[str], several: bool) -> None:
    (place / "sound.toml").write_text(SCENE)
    source: Any = "sound.toml" if several else TREE
    scene = kept(lambda: load_scene(source, overrides))
    if scene is not None:
        is_resolved(scene)


def is_within_bounds(fabric: Fabric) -> None:
    for key, (low, high) in BOUNDS.items():
        value = getattr(fabric, key)
        assert (key == "shear" and value is None) or low <= value <= high, key


@pytest.mark.filterwarnings("error")
@given(content=damaged(FABRIC.encode()))
def test_a_damaged_fabric_file_is_a_fabric_or_one_line(place: Path, content: bytes) -> None:
    (place / "fabric.toml").write_bytes(content)
    fabric = kept(lambda: resolve_fabric("fabric.toml", place))
    if fabric is not None:
        is_within_bounds(fabric)


FABRIC_VALUES = st.one_of(
    st.floats(),
    st.floats(1e-9, 1e9),
    st.integers(),
    st.booleans(),
    st.text(max_size=4),
    st.lists(st.lists(st.floats(), max_size=3), max_size=3),
    st.none(),
)


@pytest.mark.filterwarnings("error")
@given(
    table=st.dictionaries(
        st.sampled_from((*asdict(Fabric()), *LABORATORY, "base")) | st.text(max_size=4), FABRIC_VALUES, max_size=5
    )
)
def test_any_fabric_table_is_a_fabric_or_one_line(table: Mapping[str, Any]) -> None:
    fabric = kept(lambda: resolve_fabric(table))
    if fabric is not None:
        is_within_bounds(fabric)


def is_small(tree: Any) -> bool:
    """Whether a scene's meshes are small enough to be fitted thousands of times."""
    scene = kept(lambda: load_scene(deepcopy(tree)))
    if scene is None:
        return True
    squares = all(g.shape is None or g.shape.kind == "square" for g in scene.garments)
    few = squares and all(g.shape is None or g.shape.vertices_per_side <= MOST_VERTICES for g in scene.garments)
    body = scene.avatar.shape if scene.avatar is not None else None
    coarse = body is None or (body.kind == "sphere" and body.edge_mm * 1e-3 > 0.2 * body.radius)
    drawn = scene.collision.avatar != "depth" or (scene.collision.pixel_mm >= 10 and (body is None or body.radius < 1))
    return few and coarse and drawn and scene.solver.iterations <= 20


def figures(value: Any) -> Iterator[float]:
    """Every number in a report."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list):
        for entry in value:
            yield from figures(entry)
    elif isinstance(value, int | float):
        yield value


def toml(value: Any) -> str:
    """A value as TOML writes it; what TOML has no word for ends as something that is refused."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(key))} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(inner) for inner in value) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


def fitted(folder: Path, tree: Mapping[str, Any]) -> dict[str, Any] | None:
    """The report of a fit through the command line; None if it is refused, as it must be: one line, nothing left."""
    (folder / "scene.toml").write_text("".join(f"{key} = {toml(value)}\n" for key, value in tree.items()))
    before = sorted(folder.rglob("*"))
    out = folder / "new" / "out"
    result = CliRunner().invoke(app, ["fit", str(folder / "scene.toml"), "--device", "cpu", "--out", str(out)])
    assert result.exit_code in (0, 2, 3), result.exception
    assert result.exception is None or isinstance(result.exception, SystemExit)
    if result.exit_code == 2:
        assert len([line for line in result.stderr.splitlines() if line.startswith("error: ")]) == 1
        assert sorted(folder.rglob("*")) == before
        return None
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    assert all(math.isfinite(number) for number in figures(report))
    assert report["status"] in ("at_rest", "iteration_limit", "diverged", "invalid")
    assert len(report["message"]) > 10
    assert report["worn"] == (result.exit_code == 0)
    assert report["worn"] or [problem for problem in report["problems"] if not problem["note"]]
    return report


@given(tree=altered(TREE))
@example(tree=TREE)
def test_an_altered_scene_fits_to_finite_numbers_or_leaves_nothing(place: Path, tree: dict[str, Any]) -> None:
    assume(is_small(tree))
    with TemporaryDirectory(dir=place) as folder:
        report = fitted(Path(folder), tree)
    event("refused" if report is None else report["status"])


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers of any size between two, and the two."""
    least = max(low, high * 1e-15)
    powers = st.floats(math.log(least), math.log(high)).map(lambda power: min(max(math.exp(power), low), high))
    return powers | st.sampled_from((low, high))


FABRICS = st.fixed_dictionaries(
    {key: between(*bounds) for key, bounds in BOUNDS.items() if key != "shear"},
    optional={"shear": between(*BOUNDS["shear"])},
)


@pytest.mark.filterwarnings("error")
@given(fabric=FABRICS, size=between(1e-3, 1e3), thinness=between(1e-5, 1.0))
def test_any_fabric_gives_finite_constants_or_one_line(fabric: dict[str, float], size: float, thinness: float) -> None:
    points, triangles = sheet(4)
    mesh = Mesh("sheet", points * [size, size * thinness, size], triangles.astype(np.int32))
    shape = kept(lambda: build_rest_shape(mesh, resolve_fabric(fabric), rest="mesh"))
    if shape is not None:
        yarns = (shape.yarns.slope, shape.yarns.packed) if shape.yarns is not None else ()
        constants = (shape.edge_length, shape.edge_pull, shape.edge_push, shape.hinge_stiffness, shape.vertex_weight)
        assert all(np.isfinite(values).all() for values in (*constants, *yarns))


SOLVERS = st.fixed_dictionaries(
    {
        "method": st.sampled_from(("multilevel", "accelerated", "direct")),
        "precision": st.sampled_from(("mixed", "float32", "float64")),
        "iterations": st.integers(0, 200),
    },
    optional={"cap": between(1e-7, 1.0)},
)


@given(
    fabric=FABRICS,
    solver=SOLVERS,
    side=between(1e-3, 100.0),
    friction=between(0.0, 10.0),
    height=st.floats(-1e6, 1e6) | st.just(1.5),
    avatar=st.sampled_from(("depth", "mesh", "none")),
)
def test_any_fabric_size_and_step_fits_to_finite_numbers(
    place: Path,
    fabric: dict[str, float],
    solver: dict[str, Any],
    side: float,
    friction: float,
    height: float,
    avatar: str,
) -> None:
    shape = {"kind": "square", "side": side, "vertices_per_side": 4, "plane": "vertical", "height": height}
    body = {"kind": "sphere", "radius": side, "centre": [0.0, height, -0.5 * side], "edge_mm": max(400.0 * side, 1.0)}
    tree = {
        "garment": {"shape": shape, "fabric": fabric, "pin": {"vertices": [0]}},
        "avatar": {"shape": body, "friction": friction},
        "collision": {"avatar": avatar, "pixel_mm": min(max(100.0 * side, 0.2), 50.0)},
        "solver": solver,
    }
    with TemporaryDirectory(dir=place) as folder:
        report = fitted(Path(folder), tree)
    event("refused" if report is None else report["status"])
