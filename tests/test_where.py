"""Cloth is said to lie on the part of the body that it lies on, with its side, in any pose."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import sure_skeleton

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.report.where import part_under


def skin(body: Mesh, part: str) -> Points:
    """Points of the skin at a part, by where they are in a body that stands with its arms out [m]."""
    x, height = body.points[:, 0], body.points[:, 1] / body.points[:, 1].max()
    out = np.abs(x) / np.abs(x).max()
    is_trunk = out < 0.25
    where = {
        "head": height > 0.93,
        "chest": (np.abs(height - 0.73) < 0.02) & is_trunk,
        "waist": (np.abs(height - 0.63) < 0.02) & is_trunk,
        "hip": (np.abs(height - 0.52) < 0.02) & is_trunk,
        "hands": out > 0.93,
        "left hand": (out > 0.93) & (x > 0.0),
        "right arm": (np.abs(out - 0.6) < 0.05) & (x < 0.0) & (height > 0.5),
        "legs": np.abs(height - 0.3) < 0.03,
        "feet": height < 0.03,
        "right foot": (height < 0.03) & (x < 0.0),
    }
    return body.points[where[part]]


@pytest.mark.parametrize(
    "part", ["head", "chest", "waist", "hip", "hands", "left hand", "right arm", "legs", "feet", "right foot"]
)
def test_cloth_is_named_by_the_part_it_lies_on(body: Mesh, part: str) -> None:
    skeleton = sure_skeleton(body)
    assert part_under(skin(body, part), skeleton) == part
