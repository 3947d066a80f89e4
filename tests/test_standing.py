"""Garments placed for one who stands, on bodies that do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bodies import sure_skeleton
from meshfiles import write_obj

from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.anatomy.standing import moved_from_standing
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.loading import load_mesh


def bent(points: Points, height: float, degrees: float, *, above: bool) -> Points:
    """A body bent forward at a height [m], within 10 cm of it: what is above, or below."""
    share = np.clip((points[:, 1] - height) / 0.1 + 0.5, 0.0, 1.0)
    angle = np.radians(degrees) * (share if above else 1.0 - share) * (1.0 if above else -1.0)
    y, z = points[:, 1] - height, points[:, 2]
    return np.stack(
        [points[:, 0], height + np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z], axis=1
    )


def on_floor(points: Points) -> Points:
    moved: Points = points - [0.0, points[:, 1].min(), 0.0]
    return moved


def skeleton(folder: Path, body: Mesh, points: Points) -> Skeleton:
    write_obj(folder / "body.obj", points, body.triangles)
    return sure_skeleton(load_mesh(folder / "body.obj", role="avatar", key="avatar"))


def test_cloth_stays_where_the_body_stands(tmp_path: Path, body: Mesh) -> None:
    assert moved_from_standing(body.points, skeleton(tmp_path, body, body.points)) is None


def test_cloth_comes_down_with_who_sits(tmp_path: Path, body: Mesh) -> None:
    knees, hips = 0.28 * np.ptp(body.points[:, 1]), 0.52 * np.ptp(body.points[:, 1])
    seated = on_floor(bent(bent(body.points, knees, -85.0, above=False), hips, 85.0, above=False))
    moved = moved_from_standing(body.points, skeleton(tmp_path, body, seated))
    assert moved is not None
    chest = body.points[:, 1] > hips + 0.15
    assert (body.points - seated)[chest, 1].min() > 0.3
    assert np.abs(moved - seated)[chest].max() < 0.15  # knees and hips bent so sharply shorten the legs' curves


def test_cloth_bows_with_the_trunk(tmp_path: Path, body: Mesh) -> None:
    waist = 0.58 * np.ptp(body.points[:, 1])
    bowed = on_floor(bent(body.points, waist, 40.0, above=True))
    moved = moved_from_standing(body.points, skeleton(tmp_path, body, bowed))
    assert moved is not None
    chest = (body.points[:, 1] > waist + 0.1) & (body.points[:, 1] < waist + 0.3) & (np.abs(body.points[:, 0]) < 0.15)
    assert np.median(np.linalg.norm(moved - bowed, axis=1)[chest]) < 0.1
