"""A shirt's girth round the trunk, against the body's chest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import sure_skeleton
from judging import judge, loaded
from meshfiles import write_obj

from warp_cloth.anatomy.openings import ARMS
from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.anatomy.trunk_girth import trunk_girth
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import Ended
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.next_attempt import next_attempt
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene

OFF = 0.01  # [m], of the shirt from the skin
RING = 0.02  # a ring of cloth is longer than the tape, which spans hollows, by its distance from the skin, and by that


@pytest.fixture(scope="module")
def shirt(body: Mesh) -> Mesh:
    """The body's skin without head, forearms, hands, and all below the crotch."""
    skeleton = sure_skeleton(body)
    end = np.select([skeleton.limb == HEAD, np.isin(skeleton.limb, ARMS)], [0.5, 0.6], 1.0)
    kept = (skeleton.station < end) & (body.points @ skeleton.up > (skeleton.spine @ skeleton.up).min())
    faces = body.triangles[kept[body.triangles].all(axis=1)]
    used, corners = np.unique(faces, return_inverse=True)
    off = (body.points[used] - skeleton.spine_at(body.points[used])) * [1.0, 0.0, 1.0]
    points = body.points[used] + OFF * off / np.linalg.norm(off, axis=1, keepdims=True)
    return Mesh("shirt", points, corners.reshape(-1, 3).astype(np.int32))


def on_body(folder: Path, shirt: Mesh, body: Mesh, width: float) -> tuple[Scene, Outfit]:
    """The shirt on the body, made wider by this factor."""
    middle = body.points.mean(axis=0) * [1.0, 0.0, 1.0]
    write_obj(folder / "shirt.obj", (shirt.points - middle) * [width, 1.0, width] + middle, shirt.triangles)
    write_obj(folder / "body.obj", body.points, body.triangles)
    garment = {"mesh": str(folder / "shirt.obj"), "units": "m", "rest": "mesh"}
    return loaded({"garment": garment, "avatar": {"mesh": str(folder / "body.obj"), "units": "m"}})


def test_a_shirt_of_the_body_s_skin_goes_round_its_chest(tmp_path: Path, body: Mesh, shirt: Mesh) -> None:
    _, outfit = on_body(tmp_path, shirt, body, 1.0)
    (garment,), (wearing,) = outfit.garments, outfit.wearing
    assert wearing is not None
    assert garment.rest.sheet is not None
    girth = trunk_girth(wearing, garment.rest.sheet.flat, body)
    assert girth is not None
    assert girth.garment - girth.body == pytest.approx(2.0 * np.pi * OFF, abs=RING)
    no_sleeves = replace(wearing, limbs=tuple(() if limbs[:1] == (ARMS[0],) else limbs for limbs in wearing.limbs))
    assert trunk_girth(no_sleeves, garment.rest.sheet.flat, body) is None


@pytest.mark.parametrize("width", [0.65, 0.9])
def test_what_rests_torn_is_too_small_where_its_trunk_is_narrow(
    width: float, tmp_path: Path, body: Mesh, shirt: Mesh
) -> None:
    scene, outfit = on_body(tmp_path, shirt, body, width)
    torn = Ended(first_attempt(scene, outfit), Status.AT_REST, 0, len(shirt.points), torn=9)
    assert (next_attempt([torn], outfit) is None) == (width < 0.7)  # no other start makes it wider
    points = outfit.garments[0].points.copy()
    far = np.min([opening.distances for opening in outfit.wearing[0].openings], axis=0).argmax()
    points[far] += 0.2  # torn there, far from all openings
    found = judge(scene, outfit, points)
    assert ("too_small" in found and "body's chest" in found["too_small"].message) == (width < 0.7)
