"""The camera's motion between two images."""

import numpy as np
import pytest

from perception.camera.motion import Motion


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
    with pytest.raises(ValueError, match="no rotation"):
        Motion(np.diag([1.0, 1.0, 1.1]), np.zeros(3))
    with pytest.raises(ValueError, match="no number"):
        Motion(np.eye(3), np.array([0, np.nan, 0]))
