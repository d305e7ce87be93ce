"""Ramps and trapezoids against closed forms."""

import math

import pytest

from medusa.head.trapezoid import Motion, profile, ramp


def test_a_ramp_takes_the_change_over_the_acceleration_and_then_keeps_its_rate() -> None:
    motion = ramp(2.0, 0.5, -1.0, 3.0, 8.0)
    assert motion.end == pytest.approx(2.5)
    # x = x0 + v t + a t²/2.
    assert motion.at(2.25) == pytest.approx((0.5 - 0.25 + 8 * 0.25**2 / 2, 1.0))
    assert motion.at(3.0)[1] == 3.0
    assert motion.at(3.0)[0] == pytest.approx(motion.at(2.5)[0] + 0.5 * 3.0)


@pytest.mark.parametrize(
    ("distance", "seconds"),
    # A trapezoid: d/v + v/a; a triangle: 2 √(d/a).
    [
        (3.0, 3.0 / 2.0 + 2.0 / 8.0),
        (-3.0, 3.0 / 2.0 + 2.0 / 8.0),
        (0.32, 2 * math.sqrt(0.32 / 8.0)),
        (0.0, 0.0),
    ],
)
def test_a_profile_takes_the_time_of_its_closed_form_and_ends_at_its_target(
    distance: float, seconds: float
) -> None:
    motion = profile(1.0, 0.2, 0.0, 0.2 + distance, 2.0, 8.0)
    assert motion.end - 1.0 == pytest.approx(seconds)
    assert motion.at(motion.end + 5.0) == pytest.approx((0.2 + distance, 0.0), abs=1e-12)
    assert max(abs(motion.at(1.0 + seconds * k / 50)[1]) for k in range(51)) <= 2.0 + 1e-12


def test_a_profile_out_of_a_rate_brakes_first() -> None:
    motion = profile(0.0, 0.0, 2.0, -1.0, 2.0, 8.0)
    # v²/2a ahead before it turns.
    assert max(motion.at(k / 1000)[0] for k in range(1000)) == pytest.approx(2.0**2 / 16, abs=1e-4)
    assert motion.at(10.0) == pytest.approx((-1.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("rate", [0.1, 0.7, 1.3, -0.77])
def test_what_has_come_to_rest_does_not_creep(rate: float) -> None:
    motion = ramp(0.0, 0.0, rate, 0.0, 9.42)
    assert motion.at(motion.end + 1.0)[1] == 0.0
    assert motion.at(1e6) == motion.at(1e3)


def test_before_its_start_a_motion_is_where_it_starts() -> None:
    assert Motion(5.0, 1.0, 2.0, ((1.0, 1.0),), 3.0).at(4.0) == (1.0, 2.0)
