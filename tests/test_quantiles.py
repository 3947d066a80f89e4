"""Percentiles are those of NumPy, of float32 as if it were float64."""

from __future__ import annotations

import numpy as np
import pytest

from warp_cloth.base.quantiles import median, quantiles


@pytest.mark.parametrize("count", [1, 2, 3, 5, 100, 101, 7421])
def test_they_are_those_of_numpy(count: int) -> None:
    figures = np.abs(np.random.default_rng(count).normal(size=count))
    for some in (figures, figures.astype(np.float32)):
        assert quantiles(some, 0.5, 0.99) == np.quantile(some.astype(np.float64), [0.5, 0.99]).tolist()


@pytest.mark.parametrize("count", [1, 2, 3, 100, 101])
def test_the_median_is_that_of_numpy(count: int) -> None:
    figures = np.random.default_rng(count).normal(size=count)
    assert median(figures) == np.median(figures)
    assert np.isnan(median(np.append(figures, np.nan)))
