"""Patches shifted by a known way in the frequency domain, so that the truth is exact to rounding."""

import numpy as np
import pytest

from perception.target import PatchTarget, estimate_disparity


def texture(seed=3, size=128, smooth=6.0):
    spectrum = np.fft.fft2(np.random.default_rng(seed).normal(size=(size, size)))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    return spectrum * np.exp(-((frequency * smooth) ** 2) * 4)


def image(spectrum, dx=0.0, dy=0.0, gain=1.0):
    """The texture moved right by dx and down by dy pixels."""
    fx, fy = np.meshgrid(np.fft.fftfreq(spectrum.shape[1]), np.fft.fftfreq(spectrum.shape[0]))
    moved = np.fft.ifft2(spectrum * np.exp(-2j * np.pi * (fx * dx + fy * dy))).real
    return np.clip(np.rint(128 + gain * 40 * moved / np.fft.ifft2(spectrum).real.std()), 0, 255).astype(
        np.uint8
    )


# The parabola's own bias on such a texture, and grey levels rounded to whole ones: a fifteenth of a pixel.
SUBPIXEL = 1 / 15


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (3.4, -2.7), (-11.5, 6.25)])
def test_a_patch_is_found_where_it_went(dx, dy):
    spectrum = texture()
    target = PatchTarget(image(spectrum)[50:75, 50:75])
    found = target.detect(image(spectrum, dx, dy), (62, 62))
    assert (found.x_px, found.y_px) == pytest.approx((62 + dx, 62 + dy), abs=SUBPIXEL)


def test_a_change_of_light_does_not_lose_the_patch():
    spectrum = texture()
    target = PatchTarget(image(spectrum)[50:75, 50:75])
    found = target.detect(image(spectrum, 2.0, 0.0, gain=0.4))
    assert (found.x_px, found.y_px) == pytest.approx((64, 62), abs=SUBPIXEL)
    assert found.confidence > 0.98


def test_a_hidden_target_is_none_and_is_found_again_anywhere():
    spectrum = texture()
    target = PatchTarget(image(spectrum)[50:75, 50:75], near_px=8)
    assert target.detect(image(spectrum), (62, 62)) is not None
    assert target.detect(np.full((128, 128), 90, np.uint8)) is None
    assert target.detect(image(texture(seed=9))) is None
    found = target.detect(image(spectrum, 40.0, -30.0))
    assert (found.x_px, found.y_px) == pytest.approx((102, 32), abs=SUBPIXEL)


def test_a_patch_without_texture_is_refused():
    with pytest.raises(ValueError, match="no texture"):
        PatchTarget(np.full((21, 21), 128, np.uint8))


@pytest.mark.parametrize("shift", [-9.6, -0.3, 0.0, 4.5, 12.2])
def test_the_disparity_at_the_fovea_is_the_shift_between_the_eyes(shift):
    spectrum = texture()
    found = estimate_disparity(image(spectrum), image(spectrum, shift, 0.0))
    assert found.x_px == pytest.approx(shift, abs=SUBPIXEL)
    assert found.y_px == pytest.approx(0.0, abs=SUBPIXEL)


def test_a_disparity_beyond_the_search_or_without_texture_is_none():
    spectrum = texture()
    blank = np.full((128, 128), 60, np.uint8)
    assert estimate_disparity(image(spectrum), image(spectrum, 40.0, 0.0)) is None
    assert estimate_disparity(blank, blank) is None
    assert estimate_disparity(image(spectrum), image(texture(seed=9))) is None


def test_images_of_different_size_are_refused():
    with pytest.raises(ValueError, match="one size"):
        estimate_disparity(np.zeros((64, 64), np.uint8), np.zeros((64, 65), np.uint8))
