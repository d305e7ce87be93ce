"""Quantiles."""

import numpy as np
import pytest

from perception.depth.quantile import median, quantiles


@pytest.mark.parametrize("count", [1, 2, 5, 1000, 1001])
def test_quantiles_are_those_of_numpy(count: int):
    values = np.random.default_rng(0).normal(size=count).astype(np.float32)
    parts = (0.0, 0.005, 0.5, 0.995, 1.0)
    # Single precision holds seven digits.
    assert np.allclose(quantiles(values, *parts), np.quantile(values, parts), rtol=1e-6, atol=1e-6)
    assert median(values) == pytest.approx(float(np.median(values)), rel=1e-6)
