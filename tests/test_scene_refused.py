"""Bad scene files: each is refused in one line with its place, what is wrong and what is allowed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from refusals import refusal, write

from warp_cloth.base.errors import InputError
from warp_cloth.scene import load_scene

MINIMAL = 'garment.mesh = "shirt.obj"\n'


def refused(source: Any, *overrides: str) -> str:
    return str(refusal(load_scene, source, overrides))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("fabric = 'silk'", "unknown key fabric; did you mean garment.fabric? allowed there"),
        ("offset_mm = 2", "unknown key offset_mm; did you mean collision.offset_mm? allowed there"),
        ("garment.grain_panels = {left = 400}", "garment.grain_panels.left: must be a number from -360 to 360"),
        ("garment.pin = {box = [0, 0, 0, 1, 1, 1]}", "garment.pin[0].box: must be a list of 2, each a list of 3"),
        (f'garment.size = "{"x" * 41}"', "garment.size: has 41 letters; at most 40 are taken"),
        ("colour = 1", "unknown key colour; allowed there: name, garment, avatar, collision, solver"),
        (
            'garment.fabrik = "silk"',
            "unknown key garment.fabrik; did you mean garment.fabric? allowed there: mesh,",
        ),
        (
            'garment.fabric = "dennim"',
            'garment.fabric: unknown fabric "dennim"; did you mean "denim"? use one of',
        ),
        ('garment.fabric = "mine.toml"', "mine.toml: no such fabric file"),
        (
            "garment.fabric = {name = 'silk', stretsh = 3}",
            "garment.fabric.stretsh: unknown key; did you mean stretch?",
        ),
        ('garment.rest = "flat"', 'garment.rest: must be one of "auto", "mesh", "uv", "physics", not "flat"'),
        ('garment.units = "ft"', 'garment.units: must be one of "m", "cm", "mm", "in", not "ft"'),
        (
            "garment.uv_units = 0",
            'garment.uv_units: 0 is not a unit; use "auto", "m", "cm", "mm", "in", or metres per unit',
        ),
        ("garment.uv_units = true", "garment.uv_units: true is not a unit"),
        ('garment.up = "x"', 'garment.up: must be one of "y", "z", not "x"'),
        ("garment.prim = 3", "garment.prim: must be a string, not 3"),
        ('garment.name = "../up"', 'garment.name: "../up" cannot be a file name'),
        ("garment.pin = 3", "garment.pin: must be a table, or a list of tables, not 3"),
        (
            "garment.pin = [{}]",
            "a pin needs exactly one of vertices, box and loop; give one of them",
        ),
        ("garment.pin = {vertices = []}", "garment.pin[0].vertices: is empty"),
        ("garment.pin = {vertices = [-1]}", "garment.pin[0].vertices[0]: must be an integer from 0"),
        (
            "garment.pin = {vertices = [1.5]}",
            "vertices[0]: must be an integer from 0 to 2147483647, not 1.5",
        ),
        (
            "garment.pin = {box = [[1, 0, 0], [0, 1, 1]]}",
            "is above the second on some axis; give the lowest",
        ),
        (
            "garment.pin = {box = [[0, 0, nan], [0, 1, 1]]}",
            "pin[0].box[0][2]: must be a number from -10000000",
        ),
        ("garment.pin = {loop = true}", "garment.pin[0].loop: true is not a boundary loop"),
        ("garment.shape = {kind = 'square'}", "garment: mesh and shape are both given; give one"),
        (
            "avatar.mesh = 'b.obj'\navatar.friction = true",
            "avatar.friction: must be a number from 0 to 10, not true",
        ),
        (
            "avatar.mesh = 'b.obj'\navatar.friction = '1'",
            'avatar.friction: must be a number from 0 to 10, not "1"',
        ),
        (
            "avatar.mesh = 'b.obj'\navatar.friction = inf",
            "avatar.friction: must be a number from 0 to 10, not inf",
        ),
        ("collision.pixel_mm = 0.1", "collision.pixel_mm: must be a number from 0.2 to 50, not 0.1"),
        ("collision.offset_mm = -1", "collision.offset_mm: must be a number from 0 to 50, not -1"),
        ("collision.cloth = 1", 'collision.cloth: must be true, false or "auto", not 1'),
        ("collision.avatar = 'depths'", 'not "depths"; did you mean depth?'),
        ("solver.iterations = 3.5", "solver.iterations: must be an integer from 0 to 10000000, not 3.5"),
        ("solver.iterations = '3'", 'solver.iterations: must be an integer from 0 to 10000000, not "3"'),
        ("solver.tolerance_mm = 0", "solver.tolerance_mm: must be a number above 0 to 1000, not 0"),
        ("solver.residual = nan", "solver.residual: must be a number above 0 to 1, not nan"),
        ("solver.cap = 2", "solver.cap: must be a number from 1e-07 to 1, not 2"),
        ("solver.method = 3", 'solver.method: must be one of "auto", "multilevel", "accelerated", "direct", not 3'),
        ("solver.cap = 1979-05-27", "solver.cap: must be a number from 1e-07 to 1, not 1979-05-27"),
    ],
)
def test_a_wrong_key_or_value_is_told_with_file_key_value_and_what_is_allowed(
    tmp_path: Path, text: str, line: str
) -> None:
    told = refused(write(tmp_path, MINIMAL + text))
    assert line in told
    assert ".toml" in told


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            'garment = {mesh = "s.usda", prim = "/W/coat"}\navatar = {mesh = "s.usda", prim = "/W"}',
            'avatar.prim: "/W" contains the garment, too; name the prim of the body alone',
        ),
        (
            'garment = {mesh = "s.usda", prim = "/W/"}\navatar = {mesh = "s.usda", prim = "/W/body"}',
            'garment.prim: "/W" contains the avatar, too; name the prim of the garment alone',
        ),
        (
            'garment = {mesh = "s.glb", prim = "coat"}\navatar = {mesh = "s.glb"}',
            "avatar.prim: all of s.glb contains the garment, too; name the prim of the body alone",
        ),
    ],
)
def test_an_avatar_that_holds_its_garment_or_is_held_by_it_is_refused(tmp_path: Path, text: str, line: str) -> None:
    assert line in refused(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[garments]\nmesh = 'a.obj'", "unknown key garments; did you mean garment?"),
        ("[garment]\nrest = 'mesh'", 'garment: neither mesh nor pattern nor shape is given; give one: mesh = "FILE"'),
        ("[garment]\nmesh = ''", 'garment.mesh: "" is not a path'),
        ("[garment]\nshape = {side = 1}", 'garment.shape.kind: is missing; give one of "square", "tshirt"'),
        ("[garment]\nshape = 'square'", 'garment.shape: must be a table, not "square"'),
        (
            "[garment]\nunits = 'm'\nshape = {kind = 'square'}",
            "garment.units: units is for a mesh file",
        ),
        ("garment = []", "garment: is empty; give a table, or a list of tables"),
        ("garment = 3", "garment: must be a table, or a list of tables, not 3"),
        ("[solver]\niterations = 3", "garment: is missing; give a table, or a list of tables"),
    ],
)
def test_a_scene_without_a_proper_garment_is_told_what_one_needs(tmp_path: Path, text: str, line: str) -> None:
    assert line in refused(write(tmp_path, text))


def test_more_than_one_mistake_is_counted(tmp_path: Path) -> None:
    told = refused(write(tmp_path, MINIMAL + "[solver]\ncap = 2\nmethod = 3\niterations = -1"))
    assert told.endswith("(and 2 more)")


def test_a_value_that_does_not_go_with_the_fabrics_own_names_the_scenes_key() -> None:
    garment = {"shape": {"kind": "square"}, "fabric": {"base": "cotton", "stretch_warp": 1.0}}
    with pytest.raises(InputError, match=r"^scene: garment\.fabric\.shear: "):
        load_scene({"garment": garment})


def test_two_garments_of_one_name_are_refused() -> None:
    same = [{"mesh": "a.obj", "name": "x"}, {"mesh": "b.obj", "name": "x"}]
    assert 'two garments have the same name, "x"; give each a name of its own' in refused({"garment": same})


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "scene.toml: is empty; give a scene file in TOML"),
        (b" \n\t\n", "scene.toml: is empty"),
        (b"[garment]\nmesh = \n", "scene.toml:2: is not valid TOML: Invalid value"),
        (b"[garment]\nmesh = a.obj\n", 'is not valid TOML: Invalid value; put strings in "quotes"'),
        (b'[garment]\nmesh = "C:\\shirts\\a.obj"\n', "in a string; write paths with /"),
        (b"[garment]\nmesh = 'a.obj", "scene.toml:2: is not valid TOML:"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\xff\xfe", "scene.toml: is not text in UTF-8 (byte 0)"),
        (b"[garment]\0", "scene.toml: is a binary file"),
        ("[garment]\nmesh = 'é.obj'".encode("latin-1"), "scene.toml: is not text in UTF-8 (byte 18)"),
        (b"x = " + b"[" * 100_000, "scene.toml"),
        (b"x = " + b"9" * 100_000, "scene.toml"),
        (b"#" * 2_000_000, "scene.toml: is not a scene file; give a TOML file below 1 MB"),
    ],
)
def test_a_file_that_is_no_scene_is_told_in_one_line(tmp_path: Path, content: bytes, line: str) -> None:
    assert line in refused(write(tmp_path, content))


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    assert load_scene(write(tmp_path, b"\xef\xbb\xbf" + MINIMAL.encode())).garments[0].name == "shirt"


def test_a_missing_scene_names_the_shipped_ones_and_the_nearest(tmp_path: Path) -> None:
    told = refused("tshrt")
    shipped = "hanging, shirt, skirt, sphere, trousers, tshirt"
    assert told == f'"tshrt": no such scene file; did you mean "tshirt"? shipped scenes: {shipped}'
    assert "shipped scenes" in refused(tmp_path / "absent.toml")
    assert "no such scene file" in refused("a\0b")
    assert "no such scene file" in refused("x" * 5000)
    assert "is a folder, not a scene file" in refused(tmp_path)


def test_a_path_that_is_no_text_is_refused() -> None:
    assert "rename" in refused({"garment": {"mesh": "shirt\udcff.obj"}})
