"""Pairs of near cloth that find no room: nothing moves until they have it, and nothing tells which of them had some."""

from __future__ import annotations

import numpy as np
import pytest
from test_cloth_contact import crumpled, sheets_at

from warp_cloth.solver.relax import Collider, Relaxation, StepOptions


@pytest.mark.parametrize("room", [20, 100])
def test_what_lacks_room_stands_still_whichever_pairs_had_some(room: int) -> None:
    model, touch, _ = sheets_at([crumpled(1)])
    relaxation = Relaxation(model, Collider(), StepOptions(), touch)
    touch.awaken()
    before = model.points()
    assert int(touch.data.count.numpy()[0]) > room
    touch._hold_pairs(touch.data, room)
    touch.data.moved.fill_(1)
    relaxation.run(20)
    assert np.array_equal(model.points(), before)
    held = model.cloth.stiffness.numpy()
    touch.data.count.zero_()  # as if nothing were near
    touch.data.searched.assign(np.full((len(before), 3), 1e3))  # and yet nothing may move
    model.cloth.stiffness.zero_()
    relaxation.forget_graphs()
    relaxation.iterate(1)
    assert np.array_equal(held, model.cloth.stiffness.numpy())
