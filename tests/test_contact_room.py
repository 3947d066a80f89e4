"""Pairs of near cloth that find no room: nothing moves until they have it, and nothing tells which of them had some."""

from __future__ import annotations

import numpy as np
import pytest
from cloths import NO_PINS, grid
from sheets import crumpled, iterate, lying, moved, sheets_at
from touching import edge_weights, four_regions, triangle_weights

from warp_cloth.avatar.collider import Collider
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_what_lacks_room_stands_still_whichever_pairs_had_some(share: float) -> None:
    model, cloth_contact, _ = sheets_at([crumpled(1)])
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    cloth_contact.awaken(relaxation.contact_state())
    before = model.points().copy()
    cloth_contact.pair_search.allocate_pairs(cloth_contact.data, int(share * cloth_contact.data.pairs.count.numpy()[0]))
    cloth_contact.data.trigger.due.fill_(1)
    relaxation.run(20)
    assert np.array_equal(model.points(), before)
    held = model.state.stiffness.numpy().copy()
    cloth_contact.data.pairs.count.zero_()  # as if nothing were near, and no search due
    cloth_contact.data.trigger.due.zero_()
    model.state.stiffness.zero_()
    relaxation.drop_graphs()
    relaxation.iterate(1)
    assert np.array_equal(held, model.state.stiffness.numpy())


def test_what_is_left_alone_is_farther_apart_than_may_meet_in_a_move() -> None:
    low_bits, above = lying(grid(6, 0.1)), moved(lying(grid(10, 0.16)), -0.03, 0.01, 0.03)
    pins = [np.arange(36, dtype=np.int32), NO_PINS]
    model, cloth_contact, _ = sheets_at([low_bits, above], pins=pins, precision="mixed")
    relaxation = Relaxation(model, Collider(), StepOptions(), cloth_contact)
    cloth_contact.awaken(relaxation.contact_state())
    cloth_contact.untangles = False
    iterate(relaxation, 160)  # it has come near, and falls on in folds
    found = 0
    for _ in range(20):
        relaxation.iterate(3)
        data, points = cloth_contact.data, model.points()
        count = int(data.pairs.count.numpy()[0])
        gone = data.bounds.path.numpy()[0] + data.bounds.step.numpy()[data.bounds.iteration.numpy()[0] % 2]
        due = data.pairs.due.numpy()[:count]
        alone = np.flatnonzero(due > gone[four_regions(data.pairs.regions.numpy()[:count])].sum(axis=1))
        assert len(alone) < count
        for corners, kind in zip(data.pairs.corners.numpy()[alone], data.pairs.kind.numpy()[alone], strict=True):
            x = points[corners]
            weights = [1.0, *-triangle_weights(x[0], x[1:])]
            if kind & 1:
                s, t = edge_weights(*x)
                weights = [1.0 - s, s, t - 1.0, -t]
            assert np.linalg.norm(np.array(weights) @ x) > 0.999 * data.model.active_distance
        found += len(alone)
    assert found > 1000
