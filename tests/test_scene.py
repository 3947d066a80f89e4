"""Scene files: what they say is what is used; --set changes it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from refusals import refusal, write

from warp_cloth.base.errors import InputError
from warp_cloth.material.fabric import fabric_named, generic_fabric
from warp_cloth.scene import GarmentSpec, Scene, load_scene, shipped_scenes
from warp_cloth.scene.schema import CollisionSpec, SolverSpec
from warp_cloth.scene.shapes import MannequinShape, SphereShape, SquareShape, TshirtShape
from warp_cloth.scene.wearables import AvatarSpec

MINIMAL = '[garment]\nmesh = "shirt.obj"\n'
BODY = '[avatar]\nmesh = "body.obj"\n'


def refused(source: Any, *overrides: str) -> str:
    return str(refusal(load_scene, source, overrides))


# What a scene says


def test_shipped_scenes_load_under_their_names() -> None:
    assert list(shipped_scenes()) == ["hanging", "shirt", "skirt", "sphere", "trousers", "tshirt"]
    for name in shipped_scenes():
        assert load_scene(name).name == name
    shirt = load_scene("tshirt")
    assert isinstance(shirt.garments[0].shape, TshirtShape)
    assert (shirt.garments[0].rest, shirt.garments[0].fabric) == ("auto", fabric_named("jersey"))
    assert load_scene("hanging").avatar is None
    assert len(load_scene("hanging").garments[0].pin) == 2


def test_every_key_of_the_issue_is_read(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        """
        [[garment]]
        mesh = "shirt.usda"
        prim = "/World/Shirt"
        units = "cm"
        rest = "uv"
        uv_units = 0.01
        fabric = {name = "cotton", stretch = 1e4}
        pin = [{vertices = [0, 5]}, {box = [[0, 0, 0], [1, 1, 1]]}, {loop = "top"}, {loop = 2}]
        [[garment]]
        mesh = "coat.obj"
        [avatar]
        mesh = "body.obj"
        prim = "/World/Body"
        units = "in"
        friction = 0
        [collision]
        avatar = "mesh"
        pixel_mm = 1
        offset_mm = 2.5
        cloth = false
        [solver]
        method = "direct"
        iterations = 7
        tolerance_mm = 0.5
        residual = 0.02
        residual_p99 = 0.2
        precision = "float64"
        cap = 1e-3
        """,
    )
    scene = load_scene(path)
    shirt, coat = scene.garments
    assert shirt.mesh == tmp_path / "shirt.usda"
    assert (shirt.prim, shirt.units, shirt.rest, shirt.uv_metres) == ("/World/Shirt", "cm", "uv", 0.01)
    assert (shirt.fabric.stretch, shirt.fabric.weight) == (1e4, fabric_named("cotton").weight)
    assert shirt.pin[0].vertices == (0, 5)
    assert shirt.pin[1].box == ((0, 0, 0), (1, 1, 1))
    assert [pin.loop for pin in shirt.pin] == [None, None, "top", 2]
    assert (coat.name, coat.fabric, coat.pin) == ("coat", generic_fabric(), ())
    assert scene.garment_keys == ("garment[0]", "garment[1]")
    assert scene.avatar == AvatarSpec(mesh=tmp_path / "body.obj", prim="/World/Body", units="in", friction=0)
    assert scene.collision == CollisionSpec(avatar="mesh", pixel_mm=1, offset_mm=2.5, cloth=False)
    assert scene.solver == SolverSpec(
        method="direct",
        iterations=7,
        tolerance_mm=0.5,
        residual=0.02,
        residual_p99=0.2,
        precision="float64",
        cap=1e-3,
    )
    assert (scene.name, scene.directory) == ("scene", tmp_path)


def test_left_out_keys_take_the_schema_defaults(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path, MINIMAL + BODY, "mine.toml"))
    assert scene.name == "mine"
    assert scene.garments[0].name == "shirt"
    assert scene.garments[0].uv_metres is None
    assert (scene.collision, scene.solver) == (CollisionSpec(), SolverSpec())
    assert scene.garment_keys == ("garment",)


def test_a_whole_number_may_be_written_as_1e3() -> None:
    assert load_scene("tshirt", ["solver.iterations=1e3"]).solver.iterations == 1000
    for text in ("1000.5", "1e30", "inf", "true"):
        with pytest.raises(InputError, match=r"must be an integer from 0 to 10000000, not"):
            load_scene("tshirt", [f"solver.iterations={text}"])


def test_every_key_has_a_description() -> None:
    tables = (GarmentSpec, AvatarSpec, CollisionSpec, SolverSpec)
    shapes = (SquareShape, TshirtShape, SphereShape, MannequinShape)
    for table in (*tables, *shapes):
        for key, field in table.model_fields.items():
            assert key == "kind" or field.description, f"{table.__name__}.{key}"


def test_a_dictionary_is_a_scene_and_is_left_as_it_was() -> None:
    values = {"garment": {"shape": {"kind": "square"}}}
    scene = load_scene(values, ["garment.shape.side=2", "solver.iterations=5"])
    assert isinstance(scene.garments[0].shape, SquareShape)
    assert (scene.garments[0].shape.side, scene.solver.iterations) == (2.0, 5)
    assert values == {"garment": {"shape": {"kind": "square"}}}


def test_without_an_avatar_its_collision_is_none_and_said_so() -> None:
    scene = load_scene("hanging")
    assert scene.collision.avatar == "none"
    assert scene.settings()["collision"]["avatar"] == "none"
    line = refused("hanging", "collision.avatar=mesh")
    assert 'collision.avatar = "mesh", but the scene has no [avatar]; add an [avatar]' in line


def test_an_avatar_may_be_left_out_of_collision() -> None:
    assert load_scene("sphere", ["collision.avatar=none"]).collision.avatar == "none"


@pytest.mark.parametrize("name", ["tshirt", "sphere", "hanging"])
def test_settings_hold_every_value_and_give_the_same_scene_again(name: str) -> None:
    settings = load_scene(name).settings()
    assert set(settings) == {"name", "garment", "avatar", "collision", "solver"}
    assert set(settings["solver"]) == set(SolverSpec.model_fields)
    assert set(settings["collision"]) == set(CollisionSpec.model_fields)
    assert settings["garment"][0]["fabric"]["stretch_warp"] > 0
    again = json.loads(json.dumps(settings, allow_nan=False))
    assert load_scene(again).settings() == settings


def test_garments_of_the_same_file_get_names_of_their_own(tmp_path: Path) -> None:
    twice = [{"mesh": "shirt.obj"}, {"mesh": "shirt.obj"}]
    assert [garment.name for garment in load_scene({"garment": twice}).garments] == ["shirt", "shirt_2"]


def test_meshes_of_one_file_are_named_as_there() -> None:
    """Before, they were "suit" and "suit_2", in the report, on the stage and in a .glb."""
    parts = [{"mesh": "suit.glb", "prim": prim} for prim in ("Jacket", "/World/Trousers", "/World/Trousers", "..")]
    names = [garment.name for garment in load_scene({"garment": parts}).garments]
    assert names == ["Jacket", "Trousers", "Trousers_2", "suit"]


def test_a_scene_is_frozen() -> None:
    with pytest.raises(ValidationError):
        load_scene("tshirt").solver.iterations = 3  # type: ignore[misc]


# --set


def test_set_changes_values_of_any_type() -> None:
    scene = load_scene(
        "tshirt",
        [
            "garment.fabric=denim",
            "garment.shape.size=L",
            "solver.iterations=500",
            'solver.precision="float32"',
            "garment.pin.loop=top",
            "avatar.shape={kind='sphere', radius=0.2}",
        ],
    )
    garment, avatar = scene.garments[0], scene.avatar
    assert garment.fabric == fabric_named("denim")
    assert isinstance(garment.shape, TshirtShape)
    assert garment.shape.size == "L"
    assert (scene.solver.iterations, scene.solver.precision) == (500, "float32")
    assert garment.pin[0].loop == "top"
    assert avatar is not None
    assert isinstance(avatar.shape, SphereShape)
    assert avatar.shape.radius == 0.2


def test_set_keeps_the_named_fabric_under_a_single_value() -> None:
    fabric = load_scene("tshirt", ["garment.fabric.weight=0.3"]).garments[0].fabric
    assert (fabric.weight, fabric.stretch) == (0.3, fabric_named("jersey").stretch)


def test_set_chooses_among_garments() -> None:
    values = {"garment": [{"mesh": "a.obj"}, {"mesh": "b.obj"}]}
    scene = load_scene(values, ["garment[1].fabric=silk"])
    assert [garment.fabric.name for garment in scene.garments] == ["default", "silk"]
    line = refused(values, "garment.fabric=silk")
    assert line == "override garment.fabric=silk: the scene has 2 garments; give an index: garment[0] is the first"
    assert "there is no [2]; the list has 2, counted from 0" in refused(values, "garment[2].fabric=silk")
    assert "there is no garment[1]" in refused("tshirt", "garment[1].fabric=silk")
    assert load_scene("tshirt", ["garment[0].fabric=silk"]).garments[0].fabric.name == "silk"


def test_set_of_a_mesh_or_kind_replaces_the_shape_before_it() -> None:
    garment = load_scene("tshirt", ["garment.mesh=a.obj", "garment.units=cm"]).garments[0]
    assert (garment.shape, garment.units) == (None, "cm")
    avatar = load_scene("sphere", ["avatar.shape.kind=mannequin"]).avatar
    assert avatar is not None
    assert avatar.shape == MannequinShape(kind="mannequin")


def test_set_finds_a_file_beside_the_scene_first_and_then_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    path = write(there, MINIMAL)
    (here / "body.obj").touch()
    monkeypatch.chdir(here)
    avatar = load_scene(path, ["avatar.mesh=body.obj"]).avatar
    assert avatar is not None
    assert avatar.mesh == here / "body.obj"
    (there / "body.obj").touch()
    avatar = load_scene(path, ["avatar.mesh=body.obj"]).avatar
    assert avatar is not None
    assert avatar.mesh == there / "body.obj"


def test_a_path_may_begin_at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    garment, strange = (load_scene("tshirt", [f"garment.mesh={mesh}"]).garments[0] for mesh in ("~/a.obj", "~$a.obj"))
    assert garment.mesh == tmp_path / "a.obj"
    assert strange.mesh is not None
    assert strange.mesh.name == "~$a.obj"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("foo", "override foo: has no value; write KEY=VALUE"),
        ("=3", 'override =3: "" is not a key; write KEY=VALUE'),
        ("a b.c=3", '"a b.c" is not a key'),
        ("solver.residual.x=3", "override solver.residual.x=3: 0.01 is a value, not a table"),
        ("solver[0]=3", "override solver[0]=3: there is no list for [0]; remove the index"),
        ("solver.iteration=3", "unknown key solver.iteration; did you mean solver.iterations?"),
        (
            "solver.iterations=many",
            'override solver.iterations=many: must be an integer from 0 to 10000000, not "many"',
        ),
        ("garment.shape.size=XL", 'override garment.shape.size=XL: must be one of "S", "M", "L", not "XL"'),
        ("garment.pin.loop=up", 'override garment.pin.loop=up: "up" is not a boundary loop; use "top"'),
        (
            "garment.fabric.weight=x",
            'override garment.fabric.weight=x: must be a number from 0.001 to 100, not "x"',
        ),
        ("avatar.shape={kind='egg'}", 'avatar.shape.kind: unknown kind "egg"; use one of "sphere"'),
    ],
)
def test_an_error_of_set_quotes_it(text: str, line: str) -> None:
    assert line in refused("tshirt", text)


def test_a_set_that_a_later_kind_undoes_is_refused() -> None:
    lost, kind = "avatar.shape.chest=1.1", "avatar.shape.kind=sphere"
    assert (
        refused("tshirt", lost, kind)
        == f"override {lost}: is undone by override {kind}; remove it, or put it after that"
    )
    assert load_scene("tshirt", ["garment.shape.size=L", "garment.mesh=a.obj"]).garments[0].shape is None


def test_of_several_sets_the_one_that_is_wrong_is_named() -> None:
    assert refused("tshirt", "garment.shape.size=L", "garment.shape.size=XL").startswith(
        "override garment.shape.size=XL:"
    )


def test_a_long_set_is_cut_short() -> None:
    assert len(refused("tshirt", "solver.iterations=" + "9" * 5000)) < 300
    assert "not a huge number" in refused("tshirt", "solver.iterations=0x" + "f" * 5000)


def test_a_scene_of_models_is_the_scene_of_its_dictionary() -> None:
    built = Scene(garment=(GarmentSpec(shape=SquareShape(kind="square"), fabric=fabric_named("silk")),))
    read = load_scene({"garment": {"shape": {"kind": "square"}, "fabric": "silk"}})
    assert built.settings() == read.settings()


@pytest.mark.parametrize("prim", ["/W/body", "/W/coa", "/W/coating/body"])
def test_a_body_and_its_garment_may_come_from_one_file(prim: str) -> None:
    scene = load_scene({"garment": {"mesh": "s.usda", "prim": "/W/coat"}, "avatar": {"mesh": "s.usda", "prim": prim}})
    assert scene.avatar is not None
    assert scene.avatar.prim == prim


def test_numpy_values_and_a_lone_override_are_taken() -> None:
    square = {"kind": "square", "vertices_per_side": np.int64(5), "side": np.float32(0.5)}
    values = {"garment": {"shape": square, "pin": {"vertices": np.array([0, 4])}}}
    scene = load_scene(values, "solver.iterations=7")
    assert scene.garments[0].shape.vertices_per_side == 5
    assert scene.garments[0].pin[0].vertices == (0, 4)
    assert scene.solver.iterations == 7
    assert isinstance(square["vertices_per_side"], np.int64)  # the caller's own stays as it is
