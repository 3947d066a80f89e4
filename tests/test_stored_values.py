"""What is derived from meshes and kept on disk is what would be derived again."""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warp_cloth.anatomy.levels import body_levels
from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.disk_cache import ENDING, Entry, disk_cache, key_of
from warp_cloth.base.first_run import FOLDER
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.stored_value import stored, stored_value
from warp_cloth.base.topology import mesh_edges
from warp_cloth.garment import stored_hinges
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.outfit import load_avatar
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.options import Terms
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.patches import cutting, spread
from warp_cloth.model.patches.cutting import garment_patches
from warp_cloth.model.patches.spread import spread_places
from warp_cloth.model.patches.tables import PatchTables
from warp_cloth.scene import load_scene
from warp_cloth.shapes import sphere, square


def same_value(first: Any, again: Any) -> bool:
    """Whether two dataclasses of arrays, or what is in them, are the same."""
    if isinstance(first, np.ndarray):
        return first.dtype == again.dtype and np.array_equal(first, again)
    if isinstance(first, tuple):
        return len(first) == len(again) and all(map(same_value, first, again))
    if isinstance(first, dict):
        return list(first) == list(again) and all(map(same_value, first.values(), again.values()))
    if is_dataclass(first):
        return all(same_value(value, getattr(again, name)) for name, value in vars(first).items())
    return bool(first == again)


def test_stored_hinges_are_those_that_are_fitted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    mesh = square(side=0.5, vertices_per_side=32, height=0.0, plane="horizontal")
    plain = Fabric(bending_warp=2e-6, bending_weft=1e-6)
    fabrics = [plain, replace(plain, bending_friction_warp=1e-3, bending_friction_weft=1e-3)]
    made = [build_rest_shape(mesh, fabric, rest="mesh") for fabric in fabrics]
    assert len(list(tmp_path.glob(f"hinges-*{ENDING}"))) == len(fabrics)
    monkeypatch.setattr(stored_hinges, "_made", lambda *_: pytest.fail("is there"))
    for first, fabric in zip(made, fabrics, strict=True):
        again = build_rest_shape(mesh, replace(fabric, name="other", friction=0.5), rest="mesh")
        assert np.array_equal(again.hinge_stiffness, first.hinge_stiffness)
        assert (first.hinge_slider is None) == (again.hinge_slider is None) == (fabric is plain)
        assert first.hinge_slider is None or np.array_equal(again.hinge_slider, first.hinge_slider)


def test_what_is_stored_of_a_body_is_what_was_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    body = load_avatar(load_scene("tshirt"))

    makers = {"skeleton": skeleton_of, "levels": body_levels, "closing": closing_of}
    for name, make in makers.items():
        made = stored_value(name, ("base",), make, body)
        again = stored_value(name, ("base",), lambda _: pytest.fail("is there"), body)
        assert type(again) is type(made) is not type(None)
        assert same_value(made, again)
    small = sphere(radius=0.2, edge=0.05)
    assert stored_value("list", ("base",), lambda _: [1], small) == [1], "too small to be stored"
    with pytest.raises(TypeError, match="list"):
        stored_value("list", ("base",), lambda _: [1], body)


@pytest.fixture
def many_vertices() -> Mesh:
    return square(side=0.5, vertices_per_side=48, height=0.0, plane="horizontal")


def test_stored_axes_are_those_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, many_vertices: Mesh) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    mesh = many_vertices
    ends = mesh_edges(mesh.triangles, mesh.vertex_count)
    first = spread_places(ends, mesh.points)
    monkeypatch.setattr(spread, "_axes", lambda *_: pytest.fail("is there"))
    assert np.array_equal(spread_places(ends, mesh.points), first)
    assert not np.array_equal(spread_places(ends, 2.0 * mesh.points + np.arange(3.0) * mesh.points), first)


def test_stored_patches_are_those_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, many_vertices: Mesh) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    mesh, terms = many_vertices, Terms(edges=True, folds=True, yarns=False)
    elements = garment_elements(mesh.triangles, build_rest_shape(mesh, Fabric(), rest="mesh"))

    def patches(size: int) -> list[PatchTables]:
        cut = {"precision": "mixed", "cache": Cache(), "size": size, "paired": False}
        return garment_patches([elements], [mesh.points], terms, **cut)

    (first,) = patches(64)
    with monkeypatch.context() as patched:
        patched.setattr(cutting, "_garment_tables", lambda *_: pytest.fail("is there"))
        assert same_value(first, patches(64)[0])
    assert not same_value(first, patches(96)[0])


@pytest.mark.parametrize(
    "planted",
    [
        ["data", "os", "getpid"],
        ["data", "warp_cloth.base.disk_cache", "disk_cache"],
        ["data", "warp_cloth.nowhere", "Thing"],
        ["data", "warp_cloth.base.mesh", "Mesh"],
        ["array", "none"],
        ["what"],
    ],
)
def test_a_planted_value_is_derived_again(planted: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    disk_cache().write(key_of("thing", ("base",)), Entry({}, {"value": planted}))
    assert stored("thing", ("base",), lambda: (1, 2.5, "a")) == (1, 2.5, "a")
    assert stored("thing", ("base",), lambda: pytest.fail("is there")) == (1, 2.5, "a")
