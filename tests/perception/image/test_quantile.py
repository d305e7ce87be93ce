"""Quantiles."""

import numpy as np
import pytest

from perception.image.quantile import known_median, median, quantiles


@pytest.mark.parametrize("count", [1, 2, 5, 1000, 1001])
def test_quantiles_are_those_of_numpy(count: int):
    values = np.random.default_rng(0).normal(size=count).astype(np.float32)
    parts = (0.0, 0.005, 0.5, 0.995, 1.0)
    # Single precision holds seven digits.
    assert np.allclose(quantiles(values, *parts), np.quantile(values, parts), rtol=1e-6, atol=1e-6)
    assert median(values) == pytest.approx(float(np.median(values)), rel=1e-6)


def test_the_median_of_what_is_known():
    assert known_median(np.array([[np.nan, 3.0], [np.inf, 1.0]], np.float32)) == 2.0
    assert known_median(np.full((2, 3), np.nan, np.float32), 7.0) == 7.0
