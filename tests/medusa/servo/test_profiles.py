"""The chip's profile and integral velocity, count for count, and profiles stretched to end together."""

import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from medusa.errors import CommandError
from medusa.servo.limits import AxisScale
from medusa.servo.profiles import IntegralVelocity, Trapezoid, plan_trapezoid, stretch, stretch_together
from medusa.servo.thesis import JOINTS

profiles = st.builds(
    Trapezoid,
    st.integers(-40_000, 40_000),
    st.integers(1, 2000),
    st.integers(1, 127),
)


def scale(name: str, timer: int = 255) -> AxisScale:
    return AxisScale(JOINTS[name].counts_per_radian, timer, JOINTS[name].plant, name)


def test_first_samples_of_a_ramp_are_the_floor_of_half_a_n_squared() -> None:
    profile = Trapezoid(10_000, 384, 100)  # a = 1.5 counts/sample²
    assert profile.commands()[:6] == [0, 0, 3, 6, 12, 18]


def test_a_profile_that_meets_its_numbers_exactly() -> None:
    # a = 2, v = 4, D = 24: two samples up, four at 4, two down; N = 24/4 + 4/2 = 8.
    assert Trapezoid(24, 512, 4).commands() == [0, 1, 4, 8, 12, 16, 20, 23, 24]
    # a = 2, D = 32: a triangle, √(32/2) = 4 samples up to 8 counts a sample, 4 down.
    triangle = Trapezoid(-32, 512, 100)
    assert triangle.triangular
    assert triangle.commands() == [0, -1, -4, -9, -16, -23, -28, -31, -32]


@settings(max_examples=150, deadline=None)
@given(profile=profiles, share=st.fractions(0, 1))
def test_command_is_the_floor_of_the_closed_form(profile: Trapezoid, share: Fraction) -> None:
    n = math.floor(share * profile.samples)
    distance, a, v = abs(profile.distance), profile.acceleration / 256, profile.speed
    if distance == 0:
        assert profile.samples == 0
        return
    rising = min(v / a, math.sqrt(distance / a))
    peak = a * rising
    length = distance / peak + rising
    if n <= rising:
        gone = a * n * n / 2
    elif n <= length - rising:
        gone = a * rising**2 / 2 + peak * (n - rising)
    else:
        gone = distance - a * (length - n) ** 2 / 2 if n < length else distance
    # The closed form in floating point is good to 1e-9 of the distance: a whole number may fall to either side.
    assert abs(profile.command(n)) in {math.floor(gone - 1e-9 * distance), math.floor(gone + 1e-9 * distance)}


@settings(max_examples=60, deadline=None)
@given(profile=profiles)
def test_a_profile_never_turns_back_never_exceeds_its_speed_and_ends_at_its_distance(
    profile: Trapezoid,
) -> None:
    n = profile.samples
    picked = sorted({*range(0, n + 1, max(1, n // 40)), n})
    commands = [profile.command(i) for i in picked]
    sign = -1 if profile.distance < 0 else 1
    assert commands[0] == 0
    assert commands[-1] == profile.distance
    for i, j, here, there in zip(picked, picked[1:], commands, commands[1:], strict=False):
        assert 0 <= sign * (there - here) <= profile.speed * (j - i) + 1  # one count by the floor


def test_thirty_degree_saccades_take_the_times_of_the_page() -> None:
    # Page 1.7: 333.3 and 471.4 ms in closed form; 475.5 ms where 127 counts a sample (111.62°/s) cap the tilt.
    times = {}
    for name, degrees in (("vergence", 190.0), ("tilt", 111.62109375), ("pan", 180.0)):
        profile = plan_trapezoid(
            scale(name), math.radians(30), math.radians(degrees), JOINTS[name].profile_acceleration
        )
        times[name] = profile.length * 2.048
    assert times["vergence"] == pytest.approx(333.33, abs=0.15)  # a is rounded to 1/256 counts/sample²
    assert times["pan"] == pytest.approx(333.33, abs=0.15)
    assert times["tilt"] == pytest.approx(475.5, abs=0.15)
    fast = AxisScale(JOINTS["tilt"].counts_per_radian, 124, JOINTS["tilt"].plant)  # 1 ms
    uncapped = plan_trapezoid(fast, math.radians(30), JOINTS["tilt"].profile_speed, 3 * math.pi)
    assert uncapped.length == pytest.approx(471.40, abs=0.8)  # a = 76.8 rounds to 77


def test_integral_velocity_ramps_holds_and_floors() -> None:
    command = IntegralVelocity(acceleration=128, position=5)  # half a count/sample²
    command.set_velocity(2)
    assert command.to_go == 4
    # velocities 0.5 1.0 1.5 2.0 2.0: positions 5.5 6.5 8 10 12
    assert [command.step() for _ in range(5)] == [5, 6, 8, 10, 12]
    command.set_velocity(-1)
    # 1.5 1.0 .5 0 -.5 -1: 13.5 14.5 15 15 14.5 13.5
    assert [command.step() for _ in range(6)] == [13, 14, 15, 15, 14, 13]
    assert command.velocity == -1.0


@pytest.mark.parametrize("velocity", [-129, 128, 200])
def test_integral_velocity_outside_its_byte_is_refused(velocity: int) -> None:
    with pytest.raises(CommandError, match=r"outside -128\.\.127"):
        IntegralVelocity(1).set_velocity(velocity)


def test_successive_integral_velocities_are_at_most_127_apart() -> None:
    command = IntegralVelocity(1)
    command.set_velocity(-100)
    with pytest.raises(CommandError, match="at most 127"):
        command.set_velocity(28)
    command.set_velocity(27)


@settings(max_examples=60, deadline=None)
@given(profile=profiles.filter(lambda p: abs(p.distance) > 200), factor=st.floats(1.0, 2.5))
def test_a_stretched_profile_ends_in_the_very_sample_no_faster_and_no_harder(
    profile: Trapezoid, factor: float
) -> None:
    samples = math.ceil(profile.samples * factor)
    found = stretch(profile, samples)
    if found is None:
        return  # the grid of the registers holds none: `stretch_together` then asks for another sample
    assert found.samples == samples
    assert found.distance == profile.distance
    assert found.speed <= profile.speed
    assert found.acceleration <= profile.acceleration


def test_four_joints_end_in_the_same_sample() -> None:
    originals = [
        plan_trapezoid(scale(name), math.radians(d), math.radians(100), 3 * math.pi)
        for name, d in (("vergence", 12.0), ("vergence", -8.0), ("tilt", -5.0), ("pan", 20.0))
    ]
    together, early = stretch_together(originals)
    assert early == []
    assert len({p.samples for p in together}) == 1
    assert together[0].samples <= max(p.samples for p in originals) + 8
    assert [p.distance for p in together] == [p.distance for p in originals]


def test_a_joint_too_near_to_be_stretched_ends_early_and_is_named() -> None:
    together, early = stretch_together(
        [Trapezoid(9677, 374, 92), Trapezoid(5, 374, 92), Trapezoid(0, 374, 92)]
    )
    assert early == [1]
    # The slowest the registers hold over 5 counts is 1/256 counts/sample²: 2 √(5 · 256) = 71.6 samples.
    assert together[1].samples == 72
    assert together[0].samples > 72
    assert together[2].distance == 0


def test_nothing_to_stretch_gives_nothing() -> None:
    assert stretch_together([]) == ([], [])
    assert stretch(Trapezoid(0, 1, 1), 10) is None
    assert stretch(Trapezoid(1000, 256, 20), 5) is None


@pytest.mark.parametrize(("acceleration", "speed"), [(0, 5), (5, 0), (0x8000, 5), (5, 128)])
def test_profile_registers_outside_their_range_are_refused(acceleration: int, speed: int) -> None:
    with pytest.raises(CommandError, match="outside"):
        Trapezoid(100, acceleration, speed)
