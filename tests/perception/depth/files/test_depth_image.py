"""The coloured depth picture."""

import numpy as np

from perception.depth.files.depth_image import UNKNOWN, colour_depth


def test_near_is_red_far_is_blue_unknown_has_a_colour_of_its_own() -> None:
    depth = np.full((120, 90), 4.0, np.float32)
    depth[:, :30], depth[:, 60:] = 1.0, np.nan
    picture = colour_depth(depth, nearest=0.9, farthest=5.0).astype(int)
    blue, _, red = picture[60, 10]
    assert red > blue
    blue, _, red = picture[60, 45]
    assert blue > red
    assert tuple(picture[60, 80]) == UNKNOWN


def test_the_scale_stands_beside_the_picture_and_says_something() -> None:
    depth = np.linspace(1, 3, 120 * 90, dtype=np.float32).reshape(120, 90)
    picture = colour_depth(depth)
    assert picture.dtype == np.uint8
    assert picture.shape[0] == 120
    assert picture.shape[1] > 90
    # Black digits on white at the right of the bar.
    assert picture[:, 110:].min() < 60
    assert picture[:, 110:].max() == 255


def test_a_map_that_knows_nothing_or_one_depth_only_is_still_a_picture() -> None:
    unknown = colour_depth(np.full((40, 30), np.nan, np.float32))
    assert np.all(unknown[:, :30] == UNKNOWN)
    assert colour_depth(np.full((40, 30), 2.0, np.float32)).shape[0] == 40
