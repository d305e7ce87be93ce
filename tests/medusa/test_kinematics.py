"""The head's chain against itself, closed forms, and the test vectors for (6.26), (6.27)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from medusa.kinematics import (
    HeadGeometry,
    Joints,
    bearing_of,
    camera_pose,
    direction_of,
    eyes_from_version,
    gaze_angle,
    image_jacobian,
    look_at,
    project,
    retinal_errors,
    symmetric_vergence,
    triangulate,
)

ON_AXES = HeadGeometry(0.13)
OFF_AXES = HeadGeometry(0.13, (0.02, 0.005, -0.004), (0.02, -0.003, -0.004))
points = st.tuples(st.floats(0.4, 4), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)).map(np.array)
pans = st.floats(-0.5, 0.5)


def test_straight_ahead_the_camera_looks_along_x_with_its_image_down_being_down():
    rotation, centre = camera_pose(ON_AXES, Joints(0, 0, 0, 0), "left")
    assert np.allclose(rotation[:, 2], [1, 0, 0])
    assert np.allclose(rotation[:, 1], [0, 0, -1])
    assert np.allclose(centre, [0, 0.065, 0])


@pytest.mark.parametrize(
    ("joint", "expected"),
    [("pan", (1, 0)), ("left", (1, 0)), ("tilt", (0, -1))],
    ids=["pan left moves the image right", "eye left moves the image right", "tilt down moves the image up"],
)
def test_turning_a_joint_moves_the_image_against_it(joint, expected):
    joints = Joints(0, 0, 0, 0)._replace(**{joint: 0.01})
    x, y = project(ON_AXES, joints, "left", np.array([1e6, 0, 0]))
    assert np.allclose(np.sign(np.round([x, y], 6)), expected)


@given(points, pans, st.sampled_from([ON_AXES, OFF_AXES]))
def test_look_at_puts_the_point_on_both_optical_axes(point, pan, geometry):
    joints = look_at(geometry, point, pan)
    # Rounding only: the solution is closed.
    assert np.allclose(project(geometry, joints, "left", point), 0, atol=1e-12)
    assert np.allclose(project(geometry, joints, "right", point), 0, atol=1e-12)


@given(points, pans)
def test_triangulation_gives_back_the_point_that_both_eyes_see(point, pan):
    joints = Joints(pan, 0.1, -0.05, 0.08)
    left, right = (project(OFF_AXES, joints, eye, point) for eye in ("left", "right"))
    found = triangulate(OFF_AXES, joints, left, right)
    # At 4 m the axes meet at 1.9°: rounding grows by some 30² there.
    assert found is not None
    assert np.allclose(found, point, atol=1e-9)


def test_lines_that_do_not_meet_in_front_of_the_eyes_have_no_point():
    assert triangulate(ON_AXES, Joints(0, 0, 0, 0), (0.0, 0.0), (0.0, 0.0)) is None
    assert triangulate(ON_AXES, Joints(0, 0, 0.1, -0.1), (0.0, 0.0), (0.0, 0.0)) is None


@given(points, pans, st.floats(-0.3, 0.3))
def test_the_jacobian_is_the_derivative_of_the_projection(point, pan, tilt):
    joints, step = Joints(pan, tilt, -0.05, 0.1), 1e-6

    def images(angles):
        return np.array(
            project(OFF_AXES, Joints(*angles), "left", point)
            + project(OFF_AXES, Joints(*angles), "right", point)
        )

    try:
        exact = image_jacobian(OFF_AXES, joints, point)
    except ValueError:
        return  # the point is behind an eye
    ahead = np.eye(4) * step
    numeric = np.array(
        [(images(joints + d) - images(joints - d)) / (2 * step) for d in map(np.array, ahead)]
    ).T
    # Central differences: third derivative × step²/6, and rounding over the step; both grow with the image's
    # eccentricity.
    assert np.allclose(exact, numeric, atol=1e-7 * (1 + np.abs(exact).max() ** 3))


@pytest.mark.parametrize(
    ("x", "theta_left", "theta_right", "gaze"),
    [(0.3, 69.94792, 76.77545, 73.30076), (-0.3, 103.22455, 110.05208, 106.69924)],
)
def test_gaze_angle_and_symmetric_vergence_of_a_point_one_metre_ahead(x, theta_left, theta_right, gaze):
    left, right = math.radians(theta_left), math.radians(theta_right)
    # Five decimals of a degree are given; the sum of two rounded angles may be one off in the last.
    assert math.degrees(gaze_angle(left, right)) == pytest.approx(gaze, abs=2e-5)
    assert math.degrees(symmetric_vergence(left, right)[0]) == pytest.approx(86.43744, abs=2e-5)
    assert sum(symmetric_vergence(left, right)) == pytest.approx(math.pi)


@given(points)
def test_the_pan_saccade_of_6_26_and_6_27_keeps_the_fixation_point(point):
    level = np.array([point[0], point[1], 0.0])
    before = look_at(ON_AXES, level, 0.0)
    theta_left, theta_right = math.pi / 2 + before.left, math.pi / 2 + before.right
    pan = gaze_angle(theta_left, theta_right) - math.pi / 2
    turned = symmetric_vergence(theta_left, theta_right)
    after = Joints(pan, 0.0, turned[0] - math.pi / 2, turned[1] - math.pi / 2)
    # 6.27 turns about the baseline's midpoint, which is exact for the head's own pan axis.
    assert np.allclose(project(ON_AXES, after, "left", level), 0, atol=1e-9)
    assert np.allclose(project(ON_AXES, after, "right", level), 0, atol=1e-9)


def test_retinal_errors_have_the_joints_signs_and_none_for_what_was_not_seen():
    left, right, tilt = retinal_errors((0.1, 0.2), None)
    assert left == pytest.approx(-math.atan(0.1))
    assert right is None
    assert tilt == pytest.approx(math.atan(0.2))
    assert retinal_errors(None, None) == (None, None, None)


@given(st.floats(-1.5, 1.5), st.floats(-1.4, 1.4))
def test_bearing_and_direction_are_inverse(azimuth, elevation):
    assert np.allclose(bearing_of(3 * direction_of(azimuth, elevation)), (azimuth, elevation), atol=1e-12)


def test_version_and_vergence_are_mean_and_difference():
    joints = Joints(0, 0, *eyes_from_version(math.radians(10), math.radians(4)))
    assert math.degrees(joints.left) == pytest.approx(8)
    assert math.degrees(joints.right) == pytest.approx(12)
    assert joints.version == pytest.approx(math.radians(10))
    assert joints.vergence == pytest.approx(math.radians(4))
