"""A suit's loop over a shoulder and between the legs, against the body's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judging import judge, loaded
from meshfiles import write_obj

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS, openings_of
from warp_cloth.anatomy.skeleton import HEAD, Skeleton
from warp_cloth.anatomy.trunk_loop import trunk_loop
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.topology import build_topology
from warp_cloth.model.attempt import Ended
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.next_attempt import next_attempt
from warp_cloth.model.result import Status

OFF = 0.01  # [m], of the suit from the skin
# A line along edges is longer than the shortest one, by a few per cent; a tape spans hollows, which shortens it.
LINES = 0.08


@pytest.fixture(scope="module")
def suit(body: Mesh, skeleton: Skeleton) -> Mesh:
    """The body's skin without head, forearms, hands and shins."""
    limb, station = skeleton.limb, skeleton.station
    end = np.select([limb == HEAD, np.isin(limb, ARMS), np.isin(limb, LEGS)], [0.5, 0.6, 0.6], 1.0)
    faces = body.triangles[(station < end)[body.triangles].all(axis=1)]
    used, corners = np.unique(faces, return_inverse=True)
    middle = skeleton.spine_at(body.points[used])
    off = (body.points[used] - middle) * [1.0, 0.0, 1.0]
    points = body.points[used] + OFF * off / np.linalg.norm(off, axis=1, keepdims=True)
    return Mesh("suit", points, corners.reshape(-1, 3).astype(np.int32))


def lengths_and_wearing(suit: Mesh, skeleton: Skeleton, points: Points) -> tuple[np.ndarray, np.ndarray, Wearing]:
    topology = build_topology(suit.triangles, len(points))
    lengths = np.linalg.norm(points[topology.edges[:, 0]] - points[topology.edges[:, 1]], axis=1)
    openings = openings_of(topology, suit.triangles, lengths, len(points))
    return topology.edges, lengths, Wearing.of(openings, points, suit.triangles, skeleton)


def test_a_suit_of_the_body_s_skin_goes_round_its_trunk(body: Mesh, skeleton: Skeleton, suit: Mesh) -> None:
    edges, lengths, wearing = lengths_and_wearing(suit, skeleton, suit.points)
    loop = trunk_loop(wearing, edges, lengths, body)
    assert loop is not None
    assert abs(loop.strain) < LINES
    half = trunk_loop(wearing, edges, 0.5 * lengths, body)
    assert half is not None
    assert half.garment == pytest.approx(0.5 * loop.garment)
    assert half.body == loop.body


def test_trousers_and_shirts_have_no_such_loop(body: Mesh, skeleton: Skeleton, suit: Mesh) -> None:
    edges, lengths, wearing = lengths_and_wearing(suit, skeleton, suit.points)
    for kept in (ARMS, LEGS):
        parts = [(each, limbs) for each, limbs in zip(wearing.openings, wearing.limbs, strict=True) if limbs[0] in kept]
        openings, limbs = zip(*parts, strict=True)
        assert trunk_loop(replace(wearing, openings=openings, limbs=limbs), edges, lengths, body) is None


@pytest.mark.parametrize("size", [0.8, 1.0])
def test_what_slides_off_is_too_small_where_its_trunk_is_short(
    size: float, tmp_path: Path, body: Mesh, suit: Mesh
) -> None:
    crotch = 0.47 * np.ptp(body.points[:, 1])
    points = suit.points * [1.0, size, 1.0] + [0.0, (1.0 - size) * crotch, 0.0]
    write_obj(tmp_path / "suit.obj", points, suit.triangles)
    write_obj(tmp_path / "body.obj", body.points, body.triangles)
    scene, outfit = loaded(
        {
            "garment": {"mesh": str(tmp_path / "suit.obj"), "units": "m", "rest": "mesh"},
            "avatar": {"mesh": str(tmp_path / "body.obj"), "units": "m"},
        }
    )
    found = judge(scene, outfit, points - [0.0, 0.4, 0.0])
    assert "slid_off" in found
    assert ("too_small" in found and "between the legs" in found["too_small"].message) == (size < 1.0)
    # and no other start is tried, which would make it no longer
    torn = Ended(first_attempt(scene, outfit), Status.AT_REST, 0, len(points), torn=9)
    assert (next_attempt([torn], outfit) is None) == (size < 1.0)
