"""Whole shifts, texture or noise, and ambiguity."""

from math import nan

import numpy as np
import pytest

from perception.flow.search import search, search_near
from perception.flow.strip import Strip
from perception.flow.window import Window
from tools.flow.textures import sense

WINDOW = Window(96, 32)


def strips(light, past_light, seed=0, window=WINDOW):
    random = np.random.default_rng(seed)
    return Strip(sense(light, random), window, 40), Strip(sense(past_light, random), window, 40)


def stripes(period, shift, contrast=0.5):
    return (
        128
        + 40 * contrast * 2**0.5 * np.cos(2 * np.pi * (np.arange(256) - shift) / period)
        + np.zeros((96, 1))
    )


@pytest.mark.parametrize("shift", [-7.4, 0.0, 5.5, 13.2])
def test_the_shift_is_found_to_a_tenth_of_a_pixel(textures, shift):
    for seed, texture in enumerate(textures[:10]):
        now, past = strips(128 + 20 * texture.moved(shift), 128 + 20 * texture.moved(0), seed)
        found = search(now, past, WINDOW, -10, 16)
        assert found.clear
        # The coarse image has waves of 10 px and more, and a parabola on them errs by less than a hundredth of that.
        assert found.peaks[0] == pytest.approx(shift, abs=0.1)


def test_faint_texture_is_told_from_noise(textures):
    """Contrast .05 is σ 2 grey levels in noise of 2. The shift's own deviation is then an eighth of a pixel."""
    for seed, texture in enumerate(textures):
        now, past = strips(128 + 2 * texture.moved(5.5), 128 + 2 * texture.moved(0), seed)
        found = search(now, past, WINDOW, -2, 14)
        assert found.texture
        assert found.peaks[0] == pytest.approx(5.5, abs=0.6)


@pytest.mark.parametrize("period", [5.0, 6.3, 8.0])
def test_stripes_are_ambiguous_and_their_shifts_are_a_period_apart(period):
    now, past = strips(stripes(period, 6.0), stripes(period, 0.0))
    found = search(now, past, WINDOW, -3, 15)
    assert not found.clear
    # Periods of 5 px are sampled five times a period, and the parabola through three of them errs by a tenth.
    assert np.diff(sorted(found.peaks)) == pytest.approx(period, abs=0.2)
    assert min(abs(p - 6.0) for p in found.peaks) < 0.1


@pytest.mark.parametrize("noise", [0.0, 0.5, 2.0])
def test_vignetting_is_no_texture_that_stands_still(noise):
    """40 % at the corner of 256×256. Without noise, rounding makes bands of it, which do stand still."""
    column, row = np.meshgrid(np.arange(256) - 127.5, np.arange(96) - 47.5)
    light = 200 * (1 - 0.4 * (column**2 + row**2) / (2 * 128**2))
    for seed in range(20):
        random = np.random.default_rng(seed)
        now, past = (Strip(sense(light, random, noise), WINDOW, 40) for _ in range(2))
        found = search(now, past, WINDOW, -8, 8)
        assert not found.texture
        assert found.peaks == ()


def test_a_best_shift_at_the_end_of_the_range_is_none(textures):
    now, past = strips(128 + 20 * textures[0].moved(6.0), 128 + 20 * textures[0].moved(0))
    found = search(now, past, WINDOW, -6, 6)
    assert found.cut_off
    assert found.texture
    assert found.peaks == ()


def test_a_wrong_prediction_is_followed_by_a_search_everywhere(textures):
    now, past = strips(128 + 20 * textures[1].moved(15.0), 128 + 20 * textures[1].moved(0))
    assert search_near(now, past, WINDOW, -4.0, (-20.0, 20.0)).peaks[0] == pytest.approx(15.0, abs=0.1)
    assert search_near(now, past, WINDOW, nan, (-20.0, 20.0)).peaks[0] == pytest.approx(15.0, abs=0.1)


def test_the_score_between_whole_shifts_lies_on_the_peak(textures):
    now, past = strips(128 + 20 * textures[2].moved(4.5), 128 + 20 * textures[2].moved(0))
    found = search(now, past, WINDOW, -4, 12)
    assert found.score(4.5) > found.scores.max()
    assert found.score(4.0) == pytest.approx(float(found.scores[8]), abs=1e-6)
    assert found.score(-9.0) == -1.0


def test_the_halves_of_the_window_tell_its_slope(textures):
    """The texture stretched by 4 %: its shift grows by 1.28 px from the middle to the edge."""
    column = np.arange(256)
    spectrum = textures[3].moved(0)
    stretched = np.stack([np.interp((column - 127.5) / 1.04 + 127.5 - 5, column, row) for row in spectrum])
    now, past = strips(128 + 20 * stretched, 128 + 20 * spectrum)
    found = search(now, past, WINDOW, -4, 14)
    # Half the window has half the texture: a quarter of a pixel.
    assert found.slope_at(found.peaks[0]) == pytest.approx(0.04 * 32, abs=0.3)


@pytest.mark.parametrize(("level", "clipped"), [(0, True), (20, False), (235, False), (255, True)])
def test_a_window_at_the_end_of_the_grey_scale_is_not_believed(textures, level, clipped):
    now, past = strips(level + 4 * textures[0].moved(3), level + 4 * textures[0].moved(0))
    assert now.clipped == clipped
    found = search(now, past, WINDOW, -4, 8)
    assert np.isfinite(found.scores).all()
    assert found.texture == (not clipped)
