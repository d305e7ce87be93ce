"""The error surface and what is equalised in it."""

import cv2
import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.match.contrast import soften
from perception.depth.refine.essd import BaseWindow, Window, sample_surface
from perception.depth.settings import Equalisation
from perception.image.interpolation import InterpolatedImage

SIZE = (80, 60)


def pattern(angle: float, shift: float = 0.0) -> np.ndarray:
    """Stripes of 12 pixels, `angle` from upright, moved to the right."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float64)
    return (100 + 40 * np.sin((np.cos(angle) * (x - shift) + np.sin(angle) * y) * 2 * np.pi / 12)).astype(
        np.float32
    )


@pytest.mark.parametrize(
    ("equalisation", "gain", "offset", "removed"),
    [
        (Equalisation.NONE, 1.0, 0.0, True),
        (Equalisation.NONE, 0.6, 0.0, False),
        (Equalisation.MEAN_RATIO, 0.6, 0.0, True),
        (Equalisation.MEAN_RATIO, 1.0, 20.0, False),
    ],
)
def test_each_equalisation_removes_what_it_says(equalisation, gain, offset, removed):
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.uniform(60, 180, (60, 80)).astype(np.float32), (0, 0), 1.5)
    window = BaseWindow(grey, 3)
    error = window.sum_of_squares((gain * grey + offset).astype(np.float32), equalisation)[10:-10, 10:-10]
    contrast = np.median(window.variance) * window.pixels
    # What is removed is so to single precision of squares of 100; what is not is a good part of the contrast.
    assert (np.median(error) < 1e-3 * contrast) == removed


def test_the_tent_averages_noise_like_the_window_of_the_thesis():
    flat = BaseWindow(pattern(0.0), 3)
    tent = BaseWindow(pattern(0.0), 4, Window.TENT)
    assert flat.pixels == 49
    assert 49 <= tent.pixels <= 56


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_the_disparity_is_measured_below_the_pixel(angle):
    camera = Pinhole(100.0, 100.0, 39.5, 29.5)
    geometry = Epipolar(camera, Motion(np.eye(3), np.array([0.01, 0, 0])), (60, 80))
    base, other = (pattern(angle, shift) + 0.7 * pattern(angle + 1.3, shift) for shift in (0.0, 2.3))
    window = BaseWindow(base, 4, Window.TENT)
    surface = sample_surface(window, InterpolatedImage(other), geometry.project(2.0))
    # 2 px were predicted
    u, v, _ = surface.minimum()
    assert np.nanmedian(u[15:-15, 15:-15]) == pytest.approx(0.3, abs=0.02)
    assert np.nanmedian(v[15:-15, 15:-15]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("off", [-0.3, 0.1, 0.3])
def test_a_step_leaves_a_hundredth_of_what_it_began_with(off):
    geometry = Epipolar(
        Pinhole(100.0, 100.0, 39.5, 29.5), Motion(np.eye(3), np.array([0.01, 0, 0])), (60, 80)
    )
    x = np.arange(80)
    rng = np.random.default_rng(2)
    waves = [(length, rng.uniform(0, 6.28)) for length in (5.0, 6.5, 9.0, 14.0)]
    base, other = (
        np.tile(100 + sum(10 * np.sin((x - shift) * 6.2832 / n + phase) for n, phase in waves), (60, 1))
        for shift in (0.0, 2.3)
    )
    window = BaseWindow(soften(base.astype(np.float32)), 4, Window.TENT)
    predicted = geometry.project(2.3 + off)
    u, _, _ = sample_surface(window, InterpolatedImage(soften(other.astype(np.float32))), predicted).minimum(
        100.0
    )
    assert np.nanmedian(u[15:-15, 15:-15]) == pytest.approx(-off, abs=0.01 + 0.03 * abs(off))


def test_an_edge_along_the_motion_says_nothing_about_depth():
    camera = Pinhole(100.0, 100.0, 39.5, 29.5)
    geometry = Epipolar(camera, Motion(np.eye(3), np.array([0.01, 0, 0])), (60, 80))
    spread = []
    rng = np.random.default_rng(1)
    for angle in (0.0, 1.45):
        noisy = (pattern(angle) + rng.normal(0, 1, (60, 80))).astype(np.float32)
        other = (pattern(angle, 2.0) + rng.normal(0, 1, (60, 80))).astype(np.float32)
        window = BaseWindow(noisy, 4, Window.TENT)
        surface = sample_surface(window, InterpolatedImage(other), geometry.project(2.0))
        # Noise of both images, and a tenth of a pixel across the line: λ_ep = s²/σ_ep².
        power = np.full((60, 80), 2.0, np.float32)
        along, _, _ = surface.covariance(power, power / np.float32(0.01))
        spread.append(float(np.sqrt(np.median(along[15:-15, 15:-15]))))
    # cos 1.45 = 0.12: the stripes nearly along the motion move by an eighth as much across themselves.
    assert spread[1] > 5 * spread[0]
