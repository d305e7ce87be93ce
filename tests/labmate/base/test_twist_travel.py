"""The law by which a base that drives no GO by itself approaches its goal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labmate.base.twist_travel import approach_speed


@given(st.floats(1e-4, 10.0), st.floats(0.01, 0.3), st.floats(0.02, 2.0), st.sampled_from((-1.0, 1.0)))
def test_from_the_speed_of_the_approach_the_base_stops_where_it_should(
    way: float, delay: float, acceleration: float, sign: float
) -> None:
    speed = approach_speed(sign * way, delay, 1e9, acceleration)
    assert speed * sign > 0.0
    # What it covers until the next command acts, and ramping down from there.
    assert abs(speed) * delay + speed**2 / (2.0 * acceleration) == pytest.approx(way)


def test_far_from_the_goal_it_is_the_limit_and_at_the_goal_nothing() -> None:
    assert approach_speed(5.0, 0.1, 0.3, 0.25) == 0.3
    assert approach_speed(-5.0, 0.1, 0.3, 0.25) == -0.3
    assert approach_speed(0.0, 0.1, 0.3, 0.25) == 0.0
