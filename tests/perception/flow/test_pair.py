"""Warped least squares between two images, on textures moved exactly: the figures asked of it."""

import numpy as np
import pytest

from perception.flow.errors import ImageError, SettingError
from perception.flow.pair import estimate_flow
from perception.flow.window import Window
from tools.flow.bare import BARE, false_flows
from tools.flow.score import score
from tools.flow.textures import Texture, sense

WINDOW = Window(96, 32)


def measure(texture, seed, flow_px, contrast, light=lambda k: 1.0, mean=128, predicted=None):
    random = np.random.default_rng([seed, round(1000 * abs(flow_px))])
    past, now = (
        sense(light(k) * (mean + 40 * contrast * texture.moved(k * flow_px)), random) for k in (0, 1)
    )
    guess = flow_px * (1 + 0.2 * random.standard_normal()) + 0.5 * random.standard_normal()
    return estimate_flow(now, past, WINDOW, guess if predicted is None else predicted)


def measure_all(textures, flow_px, contrast, **more):
    found = [measure(texture, seed, flow_px, contrast, **more) for seed, texture in enumerate(textures)]
    return score([(f.flow_px, f.deviation_px) for f in found], flow_px)


@pytest.mark.parametrize(
    ("flow_px", "contrast", "bias", "deviation"),
    [
        (0.61, 0.5, 1.5, 4.0),
        (1.02, 0.5, 1.5, 2.0),
        (-1.02, 0.2, 1.5, 5.0),
        (1.02, 0.1, 3.0, 9.0),
        (-4.0, 0.5, 1.5, 0.5),
        (4.0, 0.2, 1.5, 1.5),
        (9.6, 0.5, 1.5, 0.5),
        (19.2, 0.5, 1.5, 0.5),
    ],
)
def test_bias_and_deviation_are_what_was_asked(textures, flow_px, contrast, bias, deviation):
    """Issue: |bias| ≤ 1.5 % from .6 to 10 px at c ≥ .2; deviation ≤ 2 % (1 px, .5), 9 % (1 px, .1), .5 % (4 px)."""
    got = measure_all(textures, flow_px, contrast)
    assert got.found >= 98
    assert abs(got.bias) <= bias
    assert got.deviation <= deviation


@pytest.mark.parametrize(("contrast", "one", "two"), [(0.05, 55, 88), (0.2, 60, 90), (1.0, 60, 90)])
def test_the_stated_deviation_is_true(textures, contrast, one, two):
    """Of 180 errors 60 to 82 and at least 90 % within 1 and 1.96 deviations (issue: from contrast .2 on).

    At contrast .05 the texture's own power is known to a tenth only, and deviations are stated 8 % too low.
    """
    covers = [measure_all(textures, flow_px, contrast) for flow_px in (1.31, -4.5, 7.7)]
    assert one <= np.mean([c.cover_68 for c in covers]) <= 82
    assert np.mean([c.cover_95 for c in covers]) >= two


def test_without_a_prediction_the_flow_is_the_same(textures):
    for seed, texture in enumerate(textures[:10]):
        known, unknown = (measure(texture, seed, 12.3, 0.5, predicted=p) for p in (11.0, float("nan")))
        assert unknown.flow_px == pytest.approx(known.flow_px, abs=1e-6)
        assert unknown.deviation_px == pytest.approx(known.deviation_px, rel=1e-4)


@pytest.mark.parametrize("name", list(BARE))
def test_bare_walls_have_no_flow(name):
    """At most one of 1 000 is allowed; the reproduction counts 10 000 of each light."""
    assert false_flows(name, 100) == (0, 0)


def test_a_gain_of_70_per_cent_does_not_move_the_flow(textures):
    for light in (lambda k: 0.7 if k else 1.0, lambda k: 1.0 if k else 0.7):
        got = measure_all(textures[:40], 4.0, 0.5, light=light, mean=110)
        assert got.found == 100
        assert abs(got.bias) < 0.5
        # Contrast .35 in the place of .5 in one of both.
        assert got.deviation < 0.75
        assert got.cover_95 >= 85


def test_vignetting_hardly_moves_the_flow(textures):
    """40 % at the corner, the window 60 px off the middle: what stands still is a hundredth of what moves."""
    column, row = np.meshgrid(np.arange(256) - 187.5, np.arange(96) - 107.5)
    shade = 1 - 0.4 * (column**2 + row**2) / (2 * 128**2)
    for contrast in (0.1, 0.5):
        got = measure_all(textures[:40], 4.0, contrast, light=lambda k: shade)
        assert got.found == 100
        assert abs(got.bias) < 1.0


def test_a_dark_wall_is_measured_or_unknown_but_not_wrong(textures):
    """A fifteenth of the light: contrast .03 of a mean of 8 grey levels, in noise of 2."""
    found = [measure(t, seed, 4.0, 0.5, light=lambda k: 1 / 15) for seed, t in enumerate(textures[:30])]
    for f in found:
        assert np.isnan(f.flow_px) or abs(f.flow_px - 4.0) < 5 * f.deviation_px
    assert not measure(textures[0], 0, 4.0, 0.5, light=lambda k: 0.0).texture


def test_an_overexposed_wall_is_unknown(textures):
    for seed, texture in enumerate(textures[:20]):
        found = measure(texture, seed, 4.0, 0.5, light=lambda k: 2.2)
        assert not found.texture
        assert np.isnan(found.flow_px)


def test_a_few_saturated_pixels_do_no_harm(textures):
    got = measure_all(textures[:40], 4.0, 1.0, mean=190)
    assert got.found == 100
    assert abs(got.bias) < 0.5
    assert got.deviation < 0.5


@pytest.mark.parametrize("period", [4.0, 5.0, 6.1, 8.0])
def test_stripes_with_a_period_near_the_shift_are_unknown(period):
    """Two images alone cannot tell a shift of 6 px from one a period more or less."""
    random = np.random.default_rng(0)
    for shift in (5.0, 6.0, period):
        now, past = (
            sense(128 + 28 * np.cos(2 * np.pi * (np.arange(256) - s) / period) + np.zeros((96, 1)), random)
            for s in (shift, 0.0)
        )
        found = estimate_flow(now, past, WINDOW, 6.0)
        assert found.texture
        assert np.isnan(found.flow_px)


def test_a_tenth_of_the_window_at_another_depth_does_not_move_the_rest(textures):
    errors = []
    for seed, texture in enumerate(textures[:20]):
        other, random = Texture(4000 + seed), np.random.default_rng(seed)

        def view(k, texture=texture, other=other, random=random):
            light = texture.moved(6.0 * k)
            edge = 96 + 6 + 12 * (k - 1)
            light[:, :edge] = other.moved(12.0 * k)[:, :edge]
            return sense(128 + 20 * light, random)

        found = estimate_flow(view(1), view(0), WINDOW, 6.5)
        errors.append(found.flow_px - 6.0)
    # Two deviations of a window that is a tenth smaller and has lost its lever on one side.
    assert np.nanmedian(np.abs(errors)) < 0.03


def test_two_depths_in_one_window_are_uncertain_by_as_much_as_they_differ():
    """A third of the window is half as far again: a flow between both is stated with a deviation of tenths."""
    for seed in range(10):
        one, other, random = Texture(5000 + seed), Texture(6000 + seed), np.random.default_rng(seed)

        def view(k, one=one, other=other, random=random):
            light = one.moved(6.0 * k)
            edge = 96 + 21 + 9 * (k - 1)
            light[:, :edge] = other.moved(9.0 * k)[:, :edge]
            return sense(128 + 20 * light, random)

        found = estimate_flow(view(1), view(0), WINDOW, 6.5)
        if np.isfinite(found.flow_px):
            assert 5.8 < found.flow_px < 9.2
            assert abs(found.flow_px - 6.0) < max(0.2, 6 * found.deviation_px)


def test_the_window_may_be_all_there_is_of_the_image(textures):
    errors = []
    for seed, texture in enumerate(textures[:30]):
        random = np.random.default_rng(seed)
        past, now = (sense(128 + 20 * texture.moved(k * 4.3), random)[32:64, 96:160] for k in (0, 1))
        errors.append(estimate_flow(now, past, Window(0, 0), 4.0).flow_px - 4.3)
    # Twelve of the 64 columns are lost: a sixth more deviation.
    assert 1.4826 * np.median(np.abs(errors)) < 0.02


@pytest.mark.parametrize(("left", "top"), [(0, 0), (192, 64), (3, 40)])
def test_the_window_may_touch_the_edges(textures, left, top):
    random = np.random.default_rng(0)
    past, now = (sense(128 + 20 * textures[5].moved(k * 3.3), random) for k in (0, 1))
    found = estimate_flow(now, past, Window(left, top), 3.0)
    assert found.flow_px == pytest.approx(3.3, abs=5 * found.deviation_px)


@pytest.mark.parametrize("size", [(24, 8), (33, 17), (96, 48), (200, 90)])
def test_windows_of_other_sizes(textures, size):
    random = np.random.default_rng(1)
    past, now = (sense(128 + 20 * textures[6].moved(k * 2.4), random) for k in (0, 1))
    found = estimate_flow(now, past, Window.centred(256, 96, *size), 2.0)
    assert found.flow_px == pytest.approx(2.4, abs=5 * found.deviation_px)


def test_what_cannot_be_an_image_is_refused_in_one_line():
    good = np.full((96, 256), 128, np.uint8)
    for bad, words in (
        (good.astype(np.float32), "image of float32: grey levels 0 to 255 in uint8 are needed"),
        (good.astype(np.uint16), "image of uint16"),
        (np.dstack([good] * 3), r"image of shape \(96, 256, 3\)"),
        (good[:50], r"image of 256×50 pixels does not hold the window of 64×32 at column 96, row 32"),
    ):
        with pytest.raises(ImageError, match=words) as caught:
            estimate_flow(bad, good, WINDOW)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("window", "words"), [((-1, 0), "column -1"), ((0, 0, 20, 32), "20×32"), ((0, 0, 64, 4), "64×4")]
)
def test_a_window_that_is_none_is_refused(window, words):
    with pytest.raises(SettingError, match=words):
        Window(*window)


def test_a_centred_window_must_fit():
    assert Window.centred(256, 256) == Window(96, 112)
    with pytest.raises(SettingError, match="60×40: it does not fit"):
        Window.centred(60, 40)
