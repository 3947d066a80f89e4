"""GLB and OBJ hold the worn mesh: vertices in their order, in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from worn import box_avatar, worn

from warp_cloth.base.errors import InputError
from warp_cloth.export.formats import chosen_formats
from warp_cloth.export.meshes import write_glb, write_obj
from warp_cloth.loading import load_mesh

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
    colours = shirt.visual.vertex_colors[:, :3] / 255
    assert np.abs(colours[0] - (0.058, 0.0003, 0.089)).max() < 2 * BYTE  # viridis' dark end in linear light
    assert set(scene.geometry) == {"shirt", "body"}


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
