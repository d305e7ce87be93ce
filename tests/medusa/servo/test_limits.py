"""Refusals of what chip and amplifier cannot do: the number in the way and the sample period that would do."""

import math

import pytest

from medusa.errors import CommandError
from medusa.servo.limits import AxisScale
from medusa.servo.sampling import longest_timer_within, sample_period, timer_for
from medusa.servo.thesis import JOINTS


def scale(name: str, timer: int = 255) -> AxisScale:
    return AxisScale(JOINTS[name].counts_per_radian, timer, JOINTS[name].plant, name)


def test_sample_periods_are_those_of_the_chip() -> None:
    assert sample_period(255) == pytest.approx(2.048e-3)
    assert sample_period(124) == pytest.approx(1e-3)
    assert sample_period(7) == pytest.approx(64e-6)
    assert longest_timer_within(1e-3) == 124
    assert longest_timer_within(60e-6) is None
    assert timer_for(2.048e-3) == 255
    with pytest.raises(CommandError, match=r"1000 µs \(T = 124\) and 1008 µs"):
        timer_for(1.003e-3)
    with pytest.raises(CommandError, match=r"outside 7\.\.255"):
        sample_period(6)


def test_speeds_a_sample_period_allows_are_those_of_the_page() -> None:
    # 127 counts a sample at 2.048 ms: 192.2, 111.6, 223.2 °/s; one count: 1.5137, .8789, 1.7578 (page 1.8).
    fast = {"vergence": 192.2, "tilt": 111.6, "pan": 223.2}
    slow = {"vergence": 1.5137, "tilt": 0.8789, "pan": 1.7578}
    for name in JOINTS:
        assert math.degrees(scale(name).chip_speed) == pytest.approx(fast[name], abs=0.06)
        assert math.degrees(scale(name).least_speed) == pytest.approx(slow[name], abs=6e-5)


def test_tilt_at_180_degrees_a_second_is_refused_with_the_period_that_would_do() -> None:
    # 204.8 counts a sample (page 1.8); 127/(180 · 555.56 counts/s) = 1.27 ms, the chip's next is 1.264 ms.
    with pytest.raises(CommandError, match=r"204\.8 counts.*127 \(111\.6°/s\).*1\.264 ms \(T = 157\)"):
        scale("tilt").check_speed(math.pi)
    scale("tilt", 157).check_speed(math.pi)


def test_table_6_3_asks_the_pan_for_more_than_its_amplifier_gives() -> None:
    with pytest.raises(CommandError, match=r"270\.0°/s is over the 197\.2°/s .* no sample period allows it"):
        scale("pan", 124).check_speed(1.5 * math.pi)
    scale("vergence", 124).check_speed(1.5 * math.pi)
    scale("tilt", 124).check_speed(0.75 * math.pi)


def test_speed_register_never_exceeds_what_was_asked() -> None:
    axis = scale("pan")
    assert axis.speed_register(math.radians(180)) == 102  # 102.4
    assert scale("tilt").speed_register(scale("tilt").chip_speed) == 127
    with pytest.raises(CommandError, match="below one count a sample"):
        axis.speed_register(math.radians(1.7))
    for speed in (0.0, -1.0):
        with pytest.raises(CommandError, match="above 0"):
            axis.speed_register(speed)
    for speed in (math.nan, math.inf):
        with pytest.raises(CommandError):
            axis.speed_register(speed)


@pytest.mark.parametrize(("name", "register"), [("vergence", 81), ("tilt", 140), ("pan", 70)])
def test_acceleration_of_the_integral_velocity_mode_is_the_register_of_the_page(
    name: str, register: int
) -> None:
    assert scale(name).acceleration_register(1.3 * math.pi) == register


@pytest.mark.parametrize("acceleration", [0.0, -1.0, math.nan])
def test_an_acceleration_of_zero_or_less_is_refused(acceleration: float) -> None:
    with pytest.raises(CommandError, match="moves nothing; it must be above 0"):
        scale("tilt").acceleration_register(acceleration)


def test_accelerations_off_the_registers_are_refused_with_a_period_that_would_do() -> None:
    with pytest.raises(
        CommandError, match=r"cannot be held at 2\.048 ms.*sample period of .* would allow it"
    ):
        scale("tilt").acceleration_register(2000.0)
    with pytest.raises(CommandError, match=r"at least .*no sample period would allow it"):
        scale("pan").acceleration_register(1e-3)
    short = AxisScale(JOINTS["pan"].counts_per_radian, 7)
    with pytest.raises(CommandError, match="a longer sample period"):
        short.acceleration_register(1.0)


def test_speed_with_acceleration_may_need_more_than_the_dac() -> None:
    axis = scale("pan")
    axis.check_drive(math.pi, 6 * math.pi)  # (v + a T_M)/C = 121
    # 190°/s and 1080°/s² on top: (52 778 + 300 000 · 7.836e-3)/431.3 = 127.8
    with pytest.raises(CommandError, match=r"needs 127\.8 DAC counts, the amplifier gets at most 127"):
        axis.check_drive(math.radians(190), 6 * math.pi)
    AxisScale(axis.counts_per_radian, 255).check_drive(100.0, 100.0)  # nothing known of the plant
