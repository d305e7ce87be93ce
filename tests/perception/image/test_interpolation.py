"""Grey levels and slopes between the pixels."""

import numpy as np
import pytest

from perception.image.interpolation import InterpolatedImage


@pytest.mark.parametrize(("length", "moved"), [(4.0, 0.007), (6.0, 0.001), (12.0, 0.0002)])
def test_a_wave_is_found_where_it_is(length: float, moved: float) -> None:
    k = 2 * np.pi / length
    x = np.arange(120.0)
    for part in (0.1, 0.25, 0.52, 0.8):
        place = (x[20:100] + part).astype(np.float32)[None, :].repeat(3, 0)
        row = np.full_like(place, 3)
        waves = [
            InterpolatedImage(np.tile(wave(k * x), (7, 1)).astype(np.float32)) for wave in (np.cos, np.sin)
        ]
        there = waves[0].at(place, row)[0] + 1j * waves[1].at(place, row)[0]
        turned = np.angle(np.mean(there * np.exp(-1j * k * place)))
        # OpenCV's cubic kernel moves 6 and 12 pixels by .024 and .041; six pixels of Lagrange 4 by .009
        assert abs(turned / k) < moved


@pytest.mark.parametrize(("length", "part_wrong"), [(4.0, 0.07), (6.0, 0.03), (12.0, 0.005)])
def test_slopes_of_a_wave_are_its_slopes(length: float, part_wrong: float) -> None:
    k = 2 * np.pi / length
    x = np.arange(120.0)
    interpolated = InterpolatedImage(np.tile(np.sin(k * x) / k, (120, 1)).astype(np.float32))
    for part in (0.0, 0.25, 0.5):
        place = (x[20:100] + part).astype(np.float32)[None, :].repeat(3, 0)
        _, slope, across = interpolated.at(place, np.full_like(place, 60.3))
        np.testing.assert_allclose(slope, np.cos(k * place), atol=part_wrong)
        np.testing.assert_allclose(across, 0, atol=1e-4)


def test_slopes_of_a_parabola_are_exact() -> None:
    y, x = np.mgrid[:30, :40].astype(np.float32)
    interpolated = InterpolatedImage(0.5 * x * x - 0.3 * x * y + 2 * y)
    column, row = x[8:20, 8:30] + np.float32(0.37), y[8:20, 8:30] + np.float32(0.81)
    _, slope_x, slope_y = interpolated.at(column, row)
    # single precision of squares of 30
    np.testing.assert_allclose(slope_x, column - 0.3 * row, atol=1e-3)
    np.testing.assert_allclose(slope_y, -0.3 * column + 2, atol=1e-3)


def test_a_place_that_is_no_number_gives_0() -> None:
    interpolated = InterpolatedImage(np.full((10, 10), 7, np.float32))
    nowhere = np.full((2, 2), np.nan, np.float32)
    assert all((part == 0).all() for part in interpolated.at(nowhere, nowhere))
