"""Chest, waist and hip, and ease at them, of who lacks limbs or does not stand straight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import sure_skeleton
from cloths import tube

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.levels import body_levels
from warp_cloth.anatomy.skeleton import LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, TRUNK, Skeleton
from warp_cloth.anatomy.stored_body import levels_of
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.maps.girths import TrunkLevels, garment_girths
from warp_cloth.material.fabric import Fabric
from warp_cloth.shapes import mannequin

GIRTH = 0.015  # [m]: without legs the stature is estimated, and the hip is searched for by it
NEAR = 0.01  # [m], below the edges' 15 mm


@pytest.fixture(scope="module")
def body() -> Mesh:
    return mannequin(edge=0.015)


def without(body: Mesh, skeleton: Skeleton, *limbs: int) -> tuple[Mesh, Skeleton]:
    kept = ~np.isin(skeleton.limb, limbs)[body.triangles].any(axis=1)
    used, corners = np.unique(body.triangles[kept], return_inverse=True)
    open_cut = Mesh("cut", body.points[used], corners.reshape(-1, 3).astype(np.int32))
    cut = closing_of(open_cut).surface(open_cut)
    of_lids = cut.vertex_count - len(used)  # which are added
    limb = np.append(skeleton.limb[used], np.full(of_lids, TRUNK, dtype=np.int8))
    station = np.append(skeleton.station[used], np.zeros(of_lids))
    own = np.ones(cut.vertex_count, dtype=np.bool_)
    return cut, replace(skeleton, skin=cut.points, lacks=limbs, limb=limb, station=station, own=own)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("limbs", [(LEFT_ARM,), (RIGHT_ARM, LEFT_ARM), (RIGHT_LEG, LEFT_LEG)])
def test_who_lacks_limbs_has_the_girths_of_who_has_them(
    body: Mesh, skeleton: Skeleton, limbs: tuple[int, ...], turned: bool
) -> None:
    whole = {level.name: level for level in body_levels(body)}
    cut, left = without(body, skeleton, *limbs)
    spin = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]) if turned else np.eye(3)
    cut = replace(cut, points=cut.points @ spin)
    left = replace(
        left,
        curves=tuple(curve @ spin for curve in left.curves),
        spine=left.spine @ spin,
        forward=left.forward @ spin,
        left=left.left @ spin,
        skin=cut.points,
    )
    found = levels_of(cut, left)
    assert found is not None
    assert [level.name for level in found] == ["chest", "waist", "hip"]
    for level in found:
        assert level.girth == pytest.approx(whole[level.name].girth, abs=GIRTH)
        section = level.section
        trunk = section.ends[section.part == level.trunk].reshape(-1, 2)
        on_skin = cut.points[np.abs(cut.points[:, 1] - level.height) < NEAR][:, [0, 2]]
        off = np.linalg.norm(trunk[:, None] - on_skin, axis=2).min(axis=1)
        assert off.max() < 2.0 * NEAR  # it lies in the body's own axes


def test_bent_hips_have_no_girth(body: Mesh, skeleton: Skeleton) -> None:
    """Sections through who sits or strides go through thighs, too: 160 cm of 97 were given."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # legs forward
    curves = list(skeleton.curves)
    for leg in (RIGHT_LEG, LEFT_LEG):
        joint = skeleton.joints[leg]
        hip, below = curves[leg][joint], curves[leg][joint:]
        curves[leg] = np.vstack([curves[leg][:joint], hip + (below - hip) @ turn])
    found = levels_of(body, replace(skeleton, curves=tuple(curves)))
    assert found is not None
    assert [level.name for level in found] == ["chest", "waist"]


def test_empty_sleeves_are_left_out_where_no_arm_tells_them(body: Mesh, skeleton: Skeleton) -> None:
    """A tube that is at once much wider above a height within reach of the chest, as where sleeves hang next to it."""
    cut, left = without(body, skeleton, RIGHT_ARM, LEFT_ARM)
    levels = levels_of(cut, left)
    assert levels is not None
    chest = levels[0].height
    rest = tube(0.2, chest - 0.3, chest + 0.2, rows=51)
    sheet = build_rest_shape(rest, Fabric(), rest="mesh").sheet
    assert sheet is not None
    trunk = TrunkLevels(cut, levels)
    plain = garment_girths("tube", rest.points, sheet, trunk)[0]
    wide = rest.points.copy()
    is_above = wide[:, 1] > chest - 0.06
    wide[is_above] *= [1.4, 1.0, 1.4]
    sleeved = build_rest_shape(replace(rest, points=wide), Fabric(), rest="mesh").sheet
    assert sleeved is not None
    row = garment_girths("tube", wide, sleeved, trunk)[0]
    assert row["natural_girth"] == pytest.approx(plain["natural_girth"], rel=0.01)
    assert row["height"] < plain["height"] + 1.0


def test_a_large_head_hides_no_chest(body: Mesh, skeleton: Skeleton) -> None:
    """Arms' roots are estimated by stature and neck, too: they seem too high, and arms to join the trunk too low."""
    chest, *_ = body_levels(body)
    neck = skeleton.spine[-1] + [0.0, 0.05, 0.0]
    above = np.maximum(body.points[:, 1] - neck[1], 0.0)
    share = np.clip(above / 0.1, 0.0, 1.0)[:, None]
    grown = replace(body, points=body.points + share * (2.2 - 1.0) * (body.points - neck) * (above[:, None] > 0.0))
    figure = Figure.of(grown, sure_skeleton(grown))
    assert figure.levels["chest"].girth == pytest.approx(chest.girth, abs=GIRTH)
