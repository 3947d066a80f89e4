"""The multilevel method: rest shapes, work against resolution, the same bits in every arrangement."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from cloths import grid

from warp_cloth.fabric import Fabric
from warp_cloth.model import ClothModel, GarmentPart, build_model
from warp_cloth.rest import build_rest_shape
from warp_cloth.result import Status
from warp_cloth.scene import load_scene
from warp_cloth.set_up import following, set_up_one
from warp_cloth.solver.certificate import Certifier, Tolerance
from warp_cloth.solver.loop import Outcome, relax_to_rest
from warp_cloth.solver.multilevel import MultilevelRelaxation
from warp_cloth.solver.relax import Collider, StepOptions
from warp_cloth.solver.simplified import build_ladder

MOST_GROWTH = 2.0  # of the iterations where the vertices become 10 times as many; one level needs 3 times as many
LIMIT = 10_000
FABRIC = Fabric(stretch_warp=2e5, stretch_weft=2e5)


def hanging(count: int, fabric: Fabric = FABRIC) -> GarmentPart:
    """A square of 0.5 m, upright, pinned by its upper corners, bulging a little."""
    mesh = grid(count, 0.5)
    rest = build_rest_shape(mesh, fabric, rest="mesh")
    points = mesh.points.copy()
    points[:, 2] += 1e-3 * np.sin(14.0 * points[:, 0]) * np.sin(10.0 * points[:, 1])
    pins = np.array([count * (count - 1), count * count - 1], dtype=np.int32)
    points[pins] = mesh.points[pins]
    return GarmentPart(points, mesh.triangles, rest, pins)


def relaxation_of(parts: list[GarmentPart], gathers: bool | None = None) -> MultilevelRelaxation:
    model = build_model(parts, device="cpu", precision="mixed", gathers=gathers)
    made = MultilevelRelaxation(
        model, Collider(), StepOptions(method="multilevel"), [build_ladder(part) for part in parts]
    )
    wp.force_load("cpu", modules=[kernel.module for kernel in made.kernels()])
    return made


def rest_of(part: GarmentPart) -> Outcome:
    relaxation = relaxation_of([part])
    certifier = Certifier(relaxation)
    wp.force_load("cpu", modules=[kernel.module for kernel in certifier.kernels()])
    return relax_to_rest(relaxation, certifier, Tolerance(), LIMIT)


def shape_after(parts: list[GarmentPart], iterations: int = 60, gathers: bool | None = None) -> np.ndarray:
    relaxation = relaxation_of(parts, gathers)
    relaxation.run(iterations)
    model: ClothModel = relaxation.model
    return model.points()


def test_iterations_hardly_grow_with_the_resolution() -> None:
    coarse, fine = rest_of(hanging(11)), rest_of(hanging(35))
    assert coarse.status is fine.status is Status.AT_REST
    assert fine.iterations <= MOST_GROWTH * coarse.iterations


def test_scattered_and_gathered_forces_give_the_same_bits() -> None:
    part = hanging(25)
    assert (shape_after([part], gathers=False) == shape_after([part], gathers=True)).all()


def test_a_garment_moves_alone_as_beside_a_larger_one() -> None:
    part = hanging(17)
    other = hanging(25, Fabric(stretch_warp=1e4, stretch_weft=1e4))
    count = len(other.points)
    both = shape_after([other, part])
    assert (both[count:] == shape_after([part])).all()
    assert (both[:count] == shape_after([other])).all()


def test_a_garment_too_small_to_be_coarsened_moves_beside_one_that_is() -> None:
    small, large = hanging(5), hanging(25)
    both = shape_after([small, large])
    assert np.isfinite(both).all()
    assert np.abs(both - np.concatenate([small.points, large.points])).max() > 1e-4


def test_overstretched_seams_are_closed_before_steps_are_implicit() -> None:
    part = hanging(13)
    apart = part.points.copy()
    apart[apart[:, 1] < 0.2, 1] -= 2.0  # a row of edges 40 times too long
    outcome = rest_of(GarmentPart(apart, part.triangles, part.rest, part.pins))
    assert outcome.status is Status.AT_REST
    assert np.ptp(outcome.points[:, 1]) < 0.6


@pytest.mark.parametrize("iterations", [0, 1, 7])
def test_any_number_of_iterations_can_be_asked_for(iterations: int) -> None:
    relaxation = relaxation_of([hanging(9)])
    certifier = Certifier(relaxation)
    outcome = relax_to_rest(relaxation, certifier, Tolerance(), iterations)
    assert outcome.status is Status.ITERATION_LIMIT
    assert np.isfinite(outcome.points).all()


def test_cloth_on_a_ball_does_not_creep_on_after_its_certificate() -> None:
    overrides = ["garment.shape.vertices_per_side=21", "solver.method=multilevel", "garment.fabric={stretch = 20000}"]
    made = set_up_one(load_scene("sphere", overrides), "cpu")
    outcome = relax_to_rest(made.relaxation, made.certifier, Tolerance(), LIMIT, follow=following(made))
    assert outcome.status is Status.AT_REST
    for _ in range(outcome.iterations // 100):
        made.relaxation.run(100)
    way = np.linalg.norm(made.model.points() - outcome.points, axis=1)
    assert np.sqrt(np.mean(way**2)) < outcome.check.rest_error
