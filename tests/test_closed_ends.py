"""Flat patches that close the ends of a garment modelled in 3-D are left out where a limb would pass through them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloths import tube
from meshfiles import obj_text

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.closed_ends import closed_ends, with_open_ends
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.scene import load_scene

RADIUS, LOW, HIGH = 0.3, 0.6, 1.0
TUBE = tube(RADIUS, LOW, HIGH, around=96, rows=20)  # a skirt round the mannequin


def capped(mesh: Mesh, height: float = 0.0) -> Mesh:
    """With its lower end closed by a fan of triangles, whose middle is that much lower [m]."""
    ring = np.flatnonzero(mesh.points[:, 1] < LOW + 1e-6)
    angle = np.arctan2(mesh.points[ring, 2], mesh.points[ring, 0])
    ring = ring[np.argsort(angle)]
    middle = mesh.points[ring].mean(axis=0) - [0.0, height, 0.0]
    fan = np.stack([ring, np.roll(ring, -1), np.full(len(ring), mesh.vertex_count)], axis=1)
    points = np.concatenate([mesh.points, middle[None]])
    return Mesh("skirt", points, np.concatenate([mesh.triangles, fan]).astype(np.int32))


def outfit_of(path: Path, mesh: Mesh, **garment: Any) -> Outfit:
    path.write_text(obj_text(mesh.points, mesh.triangles))
    table = {"mesh": str(path), "units": "m", **garment}
    return load_outfit(load_scene({"garment": table, "avatar": {"shape": {"kind": "mannequin"}}}))


def test_a_flat_patch_with_a_sharp_rim_closes_an_end() -> None:
    mesh = capped(TUBE)
    (end,) = closed_ends(mesh.points, mesh.triangles)
    assert end.tolist() == list(range(TUBE.triangle_count, mesh.triangle_count))


def stairs(size: float) -> tuple[Points, np.ndarray]:
    """A strip in steps: patches with sharp edges, and rims at their sides."""
    steps = np.array([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]) * size
    points = np.concatenate([np.column_stack([steps, np.full(5, z)]) for z in (0.0, size)])
    faces = [(k, k + 1, k + 6) for k in range(4)] + [(k, k + 6, k + 5) for k in range(4)]
    return points, np.array(faces, dtype=np.int32)


def test_others_do_not() -> None:
    flat, pointed = capped(TUBE), capped(TUBE, height=0.2)
    for points, triangles in (
        (TUBE.points, TUBE.triangles),
        (pointed.points, pointed.triangles),
        (0.04 * flat.points, flat.triangles),  # a finger's
        stairs(0.1),
    ):
        assert closed_ends(points, triangles) == []


def test_opened_it_is_as_it_was() -> None:
    opened = with_open_ends(capped(TUBE))
    np.testing.assert_array_equal(opened.points, TUBE.points)
    np.testing.assert_array_equal(opened.triangles, TUBE.triangles)
    assert opened.vertex_map.tolist() == [*range(TUBE.vertex_count), -1]
    assert opened.triangle_source.tolist() == list(range(TUBE.triangle_count))


def test_what_limbs_pass_through_is_opened(tmp_path: Path) -> None:
    outfit = outfit_of(tmp_path / "skirt.obj", capped(TUBE))
    (choice,) = [each for each in outfit.readings if each.key == "garment.open_ends"]
    assert (choice.value, "right leg, left leg" in choice.reason) == (True, True)
    assert outfit.meshes[0].triangle_count == TUBE.triangle_count


@pytest.mark.parametrize(("garment", "up"), [({"open_ends": False}, 0.0), ({}, -0.65)])
def test_what_its_author_keeps_and_what_no_limb_meets_stays(tmp_path: Path, garment: dict, up: float) -> None:
    mesh = capped(TUBE)
    lifted = Mesh("skirt", mesh.points + np.array([0.0, up, 0.0]), mesh.triangles)
    outfit = outfit_of(tmp_path / "skirt.obj", lifted, **garment)
    assert outfit.meshes[0].triangle_count >= mesh.triangle_count
    assert not [each for each in outfit.readings if each.key == "garment.open_ends"]


def test_only_a_mesh_has_ends_to_open() -> None:
    with pytest.raises(InputError, match=r"garment.open_ends: open_ends is for a mesh; remove it$"):
        load_scene({"garment": {"shape": {"kind": "tshirt"}, "open_ends": True}})
