"""Discs drawn at known places, with analytic coverage of each pixel; and the real images where they are present."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.target import Shape, detect_bright_target, subsample

REAL = Path(__file__).parents[4] / "shared/data/visp_mire2_target"


def disc(x, y, radius, shape=(128, 128), level=250, background=20, flat=1.0):
    """A disc (or ellipse of height `flat`), each pixel averaged over 8×8 points."""
    fine = (np.arange(shape[0] * 8) + 0.5) / 8 - 0.5
    rows, columns = np.meshgrid(fine, (np.arange(shape[1] * 8) + 0.5) / 8 - 0.5, indexing="ij")
    inside = ((columns - x) / radius) ** 2 + ((rows - y) / (radius * flat)) ** 2 <= 1
    grey = background + (level - background) * inside.reshape(shape[0], 8, shape[1], 8).mean((1, 3))
    return np.rint(grey).astype(np.uint8)


@pytest.mark.parametrize(("x", "y"), [(40.0, 60.0), (40.3, 60.7), (99.5, 12.25)])
def test_the_centre_of_mass_is_the_discs_centre(x, y):
    found = detect_bright_target(disc(x, y, 6), 100, size=128)
    # Rim pixels under the threshold drop out on both sides alike: what remains is the 8×8 sampling, 1/16 px.
    assert (found.x_px, found.y_px) == pytest.approx((x, y), abs=1 / 16)


def test_a_subsampled_image_gives_the_place_in_the_full_one():
    image = cv2.resize(disc(40.0, 24.0, 5, (64, 64)), (512, 512), interpolation=cv2.INTER_NEAREST)
    found = detect_bright_target(image, 100)
    # A pixel of 64 covers eight of 512: its centre is at 8·40 + 3.5.
    assert (found.x_px, found.y_px) == pytest.approx((323.5, 195.5), abs=0.5)


def test_subsampling_averages_whole_blocks():
    image = np.arange(256, dtype=np.uint8).reshape(16, 16)
    # The first block holds 0, 1, 16 and 17: 8.5, and either neighbour will do.
    assert subsample(image, 8)[0, 0] in (8, 9)
    assert subsample(image, 8).shape == (8, 8)


def test_a_dark_image_has_no_target():
    assert detect_bright_target(np.zeros((512, 512), np.uint8), 100) is None
    assert detect_bright_target(np.full((512, 512), 90, np.uint8), 100, shape=Shape()) is None


def test_of_many_bright_things_the_round_one_of_the_right_size_is_the_target():
    image = disc(90, 40, 9, flat=0.5)
    image[5:15, 5:100] = 250  # a bar
    image[60:120, 10:70] = 250  # a square, too large
    image[100:103, 100:103] = 250  # a spot, too small
    found = detect_bright_target(image, 100, size=128, shape=Shape(50, 1000, 0.95, 0.3))
    assert (found.x_px, found.y_px) == pytest.approx((90, 40), abs=1 / 16)


def test_a_square_is_less_round_than_any_ellipse():
    square = np.zeros((64, 64), np.uint8)
    square[20:40, 20:40] = 255
    # Of a square: area/(4π √det M) = 12/(4π) = 0.955.
    assert detect_bright_target(square, 100, shape=Shape(least_roundness=0.96)) is None
    assert detect_bright_target(square, 100, shape=Shape(least_roundness=0.95)) is not None
    ellipse = disc(64, 64, 30, flat=0.4)
    assert detect_bright_target(ellipse, 100, size=128, shape=Shape(least_roundness=0.985)) is not None


@pytest.mark.parametrize(
    ("image", "threshold", "message"),
    [(np.zeros((8, 8, 3), np.uint8), 100, "grey image"), (np.zeros((8, 8), np.uint8), 300, "0 to 254")],
)
def test_what_cannot_be_thresholded_is_refused(image, threshold, message):
    with pytest.raises(ValueError, match=message):
        detect_bright_target(image, threshold)


def test_a_shape_that_nothing_can_have_is_refused():
    with pytest.raises(ValueError, match="under the least"):
        Shape(least_area_px=100, largest_area_px=50)


@pytest.mark.skipif(not REAL.is_dir(), reason="shared/data is not here")
def test_the_white_disc_of_the_real_images_is_found_in_every_one_and_moves_smoothly():
    places = []
    for path in sorted(REAL.glob("*.png")):
        found = detect_bright_target(
            cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), 200, size=384, shape=Shape(60, 4000, 0.93, 0.3)
        )
        assert found is not None, path.name
        places.append((found.x_px, found.y_px))
    assert len(places) == 70
    # The box is moved by hand: some pixels an image; the brightest part of the background is more than 60 px
    # away.
    assert np.abs(np.diff(places, axis=0)).max() < 15
