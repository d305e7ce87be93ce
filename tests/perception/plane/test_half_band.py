"""Twice the size without a shift."""

import numpy as np

from perception.plane.half_band import double_size


def test_pixels_stay_and_the_values_between_are_those_of_a_wave() -> None:
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))

    def wave(px: np.ndarray, py: np.ndarray) -> np.ndarray:
        return 100 + 40 * np.cos(2 * np.pi * (px / 6 + py / 9) + 0.4)

    double = double_size(wave(x, y).astype(np.float32))
    assert double.shape == (100, 120)
    assert np.array_equal(double[::2, ::2], wave(x, y).astype(np.float32))
    half_x, half_y = np.meshgrid(np.arange(120) / 2, np.arange(100) / 2)
    inner = np.s_[8:-9, 8:-9]
    # A wave of 6 px is attenuated by .4 % half-way; a linear kernel would by 13 %.
    assert np.abs(double - wave(half_x, half_y))[inner].max() < 0.4


def test_a_polynomial_of_the_seventh_degree_is_exact() -> None:
    row = (np.linspace(-1, 1, 40) ** 7)[None, :].repeat(12, axis=0).astype(np.float32)
    between = ((np.linspace(-1, 1, 40)[:-1] + np.diff(np.linspace(-1, 1, 40)) / 2) ** 7)[4:-4]
    assert np.abs(double_size(row)[4, 9:-9:2] - between).max() < 1e-6
