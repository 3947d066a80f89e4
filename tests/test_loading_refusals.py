"""What loading refuses: one line that says where, what is wrong, and what to do."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
from meshfiles import glb, gltf_of, sheet, write_ply
from refusals import refusal

from warp_cloth.base.errors import InputError
from warp_cloth.loading import load_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
FIN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n"
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]]
PLY_HEAD = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
)

# name, content, line (or None), words of the problem, words of the remedy
REFUSED: list[tuple[str, str | bytes, int | None, str, str]] = [
    ("empty.obj", "", None, "empty", "export"),
    ("empty.glb", "", None, "empty", "export"),
    ("noise.obj", bytes(range(256)) * 4, None, "binary data", "content"),
    ("prose.obj", "Dear Sir,\nplease find enclosed\n", 1, "'Dear' is not an OBJ statement", "content"),
    ("blank.obj", "# only a comment\n\n", None, "no vertices", "export"),
    ("cloud.obj", SQUARE, None, "no faces", "surface"),
    ("lines.obj", SQUARE + "l 1 2\nl 2 3\np 4\n", None, "no faces", "surface"),
    ("nan.obj", SQUARE.replace("1 1 0", "nan 1 0") + "f 1 2 3\n", 3, "vertex 3 is not finite", "repair"),
    ("inf.obj", SQUARE.replace("1 1 0", "1 -inf 0") + "f 1 2 3\n", 3, "vertex 3 is not finite", "repair"),
    ("overflow.obj", SQUARE.replace("1 1 0", "1 1e400 0") + "f 1 2 3\n", 3, "not finite", "repair"),
    ("comma.obj", SQUARE.replace("1 1 0", "1,5 1 0") + "f 1 2 3\n", 3, "'1,5'", "decimal point"),
    ("word.obj", SQUARE + "v 1 two 3\nf 1 2 3\n", 5, "'two'", "export"),
    ("short.obj", SQUARE + "v 1 2\nf 1 2 3\n", 5, "needs 3 numbers, found 2", "cut off"),
    ("high.obj", SQUARE + "f 1 2 3\nf 1 2 9\n", 6, "vertex 9, but the file has 4 vertices", "export"),
    ("huge.obj", SQUARE + "f 1 2 99999999999999999999999\n", 5, "vertex 999", "export"),
    ("low.obj", SQUARE + "f -1 -2 -5\n", 5, "vertex -5", "export"),
    ("zero.obj", SQUARE + "f 0 1 2\n", 5, "vertex 0", "export"),
    ("texture.obj", SQUARE + "vt 0 0\nf 1/1 2/1 3/2\n", 6, "texture coordinate 2", "export"),
    ("odd.obj", SQUARE + "v 1.#IND 0 0\nf 1 2 3\n", 5, "'1.#IND'", "export"),
    ("letters.obj", SQUARE + "f 1 2 three\n", 5, "'three' is not an index", "export"),
    ("two.obj", SQUARE + "f 1 2 3\nf 1 2\n", 6, "at least 3 corners", "cut off"),
    ("flat.obj", SQUARE + "f 1 1 2\nf 1 2 2\n", None, "none of its 2 faces can be used", "no area"),
    ("fin.obj", FIN, 6, "edge between vertices 1 and 2 has 3 faces (line 6, line 7, line 8)", "separate"),
    ("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", None, "one point", "export"),
    ("noise.ply", bytes(range(256)), None, "is not a PLY", "content"),
    ("header.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", None, "header has no end_header", "cut off"),
    ("type.ply", PLY_HEAD.replace("float y", "number y"), 5, "'property number y'", "export"),
    ("cut.ply", PLY_HEAD + "0 0 0\n1 0 0\n", None, "ends after 2 of 3 vertex rows", "cut off"),
    ("face.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n3 0 1\n", None, "ends after 0 of 1 face rows", "cut off"),
    ("word.ply", PLY_HEAD + "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n", None, "is not a number", "export"),
    ("nan.ply", PLY_HEAD + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", 11, "vertex 1 is not finite", "repair"),
    ("high.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", 13, "refers to vertex 3", "export"),
    ("more.ply", PLY_HEAD + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1 0\n", None, "has 4 values more", "header"),
    ("cloud.ply", PLY_HEAD.replace("face 1", "face 0") + "0 0 0\n1 0 0\n0 1 0\n", None, "no faces", "surface"),
    ("noise.stl", bytes(range(200)), None, "is not an STL", "cut off"),
    ("short.stl", b"not much", None, "too short", "cut off"),
    ("word.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 zero\n", 4, "not a vertex of three", "export"),
    ("noise.glb", bytes(range(255, 55, -1)), None, "is not a glTF", "content"),
    ("bytes.glb", bytes(range(128, 200)), None, "is not a glTF file: it is not text", "content"),
    ("noise.gltf", "{]", None, "is cut off or damaged in line 1, column 2", "content"),
    ("other.gltf", '{"some": "json"}', None, "no 'asset'", "content"),
    ("noise.usda", "#usda 1.0\nthis is no stage", None, "cannot be read as USD", "export"),
    ("noise.usdc", b"PXR-USDC" + bytes(80), None, "cannot be read as USD", "export"),
    ("noise.usdz", bytes(range(200)), None, "cannot be read as USD", "export"),
    ("empty.usd", b"", None, "the file is empty", "export"),
    ("nothing.usda", "#usda 1.0\n", None, "no mesh", "export"),
    ("shirt.fbx", b"Kaydara FBX Binary", None, "is not a supported mesh format", ".obj, .ply, .stl, .glb"),
    ("shirt", b"something", None, "without extension", ".usdz"),
]


def refused_mesh(path: Path, **options: object) -> InputError:
    """The refusal of a garment; one line with the file in it."""
    error = refusal(load_mesh, path, **{"role": "garment", "key": "garment", **options})
    assert error.place.startswith(str(path))
    return error


@pytest.mark.parametrize(("name", "content", "line", "problem", "remedy"), REFUSED, ids=[case[0] for case in REFUSED])
def test_bad_file_is_refused_with_place_problem_and_remedy(
    tmp_path: Path, name: str, content: str | bytes, line: int | None, problem: str, remedy: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    error = refused_mesh(path)
    assert error.place == (f"{path}:{line}" if line else str(path))
    assert problem in error.problem
    assert remedy in error.remedy


def test_missing_file_names_its_close_matches(tmp_path: Path) -> None:
    (tmp_path / "tshirt.obj").write_text(SQUARE)
    assert "tshirt.obj" in refused_mesh(tmp_path / "tshrt.obj").remedy
    assert "tshirt.obj" in refused_mesh(tmp_path / "tshirt.glb").remedy
    assert "did you mean" not in refused_mesh(tmp_path / "trousers.stl").remedy
    assert "folder does not exist" in refused_mesh(tmp_path / "nowhere" / "tshirt.obj").problem


def test_a_path_written_as_on_windows_is_told_how_to_write_it(tmp_path: Path) -> None:
    if os.sep == "\\":
        pytest.skip("such paths are understood here")
    (tmp_path / "shirts").mkdir()
    (tmp_path / "shirts" / "a.obj").write_text(SQUARE + "f 1 2 3\n")
    assert f"write {tmp_path}/shirts/a.obj, with /" in refused_mesh(tmp_path / "shirts\\a.obj").remedy


def test_an_address_is_told_to_be_downloaded() -> None:
    found = refused_mesh(Path("scenes") / "https://example.com/shirt.obj")
    assert (found.problem, found.remedy) == ("is not a local file", "download it first")


def test_folder_and_dead_link_are_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "link.obj").symlink_to(tmp_path / "gone.obj")
    assert "folder" in refused_mesh(tmp_path / "folder.obj").problem
    assert "link" in refused_mesh(tmp_path / "link.obj").problem
    os.mkfifo(tmp_path / "pipe.obj")
    assert "regular file" in refused_mesh(tmp_path / "pipe.obj").problem


def test_unreadable_file_says_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "locked.obj"
    path.write_text(SQUARE)

    def denied(_: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", denied)
    assert "permission" in refused_mesh(path).problem


def test_prim_is_only_for_files_that_name_their_meshes(tmp_path: Path) -> None:
    path = tmp_path / "square.obj"
    path.write_text(SQUARE + "f 1 2 3 4\n")
    assert "garment.prim" in refused_mesh(path, prim="/a").remedy


def test_avatar_may_have_an_edge_with_three_faces_but_no_wild_numbers(tmp_path: Path) -> None:
    path = tmp_path / "fin.obj"
    path.write_text(FIN)
    assert load_mesh(path, role="avatar", key="avatar").triangle_count == 3
    path.write_text(FIN.replace("v 0 0 1", "v 0 0 inf"))
    assert "vertex 5" in refused_mesh(path, role="avatar").problem


def test_stl_with_an_edge_of_three_faces_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fin.stl"
    corners = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 0, 0], [0, -1, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]]]
    path.write_bytes(binary_stl(np.array(corners)))
    assert "has 3 faces" in refused_mesh(path).problem


def binary_stl(corners: np.ndarray) -> bytes:
    records = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    records["corners"] = corners
    return bytes(80) + struct.pack("<I", len(corners)) + records.tobytes()


@pytest.mark.parametrize("share", [0.0001, 0.01, 0.1, 0.3, 0.6, 0.9, 0.999])
def test_truncated_glb_is_refused(tmp_path: Path, share: float) -> None:
    whole = glb(*gltf_of(*TRIANGLE))
    path = tmp_path / "cut.glb"
    path.write_bytes(whole)
    assert load_mesh(path, role="garment", key="garment").triangle_count == 1
    path.write_bytes(whole[: max(4, int(share * len(whole)))])
    assert "cut off" in refused_mesh(path).remedy


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t["accessors"][0].update(sparse={"count": 1}), "sparse"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=6), "fans"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=0), "no mesh with faces"),
        (lambda t: t["meshes"][0]["primitives"][0].update(extensions={"KHR_draco_mesh_compression": {}}), "compressed"),
        (lambda t: t.update(extensionsRequired=["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
        (lambda t: t["nodes"][0].update(extensions={"EXT_mesh_gpu_instancing": {}}), "EXT_mesh_gpu_instancing"),
        (lambda t: t["accessors"][1].update(count=3000), "cannot be read as glTF"),
        (lambda t: t["buffers"].append({"uri": "gone.bin", "byteLength": 4}), "'gone.bin' is missing"),
    ],
)
def test_gltf_that_would_be_misread_is_refused(tmp_path: Path, change: object, words: str) -> None:
    tree, body = gltf_of(*TRIANGLE)
    change(tree)  # type: ignore[operator]
    path = tmp_path / "odd.glb"
    path.write_bytes(glb(tree, body))
    assert words in refused_mesh(path).problem


@pytest.mark.parametrize("scenes", [None, [{"nodes": [1]}]])
def test_gltf_without_scenes_means_all_its_nodes(tmp_path: Path, scenes: list | None) -> None:
    tree, body = gltf_of(*TRIANGLE)
    del tree["scene"], tree["scenes"]
    tree["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [0.0, 2.0, 0.0]}]
    if scenes:
        tree["scenes"] = scenes
    path = tmp_path / "library.glb"
    path.write_bytes(glb(tree, body))
    assert load_mesh(path, role="garment", key="garment").points[:, 1].min() == 2.0


@pytest.mark.parametrize("moved", ["skin", "morph"])
def test_gltf_that_is_posed_or_shaped_is_told_of(tmp_path: Path, moved: str) -> None:
    tree, body = gltf_of(*TRIANGLE)
    if moved == "skin":
        tree["skins"] = [{"joints": [0]}]
        tree["nodes"][0]["skin"] = 0
    else:
        tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    path = tmp_path / "posed.glb"
    path.write_bytes(glb(tree, body))
    assert any("not applied" in note for note in load_mesh(path, role="avatar", key="avatar").notes)


def test_gltf_index_out_of_range_and_wild_vertex_are_named(tmp_path: Path) -> None:
    tree, body = gltf_of(*TRIANGLE)
    path = tmp_path / "bad.glb"
    path.write_bytes(glb(tree, body[:36] + np.array([0, 1, 7], "<u4").tobytes()))
    assert "vertex 7, but there are only 3" in refused_mesh(path).problem
    path.write_bytes(glb(tree, np.array([0, np.nan], "<f4").tobytes() + body[8:]))
    assert "vertex 0 is not finite" in refused_mesh(path).problem


@pytest.mark.filterwarnings("error")
def test_a_nan_that_numpy_warns_of_is_refused_in_one_line(tmp_path: Path) -> None:
    points, faces = sheet(3)
    write_ply(tmp_path / "nan.ply", points, faces)
    content = (tmp_path / "nan.ply").read_bytes()
    first = content.index(b"end_header\n") + len(b"end_header\n")
    signalling = b"\xab\xaa\xaa\xff"
    (tmp_path / "nan.ply").write_bytes(content[:first] + signalling + content[first + 4 :])
    assert "vertex 0 is not finite" in refused_mesh(tmp_path / "nan.ply").problem


def test_a_data_file_whose_name_no_system_takes_is_refused_in_one_line(tmp_path: Path) -> None:
    tree = {"asset": {"version": "2.0"}, "buffers": [{"uri": "A" * 5000, "byteLength": 1}]}
    (tmp_path / "long.gltf").write_text(json.dumps(tree))
    assert "is not a glTF" in refused_mesh(tmp_path / "long.gltf").problem
