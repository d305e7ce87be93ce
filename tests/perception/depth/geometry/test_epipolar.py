"""Where points go when the camera moves, thesis (2.20)–(2.22), against the rigid transform of points in space."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole

CAMERA = Pinhole(120.0, 110.0, 30.5, 22.0)
SHAPE = (45, 62)


def finite_motion() -> Motion:
    """20° and 40 cm: far beyond the first order."""
    return Motion.from_velocity(np.array([0.25, -0.1, 0.3]), np.array([0.15, -0.25, 0.2]), 1.0)


def by_hand(depth: np.ndarray, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels and depth in the other view, point by point in double precision."""
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]].astype(float)
    points = np.stack(
        [(x - CAMERA.cx) / CAMERA.fx * depth, (y - CAMERA.cy) / CAMERA.fy * depth, depth], axis=-1
    )
    moved = points @ motion.rotation.T + motion.translation
    return (
        CAMERA.fx * moved[..., 0] / moved[..., 2] + CAMERA.cx,
        CAMERA.fy * moved[..., 1] / moved[..., 2] + CAMERA.cy,
        moved[..., 2],
    )


def test_finite_motion_is_the_rigid_transform() -> None:
    depth = np.random.default_rng(0).uniform(1.0, 6.0, SHAPE)
    motion = finite_motion()
    x, y, z = by_hand(depth, motion)
    found = Epipolar(CAMERA, motion, SHAPE).project((1 / depth).astype(np.float32))
    # coordinates below 100 px in single precision after some ten operations: 1e-3 px
    np.testing.assert_allclose(found.x, x, atol=1e-3)
    np.testing.assert_allclose(found.y, y, atol=1e-3)
    np.testing.assert_allclose(found.scale, z / depth, rtol=1e-5)


def test_vector_c_is_the_derivative_by_inverse_depth() -> None:
    geometry, rho, step = Epipolar(CAMERA, finite_motion(), SHAPE), 0.3, 1e-2
    here = geometry.project(rho)
    x0, y0, _ = by_hand(np.full(SHAPE, 1 / (rho - step)), finite_motion())
    x1, y1, _ = by_hand(np.full(SHAPE, 1 / (rho + step)), finite_motion())
    # a central difference of 1e-2 leaves (b·1e-2)² ≈ 1e-5 of about 50 px·m
    np.testing.assert_allclose(here.slope_x, (x1 - x0) / (2 * step), rtol=1e-4, atol=5e-3)
    np.testing.assert_allclose(here.slope_y, (y1 - y0) / (2 * step), rtol=1e-4, atol=5e-3)


def test_lateral_motion_is_the_disparity_of_a_stereo_pair() -> None:
    # f·B·ρ = 120 · .1/3 = 4 px to the left, exactly along the rows
    found = Epipolar(CAMERA, Motion(np.eye(3), np.array([-0.1, 0, 0])), SHAPE).project(1 / 3)
    columns = np.arange(SHAPE[1])[None, :]
    np.testing.assert_allclose(found.x - columns, -4.0, atol=1e-4)
    np.testing.assert_allclose(found.y, np.arange(SHAPE[0])[:, None] * np.ones(SHAPE), atol=1e-4)


def test_forward_motion_expands_about_the_axis() -> None:
    # Z = 4 becomes 3: all grows by 4/3 about the principal point
    found = Epipolar(CAMERA, Motion(np.eye(3), np.array([0, 0, -1.0])), SHAPE).project(0.25)
    x = np.arange(SHAPE[1])[None, :]
    np.testing.assert_allclose(
        found.x, np.broadcast_to(CAMERA.cx + (x - CAMERA.cx) * 4 / 3, SHAPE), atol=1e-4
    )
    np.testing.assert_allclose(found.scale, 0.75, atol=1e-6)


def test_point_behind_the_camera_goes_nowhere() -> None:
    found = Epipolar(CAMERA, Motion(np.eye(3), np.array([0, 0, -1.0])), SHAPE).project(2.0)
    assert np.isnan(found.x).all()


def test_homography_of_a_plane_agrees_with_its_points() -> None:
    geometry, rho = Epipolar(CAMERA, finite_motion(), SHAPE), 0.4
    image = geometry.homography(rho) @ np.array([50.0, 40.0, 1.0])
    x, y, _ = by_hand(np.full(SHAPE, 1 / rho), finite_motion())
    assert image[:2] / image[2] == pytest.approx([x[40, 50], y[40, 50]], abs=1e-9)


def test_planes_stand_a_pixel_apart() -> None:
    # 120 · .1 m · (2 − .5)/m = 18 px: 19 planes
    geometry = Epipolar(CAMERA, Motion(np.eye(3), np.array([-0.1, 0, 0])), SHAPE)
    assert geometry.parallax(2.0, 0.5) == pytest.approx(18.0, abs=1e-9)
    planes = geometry.planes(0.5, 2.0)
    assert len(planes) in (19, 20)  # 18.000000001 rounds up
    assert (planes[0], planes[-1]) == (0.5, 2.0)


def test_pure_rotation_shows_no_parallax() -> None:
    turning = Motion.from_velocity(np.zeros(3), np.array([0.1, 0.2, 0.05]), 1.0)
    assert Epipolar(CAMERA, turning, SHAPE).parallax(10.0, 0.001) == pytest.approx(0, abs=1e-9)


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
