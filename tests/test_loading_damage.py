"""Damaged files, byte by byte: every one ends as a mesh or as one line, never as anything else."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, Vt

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import load_mesh

CASES = {"obj": 40, "ply": 40, "stl": 40, "glb": 40, "gltf": 30, "usda": 8, "usdc": 12}  # USD: a process each
POINTS = np.array([[x, y, 0.0] for y in range(3) for x in range(3)]) / 2.0
TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]])


def whole(folder: Path, kind: str) -> bytes:
    """A small grid in the format; its other files are written into the folder."""
    grid = trimesh.Trimesh(POINTS, TRIANGLES, process=False)
    if kind.startswith("usd"):
        path = folder / f"whole.{kind}"
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        mesh = UsdGeom.Mesh.Define(stage, "/grid")
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(POINTS.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr([3] * len(TRIANGLES))
        mesh.CreateFaceVertexIndicesAttr(TRIANGLES.reshape(-1).tolist())
        stage.Save()
        return path.read_bytes()
    if kind == "gltf":
        parts = grid.export(file_type="gltf")
        for name, content in parts.items():
            (folder / name).write_bytes(content)
        return next(content for name, content in parts.items() if name.endswith("gltf"))
    content = grid.export(file_type=kind)
    return content.encode() if isinstance(content, str) else content


def damaged(content: bytes, seed: int) -> bytes:
    chance = random.Random(seed)
    if chance.random() < 0.3:
        return content[: chance.randrange(1, len(content))]
    changed = bytearray(content)
    for _ in range(chance.choice([1, 2, 8, 40])):
        changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def outcome(path: Path, role: str) -> Mesh | InputError:
    try:
        return load_mesh(path, role=role, key=role)  # type: ignore[arg-type]
    except InputError as error:
        return error


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.filterwarnings("error")
def test_damage_ends_as_a_mesh_or_as_one_line(tmp_path: Path, kind: str) -> None:
    content = whole(tmp_path, kind)
    refused = 0
    for seed in range(CASES[kind]):
        path = tmp_path / f"damaged{seed}.{kind}"
        path.write_bytes(damaged(content, seed))
        found = outcome(path, "garment" if seed % 2 else "avatar")
        if isinstance(found, InputError):
            refused += 1
            assert "\n" not in str(found)
            assert found.remedy
        else:
            assert np.isfinite(found.points).all()
            assert found.triangles.min() >= 0
            assert found.triangles.max() < found.vertex_count
    assert refused > CASES[kind] // 4
