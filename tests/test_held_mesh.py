"""Meshes in memory: as their files, told where they are no meshes, and nothing left of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from meshfiles import ball, sheet, write_obj

import warp_cloth
from warp_cloth.base.errors import InputError
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene

PLAIN = ["solver.iterations=100", "collision.pixel_mm=10"]


def cloth() -> tuple[Any, Any]:
    """A sheet over the ball of ``meshfiles``."""
    points, faces = sheet(count=9, side=0.8)
    return points[:, [0, 2, 1]] * [1.0, 1.0, -1.0] + [0.0, 1.3, 1.4], faces


def as_trimesh(mesh: tuple[Any, Any], **visual: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(*mesh, process=False, **visual)


def test_meshes_in_memory_are_worn_with_the_bits_of_their_files(tmp_path: Path) -> None:
    write_obj(tmp_path / "cloth.obj", *cloth())
    write_obj(tmp_path / "ball.obj", *ball())
    files = warp_cloth.fit(tmp_path / "cloth.obj", on=tmp_path / "ball.obj", device="cpu", overrides=PLAIN)
    for garment, body in ((as_trimesh(cloth()), as_trimesh(ball())), (cloth(), ball())):
        held = warp_cloth.fit(garment, on=body, device="cpu", overrides=PLAIN)
        assert np.array_equal(held.garments[0].points, files.garments[0].points)


def test_every_digit_is_kept() -> None:
    points, faces = cloth()
    points = points + np.random.default_rng(0).uniform(0.0, 1e-3, points.shape)
    assert np.array_equal(load_outfit(load_scene((points, faces), on="mannequin")).garments[0].points, points)


def test_they_may_stand_wherever_a_file_may() -> None:
    scene = load_scene(
        {"garment": {"mesh": as_trimesh(cloth()), "fabric": "silk"}, "avatar": {"mesh": as_trimesh(ball())}}
    )
    assert len(load_outfit(scene).garments[0].points) == 81
    other = load_scene("sphere", {"avatar": {"mesh": as_trimesh(ball())}})
    assert other.avatar is not None
    assert other.avatar.mesh is not None
    assert other.avatar.mesh.exists()
    fitter = warp_cloth.Fitter(as_trimesh(cloth()), as_trimesh(ball()), device="cpu", overrides=PLAIN)
    plain = warp_cloth.fit(cloth(), on=ball(), device="cpu", overrides=[*PLAIN, "garment.fabric=denim"])
    assert np.array_equal(fitter.fit(fabric="denim").garments[0].points, plain.garments[0].points)


def test_texture_coordinates_are_panels() -> None:
    points, faces = cloth()
    uv = points[:, [0, 2]]
    drawn = as_trimesh((points, faces), visual=trimesh.visual.TextureVisuals(uv=uv))
    mesh = load_outfit(load_scene(drawn, on="mannequin")).meshes[0]
    assert mesh.texcoords is not None
    assert np.array_equal(mesh.texcoords, uv[mesh.triangles])


@pytest.mark.parametrize(
    ("garment", "said"),
    [
        (
            (np.zeros((4, 2)), [[0, 1, 2]]),
            "scene: its vertices are of shape [4, 2], float64; give vertices",
        ),
        ((np.zeros((4, 3)), [[0.5, 1, 2]]), "scene: its faces are of shape [1, 3], float64; give vertices"),
        ((np.zeros((4, 3)), [[0, 1], [1, 2, 3]]), "scene: its faces are no array; give vertices"),
        ((np.zeros((4, 3)), [[0, 1, 4]]), "scene: a face names vertex 4 of 4; count vertices from 0"),
        ((np.zeros((4, 3)), [[0, 1, -1]]), "scene: a face names vertex -1 of 4; count vertices from 0"),
        (
            SimpleNamespace(vertices=np.zeros((4, 3)), faces=[[0, 1, 2]], visual=SimpleNamespace(uv=np.zeros((3, 2)))),
            "scene: 3 texture coordinates for 4 vertices; give one for each",
        ),
    ],
)
def test_what_is_no_mesh_is_refused(garment: Any, said: str) -> None:
    with pytest.raises(InputError) as error:
        load_scene(garment, on="mannequin")
    assert str(error.value).startswith(said)


def test_old_files_go_where_there_are_very_many(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [load_scene((np.eye(3) * number, [[0, 1, 2]]), on="mannequin") for number in (1.0, 2.0, 3.0)]
    files = [scene.garments[0].mesh for scene in scenes]
    assert all(file is not None and file.exists() for file in files)
    monkeypatch.setattr("warp_cloth.scene.held_mesh.MOST_BYTES", 100)
    last = load_scene((np.eye(3) * 4.0, [[0, 1, 2]]), on="mannequin").garments[0].mesh
    assert last is not None
    assert last.exists()
    assert not any(file is not None and file.exists() for file in files)


def test_a_fitter_takes_another_body() -> None:
    fitter = warp_cloth.Fitter(cloth(), ball(), device="cpu", overrides=PLAIN)
    points, faces = ball()
    larger = points * 1.02, faces
    for avatar in (larger, ball()):
        plain = warp_cloth.fit(cloth(), on=avatar, device="cpu", overrides=PLAIN)
        assert np.array_equal(fitter.fit(avatar=avatar).garments[0].points, plain.garments[0].points)
    assert not np.array_equal(fitter.fit(avatar=larger).garments[0].points, fitter.fit().garments[0].points)


def test_no_file_is_left_of_them(tmp_path: Path) -> None:
    code = (
        "import warp_cloth, numpy as np\n"
        "scene = warp_cloth.load_scene((np.eye(3), [[0, 1, 2]]), on='mannequin')\n"
        "print(scene.garments[0].mesh)"
    )
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert not Path(run.stdout.strip()).exists()
    assert not Path(run.stdout.strip()).parents[1].exists()
