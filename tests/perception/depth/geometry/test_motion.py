"""The camera's motion between two images."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from perception.depth.errors import MotionError
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.motion import Motion
from perception.depth.geometry.pinhole import Pinhole

UNIT = Pinhole(1.0, 1.0, 0.0, 0.0)


def test_a_motion_is_integrated_exactly_over_a_large_turn():
    # A camera that goes 1 m/s along x while it turns about y at 1 rad/s runs on a circle of radius 1 m:
    # after a quarter turn it is at x = 1, z = −1 of its first frame (y points down, ω_y > 0 turns z to x).
    motion = Motion.from_velocity(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.pi / 2)
    camera_centre = -motion.rotation.T @ motion.translation
    assert camera_centre == pytest.approx([1.0, 0.0, -1.0], abs=1e-9)
    assert motion.angle == pytest.approx(np.pi / 2, abs=1e-9)


def test_for_a_short_time_the_motion_is_that_of_the_thesis():
    # (2.20)–(2.22) are of first order in τ: the difference must fall with τ².
    velocity, turn, rho = np.array([0.3, -0.2, 0.5]), np.array([0.1, -0.2, 0.15]), 0.4
    x, y = 0.3, -0.2
    error = []
    for tau in (1e-2, 1e-3):
        moved = Motion.from_velocity(velocity, turn, tau)
        q = moved.rotation @ [x, y, 1] + rho * moved.translation
        c = tau * np.array([x * velocity[2] - velocity[0], y * velocity[2] - velocity[1]])
        d = tau * np.array(
            [
                turn[0] * x * y - turn[1] * (x * x + 1) + turn[2] * y,
                turn[0] * (1 + y * y) - turn[1] * x * y - turn[2] * x,
            ]
        )
        a, b = 1 + tau * (turn[1] * x - turn[0] * y), -tau * velocity[2]
        error.append(np.abs(q[:2] / q[2] - (x, y) - (c * rho + d)).max())
        assert q[2] == pytest.approx(a + b * rho, abs=tau**2)
    assert error[1] < error[0] / 50


def test_there_and_back_is_no_motion():
    motion = Motion.from_velocity(np.array([0.1, 0.2, 0.3]), np.array([0.3, -0.1, 0.2]), 1.0)
    both = motion.then(motion.inverse())
    assert both.rotation == pytest.approx(np.eye(3), abs=1e-9)
    assert both.translation == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_matrix_that_is_no_rotation_is_refused():
    with pytest.raises(MotionError, match="no rotation"):
        Motion(np.diag([1.0, 1.0, 1.1]), np.zeros(3))
    with pytest.raises(MotionError, match="no number"):
        Motion(np.eye(3), np.array([0, np.nan, 0]))


def test_a_point_goes_where_the_pinhole_camera_puts_it():
    camera = Pinhole(200.0, 210.0, 79.5, 59.5)
    motion = Motion(cv2.Rodrigues(np.array([0.05, -0.1, 0.2]))[0], np.array([0.2, -0.1, 0.3]))
    depth = np.float32(2.5)
    projection = Epipolar(camera, motion, (120, 160)).project(np.float32(1 / depth))
    row, column = 30, 100
    point = np.array([(column - 79.5) / 200 * 2.5, (row - 59.5) / 210 * 2.5, 2.5])
    moved = motion.rotation @ point + motion.translation
    # Single precision on coordinates of hundreds of pixels.
    assert projection.x[row, column] == pytest.approx(200 * moved[0] / moved[2] + 79.5, abs=1e-3)
    assert projection.y[row, column] == pytest.approx(210 * moved[1] / moved[2] + 59.5, abs=1e-3)
    assert projection.scale[row, column] == pytest.approx(moved[2] / 2.5, abs=1e-5)


def test_the_slope_is_the_derivative_of_the_projection():
    camera = Pinhole(200.0, 200.0, 79.5, 59.5)
    geometry = Epipolar(camera, Motion(np.eye(3), np.array([0.1, 0.05, 0.2])), (120, 160))
    here, near = geometry.project(0.5), geometry.project(0.501)
    numeric = (near.x - here.x) / 0.001
    # Second-order term of a step of 0.001 1/m and single precision.
    assert np.abs(numeric - here.slope_x).max() < 0.2


def test_no_pixel_jumps_by_more_than_a_step_between_two_planes():
    camera = Pinhole(300.0, 300.0, 159.5, 119.5)
    geometry = Epipolar(camera, Motion(np.eye(3), np.array([0.1, 0, 0.02])), (240, 320))
    planes = geometry.planes(0.1, 1.0)
    steps = [geometry.parallax(float(b), float(a)) for a, b in pairwise(planes)]
    # Even steps in 1/Z are not quite even in pixels when the camera moves forward: 5 % over.
    assert max(steps) < 1.05
    assert min(steps) > 0.5
