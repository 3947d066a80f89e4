"""A garment's mesh on a body's without a scene file: fit --on, init, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cloths import tube
from meshfiles import ball, sheet, write_obj
from typer.testing import CliRunner, Result

from warp_cloth.base.errors import InputError
from warp_cloth.cli.main import app
from warp_cloth.fitting.fit import fit
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.loading import load_mesh
from warp_cloth.loading.obj import obj_mesh_names
from warp_cloth.maps.measure import MeasuredBody
from warp_cloth.scene import MannequinShape, load_scene
from warp_cloth.shapes import MannequinMeasures, mannequin


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Current folder with a sheet of cloth over a ball."""
    points, faces = sheet(count=9, side=0.8)
    write_obj(tmp_path / "cloth.obj", points[:, [0, 2, 1]] * [1.0, 1.0, -1.0] + [0.0, 1.3, 1.4], faces)
    points, faces = ball()
    write_obj(tmp_path / "ball.obj", points, faces)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


def refused(*arguments: str) -> str:
    result = call(*arguments)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    return result.stderr.strip().removeprefix("error: ")


def test_two_meshes_are_a_scene(folder: Path) -> None:
    scene = load_scene("cloth.obj", {"avatar.friction": np.float64(0.2)}, on=Path("ball.obj"), fabric="silk")
    assert (scene.name, scene.garments[0].mesh, scene.garments[0].fabric.name) == ("cloth", Path("cloth.obj"), "silk")
    assert (scene.avatar.mesh, scene.avatar.friction) == (Path("ball.obj"), 0.2)


def test_the_shipped_body_needs_no_file(folder: Path) -> None:
    scene = load_scene(folder / "cloth.obj", on="mannequin")
    assert isinstance(scene.avatar.shape, MannequinShape)


def test_a_scene_is_worn_by_another_body_in_another_fabric(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files that were typed are found from the current folder, whatever folder the scene is in."""
    (folder / "there").mkdir()
    (folder / "silk").touch()  # no file can stand for a shipped fabric
    avatar = 'mesh = "thin.obj"\nunits = "cm"\nfriction = 0.3\n'
    (folder / "there/scene.toml").write_text(f'[[garment]]\nshape = {{kind = "square"}}\n[avatar]\n{avatar}')
    scene = load_scene("there/scene.toml", {"garment.name": "towel"}, on="ball.obj", fabric="silk")
    (garment,), body = scene.garments, scene.avatar
    assert (garment.fabric.name, garment.name, body.friction, body.units) == ("silk", "towel", 0.3, None)
    assert body.mesh == folder / "ball.obj"
    shipped = load_scene("tshirt", on="ball.obj").avatar
    assert (shipped.mesh, shipped.shape) == (folder / "ball.obj", None)


@pytest.mark.parametrize(
    "override",
    ["avatar.mesh=ball.obj", 'avatar={mesh="ball.obj"}', {"avatar.mesh": "ball.obj"}, {"avatar": {"mesh": "ball.obj"}}],
)
def test_files_of_overrides_are_found_from_the_current_folder(folder: Path, override: Any) -> None:
    avatar = load_scene("tshirt", [override] if isinstance(override, str) else override).avatar
    assert avatar.mesh == folder / "ball.obj"
    (garment,) = load_scene("tshirt", ['garment=[{mesh="cloth.obj"}]']).garments
    assert garment.mesh == folder / "cloth.obj"


def test_it_is_the_fit_of_the_scene_that_init_writes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "there").mkdir()
    result = call("init", "cloth.obj", "--on", "ball.obj", "--fabric", "silk", "--out", "there/scene.toml")
    assert result.exit_code == 0, result.output
    few = ["solver.iterations=20"]
    direct = fit("cloth.obj", on="ball.obj", fabric="silk", overrides=few, device="cpu")
    monkeypatch.chdir("/")
    assert np.array_equal(fit(folder / "there/scene.toml", overrides=few, device="cpu").garments[0].points,
                          direct.garments[0].points)  # fmt: skip


def test_init_writes_what_was_guessed_and_overwrites_nothing(folder: Path) -> None:
    assert call("init", "cloth.obj", "--on", "mannequin").exit_code == 0
    text = (folder / "cloth.toml").read_text()
    assert "# units not stated: metres assumed" in text
    assert 'units = "m"' in text
    assert 'shape = {kind = "mannequin"}' in text
    assert load_scene("cloth.toml").garments[0].units == "m"
    assert "is there already" in refused("init", "cloth.obj", "--on", "ball.obj")
    assert (folder / "cloth.toml").read_text() == text


def test_what_init_comments_out_is_valid(folder: Path) -> None:
    """Every example in the file can be used by removing its #."""
    call("init", "cloth.obj", "--on", "mannequin")
    lines = (folder / "cloth.toml").read_text().splitlines()
    keys = [line.removeprefix("# ") for line in lines[4:] if line.startswith("# ") and " = " in line]
    assert len(keys) >= 10
    named = {key.partition(" = ")[0] for key in keys}
    plain = [line for line in lines[4:] if not line.startswith("#") and line.partition(" = ")[0] not in named]
    at = {"[garment]": keys[:5], "[avatar]": keys[5:7], "[collision]": keys[7:9], "[solver]": keys[9:]}
    (folder / "all.toml").write_text("\n".join(part for line in plain for part in (line, *at.get(line, ()))))
    scene = load_scene("all.toml")
    assert (scene.garments[0].fabric.weight, scene.garments[0].scale, scene.solver.tolerance_mm) == (0.2, 1.0, 1.0)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["cloth.obj"], "cloth.obj: is a mesh, not a scene; say what it is worn on: --on BODY.obj or --on mannequin"),
        (["clot.obj"], "clot.obj: no such file; did you mean cloth.obj?"),
        (["clot.obj", "--on", "ball.obj"], "clot.obj: no such file; did you mean cloth.obj?"),
        (["cloth.obj", "--on", "bal.obj"], "bal.obj: no such file; did you mean ball.obj?"),
        (["cloth.obj", "--on", "manequin"], "manequin: no such file; did you mean mannequin?"),
        (["cloth.obj", "--on", "tshirt"], "tshirt: no such file; check the path or give mannequin"),
        (["tshirt", "--frames", "-1"], "--frames: must be an integer from 0 to 10000, not -1"),
        ([".", "--on", "ball.obj"], ".: is a folder; name a mesh file in it"),
        (["a.csv", "--on", "ball.obj"], "a.csv: no such file; check the path"),
        (["cloth.obj", "--on", "a.toml"], "--on: a.toml is a scene, not a body; give a body's mesh file"),
        (["cloth.obj", "--on", "cloth.obj"], "--on: cloth.obj is the garment, too; give the body's mesh file"),
        (["tshirt", "--on", "bal.obj"], "bal.obj: no such file; did you mean ball.obj?"),
        (["tshirt", "--fabric", "slik"], '--fabric: unknown fabric "slik"; did you mean "silk"'),
        (["cloth.obj", "--on", "ball.obj", "--fabric", "slik"], '--fabric: unknown fabric "slik"; did you mean "silk"'),
        (["tshirt", "--set", "garment.fabrik=silk"], "--set garment.fabrik=silk: unknown key garment.fabrik; did you"),
    ],
)
def test_mistakes_are_one_line(folder: Path, arguments: list[str], line: str) -> None:
    assert refused("fit", *arguments).startswith(line)
    assert not (folder / "out").exists()


@pytest.mark.parametrize("command", ["fit", "plan", "tradeoff", "view"])
def test_every_command_says_its_own_option(folder: Path, command: str) -> None:
    assert refused(command, "cloth.obj").endswith("say what it is worn on: --on BODY.obj or --on mannequin")


def test_a_mesh_is_no_pattern(folder: Path) -> None:
    assert refused("pattern", "cloth.obj").startswith("cloth.obj: is a mesh, not a sewing pattern; fit it: warp-cloth")


def test_overrides_may_be_a_dictionary_of_values() -> None:
    scene = load_scene("tshirt", {"garment": {"fabric": "denim"}, "garment.name": "5", "solver.iterations": 7})
    assert (scene.garments[0].fabric.name, scene.garments[0].name, scene.solver.iterations) == ("denim", "5", 7)
    with pytest.raises(InputError, match=r"^override garment\.shape\.size=XL: must be one of"):
        load_scene("tshirt", {"garment.shape.size": "XL"})


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_body_as_the_garment_is_told(folder: Path, exchanged: bool) -> None:
    body = mannequin(MannequinMeasures())
    write_obj(folder / "body.obj", body.points, body.triangles)
    avatar = "cloth.obj" if exchanged else "mannequin"
    with pytest.raises(InputError, match='exchange it and "cloth"' if exchanged else "give the mesh of the garment"):
        load_outfit(load_scene("body.obj", on=avatar))


@pytest.fixture
def scan(folder: Path) -> Path:
    """A body with eight holes, one of them below an armpit."""
    body = mannequin(MannequinMeasures())
    middles = body.points[body.triangles].mean(axis=1)
    holes = [np.linalg.norm(middles - point, axis=1) < 0.03 for point in body.points[:: len(body.points) // 8]]
    write_obj(folder / "scan.obj", body.points, body.triangles[~np.any(holes, axis=0)])
    return folder / "scan.obj"


def test_a_scan_with_holes_as_the_garment_is_told(scan: Path) -> None:
    with pytest.raises(InputError, match=r'"scan" is a body: .*; exchange it and "cloth", which is open'):
        load_outfit(load_scene("scan.obj", on="cloth.obj"))


def test_a_body_beside_the_garment_is_told(folder: Path) -> None:
    """Programs export both as one file; before, both were cloth, and the fit went on for minutes."""
    points, triangles = sheet(height=1.0, toward=0.4)
    body = mannequin(MannequinMeasures())
    soles = body.points[body.triangles].max(axis=1)[:, 1] < 0.02  # not scanned
    faces = np.concatenate([triangles, body.triangles[~soles] + len(points)])
    write_obj(folder / "both.obj", np.concatenate([points, body.points]), faces)
    with pytest.raises(InputError, match=r'"both" holds a body, too: .*; export the garment alone, or'):
        load_outfit(load_scene("both.obj", on="mannequin", overrides={"garment.units": "m"}))


def test_a_scan_measures_the_same_in_a_fit_and_by_itself(scan: Path) -> None:
    outfit = load_outfit(load_scene("cloth.obj", on="scan.obj", overrides={"avatar.units": "m"}))
    assert outfit.avatar is not None
    trunk = MeasuredBody.of(outfit.avatar).trunk
    assert trunk is not None
    fitted = {around.level.name: around.level.girth for around in trunk.named}
    assert call("avatar", "scan.obj", "--measures").exit_code == 0
    alone = json.loads(Path("out/scan_body.json").read_text())["measures_m"]
    for name in ("chest", "waist", "hip"):
        assert alone[name] == pytest.approx(fitted[name], abs=1e-3)


def outfit_file(path: Path, *parts: tuple[np.ndarray, np.ndarray]) -> Path:
    """A file of any format that names meshes, with a mesh "part0", "part1" ... for each."""
    if path.suffix == ".obj":
        lines, first = [], 1
        for number, (points, faces) in enumerate(parts):
            lines += [f"o part{number}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist())]
            lines += [f"f {a} {b} {c}" for a, b, c in (faces + first).tolist()]
            first += len(points)
        path.write_text("\n".join(lines) + "\n")
    elif path.suffix == ".usda":
        meshes = [
            f'def Mesh "part{number}" {{\n'
            f"point3f[] points = {list(map(tuple, points.tolist()))}"
            f"\nint[] faceVertexCounts = {[3] * len(faces)}\nint[] faceVertexIndices = {faces.ravel().tolist()}\n}}"
            for number, (points, faces) in enumerate(parts)
        ]
        path.write_text("\n".join(['#usda 1.0\n(metersPerUnit = 1\nupAxis = "Y")', *meshes]))
    else:
        scene = trimesh.Scene()
        for number, (points, faces) in enumerate(parts):
            mesh = trimesh.Trimesh(points, faces, process=False)
            scene.add_geometry(mesh, node_name=f"part{number}", geom_name=f"part{number}")
        scene.export(path)
    return path


def tube_of(radius: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    mesh = tube(radius, low, high, around=24, rows=4)
    return mesh.points, mesh.triangles


def prims_of(path: Path, **options: Any) -> list[str | None]:
    return [each.prim for each in load_scene(path, on="mannequin", **options).garments]


@pytest.mark.parametrize("kind", ["glb", "obj", "usda"])
def test_an_outfit_in_one_file_is_several_garments(tmp_path: Path, kind: str) -> None:
    top, skirt = tube_of(0.25, 0.95, 1.3), tube_of(0.27, 0.4, 1.0)
    path = outfit_file(tmp_path / f"outfit.{kind}", top, skirt)
    scene = load_scene(path, on="mannequin", fabric="denim")
    assert [(each.name, each.prim.strip("/"), each.fabric.name) for each in scene.garments] == [
        ("part0", "part0", "denim"),
        ("part1", "part1", "denim"),
    ]
    meshes = load_outfit(scene, divides=False).meshes
    assert all(np.allclose(mesh.points, each) for mesh, (each, _) in zip(meshes, (top, skirt), strict=True))
    assert len(meshes[1].panel_names) < 2  # of its own alone
    chosen = scene.garments[1].prim
    assert prims_of(path, overrides=[f"garment.prim={chosen}"]) == [chosen]


def test_an_object_of_an_obj_is_named_by_its_place_in_the_file(tmp_path: Path) -> None:
    """Messages about one object give the lines and numbers of the whole file."""
    path = outfit_file(tmp_path / "outfit.obj", tube_of(0.25, 0.95, 1.3), tube_of(0.27, 0.4, 1.0))
    lines = path.read_text().splitlines()
    first = lines.index("o part1") + 1
    lines[first] = "v nan 0 0"
    path.write_text("\n".join(lines))
    vertex = sum(line.startswith("v ") for line in lines[: first + 1])
    with pytest.raises(InputError, match=rf"outfit\.obj:{first + 1}: vertex {vertex} is not finite"):
        load_mesh(path, role="garment", key="garment", prim="part1")
    with pytest.raises(InputError, match=r'holds no object "part2"; garment\.prim may be part0, part1$'):
        load_mesh(path, role="garment", key="garment", prim="part2")


@pytest.mark.parametrize(
    "other",
    [
        (0.25, 0.5, 0.95),  # sewn on: a shirt and its lower part
        (0.251, 1.27, 1.29),  # a trim
    ],
)
@pytest.mark.parametrize("kind", ["glb", "obj"])
def test_parts_of_one_garment_stay_one(tmp_path: Path, other: tuple[float, float, float], kind: str) -> None:
    assert prims_of(outfit_file(tmp_path / f"shirt.{kind}", tube_of(0.25, 0.95, 1.3), tube_of(*other))) == [None]


def test_a_sleeve_modelled_by_itself_is_no_garment(tmp_path: Path) -> None:
    """Its rim runs along that of the armhole, with vertices of its own: here it has 31 for 24."""
    lower = tube(0.2505, 0.5, 0.949, around=31, rows=4)
    path = outfit_file(tmp_path / "shirt.obj", tube_of(0.25, 0.95, 1.3), (lower.points, lower.triangles))
    assert prims_of(path) == [None]
    inner = tube(0.244, 0.95, 1.3, around=31, rows=4)  # hems of two layers
    path = outfit_file(tmp_path / "layers.obj", tube_of(0.25, 0.95, 1.3), (inner.points, inner.triangles))
    assert prims_of(path) == ["part0", "part1"]


def test_a_file_that_names_no_object_is_not_read_for_that() -> None:
    assert obj_mesh_names("", b"v 0 0 0\nunknown\n") == []
    with pytest.raises(InputError, match="not an OBJ statement"):
        obj_mesh_names("", b"o\tshirt\nunknown\n")


def test_panels_of_one_garment_stay_one(tmp_path: Path) -> None:
    points, faces = sheet(count=9, side=0.5)
    behind = points - np.array([0.0, 0.0, 0.4])
    assert prims_of(outfit_file(tmp_path / "panels.glb", (points, faces), (behind, faces))) == [None]


def test_a_body_with_holes_in_a_garments_file_is_refused(tmp_path: Path) -> None:
    body = mannequin(MannequinMeasures())
    level = body.points[:, 1] / body.points[:, 1].max()
    faces = body.triangles[(level > 0.02)[body.triangles].all(axis=1)]  # as a scan whose soles were not seen
    used, faces = np.unique(faces, return_inverse=True)
    shirt = tube_of(0.25, 0.95, 1.3)
    path = outfit_file(tmp_path / "dressed.glb", shirt, (body.points[used], faces.reshape(-1, 3)))
    with pytest.raises(InputError, match=r'"dressed" holds a body, too'):
        load_outfit(load_scene(path, on="mannequin"))
