"""Trapezoids in the chip's units against the closed forms of the thesis' saccades."""

import pytest

from medusa.errors import CommandError
from medusa.mc3000.board import FilterBytes, Profile, make_profile, profile_samples

SLOWEST = FilterBytes(0, 0, 5, 255)
CLOCK_HZ = 2_000_000
PERIOD = 0.002048


def test_a_triangle_takes_twice_the_root_of_distance_over_acceleration() -> None:
    # 30° of pan at 1080°/s²: 2 √(30/1080) = 333.33 ms (thesis, table 6.3); 8.8 rounding of the
    # acceleration (322/256 for 322.15) is worth 0.03 %.
    profile = make_profile(1080 * 277.778, 180 * 277.778, SLOWEST, CLOCK_HZ)
    assert profile_samples(8333, profile) * PERIOD == pytest.approx(0.33333, rel=5e-4)


def test_a_trapezoid_takes_distance_over_speed_and_speed_over_acceleration() -> None:
    # D/v + v/a with D = 1000, v = 10, a = 1/2.
    assert profile_samples(-1000, Profile(128, 10)) == pytest.approx(100 + 20)


def test_no_distance_takes_no_time() -> None:
    assert profile_samples(0, Profile(256, 10)) == 0


@pytest.mark.parametrize(
    ("speed", "accepted"),
    [(127 / PERIOD, 127), (0.51 / PERIOD, 1), (118.9 / PERIOD, 119)],
)
def test_speeds_round_to_whole_counts_a_sample(speed: float, accepted: int) -> None:
    assert make_profile(1e4, speed * (1 - 1e-12), SLOWEST, CLOCK_HZ).maximum == accepted


def test_a_speed_that_the_chip_cannot_do_is_refused_with_the_number() -> None:
    # 180°/s of tilt at T = 2.048 ms: 204.8 counts a sample (thesis, table 6.1).
    with pytest.raises(CommandError, match=r"204\.80 counts a sample at T=255; the chip can do 1 to 127"):
        make_profile(1e5, 180 * 555.5556, SLOWEST, CLOCK_HZ)
    with pytest.raises(CommandError, match=r"0\.20 counts a sample"):
        make_profile(1e5, 0.2 / PERIOD, SLOWEST, CLOCK_HZ)


@pytest.mark.parametrize(
    ("acceleration", "reported"), [(0.0, r"0\.00/256"), (128 / PERIOD**2, r"32768\.00/256")]
)
def test_an_acceleration_that_the_chip_cannot_do_is_refused_with_the_number(
    acceleration: float, reported: str
) -> None:
    with pytest.raises(CommandError, match=reported):
        make_profile(acceleration, 1e4, SLOWEST, CLOCK_HZ)
