"""Iterations per second of the relax loop: by size of the garment, device, terms and batch.

    pytest tests/benchmarks --benchmark-only

Each round is a burst of BURST iterations. Besides pytest-benchmark's table it prints lines ``name value``:
microseconds per iteration, vertex-iterations per second, and the compulsory bytes of an iteration per second as a
share of what the device copies per second (above 1 where a processor's caches hold the garment). They are what
--benchmark-json saves as ``extra_info``, too.
"""

from __future__ import annotations

import functools
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp
from devices import DEVICES

from warp_cloth.avatar.collider import Collider
from warp_cloth.fitting.problem import load_problem
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import build_model
from warp_cloth.scene import load_scene
from warp_cloth.shapes import square
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions
from warp_cloth.study.footprint import compulsory_bytes
from warp_cloth.study.launches import launches_of

BURST = 20  # iterations in a graph, as in a fit
ROUNDS = 20
COPIED = 1 << 26  # bytes of the copy that measures the memory's speed: larger than caches
FABRICS = {
    "edges": Fabric(bending_warp=0.0, bending_weft=0.0),
    "edges, bending": Fabric(),
    "yarns, bending": replace(Fabric(), shear=800.0),
}


@functools.cache
def bytes_per_second(device: str) -> float:
    """What a device's memory reads and writes while it copies."""
    source, target = (wp.zeros(COPIED, dtype=wp.uint8, device=device) for _ in range(2))
    best = np.inf
    for _ in range(5):
        began = time.perf_counter()
        wp.copy(target, source)
        wp.synchronize_device(device)
        best = min(best, time.perf_counter() - began)
    return 2.0 * COPIED / best


def timed(benchmark: Any, relaxation: Relaxation) -> None:
    """Chunks of iterations, the device's work included, after one that compiles and captures."""
    model = relaxation.model
    wp.force_load(model.device, modules=[kernel.module for kernel in relaxation.kernels()])

    def burst() -> None:
        relaxation.run(BURST)
        wp.synchronize_device(model.device)

    benchmark.pedantic(burst, rounds=ROUNDS, warmup_rounds=1)
    seconds = benchmark.stats.stats.median / BURST
    moved = sum(compulsory_bytes(launch) for launch in launches_of(lambda: relaxation.iterate(2))) / 2
    benchmark.extra_info["vertices"] = model.vertex_count
    benchmark.extra_info["microseconds_per_iteration"] = 1e6 * seconds
    benchmark.extra_info["vertex_iterations_per_second"] = model.vertex_count / seconds
    benchmark.extra_info["share_of_memory_limit"] = moved / seconds / bytes_per_second(model.device)
    assert np.isfinite(model.points()).all()


def hanging(side: int, terms: str) -> Garment:
    mesh = square(side=1.0, vertices_per_side=side, plane="vertical")
    rest = build_rest_shape(mesh, FABRICS[terms], rest="mesh")
    return Garment(mesh.points, mesh.triangles, rest, np.array([0, side - 1], dtype=np.int32))


@pytest.mark.parametrize("terms", FABRICS)
@pytest.mark.parametrize("side", [33, 65, 129])
@pytest.mark.parametrize("device", DEVICES)
def test_hanging_square(benchmark: Any, device: str, side: int, terms: str) -> None:
    model = build_model([hanging(side, terms)], device=device, precision="mixed")
    benchmark.group = f"hanging square, {side * side} vertices, {device}"
    timed(benchmark, Relaxation(model, Collider(), StepOptions()))


@pytest.mark.parametrize("items", [1, 8, 64])
@pytest.mark.parametrize("device", DEVICES)
def test_batch_of_hanging_squares(benchmark: Any, device: str, items: int) -> None:
    garments = [hanging(33, "yarns, bending")] * items
    model = build_model(garments, device=device, precision="mixed", garment_counts=[1] * items)
    benchmark.group = f"batch of hanging squares of 1089 vertices, {device}"
    timed(benchmark, Relaxation(model, Collider(), StepOptions()))


@pytest.mark.parametrize("fabric", ["default", "jersey"])
@pytest.mark.parametrize("device", DEVICES)
def test_worn_tshirt(benchmark: Any, device: str, fabric: str) -> None:
    worn = load_problem(load_scene("tshirt", [f"garment.fabric={fabric}", "collision.cloth=false"]), device)
    benchmark.group = f"T-shirt on the mannequin, {device}"
    timed(benchmark, worn.relaxation)


@pytest.mark.parametrize("device", DEVICES)
def test_tshirt_in_contact_with_itself(benchmark: Any, device: str) -> None:
    worn = load_problem(load_scene("tshirt", ["collision.cloth=true"]), device)
    benchmark.group = f"T-shirt on the mannequin, {device}"
    worn.relaxation.cloth_contact.awaken(worn.relaxation.contact_state())
    timed(benchmark, worn.relaxation)
