"""Joint angles between looks, linear by assumption, so linear motion is exact."""

import pytest

from medusa.gaze.run.joint_history import JointHistory
from medusa.kinematics import Joints


def moving(time):
    return Joints(0.1 * time, -0.2 * time, 0.3, 1.0 - time)


def test_between_looks_the_angles_are_interpolated_and_after_them_extrapolated():
    history = JointHistory()
    for time in (1.0, 1.04, 1.1):
        history.add(time, moving(time))
    for moment in (1.0, 1.01, 1.05, 1.1, 1.12):
        assert history.at(moment) == pytest.approx(moving(moment))


def test_before_the_first_look_nothing_is_known():
    history = JointHistory()
    assert history.at(0.0) is None
    history.add(1.0, moving(1.0))
    assert history.at(0.99) is None
    assert history.at(1.5) == moving(1.0)


def test_old_looks_are_forgotten_and_a_look_out_of_order_is_dropped():
    history = JointHistory(length=2)
    for time in (1.0, 2.0, 3.0):
        history.add(time, moving(time))
    history.add(2.5, Joints(9, 9, 9, 9))
    assert history.at(1.5) is None
    assert history.at(2.5) == pytest.approx(moving(2.5))
