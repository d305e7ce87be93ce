"""The match of low-pass and derivative, by their spectra."""

import numpy as np
import pytest

from perception.flow.derivatives import FIVE, SEVEN


@pytest.mark.parametrize(("filters", "most"), [(FIVE, 0.031), (SEVEN, 0.0025)])
def test_the_derivative_is_that_of_the_low_passed_signal(filters, most):
    """D(ω) = iω P(ω) up to ω = 2, within what the filters' authors reach with so many taps."""
    place = np.arange(len(filters.level)) - len(filters.level) // 2
    for omega in np.linspace(0.05, 2.0, 40):
        level = filters.level @ np.cos(omega * place)
        slope = filters.slope @ np.sin(omega * place)
        assert slope / (omega * level) == pytest.approx(1.0, abs=most)


@pytest.mark.parametrize("filters", [FIVE, SEVEN])
def test_a_constant_keeps_its_level_and_a_rising_ramp_has_a_positive_slope(filters):
    place = np.arange(len(filters.level)) - len(filters.level) // 2
    assert float(filters.level.sum()) == pytest.approx(1.0, abs=1e-5)
    assert float(filters.slope.sum()) == pytest.approx(0.0, abs=1e-7)
    # .3 % too steep with five taps, as printed.
    assert float(filters.slope @ place) == pytest.approx(1.0, abs=0.003)


def test_the_powers_are_those_of_white_noise():
    noise = np.random.default_rng(0).normal(size=400_000)
    # 400 000 samples: half a per cent.
    assert np.convolve(noise, FIVE.level).var() == pytest.approx(FIVE.level_power, rel=0.01)
    assert np.convolve(noise, FIVE.slope).var() == pytest.approx(FIVE.slope_power, rel=0.01)
