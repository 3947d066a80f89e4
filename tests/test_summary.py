"""Bounds of some items are measured without measuring the others."""

from __future__ import annotations

import numpy as np

from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.scene import load_scene
from warp_cloth.solver.certificate.certifier import read_bounds

CHANGES = ["garment.shape.vertices_per_side=9", "collision.pixel_mm=10"]


def test_selected_items_are_where_they_are_now() -> None:
    scene = load_scene("sphere", CHANGES)
    made = build_problem([scene] * 3, [load_outfit(scene)] * 3, "cpu")
    before = made.certifier.measure(0).boxes
    for item in range(3):
        made.model.set_points(made.model.points(item) + np.array([0.0, 0.1 * (item + 1), 0.0]), item)
    made.relaxation.deactivate([2])
    found = read_bounds(made.certifier.request_bounds([1, 2]))
    np.testing.assert_allclose(found[1] - before[1], [[0.0, 0.2, 0.0]] * 2, atol=1e-12)
    np.testing.assert_array_equal(found[[0, 2]], before[[0, 2]])
    np.testing.assert_allclose(made.certifier.measure(0).boxes[0] - before[0], [[0.0, 0.1, 0.0]] * 2, atol=1e-12)
