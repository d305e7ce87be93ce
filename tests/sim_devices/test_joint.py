"""The joint against closed forms: stops, switches, friction, backlash, edges (docs/protocols)."""

from itertools import pairwise
from math import exp, floor, inf, log

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_devices.motor import Bridge

T_M, C, E = 16.020856e-3, 1235.08619, 18482.5
STOP, SWITCH, EDGE = 14516.0, 12903.0, -4839.0
# Doubles carry 10⁻¹⁶ of some 10⁴ counts; sums of a few hundred steps stay far inside this.
EXACT = 1e-6


class TestHardStops:
    @pytest.mark.parametrize("way", [1, -1])
    def test_the_joint_rests_against_them_and_comes_off_again(self, way, make_joint):
        joint = make_joint(position=way * (STOP - 100))
        joint.forced_positive = joint.forced_negative = False
        joint.refresh()
        joint.drive(way * 40)
        joint.advance_to(1.0)
        assert (joint.m, joint.w) == (way * STOP, 0.0)
        joint.drive(-way * 10)
        joint.advance_to(1.02)
        assert abs(joint.m) < STOP

    def test_no_place_beyond_them(self, make_joint):
        with pytest.raises(ValueError, match="stops"):
            make_joint(position=STOP + 1)


def bisect(f, low, high):
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (low, middle) if f(middle) > 0 else (middle, high)
    return high


class TestSwitches:
    @pytest.mark.parametrize("way", [1, -1])
    def test_each_closes_at_its_place_and_opens_there(self, way, make_joint):
        joint = make_joint(position=way * (SWITCH - 50))
        joint.drive(way * 5)
        joint.advance_to(0.1)
        closed = joint.positive_closed if way > 0 else joint.negative_closed
        other = joint.negative_closed if way > 0 else joint.positive_closed
        assert (closed, other) == (True, False)
        joint.drive(-way * 20)
        joint.advance_to(0.4)
        assert not joint.positive_closed
        assert not joint.negative_closed
        assert abs(joint.j) < SWITCH

    def test_from_the_crossing_on_nothing_drives_into_it_and_the_shaft_coasts(self, make_joint):
        joint = make_joint(position=SWITCH - 50)
        joint.drive(10)
        joint.advance_to(0.02)
        assert joint.positive_closed
        crossing = bisect(lambda t: 10 * C * (t - T_M * (1 - exp(-t / T_M))) - 50, 0, 0.1)
        speed = 10 * C * (1 - exp(-crossing / T_M))
        assert joint.w == pytest.approx(speed, rel=1e-9)
        assert joint.m == pytest.approx(SWITCH + speed * (0.02 - crossing), abs=EXACT)
        assert joint.motor.current(joint.w) == 0.0

    def test_coasting_ends_at_the_hard_stop(self, make_joint):
        joint = make_joint(position=SWITCH - 50)
        joint.drive(100)
        joint.advance_to(0.5)
        assert (joint.m, joint.w) == (STOP, 0.0)

    def test_braking_and_driving_off_a_closed_switch_is_allowed(self, make_joint):
        joint = make_joint(position=SWITCH + 10)
        joint.drive(50)
        joint.advance_to(0.01)
        assert joint.m == SWITCH + 10
        joint.drive(-50)
        joint.advance_to(0.03)
        assert joint.m == pytest.approx(
            SWITCH + 10 - 50 * C * (0.02 - T_M * (1 - exp(-0.02 / T_M))), abs=EXACT
        )

    def test_a_held_switch_shows_and_inhibits_anywhere(self, make_joint):
        joint = make_joint()
        joint.forced_negative = True
        joint.refresh()
        joint.drive(-50)
        joint.advance_to(0.1)
        assert (joint.negative_closed, joint.m) == (True, 0.0)


class TestFriction:
    def test_holds_what_does_not_overcome_it(self, make_joint):
        joint = make_joint(friction=2.0)
        for command in (2, -2, 1, 0):
            joint.drive(command)
            joint.advance_to(joint.t + 0.1)
            assert (joint.m, joint.w) == (0.0, 0.0)

    def test_takes_two_counts_off_a_steady_drive(self, make_joint):
        joint = make_joint(friction=2.0)
        joint.drive(12)
        joint.advance_to(0.05)
        assert joint.w == pytest.approx(10 * C * (1 - exp(-0.05 / T_M)), abs=EXACT)
        joint = make_joint(friction=2.0)
        joint.drive(-12)
        joint.advance_to(0.05)
        assert joint.w == pytest.approx(-10 * C * (1 - exp(-0.05 / T_M)), abs=EXACT)

    def test_stops_a_shaft_at_the_closed_forms_time_and_place(self, make_joint):
        joint = make_joint(friction=2.0)
        joint.w = 6000.0
        # ẇ = (−2C − w)/T_M from w₀ = 6000: stands at t = T_M ln(1 + w₀/2C).
        stop = T_M * log(1 + 6000 / (2 * C))
        joint.advance_to(stop - 1e-9)
        assert joint.w > 0
        joint.advance_to(stop + 1e-9)
        assert joint.w == 0.0
        assert joint.m == pytest.approx(6000 * T_M - 2 * C * stop, abs=EXACT)
        joint.advance_to(1.0)
        assert joint.m == pytest.approx(6000 * T_M - 2 * C * stop, abs=EXACT)

    def test_reverses_exactly_when_driven_back(self, make_joint):
        joint = make_joint(friction=2.0)
        joint.w = 6000.0
        joint.drive(-10)
        turn = T_M * log(1 + 6000 / (12 * C))
        joint.advance_to(turn + 0.01)
        assert joint.w == pytest.approx(-8 * C * (1 - exp(-0.01 / T_M)), abs=EXACT)

    def test_acts_on_an_inhibited_shaft_too(self, make_joint, bridge):
        joint = make_joint(friction=2.0)
        joint.w = 6000.0
        bridge(joint, Bridge.INHIBITED)
        joint.advance_to(0.02)
        # ẇ = −w/10T_M − 2C/T_M: the same torque as ever.
        assert joint.w == pytest.approx(-20 * C + (6000 + 20 * C) * exp(-0.02 / (10 * T_M)), abs=EXACT)


class TestBacklash:
    def test_the_joint_follows_half_a_gap_behind_and_stands_through_a_reversal(self, make_joint):
        joint = make_joint(backlash=8.0)
        joint.w = 2000.0
        joint.advance_to(1.0)
        assert joint.j == pytest.approx(joint.m - 4.0, abs=EXACT)
        stood = joint.j
        joint.w = -7.9 / T_M
        joint.advance_to(2.0)
        assert joint.j == stood
        joint.w = -100 / T_M
        joint.advance_to(3.0)
        assert joint.j == pytest.approx(joint.m + 4.0, abs=EXACT)

    def test_the_sensor_is_on_the_joint(self, make_joint):
        edges = []
        joint = make_joint(position=EDGE - 20.5, backlash=8.0)
        joint.on_home = lambda level, count, t: edges.append((level, count))
        joint.drive(5)
        joint.advance_to(0.2)
        joint.drive(-5)
        joint.advance_to(0.6)
        # Up: the shaft is 4 counts ahead. Down: it must come 4 counts below.
        assert edges == [(True, floor(EDGE + 4)), (False, floor(EDGE - 4))]


class TestHomeSensor:
    @pytest.mark.parametrize("step", [0.3, 2.048e-3, 1e-4])
    def test_its_edge_comes_at_the_closed_forms_time_and_count(self, step, make_joint):
        edges = []
        joint = make_joint(position=EDGE - 200.25)
        joint.on_home = lambda level, count, t: edges.append((level, count, t))
        joint.drive(7)
        while joint.t < 0.3:
            joint.advance_to(joint.t + step)
        crossing = bisect(lambda t: 7 * C * (t - T_M * (1 - exp(-t / T_M))) - 200.25, 0, 0.3)
        assert edges == [(True, floor(EDGE), pytest.approx(crossing, abs=1e-9))]

    def test_on_a_mirrored_joint_it_goes_on_as_the_counts_fall(self, make_joint):
        edges = []
        joint = make_joint(position=3900.0, sign=-1, edge=3871.0)
        assert not joint.sensor
        joint.on_home = lambda level, count, t: edges.append((level, count))
        joint.drive(-5)
        joint.advance_to(0.1)
        assert edges == [(True, 3871)]
        assert joint.angle == pytest.approx(-joint.m / E)

    def test_stuck_it_gives_no_edge(self, make_joint):
        edges = []
        joint = make_joint(position=EDGE - 50)
        joint.on_home = lambda level, count, t: edges.append(level)
        joint.forced_sensor = False
        joint.refresh()
        joint.drive(5)
        joint.advance_to(0.2)
        assert joint.j > EDGE
        assert edges == []
        joint.forced_sensor = None
        joint.refresh()
        assert edges == [True]


class TestIndex:
    @pytest.mark.parametrize(("start", "command", "first"), [(1990.5, 5, 2000), (2011.5, -5, 2000)])
    def test_comes_every_2000_counts_in_both_directions(self, start, command, first, make_joint):
        seen = []
        joint = make_joint(position=start)
        joint.index_armed = True
        joint.on_index = lambda count, t: seen.append(count)
        joint.drive(command)
        joint.advance_to(0.8)
        way = 1 if command > 0 else -1
        assert seen[0] == first
        assert {way * (b - a) for a, b in pairwise(seen)} == {2000}


@settings(max_examples=60, deadline=None)
@given(
    commands=st.lists(st.tuples(st.integers(-128, 127), st.floats(1e-5, 5e-3)), min_size=5, max_size=60),
    friction=st.sampled_from([0.0, 2.0]),
    backlash=st.sampled_from([0.0, 6.0]),
    current=st.sampled_from([0.5, 20.0]),
    start=st.floats(-14000, 14000),
    state=st.sampled_from(list(Bridge)),
)
def test_whatever_is_asked_of_it_it_stays_between_its_stops_and_within_its_speed(
    commands, friction, backlash, current, start, state, make_joint, bridge
):
    joint = make_joint(start, friction=friction, backlash=backlash, peak=current, continuous=current)
    bridge(joint, state)
    t = 0.0
    for command, h in commands:
        joint.drive(command)
        t += h
        joint.advance_to(t)
        assert joint.t == t
        assert abs(joint.j) <= STOP
        assert abs(joint.m - joint.j) <= backlash / 2 + EXACT
        assert abs(joint.w) <= 128 * C + EXACT
        assert joint.positive_closed == (joint.j >= SWITCH)
        assert joint.sensor == (joint.j >= EDGE) or abs(joint.j - EDGE) < EXACT


def test_a_long_stretch_and_many_short_ones_end_at_the_same_place(make_joint):
    def run(steps):
        joint = make_joint(position=EDGE - 30, friction=1.5, backlash=6.0)
        for command in (40, -60, 3, -2, 90, 0):
            joint.drive(command)
            begin = joint.t
            for n in range(1, steps + 1):
                joint.advance_to(begin + 0.02 * n / steps)
        return joint.m, joint.j, joint.w

    assert run(1) == pytest.approx(run(50), abs=EXACT)


def test_an_unarmed_joint_is_never_due(make_joint):
    assert make_joint().due == inf
