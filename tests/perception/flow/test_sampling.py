"""Rows sampled between their pixels, against waves whose values are known everywhere."""

import numpy as np
import pytest

from perception.flow.sampling import LEVEL_NOISE, pixel_matrix, sampling_matrix


def sample(row, places):
    both = sampling_matrix(np.asarray(places, np.float32), len(row)) @ np.asarray(row, np.float32)[:, None]
    return both[: len(places), 0], both[len(places) :, 0]


def test_the_slope_of_a_ramp_is_exact_at_any_place():
    level, slope = sample(3.0 + 0.5 * np.arange(40), [5.0, 7.25, 20.003, 30.9])
    assert slope == pytest.approx(0.5, abs=1e-5)
    # The places are rounded to 1/1024 px, and of a ramp the level is right to .001 px more.
    assert level == pytest.approx([5.5, 6.625, 13.0015, 18.45], abs=0.5 * 0.0016)


@pytest.mark.parametrize("period", [20.0, 8.0, 5.0])
def test_a_wave_keeps_its_phase_wherever_it_is_sampled(period):
    """The low-pass scales level and slope of a wave, but alike at every fraction of a pixel."""
    places = np.linspace(10, 30, 101)
    turns = 2 * np.pi * places / period
    row = np.sin(2 * np.pi * np.arange(48) / period)
    level, slope = sample(row, places)
    gain = float(level @ np.sin(turns) / (np.sin(turns) @ np.sin(turns)))
    # At 5 px the window lets .5 % of the wave's alias through; longer waves are far below it.
    assert level == pytest.approx(gain * np.sin(turns), abs=0.006)
    assert slope == pytest.approx(gain * 2 * np.pi / period * np.cos(turns), abs=0.02)
    assert gain == pytest.approx(1.0, abs=0.06)


def test_white_noise_keeps_the_stated_part_of_its_variance():
    noise = np.random.default_rng(1).normal(size=(64, 4000)).astype(np.float32)
    places = np.arange(8, 48, dtype=np.float32) + np.linspace(0, 0.97, 40, dtype=np.float32)
    levels = sampling_matrix(places, 64)[:40] @ noise
    # 160 000 samples, neighbours of which are correlated: 1 %.
    assert levels.var() == pytest.approx(LEVEL_NOISE, rel=0.01)


def test_a_place_that_lacks_a_pixel_cannot_be_sampled():
    for places, there in (([3.0, 15.9], True), ([2.9, 9.0], False), ([9.0, 16.0], False)):
        assert (sampling_matrix(np.array(places, np.float32), 20) is not None) == there


def test_the_pixels_matrix_samples_the_pixels():
    row = np.random.default_rng(2).normal(size=30).astype(np.float32)
    expected, _ = sample(row, np.arange(5, 20))
    assert (pixel_matrix(5, 15, 30) @ row)[:15] == pytest.approx(expected, abs=1e-6)
