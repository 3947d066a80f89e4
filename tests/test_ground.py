"""Bodies grown together with what they stand on."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import sure_skeleton
from meshfiles import box

from warp_cloth.anatomy.ground import above_ground
from warp_cloth.anatomy.person import understand
from warp_cloth.anatomy.skeleton import LEFT_ARM
from warp_cloth.anatomy.wrapping import wrapped
from warp_cloth.base.mesh import Indices, Mesh, Points

SOLES = 0.012  # [m] that the feet are sunk in


def block(half: float, low: float, high: float) -> tuple[Points, Indices]:
    return box((-half, low, -half), (half, high, half))


@pytest.mark.parametrize(("half", "low"), [(0.6, -0.03), (0.35, -0.4)])
def test_who_is_grown_together_with_a_floor_or_a_plinth_has_limbs(body: Mesh, half: float, low: float) -> None:
    corners, sides = block(half, low, SOLES)
    faces = np.concatenate([body.triangles, sides + body.vertex_count]).astype(np.int32)
    scan = Mesh("scan", *wrapped(np.vstack([body.points, corners]), faces))
    found, alone = understand(scan), understand(Mesh("scan", *wrapped(body.points, body.triangles)))
    assert found.skeleton is not None, found.reason
    assert found.skeleton.is_on_ground
    assert any("grown together with a floor" in note for note in found.notes)
    height = scan.points[:, 1]
    assert not found.skeleton.own[height < SOLES].any()
    assert found.skeleton.own[height > 0.1].all()
    measured, without = ({each.name: each.value for each in person.measures} for person in (found, alone))
    for name in ("chest", "waist", "hip"):
        assert measured[name] == pytest.approx(without[name], abs=0.02)
    assert without["stature"] - 0.05 < measured["stature"] < without["stature"]


def test_what_a_hand_holds_is_no_floor(body: Mesh) -> None:
    """A bag was taken for the floor, since one of its sides is flat and large."""
    skeleton = sure_skeleton(body)
    hand = skeleton.curves[LEFT_ARM][-3]
    low, high = np.array([0.04, 0.35, 0.22]), np.array([0.04, 0.02, 0.22])
    bag, sides = box(hand - low, hand + high)
    faces = np.concatenate([body.triangles, sides + body.vertex_count]).astype(np.int32)
    found = understand(Mesh("scan", *wrapped(np.vstack([body.points, bag]), faces)))
    assert found.skeleton is not None
    assert not found.skeleton.is_on_ground
    assert not any("floor" in note for note in found.notes)


def test_bodies_and_boxes_stand_on_nothing(body: Mesh) -> None:
    assert above_ground(body.points, body.triangles) is None
    assert above_ground(*block(0.4, 0.0, 1.0)) is None
