"""Every format gives the same mesh; what each says about panels, texture, units and place is honoured."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from small_grid import FLOAT32_AT_ONE_METRE, POINTS, TRIANGLES, load, write_usd

from warp_cloth.base.errors import InputError
from warp_cloth.loading import load_mesh


def write(path: Path) -> None:
    if path.suffix.startswith(".usd"):
        write_usd(path)
        return
    grid = trimesh.Trimesh(POINTS, TRIANGLES, process=False)
    if path.suffix == ".gltf":
        for name, content in grid.export(file_type="gltf").items():
            (path if name.endswith("gltf") else path.with_name(name)).write_bytes(content)
        return
    options = {"encoding": "ascii"} if "text" in path.stem and path.suffix == ".ply" else {}
    kind = "stl_ascii" if "text" in path.stem and path.suffix == ".stl" else path.suffix[1:]
    path.write_bytes(as_bytes(grid.export(file_type=kind, **options)))


def as_bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content


@pytest.mark.parametrize(
    "name",
    ["a.obj", "a.ply", "text.ply", "a.stl", "text.stl", "a.glb", "a.gltf", "a.usda", "a.usdc", "a.usd", "UPPER.OBJ"],
)
def test_grid_survives_every_format(tmp_path: Path, name: str) -> None:
    path = tmp_path / name.lower()
    write(path)
    path = path.rename(tmp_path / name)
    mesh = load(path)
    assert mesh.triangle_count == len(TRIANGLES)
    np.testing.assert_allclose(mesh.points[mesh.triangles], POINTS[TRIANGLES], atol=FLOAT32_AT_ONE_METRE)
    assert mesh.vertex_count == len(POINTS)
    if "stl" not in name:
        np.testing.assert_array_equal(mesh.triangles, TRIANGLES)
        assert mesh.vertex_map is None
    declared = name.split(".")[1] in ("glb", "gltf", "usda", "usdc", "usd")
    assert any("units not stated" in note for note in mesh.notes) != declared
    assert mesh.name == name.split(".")[0]


def test_obj_reads_every_way_to_write_a_face(tmp_path: Path) -> None:
    path = tmp_path / "ways.obj"
    path.write_bytes(
        b"\xef\xbb\xbf# byte order mark, CRLF, tabs, remarks, names that are no UTF-8\r\n"
        b"mtllib caf\xe9.mtl\r\no thing\r\n  v\t0 0 0\r\nv 1 0 0 # here\r\nv 1 1 0 0.5 0.5 0.5\r\nv 0 1 0 1.0\r\n"
        b"vt 0 0\r\nvt 1 0 0\r\nvt 1 1\r\nvt 0\r\nvn 0 0 1\r\ns off\r\n"
        b"g lower\r\nf 1/1/1 2/2/1 3/3/1\r\ng upper part\r\nf -4/-4 \\\r\n -2/-2 -1/4\r\nf 1//1 2//1 4//1"
    )
    mesh = load(path, role="avatar")
    assert [sorted(face) for face in mesh.triangles.tolist()] == [[0, 1, 2], [0, 2, 3], [0, 1, 3]]
    assert mesh.panel_names == ("lower", "upper part")
    assert mesh.panels.tolist() == [0, 1, 1]
    path.write_bytes(path.read_bytes().rpartition(b"\r\n")[0])
    texcoords = load(path).texcoords
    assert texcoords.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 0]]]


@pytest.mark.parametrize(("first", "second"), [("g", "o"), ("o", "usemtl"), ("usemtl", "usemtl")])
def test_obj_panels_come_from_the_best_grouping(tmp_path: Path, first: str, second: str) -> None:
    path = tmp_path / "panels.obj"
    rows = ["v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0", f"{second} all", f"{first} a", "f 1 2 3", f"{first} b", "f 1 3 4"]
    path.write_text("\n".join(rows))
    assert load(path).panel_names == ("a", "b")


def test_obj_index_may_refer_ahead(tmp_path: Path) -> None:
    path = tmp_path / "ahead.obj"
    path.write_text("v 0 0 0\nf 1 2 3\nv 1 0 0\nv 1 1 0\n")
    assert load(path).triangle_count == 1


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
@pytest.mark.parametrize("name", ["a.obj", "text.ply", "text.stl", "a.gltf"])
def test_text_with_a_byte_order_mark_is_read_in_any_unicode(tmp_path: Path, name: str, encoding: str) -> None:
    path = tmp_path / name
    write(path)
    path.write_bytes(path.read_text().encode(encoding))
    assert load(path).triangle_count == len(TRIANGLES)


def test_obj_names_may_hold_a_hash(tmp_path: Path) -> None:
    path = tmp_path / "hash.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng part#1 # left\nf 1 2 3\ng part#2\nf 1 3 4\n")
    assert load(path).panel_names == ("part#1", "part#2")


def test_a_binary_ply_that_goes_on_after_what_it_counts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "more.ply"
    write(path)
    data = path.read_bytes()
    path.write_bytes(data + b"\n")  # padding
    assert load(path).triangle_count == len(TRIANGLES)
    path.write_bytes(data.replace(b"element face 18", b"element face 17"))
    with pytest.raises(InputError, match=r"has 13 bytes more .* 17 face rows"):
        load(path)


def test_ply_lines_may_end_as_on_an_old_macintosh(tmp_path: Path) -> None:
    path = tmp_path / "text.ply"
    write(path)
    path.write_bytes(path.read_bytes().replace(b"\r", b"").replace(b"\n", b"\r"))
    assert load(path).triangle_count == len(TRIANGLES)


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_with_triangles_and_quads(tmp_path: Path, order: str) -> None:
    endian = "little" if order == "<" else "big"
    head = (
        f"ply\nformat binary_{endian}_endian 1.0\ncomment made here\nelement vertex 5\nproperty float x\n"
        "property float y\nproperty float z\nproperty float s\nproperty float t\nproperty uchar red\n"
        "element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 2)]
    vertex = np.dtype([("p", order + "f4", 5), ("c", "u1")])
    body = b"".join(np.array(((x, y, 0, x, y), 9), dtype=vertex).tobytes() for x, y in rows)
    for face in ((0, 1, 2, 3), (3, 2, 4)):
        body += bytes([7, len(face)]) + np.array(face, dtype=order + "i4").tobytes()
    path = tmp_path / "mixed.ply"
    path.write_bytes(head.encode() + body)
    mesh = load(path)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    assert mesh.texcoords is not None
    np.testing.assert_allclose(mesh.texcoords, mesh.points[mesh.triangles][:, :, :2])
    path.write_bytes(head.encode() + body[:-3])
    with pytest.raises(InputError, match="ends after 1 of 2 face rows"):
        load(path)


def test_ply_with_very_many_properties(tmp_path: Path) -> None:
    count = 50_000
    names = "".join(f"property float p{number}\n" for number in range(count))
    header = (
        f"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{names}"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path = tmp_path / "wide.ply"
    path.write_text(header + "".join(f"{at}{' 7' * count}\n" for at in ("0 0 0", "1 0 0", "0 1 0")) + "3 0 1 2\n")
    mesh = load_mesh(path, role="garment", key="garment", units="m")
    assert mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_ply_texture_coordinates_per_face(tmp_path: Path) -> None:
    path = tmp_path / "faces.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_index\nproperty list uchar float texcoord\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 5 0 0 5\n"
    )
    texcoords = load(path).texcoords
    assert texcoords.tolist() == [[[0, 0], [5, 0], [0, 5]]]


def test_glb_scene_is_joined_in_place_with_texture(tmp_path: Path) -> None:
    """Two nodes of one mesh; the second moved and mirrored, so that its faces turn round."""
    uv = POINTS[:, :2]
    grid = trimesh.Trimesh(POINTS, TRIANGLES, process=False, visual=trimesh.visual.TextureVisuals(uv=uv))
    scene = trimesh.Scene()
    scene.add_geometry(grid, geom_name="left", node_name="left")
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = -0.5
    scene.add_geometry(grid, geom_name="right", node_name="right", transform=mirror)
    path = tmp_path / "scene.glb"
    path.write_bytes(scene.export(file_type="glb"))
    mesh = load(path)
    assert mesh.vertex_count == 32
    assert mesh.panel_names == ("left", "right")
    assert mesh.texcoords is not None
    normal = np.cross(*(mesh.points[mesh.triangles][:, i] - mesh.points[mesh.triangles][:, 0] for i in (1, 2)))
    assert (normal[:, 2] > 0).all()
    assert mesh.points[16:, 0].max() == pytest.approx(-0.5)


def test_glb_gives_the_mesh_that_is_named(tmp_path: Path) -> None:
    """By its node, by what its node hangs from, or by itself."""
    path, scene = tmp_path / "both.glb", trimesh.Scene()
    matrix = trimesh.transformations.translation_matrix((0.0, 0.0, 0.1))
    scene.graph.update("rig", matrix=matrix)
    for size, name in enumerate(("body", "shirt"), start=1):
        part = trimesh.Trimesh(size * POINTS, TRIANGLES, process=False)
        scene.add_geometry(part, geom_name=f"{name} data", node_name=name, parent_node_name="rig")
    path.write_bytes(as_bytes(scene.export(file_type="glb")))
    for asked in ("shirt", "shirt data"):
        shirt = load(path, prim=asked)
        np.testing.assert_allclose(shirt.points, 2.0 * POINTS + [0.0, 0.0, 0.1], atol=2.0 * FLOAT32_AT_ONE_METRE)
    assert load(path, prim="rig").vertex_count == load(path).vertex_count == 2 * len(POINTS)
    with pytest.raises(InputError, match=r'no mesh "skirt"; garment.prim may be body, shirt$'):
        load(path, prim="skirt")


def test_gltf_with_a_data_uri(tmp_path: Path) -> None:
    write(tmp_path / "whole.gltf")
    tree = json.loads((tmp_path / "whole.gltf").read_text())
    for buffer in tree["buffers"]:
        content = base64.b64encode((tmp_path / buffer["uri"]).read_bytes()).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{content}"
    path = tmp_path / "alone" / "single.gltf"
    path.parent.mkdir()
    path.write_text(json.dumps(tree))
    assert load(path).triangle_count == len(TRIANGLES)


@pytest.mark.parametrize(
    ("name", "vertices", "triangles"),
    [
        ("garmentcode/tshirt.obj", 7145, 14026),
        ("garmentcode/mean_all.obj", 23752, 47500),
        ("anny/female_avg_A_pose.obj", 13718, 27420),
        ("anny/female_avg_T_pose.obj", 13718, 27420),
        ("anny/female_avg_arms_down.obj", 13718, 27420),
    ],
)
def test_real_meshes_load_unchanged(shared_data: Path, name: str, vertices: int, triangles: int) -> None:
    role = "garment" if "tshirt" in name else "avatar"
    mesh = load(shared_data / name, role=role)
    assert (mesh.vertex_count, mesh.triangle_count) == (vertices, triangles)
    assert mesh.vertex_map is None
    assert mesh.triangle_source is None
    assert len(mesh.notes) == 1
    assert mesh.unit == "m"
    if role == "garment":
        assert mesh.texcoords.shape == (14026, 3, 2)
        assert len(mesh.panel_names) == 8


@pytest.mark.parametrize("name", ["grid.obj", "grid.ply", "grid.stl"])
def test_what_does_not_say_its_up_axis_is_stood_up_where_a_scene_says_it(tmp_path: Path, name: str) -> None:
    write(tmp_path / name)
    lying, standing = load(tmp_path / name, units="m"), load(tmp_path / name, units="m", up="z")
    x, y, z = lying.points.T
    np.testing.assert_array_equal(standing.points, np.stack([x, z, -y], axis=1))
    np.testing.assert_array_equal(standing.triangles, lying.triangles)


@pytest.mark.parametrize("name", ["grid.glb", "grid.usda"])
def test_what_says_its_up_axis_is_not_overruled(tmp_path: Path, name: str) -> None:
    write(tmp_path / name)
    with pytest.raises(InputError, match=r"files state their up axis.*; remove garment\.up"):
        load(tmp_path / name, up="z")


def test_a_body_that_lies_is_told_of(tmp_path: Path) -> None:
    def notes(body: trimesh.Trimesh, **options: object) -> tuple[str, ...]:
        (tmp_path / "body.obj").write_text(body.export(file_type="obj"))
        return load(tmp_path / "body.obj", **{"role": "avatar", "key": "avatar", "units": "m", **options}).notes

    def on_floor(body: trimesh.Trimesh) -> trimesh.Trimesh:
        below = trimesh.creation.box(extents=(4.0, 0.01, 4.0))
        return trimesh.util.concatenate([body, below.apply_translation((0.0, body.bounds[0, 1], 0.0))])

    lying = trimesh.creation.box(extents=(1.75, 0.3, 1.7))  # arms stretched out
    standing = trimesh.creation.box(extents=(1.75, 1.7, 0.3))
    for body in (lying, on_floor(lying)):
        assert [note for note in notes(body) if 'set avatar.up = "z"' in note]
    assert notes(lying, up="y") == notes(lying, up="z") == notes(standing) == notes(on_floor(standing)) == ()


def test_a_row_of_very_many_numbers_is_read_as_its_first(tmp_path: Path) -> None:
    more = "1 " * 200_000
    (tmp_path / "rows.obj").write_text(f"v 0 0 0 {more}\nv 1 0 0 {more}\nv 0 1 0 {more}\nf 1 2 3\n")
    mesh = load(tmp_path / "rows.obj")
    np.testing.assert_array_equal(mesh.points, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
