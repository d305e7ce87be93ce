"""The trapezoid against its own formulas in sixty digits, and against closed forms."""

from decimal import ROUND_FLOOR, Decimal, localcontext

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_devices.profile import Trapezoid

accelerations = st.integers(1, 0x7FFF)
speeds = st.integers(1, 0x7F)
distances = st.integers(1, 1 << 20)


class Page:
    """The board's page, word for word, in decimals."""

    def __init__(self, distance, acceleration_256, maximum):
        self.a, self.d = Decimal(acceleration_256) / 256, Decimal(distance)
        self.n_a = min(Decimal(maximum) / self.a, (self.d / self.a).sqrt())
        self.v_p = self.a * self.n_a
        self.n = self.d / self.v_p + self.n_a

    def s(self, n):
        if n <= self.n_a:
            return self.a * n * n / 2
        if n <= self.n - self.n_a:
            return self.a * self.n_a**2 / 2 + self.v_p * (n - self.n_a)
        return self.d - self.a * (self.n - n) ** 2 / 2

    def speed(self, n):
        return min(self.a * n, self.v_p, self.a * (self.n - n))

    def gone(self, n):
        return floor(self.s(n)) if n < self.n else int(self.d)


def floor(value):
    # Sixty digits leave an exact integer within 10⁻³⁰ of itself; nothing else comes so near.
    return int((value + Decimal("1e-30")).to_integral_value(ROUND_FLOOR))


@settings(max_examples=150, deadline=None)
@given(distances, accelerations, speeds, st.floats(0, 1))
def test_every_sample_is_the_floor_of_the_pages_formula(distance, acceleration, maximum, where):
    profile = Trapezoid(0, distance, acceleration, maximum)
    with localcontext() as context:
        context.prec = 60
        page = Page(distance, acceleration, maximum)
        middle = int(where * profile.last)
        for n in {0, 1, 2, middle, middle + 1, profile.last - 1, profile.last, profile.last + 1}:
            assert profile.gone(n) == page.gone(n)
        assert profile.last - 1 < page.n <= profile.last


@settings(max_examples=150, deadline=None)
@given(distances, accelerations, speeds, st.floats(0, 1))
def test_a_stop_goes_on_by_the_pages_formula_and_ends_at_its_apex(distance, acceleration, maximum, where):
    profile = Trapezoid(0, distance, acceleration, maximum)
    at = int(where * profile.last)
    profile.stop(at)
    with localcontext() as context:
        context.prec = 60
        page = Page(distance, acceleration, maximum)
        if at >= page.n:
            assert profile.gone(at) == distance
            return
        speed, s = page.speed(at), page.s(at)
        whole = speed / page.a
        for m in (0, 1, int(whole) // 2, int(whole), int(whole) + 1):
            elapsed = min(Decimal(m), whole)
            assert profile.gone(at + m) == floor(s + speed * elapsed - page.a * elapsed**2 / 2)
        assert at + whole <= profile.last < at + whole + 1


@settings(max_examples=50, deadline=None)
@given(distances, accelerations, speeds)
def test_lists_of_commands_equal_single_ones(distance, acceleration, maximum):
    profile = Trapezoid(-50, -50 - distance, acceleration, maximum)
    for first in {0, profile.rise, profile.cruise_end, max(profile.last - 20, 0)}:
        end = first + 25
        assert profile.commands(first, end) == [profile.command(n) for n in range(first, end)]


def test_a_30_degree_saccade_of_an_eye_takes_333_ms():
    # Equations §1.7: t = 2√(d/a) = 333.33 ms at 1080°/s², triangular. In samples of 2.048 ms, whole ones.
    counts_per_degree, sample = 1 / 0.0031, 2.048e-3
    acceleration = round(1080 * counts_per_degree * sample**2 * 256)
    profile = Trapezoid(0, round(30 * counts_per_degree), acceleration, 127)
    assert profile.triangular
    # A byte's rounding of the acceleration is 0.13 %, so half of that of the time; and one whole sample.
    assert profile.last * sample == pytest.approx(0.33333, abs=0.0025)


def test_a_tilt_of_30_degrees_runs_into_127_counts_a_sample_and_takes_475_ms():
    # Equations §1.7: 540°/s², capped at 111.6°/s: 475.47 ms.
    counts_per_degree, sample = 200000 / 360, 2.048e-3
    acceleration = round(540 * counts_per_degree * sample**2 * 256)
    profile = Trapezoid(0, round(30 * counts_per_degree), acceleration, 127)
    assert not profile.triangular
    assert profile.last * sample == pytest.approx(0.47547, abs=0.0025)


def test_it_begins_with_the_old_command_and_ends_with_the_final_one():
    profile = Trapezoid(1000, -1000, 256, 20)
    # a = 1, v = 20: n_a = 20, N = 2000/20 + 20.
    assert profile.last == 120
    assert [profile.command(n) for n in (0, 1, 2, 20, 120, 500)] == [1000, 1000, 998, 800, -1000, -1000]


def test_no_distance_ends_in_its_first_sample():
    assert Trapezoid(7, 7, 0, 0).last == 0


def test_a_distance_without_acceleration_or_speed_is_refused():
    with pytest.raises(ValueError, match="0/256"):
        Trapezoid(0, 1, 0, 5)
    with pytest.raises(ValueError, match="maximum 0"):
        Trapezoid(0, 1, 5, 0)


def test_a_stop_before_the_first_sample_goes_nowhere():
    profile = Trapezoid(0, 5000, 256, 20)
    profile.stop(-1)
    assert profile.last == 0
    assert profile.command(0) == profile.command(9) == 0
