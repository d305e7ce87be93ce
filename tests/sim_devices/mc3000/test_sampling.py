"""When samples fall, and that many at once are the same as each by itself (docs/protocols, the board)."""

import random
import struct
from itertools import pairwise

import pytest

IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)


def sample_times(rig, seconds, axis=0):
    name = {0: "left_vergence", 1: "right_vergence", 2: "tilt"}[axis]
    with rig.machine.record(name) as recording:
        rig.run(seconds)
    return [round(t * 1e6) for t in recording.time]


class TestSampleTimes:
    def test_fall_on_the_multiples_of_the_period_since_power_up(self, rig):
        # T = 40H at power-up: 16·65/2 MHz = 520 µs.
        assert sample_times(rig, 0.003) == [520, 1040, 1560, 2080, 2600]

    @pytest.mark.parametrize(("timer", "period"), [(7, 64), (124, 1000), (255, 2048)])
    def test_the_timer_gives_64_to_2048_us(self, rig, timer, period):
        rig.filter(filter_bytes=(225, 0, 5, timer))
        rig.run(0.01)
        times = sample_times(rig, 0.02)
        assert {time % period for time in times} == {0}
        assert {b - a for a, b in pairwise(times)} == {period}

    def test_a_new_timer_takes_hold_at_its_first_multiple_after_the_running_sample(self, rig):
        rig.run(0.0006)
        rig.filter(filter_bytes=(225, 0, 5, 124))
        # The running sample ends at 1040; until 2000, the first multiple of 1000 after it, the old period goes on.
        assert sample_times(rig, 0.004) == [1040, 1560, 2000, 3000, 4000]

    def test_a_shorter_one_alike(self, rig):
        rig.run(0.0006)
        rig.filter(filter_bytes=(225, 0, 5, 31))
        assert sample_times(rig, 0.0012)[:3] == [1040, 1280, 1536]

    def test_axes_with_equal_timers_are_in_phase(self, rig):
        rig.run(0.0003)
        rig.filter(0)
        rig.run(0.0131)
        rig.filter(1)
        rig.run(0.05)
        with rig.machine.record("left_vergence") as left, rig.machine.record("right_vergence") as right:
            rig.run(0.02)
        assert left.time == right.time

    def test_changing_it_in_control_keeps_the_control_going(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(10)
        rig.run(0.2)
        rig.filter(filter_bytes=(225, 0, 5, 124))
        rig.velocity(5)
        rig.run(0.2)
        before = rig.snapshot().command
        rig.run(0.1)
        # 5 counts in each of a hundred samples of 1 ms.
        assert rig.snapshot().command - before == 500


def drive_at_random(make_rig, careful):
    """Drive an eye about with everything that a host can ask for; return all snapshots and events."""
    source = random.Random(5)
    rig = make_rig(start_deg={"left_vergence": -17.0})
    rig.machine.channels["left_vergence"].careful = careful
    rig.enter(POSITION)
    rig.ok(0x1F, struct.pack("<H", 4000), 0)
    seen = []
    for _ in range(250):
        choice = source.randrange(8)
        if choice == 0:
            rig.status(0x16, [source.choice([1, 1, 2, 3, 3])])
        elif choice == 1:
            rig.move(source.randrange(-2500, 2500))
        elif choice == 2:
            rig.velocity(source.randrange(-20, 20))
        elif choice == 3:
            rig.ok(0x20, axis=0)
        elif choice == 4:
            rig.command(source.randrange(-2500, 2500))
        elif choice == 5:
            rig.ok(0x1D, [source.randrange(4)], 0)
        elif choice == 6:
            rig.profile(
                source.randrange(1, 600), source.randrange(1, 100)
            ) if not rig.snapshot().flags & 1 else None
        rig.run(source.uniform(0.0, 0.08))
        joint = rig.joint()
        seen.append((rig.snapshot(), joint.m, joint.w, rig.settings(), rig.ok(0x21, axis=0)))
        seen.extend(rig.events())
    return seen


def test_many_samples_at_once_are_each_sample_by_itself_to_the_last_bit(make_rig):
    assert drive_at_random(make_rig, careful=False) == drive_at_random(make_rig, careful=True)


def test_how_often_a_device_is_advanced_changes_nothing_that_it_does(make_rig):
    def run(step):
        rig = make_rig()
        rig.enter(POSITION)
        rig.move(6000)
        end = rig.t + 0.4
        while rig.t < end - 1e-9:
            rig.t += step
            rig.device.advance_to(rig.t)
        rig.run(0.5 - rig.t)
        return rig.snapshot(), rig.joint().m, rig.events()

    assert run(0.4) == run(0.005) == run(0.0001)


class TestWakes:
    def test_an_axis_at_rest_in_idle_asks_for_nothing(self, rig):
        assert rig.device.next_due() is None

    def test_in_control_it_wakes_within_5_ms(self, rig):
        rig.enter(POSITION)
        assert rig.t < rig.device.next_due() <= rig.t + 0.005

    def test_coasting_too_until_it_stands(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(20)
        rig.run(0.2)
        rig.ok(0x16, [IDLE], 0)
        assert rig.device.next_due() is not None
        rig.run(1.0)
        assert rig.device.next_due() is None
        assert rig.joint().w == 0.0

    def test_an_event_is_sent_within_5_ms_of_its_stamp(self, rig):
        rig.enter(POSITION)
        rig.move(1000)
        rig.run(0.4)
        (done,) = rig.events(0x40)
        sent = next(t for t in rig.times if t >= done.time_us * 1e-6)
        assert sent - done.time_us * 1e-6 <= 0.005
