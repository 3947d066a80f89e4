"""Iterations per second of the relax loop: by size of the garment, device and terms.

    pytest tests/benchmarks --benchmark-only

Each round is a chunk of CHUNK iterations. What --benchmark-json saves has microseconds per iteration and
vertex-iterations per second as ``extra_info``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp

from warp_cloth.fabric import Fabric
from warp_cloth.fitting import set_up
from warp_cloth.model import GarmentPart, build_model
from warp_cloth.rest import build_rest_shape
from warp_cloth.scene import load_scene
from warp_cloth.shapes import square
from warp_cloth.solver.relax import Collider, Relaxation, StepOptions

CHUNK = 20  # iterations in a graph, as in a fit
ROUNDS = 20
FABRICS = {
    "edges": Fabric(bending_warp=0.0, bending_weft=0.0),
    "edges, bending": Fabric(),
    "threads, bending": replace(Fabric(), shear=800.0),
}
DEVICES = [
    "cpu",
    pytest.param(
        "cuda:0",
        marks=[pytest.mark.cuda, pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device")],
    ),
]


def timed(benchmark: Any, relaxation: Relaxation) -> None:
    """Chunks of iterations, the device's work included, after one that compiles and captures."""
    model = relaxation.model
    wp.force_load(model.device, modules=[kernel.module for kernel in relaxation.kernels()])

    def chunk() -> None:
        relaxation.run(CHUNK)
        wp.synchronize_device(model.device)

    benchmark.pedantic(chunk, rounds=ROUNDS, warmup_rounds=1)
    seconds = benchmark.stats.stats.median / CHUNK
    benchmark.extra_info["vertices"] = model.vertex_count
    benchmark.extra_info["microseconds_per_iteration"] = 1e6 * seconds
    benchmark.extra_info["vertex_iterations_per_second"] = model.vertex_count / seconds
    assert np.isfinite(model.points()).all()


@pytest.mark.parametrize("terms", FABRICS)
@pytest.mark.parametrize("side", [33, 65, 129])
@pytest.mark.parametrize("device", DEVICES)
def test_hanging_square(benchmark: Any, device: str, side: int, terms: str) -> None:
    mesh = square(side=1.0, vertices_per_side=side, plane="vertical")
    rest = build_rest_shape(mesh, FABRICS[terms], rest="mesh")
    pins = np.array([0, side - 1], dtype=np.int32)
    model = build_model([GarmentPart(mesh.points, mesh.triangles, rest, pins)], device=device, precision="mixed")
    benchmark.group = f"hanging square, {side * side} vertices, {device}"
    timed(benchmark, Relaxation(model, Collider(), StepOptions()))


@pytest.mark.parametrize("fabric", ["default", "jersey"])
@pytest.mark.parametrize("device", DEVICES)
def test_worn_tshirt(benchmark: Any, device: str, fabric: str) -> None:
    worn = set_up(load_scene("tshirt", [f"garment.fabric={fabric}"]), device)
    benchmark.group = f"T-shirt on the mannequin, {device}"
    timed(benchmark, worn.relaxation)
