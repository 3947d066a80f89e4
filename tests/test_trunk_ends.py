"""The chest's level comes from the trunk: not from the head or feet, and not where arms hide the armpits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import sure_skeleton
from numpy.typing import NDArray

from warp_cloth.anatomy.openings import LEGS
from warp_cloth.anatomy.person import understand
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import load_mesh

GIRTH = 0.02  # [m]; the girth grows by 6 mm over each centimetre there

Heights = NDArray[np.float64]


def girths(body: Mesh) -> dict[str, float | None]:
    return {each.name: each.value for each in understand(closing_of(body).surface(body)).measures}


def share_of_stature(body: Mesh) -> Heights:
    (_, low, _), (_, high, _) = body.bounds()
    shares: Heights = (body.points[:, 1] - low) / (high - low)
    return shares


def with_hat(body: Mesh) -> Mesh:
    """A body whose crown is stretched by 18 cm."""
    lift = np.interp(share_of_stature(body), [0.96, 1.0], [0.0, 0.18])
    return replace(body, points=body.points + np.outer(lift, [0.0, 1.0, 0.0]))


def on_heels(body: Mesh) -> Mesh:
    """A body whose soles are stretched down by 10 cm."""
    drop = np.interp(share_of_stature(body), [0.0, 0.03], [0.1, 0.0])
    return replace(body, points=body.points - np.outer(drop, [0.0, 1.0, 0.0]))


def without_crown(body: Mesh) -> Mesh:
    """A scan that ends in the middle of the forehead."""
    return replace(body, triangles=body.triangles[share_of_stature(body)[body.triangles].max(axis=1) < 0.95])


@pytest.mark.parametrize("changed", [with_hat, on_heels, without_crown])
def test_head_and_feet_do_not_move_the_chest(body: Mesh, changed) -> None:
    before, after = girths(body), girths(changed(body))
    for name in ("chest", "waist"):
        assert after[name] == pytest.approx(before[name], abs=GIRTH)


@pytest.mark.parametrize("longer", [0.72, 1.35])
def test_the_hip_is_found_over_short_and_long_legs(body: Mesh, longer: float) -> None:
    """By the stature alone it was sought at the waist of who has short legs, and below the crotch of long ones."""
    skeleton = sure_skeleton(body)
    hips = float(skeleton.spine[0, 1])
    low = float(body.points[:, 1].min())
    height = body.points[:, 1]
    is_leg = np.isin(skeleton.limb, LEGS) & (height < hips)
    points = body.points.copy()
    points[:, 1] = np.where(is_leg, low + longer * (height - low), height + (longer - 1.0) * (hips - low))
    after = girths(replace(body, points=points))
    assert after["hip"] == pytest.approx(girths(body)["hip"], abs=GIRTH)


def test_a_chest_without_armpits_is_not_measured(shared_data: Path) -> None:
    """A scanner sees no armpits: what closes the holes there joins the arms to the trunk down to below the chest."""
    body = load_mesh(shared_data / "anny/female_avg_A_pose.obj", role="avatar", key="avatar")
    aside, share = (
        np.abs(body.points[body.triangles, 0].mean(axis=1)),
        share_of_stature(body)[body.triangles].mean(axis=1),
    )
    unseen = (np.abs(aside - 0.175) < 0.06) & (np.abs(share - 0.745) < 0.037)
    found = understand(closing_of(torn := replace(body, triangles=body.triangles[~unseen])).surface(torn))
    chest = next(each for each in found.measures if each.name == "chest")
    assert chest.value is None
    assert "grown together" in chest.reason
    assert all(each.value for each in found.measures if each.name in ("waist", "hip"))
