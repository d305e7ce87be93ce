"""Chapter 3's filter to the letter: its start-up, its selection, its sets of five."""

import numpy as np
import pytest

from perception.flow.errors import ImageError, SettingError
from perception.flow.thesis import ThesisFlow, ThesisSettings
from perception.flow.window import Window
from tools.flow.textures import sense

WINDOW = Window(40, 20)


def ramp(shift, slope=2.0):
    """Grey levels that rise to the right, moved to the right: whole ones for whole products of slope and shift."""
    return np.broadcast_to(slope * (np.arange(120) - shift) + 5, (80, 120)).astype(np.uint8)


def last(flow, images):
    found = [flow.step(image) for image in images]
    assert found[:-1] == [None] * (len(images) - 1)
    return found[-1]


@pytest.mark.parametrize("smoothing", [0.0, 0.4, 0.6, 0.8])
def test_after_five_images_the_flow_is_scaled_by_1_minus_lambda_to_the_fourth(smoothing):
    """On a ramp the Gaussian changes nothing, and (3.7) from I_s(0) = I(0) gives I_t (1 − λ⁴): equations.md §2."""
    flow = ThesisFlow(WINDOW, ThesisSettings(smoothing=smoothing, least_slope=1.0))
    found = last(flow, [ramp(0.5 * k) for k in range(5)])
    # Single precision of the filters.
    assert found.flow_px == pytest.approx(0.5 * (1 - smoothing**4), rel=1e-4)
    assert found.vectors == 64 * 32


def test_content_that_moves_to_the_left_has_a_negative_flow():
    found = last(ThesisFlow(WINDOW, ThesisSettings(least_slope=1.0)), [ramp(-0.5 * k) for k in range(5)])
    assert found.flow_px == pytest.approx(-0.5 * (1 - 0.6**4), rel=1e-4)


def test_every_set_of_five_begins_anew():
    """The second set knows nothing of the first, whose last image is far from its own first one."""
    flow = ThesisFlow(WINDOW, ThesisSettings(least_slope=1.0))
    one = last(flow, [ramp(0.5 * k) for k in range(5)])
    other = last(flow, [ramp(8 + 0.5 * k) for k in range(5)])
    assert other.flow_px == pytest.approx(one.flow_px, rel=1e-4)


def test_only_pixels_with_enough_slope_count():
    """Half of the window rises by 2 grey levels a pixel, half by 6: with a threshold of 4 only that half is left."""
    column = np.arange(120) - 72.0
    level = 120 + np.where(column < 0, 2, 6) * column * 0.5
    images = [np.broadcast_to(level, (80, 120)).astype(np.uint8)] * 5
    found = last(ThesisFlow(WINDOW, ThesisSettings(sigma_px=0.5, least_slope=2.0)), images)
    # The edge between the halves is blurred by the Gaussian and the central difference, 2 pixels wide.
    assert found.vectors == pytest.approx(32 * 32, abs=2 * 32)
    assert found.flow_px == 0.0


def test_a_wall_without_slopes_has_no_vector_and_no_flow():
    found = last(ThesisFlow(WINDOW), [np.full((80, 120), 128, np.uint8)] * 5)
    assert found.vectors == 0
    assert np.isnan(found.flow_px)


def test_at_4_px_a_frame_a_third_of_the_flow_is_missed(textures):
    """Waves shorter than four times the shift turn their sign in I_t/I_x: a fault of (3.6), not of this program."""
    flows = []
    for seed, texture in enumerate(textures[:20]):
        noise = np.random.default_rng(seed)
        images = [sense(128 + 20 * texture.moved(3.84 * k), noise) for k in range(5)]
        flows.append(last(ThesisFlow(Window(96, 32)), images).flow_px)
    # A 1/f texture has waves of all lengths; how many are short is a matter of the lens.
    assert 0.35 * 3.84 < np.median(flows) < 0.67 * 3.84


@pytest.mark.parametrize(
    ("settings", "name"),
    [({"smoothing": 1.0}, "smoothing"), ({"sigma_px": 0.0}, "sigma"), ({"least_slope": 0.0}, "least slope")],
)
def test_settings_outside_their_range_are_refused(settings, name):
    with pytest.raises(SettingError, match=name):
        ThesisSettings(**settings)


def test_a_colour_image_is_refused():
    with pytest.raises(ImageError, match=r"shape \(80, 120, 3\)"):
        ThesisFlow(WINDOW).step(np.zeros((80, 120, 3), np.uint8))
