"""One pass with matched filters, on textures moved exactly."""

import numpy as np
import pytest

from perception.flow.errors import ImageError
from perception.flow.one_pass import FRAMES, OnePassFlow
from perception.flow.window import Window
from tools.flow.score import score
from tools.flow.textures import sense

WINDOW = Window(96, 32)


def measure(texture, seed, flow_px, contrast, light=lambda k: 1.0):
    random, flow = np.random.default_rng([seed, round(1000 * abs(flow_px))]), OnePassFlow(WINDOW)
    for k in range(FRAMES):
        found = flow.step(sense(light(k) * (128 + 40 * contrast * texture.moved(k * flow_px)), random))
    return found


def measure_all(textures, flow_px, contrast, **more):
    found = [measure(texture, seed, flow_px, contrast, **more) for seed, texture in enumerate(textures)]
    return score([(f.flow_px, f.deviation_px) for f in found], flow_px)


@pytest.mark.parametrize("flow_px", [0.3, -1.02, 2.3])
def test_bias_and_deviation_stay_below_one_and_a_half_per_cent(textures, flow_px):
    got = measure_all(textures[:40], flow_px, 0.5)
    assert got.found == 100
    # The five-tap filters do not match by .3 % at long waves; the mean of 40 errors of 1.5 % is known to .3 %.
    assert abs(got.bias) < 0.9
    assert got.deviation < 1.5


def test_noise_does_not_make_a_faint_wall_slower_or_faster(textures):
    """At contrast .05, σ 2 grey levels in noise of 2, plain least squares would be a quarter too low."""
    got = measure_all(textures, 1.02, 0.05)
    assert got.found == 100
    # 60 errors of 6 %: their median is known to 1 %.
    assert abs(got.bias) < 3
    assert got.deviation < 9


def test_the_stated_deviation_is_true(textures):
    """68 and 95 % of 180 errors: a binomial's standard deviations are 3.5 and 1.6 %, and twice as much is allowed."""
    covers = [measure_all(textures, flow_px, 0.15) for flow_px in (0.61, 1.02, -1.6)]
    assert 61 <= np.mean([got.cover_68 for got in covers]) <= 75
    assert 92 <= np.mean([got.cover_95 for got in covers]) <= 98.5


def test_flicker_does_not_move_the_flow(textures):
    got = measure_all(textures[:30], 1.02, 0.5, light=lambda k: 0.7 if k % 2 else 1.0)
    assert got.found == 100
    # As without flicker.
    assert abs(got.bias) < 0.9
    assert got.deviation < 1.5


@pytest.mark.parametrize("flow_px", [3.3, 4.5, 9.6, 19.2])
def test_a_shift_out_of_reach_is_unknown_and_never_a_wrong_number(textures, flow_px):
    for seed, texture in enumerate(textures[:30]):
        found = measure(texture, seed, flow_px, 0.5)
        assert found.texture
        assert np.isnan(found.flow_px)
        assert np.isnan(found.deviation_px)


@pytest.mark.parametrize("level", [0, 1, 128, 255])
def test_a_bare_wall_has_no_flow(level):
    random, flow = np.random.default_rng(level), OnePassFlow(WINDOW)
    for _ in range(FRAMES):
        found = flow.step(sense(np.full((96, 256), level, float), random))
    assert not found.texture
    assert np.isnan(found.flow_px)


def test_images_without_any_noise_have_no_flow_either():
    flow = OnePassFlow(WINDOW)
    found = [flow.step(np.full((96, 256), 128, np.uint8)) for _ in range(FRAMES)][-1]
    assert not found.texture
    assert np.isnan(found.flow_px)


def test_the_first_four_frames_give_nothing_and_then_every_one_does(textures):
    random, flow = np.random.default_rng(0), OnePassFlow(WINDOW)
    found = [flow.step(sense(128 + 20 * textures[0].moved(0.5 * k), random)) for k in range(9)]
    assert found[:4] == [None] * 4
    # A texture's own deviation is about .01 px.
    assert [f.flow_px for f in found[4:]] == pytest.approx([0.5] * 5, abs=0.04)


def test_a_window_as_large_as_the_image_loses_two_columns_a_side(textures):
    random, flow = np.random.default_rng(0), OnePassFlow(Window(0, 0))
    for k in range(FRAMES):
        found = flow.step(sense(128 + 20 * textures[1].moved(0.8 * k), random)[32:64, 96:160])
    assert found.flow_px == pytest.approx(0.8, abs=0.04)


def test_an_image_of_another_type_is_refused_in_one_line():
    with pytest.raises(ImageError, match="image of float32: grey levels 0 to 255 in uint8 are needed"):
        OnePassFlow(WINDOW).step(np.zeros((96, 256), np.float32))
