"""Noise taken out of an image."""

import numpy as np

from perception.depth.match.contrast import NOISY_SHARE, denoise, noise_share
from perception.depth.match.view import View


def test_on_even_ground_a_third_of_the_noise_is_left_at_most() -> None:
    grey = (100 + np.random.default_rng(0).normal(0, 2, (100, 100))).astype(np.float32)
    # The mean of nine independent values has a third of their deviation; the means of those means less.
    assert denoise(grey, 2.0)[5:-5, 5:-5].std() < 2 / 3 + 0.05


def test_an_edge_above_the_noise_stays_as_sharp_as_it_was() -> None:
    clean = np.full((60, 60), 50, np.float32)
    clean[:, 30:] = 100
    grey = clean + np.random.default_rng(1).normal(0, 2, clean.shape).astype(np.float32)
    step = np.diff(denoise(grey, 2.0).mean(axis=0))[29]
    # Signal is 22 % of 50² or more in a window over the edge: s/(s + σ²) > .99.
    assert step > 0.97 * 50


def test_a_image_is_noisy_by_its_noise_against_its_texture() -> None:
    rng = np.random.default_rng(2)
    x = np.arange(120, dtype=np.float32)
    waves = np.tile(100 + 40 * np.sin(x / 4), (90, 1)).astype(np.float32)
    weak = (100 + 0.1 * (waves - 100) + rng.normal(0, 2, waves.shape)).astype(np.float32)
    # Sobel's slope of a wave of amplitude A and wave number k is 8 A sin k: 56 rms at 40, and √12 of noise at σ = 1.
    assert abs(noise_share(waves, 1.0) - 12**0.5 / (8 * 40 * np.sin(0.25) / 2**0.5)) < 0.003
    assert not View(waves).noisy
    assert View(weak).noise_share > NOISY_SHARE


def test_a_clean_image_is_left_alone() -> None:
    view = View(np.tile(100 + 40 * np.sin(np.arange(120) / 4), (90, 1)).astype(np.float32))
    assert view.denoised is view.grey
