"""Pairs of near cloth that find no room: nothing moves until they have it, and nothing tells which of them had some."""

from __future__ import annotations

import numpy as np
import pytest
from sheets import crumpled, sheets_at

from warp_cloth.solver.relax import Collider, Relaxation, StepOptions


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_what_lacks_room_stands_still_whichever_pairs_had_some(share: float) -> None:
    model, touch, _ = sheets_at([crumpled(1)])
    relaxation = Relaxation(model, Collider(), StepOptions(), touch)
    touch.awaken()
    before = model.points().copy()
    touch._hold_pairs(touch.data, int(share * touch.data.count.numpy()[0]))
    touch.data.moved.fill_(1)
    relaxation.run(20)
    assert np.array_equal(model.points(), before)
    held = model.cloth.stiffness.numpy().copy()
    touch.data.count.zero_()  # as if nothing were near, and no search due
    touch.data.moved.zero_()
    model.cloth.stiffness.zero_()
    relaxation.forget_graphs()
    relaxation.iterate(1)
    assert np.array_equal(held, model.cloth.stiffness.numpy())
