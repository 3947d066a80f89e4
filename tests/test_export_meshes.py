"""GLB, OBJ and point caches hold the worn mesh: vertices in their order, in metres."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from worn import box_avatar, worn

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import vertex_normals
from warp_cloth.export.formats import check_frames, chosen_formats
from warp_cloth.export.meshes import write_glb, write_obj
from warp_cloth.export.point_cache import write_point_caches
from warp_cloth.loading import load_mesh
from warp_cloth.material.fabric import fabric_named

FLOAT32 = 1e-7  # [m], near 1 m
BYTE = 1 / 255


def test_glb_keeps_vertices_their_order_and_maps(tmp_path: Path) -> None:
    garment = worn()
    garment.fields["pressure"] = np.linspace(0, 1, len(garment.points), dtype=np.float32)
    path = tmp_path / "fit.glb"
    write_glb(path, garments=[garment], avatar=box_avatar(), ranges={"pressure": (0.0, 1.0)}, colour="pressure")
    scene = trimesh.load(path, process=False)
    shirt = scene.geometry["shirt"]
    assert np.abs(shirt.vertices - garment.points).max() < FLOAT32
    assert np.array_equal(shirt.faces, garment.mesh.triangles)
    assert np.allclose(np.ravel(shirt.vertex_attributes["_pressure"]), garment.fields["pressure"])
    colours = shirt.visual.vertex_attributes["color"][:, :3] / 255
    assert np.abs(colours[0] - (0.058, 0.0003, 0.089)).max() < 2 * BYTE  # viridis' dark end in linear light
    assert set(scene.geometry) == {"shirt", "body"}


def test_glb_has_smooth_normals_panels_and_materials_named_by_garment_and_fabric(tmp_path: Path) -> None:
    path = tmp_path / "fit.glb"
    plain, jersey = worn("wide coat"), replace(worn("shirt", toward=0.6), fabric=fabric_named("jersey"))
    write_glb(path, garments=[plain, jersey], avatar=box_avatar(), ranges={})
    scene = trimesh.load(path, process=False)
    for name, points, triangles in (
        ("shirt", jersey.points, jersey.mesh.triangles),
        ("body", box_avatar().points, box_avatar().triangles),
    ):
        assert np.abs(scene.geometry[name].vertex_normals - vertex_normals(points, triangles)).max() < 1e-6
    materials = {name: part.visual.material.name for name, part in scene.geometry.items()}
    assert materials == {"wide coat": "wide_coat", "shirt": "shirt_jersey", "body": "body"}
    front = np.ravel(scene.geometry["shirt"].vertex_attributes["_panel_front"])
    mesh = jersey.mesh
    assert np.array_equal(np.flatnonzero(front), np.unique(mesh.triangles[mesh.panels == 0]))
    assert "_panel_panel_2" in scene.geometry["shirt"].vertex_attributes


def test_obj_names_materials_and_has_normals_at_each_corner(tmp_path: Path) -> None:
    path = tmp_path / "my fit.obj"
    garment = replace(worn("wide coat"), fabric=fabric_named("jersey"))
    assert write_obj(path, garments=[garment]) == tmp_path / "my_fit.mtl"
    lines = path.read_text().splitlines()
    assert lines[0] == "mtllib my_fit.mtl"
    assert "newmtl wide_coat_jersey" in (tmp_path / "my_fit.mtl").read_text().splitlines()
    assert "usemtl wide_coat_jersey" in lines
    normals = np.array([line.split()[1:] for line in lines if line.startswith("vn ")], dtype=float)
    assert np.abs(normals - vertex_normals(garment.points, garment.mesh.triangles)).max() < 1e-5
    corners = [corner.split("/") for line in lines if line.startswith("f ") for corner in line.split()[1:]]
    assert all(vertex == normal for vertex, _, normal in corners)


def test_faces_keep_the_materials_of_their_file(tmp_path: Path) -> None:
    source, written = tmp_path / "two.obj", tmp_path / "fit.obj"
    corners = "".join(f"v {x} {y} 0\n" for y in (0, 0.1, 0.2, 0.3) for x in (0, 0.1))
    source.write_text(
        f"{corners}o shirt\nusemtl red cotton\nf 1 2 4 3\nusemtl lining\nf 3 4 6 5\nusemtl red cotton\nf 5 6 8 7\n"
    )
    mesh = load_mesh(source, role="garment", key="garment", units="m")
    assert mesh.material_names == ("red cotton", "lining")
    garment = replace(worn("shirt"), mesh=mesh, points=mesh.points, fields={})
    write_obj(written, garments=[garment, replace(garment, name="other")])
    used = [line.removeprefix("usemtl ") for line in written.read_text().splitlines() if line.startswith("usemtl")]
    assert used == ["red_cotton", "lining", "red_cotton"] * 2
    looks = (tmp_path / "fit.mtl").read_text().splitlines()
    assert [line for line in looks if line.startswith("newmtl")] == ["newmtl red_cotton", "newmtl lining"]
    again = load_mesh(written, role="garment", key="garment", units="m")
    assert again.materials is not None
    assert mesh.materials is not None
    assert np.array_equal(again.materials[: mesh.triangle_count], mesh.materials)


def test_materials_of_one_name_in_two_files_stay_two(tmp_path: Path) -> None:
    """Or the trousers would have the shirt's colour, and one could not be changed without the other."""
    garments = []
    for name in ("shirt", "trousers"):
        mesh = replace(worn(name).mesh, name=name, material_names=("Fabric", "Lining"))
        mesh = replace(mesh, materials=np.zeros(mesh.triangle_count, dtype=np.int32))
        garments.append(replace(worn(name), mesh=mesh))
    write_obj(tmp_path / "fit.obj", garments=garments)
    looks = (tmp_path / "fit.mtl").read_text().splitlines()
    assert [line for line in looks if line.startswith("newmtl")] == ["newmtl Fabric", "newmtl Fabric_trousers"]
    used = [line for line in (tmp_path / "fit.obj").read_text().splitlines() if line.startswith("usemtl")]
    assert used == ["usemtl Fabric", "usemtl Fabric_trousers"]
    assert len({line for line in looks if line.startswith("Kd")}) == 2


def test_point_caches_hold_every_frame_of_each_garment(tmp_path: Path) -> None:
    garments = [worn("shirt", frame_count=4), worn("coat")]
    paths = write_point_caches(tmp_path / "fit.pc2", garments=garments)
    assert [path.name for path in paths] == ["fit_shirt.pc2", "fit_coat.pc2"]
    for path, frames in zip(paths, (garments[0].frames, garments[1].points[None].astype(np.float32)), strict=True):
        signature, version, points, start, rate, samples = struct.unpack("<12siiffi", path.read_bytes()[:32])
        assert (signature, version, start, rate) == (b"POINTCACHE2\0", 1, 1.0, 1.0)
        shapes = np.frombuffer(path.read_bytes(), dtype="<f4", offset=32).reshape(samples, points, 3)
        assert np.array_equal(shapes, frames)


def test_buttons_have_a_point_cache_of_their_own(tmp_path: Path) -> None:
    garment = worn("coat", frame_count=4)
    corners = garment.mesh.points[garment.mesh.triangles[0]]
    mesh = replace(
        garment.mesh, trim_points=corners + np.array([0.0, 0.0, 0.005]), trim_triangles=np.array([[0, 1, 2]], np.int32)
    )
    garment = replace(garment, mesh=mesh)
    _, path = write_point_caches(tmp_path / "fit.pc2", garments=[garment])
    assert path.name == "fit_coat_trims.pc2"
    shapes = np.frombuffer(path.read_bytes(), dtype="<f4", offset=32).reshape(4, 3, 3)
    assert garment.trims is not None
    assert np.array_equal(shapes[-1], garment.trims.at(garment.frames[-1]).astype(np.float32))
    assert shapes[0, 0, 1] - shapes[-1, 0, 1] == pytest.approx(0.2, abs=1e-5)


def test_a_point_cache_without_frames_is_refused_before_the_work() -> None:
    check_frames(("usdc",), frames=False, remedy="add --frames 48")
    with pytest.raises(InputError, match="pc2 holds intermediate shapes, and there are none; add --frames 48"):
        check_frames(("pc2",), frames=False, remedy="add --frames 48")


def test_obj_keeps_vertices_their_order_panels_and_texture(tmp_path: Path) -> None:
    garment = worn()
    path = tmp_path / "fit.obj"
    write_obj(path, garments=[garment])
    back = load_mesh(path, role="garment", key="garment", units="m")
    assert np.abs(back.points - garment.points).max() < FLOAT32
    assert np.array_equal(back.triangles, garment.mesh.triangles)
    assert np.allclose(back.texcoords, garment.mesh.texcoords)
    assert back.panel_names[:2] == ("front", "back")
    assert np.array_equal(back.panels, garment.mesh.panels)


def test_two_garments_in_an_obj_keep_their_own_indices(tmp_path: Path) -> None:
    path = tmp_path / "fit.obj"
    write_obj(path, garments=[worn("shirt"), worn("wide coat", toward=0.6)])
    text = path.read_text().splitlines()
    assert [line for line in text if line.startswith("o ")] == ["o shirt", "o wide_coat"]
    faces = [int(corner.split("/")[0]) for line in text if line.startswith("f ") for corner in line.split()[1:]]
    assert (min(faces), max(faces)) == (1, 98)


def test_formats_are_told_apart() -> None:
    assert chosen_formats("usdc, .GLB") == ("usdc", "glb")
    with pytest.raises(InputError, match='"fbx" is not a supported format'):
        chosen_formats("usdc,fbx")
