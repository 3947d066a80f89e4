"""The certificate's percentiles, which a batch asks for many times."""

from __future__ import annotations

import numpy as np
import pytest

from warp_cloth.model.result import Residual
from warp_cloth.solver.certificate.certifier import residual_summary


@pytest.mark.parametrize("count", [1, 2, 3, 50, 101, 200, 7420])
def test_percentiles_are_numpys_to_the_bit(count: int) -> None:
    left = np.random.default_rng(count).lognormal(sigma=3.0, size=(count, 2)).astype(np.float32)
    p99, relative_p99 = np.quantile(left.astype(np.float64), 0.99, axis=0)
    wanted = Residual(1.0, float(p99), float(left[:, 0].max()), 2.0, float(relative_p99))
    assert residual_summary(left, 1.0, 2.0) == wanted
    pinned = np.full((3, 2), -1.0, dtype=np.float32)
    assert residual_summary(np.concatenate([pinned, left]), 1.0, 2.0) == wanted


def test_cloth_that_is_pinned_everywhere_has_no_residual() -> None:
    assert residual_summary(np.full((4, 2), -1.0, dtype=np.float32), 1.0, 2.0) == Residual(0.0, 0.0, 0.0, 0.0, 0.0)
