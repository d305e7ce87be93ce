"""The three ways of 6.5.3 keep the fixation point; they differ in who turns."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from medusa.gaze.coordination import COORDINATIONS, SharedEffort, coordinate, eyes_after_pan, gaze_azimuth
from medusa.kinematics import HeadGeometry, Joints, look_at, project

GEOMETRY = HeadGeometry(0.1)
level_points = st.tuples(st.floats(0.5, 3), st.floats(-0.4, 0.4)).map(lambda p: np.array([*p, 0.0]))


@given(level_points, st.sampled_from(sorted(COORDINATIONS)), st.booleans())
def test_every_way_keeps_both_eyes_on_the_point(point, name, at_once):
    shared = coordinate(COORDINATIONS[name], look_at(GEOMETRY, point, 0.0), at_once=at_once)
    for eye in ("left", "right"):
        # Closed form, so rounding only; the eyes are as little as 2° apart.
        assert np.allclose(project(GEOMETRY, shared, eye, point), 0, atol=1e-9)


@given(level_points)
def test_the_following_neck_takes_all_and_leaves_the_eyes_symmetric(point):
    joints = coordinate(COORDINATIONS["ii"], look_at(GEOMETRY, point, 0.0))
    assert joints.pan == pytest.approx(math.atan2(point[1], point[0]))
    assert joints.version == pytest.approx(0.0, abs=1e-9)


def test_eyes_first_leave_the_neck_until_the_version_is_uncomfortable():
    way = COORDINATIONS["i"]
    assert not way.wants_neck_saccade(0.0, math.radians(14))
    assert way.wants_neck_saccade(0.0, math.radians(16))
    assert way.wants_neck_saccade(math.radians(30), math.radians(14))
    assert way.pan(0.1, 0.4) == 0.1


def test_shared_effort_is_the_least_of_its_cost():
    way = SharedEffort(pan_effort=3.0, discomfort=2.0)
    turn = way.pan(0.0, 0.5)
    costs = [3.0 * d**2 + 2.0 * (0.5 - d) ** 2 for d in (turn - 0.01, turn, turn + 0.01)]
    assert costs[1] < min(costs[0], costs[2])


def test_eyes_on_infinity_turn_back_by_the_pan():
    assert eyes_after_pan(0.2, 0.2, 0.15) == pytest.approx((0.05, 0.05))
    assert gaze_azimuth(Joints(0.1, 0.0, 0.2, 0.2)) == pytest.approx(0.3)
