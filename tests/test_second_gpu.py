"""A fit on a GPU that is not Warp's default one."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

import warp_cloth


@pytest.mark.skipif(wp.get_cuda_device_count() < 2, reason="needs two CUDA devices")
@pytest.mark.parametrize("scene", ["tshirt", "trousers"])
def test_the_second_gpu_gives_the_bits_of_the_first(scene: str) -> None:
    first, second = (warp_cloth.fit(scene, device=device) for device in ("cuda:0", "cuda:1"))
    assert np.array_equal(first.garments[0].points, second.garments[0].points)
    assert first.status is second.status
