"""Shifts take the place of warps where a plane's homography is one."""

import cv2
import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.image.plane_warp import find_shift, shift_image, warp_image

CAMERA = Pinhole(100.0, 90.0, 31.5, 23.5)


def homography(way: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    return Epipolar(
        CAMERA, Motion(cv2.Rodrigues(np.array(turn, float))[0], np.array(way)), (48, 64)
    ).homography(0.5)


def test_a_camera_that_neither_turns_nor_moves_forward_shifts_its_planes() -> None:
    assert find_shift(homography((0.1, -0.2, 0.0))) == pytest.approx((5.0, -9.0))
    assert find_shift(homography((0.1, 0.0, 0.01))) is None
    assert find_shift(homography((0.1, 0.0, 0.0), (0.0, 1e-3, 0.0))) is None
    assert find_shift(homography((0.1, 0.0, 0.0), (0.0, 0.0, 1e-3))) is None


@pytest.mark.parametrize(
    "shift", [(0.0, 0.0), (5.0, -3.0), (-7.25, 0.0), (3.4, 2.7), (0.5, -47.5), (-63.6, 1.0)]
)
def test_a_shift_is_the_warp_by_its_homography(shift: tuple[float, float]) -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (48, 64)).astype(np.uint8)
    matrix = np.array([[1, 0, shift[0]], [0, 1, shift[1]], [0, 0, 1]])
    warped = warp_image(image, matrix, cv2.INTER_LINEAR, 127)
    # rounding to bytes between the two axes, and once more at the end
    assert np.abs(shift_image(image, *shift, 127).astype(int) - warped).max() <= 1


def test_a_shift_out_of_sight_leaves_nothing_but_the_outside() -> None:
    image = np.full((48, 64), 9, np.int16)
    for shift in ((64.0, 0.0), (0.0, -48.0), (-1000.0, 3.0)):
        assert (shift_image(image, *shift, 32_000) == 32_000).all()
