"""Moves and their common start, and what refuses them (docs/protocols, the board)."""

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)


class TestMove:
    def test_runs_a_trapezoid_and_says_when_f0_clears(self, rig):
        rig.enter(POSITION)
        begun = int(rig.t / 2.048e-3) + 1
        assert rig.move(1000) == 0
        assert rig.snapshot().flags == 0x01
        assert rig.snapshot().status == 0xD0
        rig.run(0.5)
        # a = 1, D = 1000: N = 2√1000 = 63.2; the first sample is n = 0, F0 clears at n = 64.
        (done,) = rig.events(0x40)
        assert done.time_us == (begun + 64) * 2048
        assert (done.axis, done.detail) == (0, 0)
        shown = rig.snapshot()
        assert (shown.flags, shown.command, abs(shown.actual - 1000) <= 7) == (0, 1000, True)

    def test_to_where_the_command_stands_it_clears_f0_on_the_next_sample(self, rig):
        rig.enter(POSITION, acceleration=0, maximum=0)
        begun = int(rig.t / 2.048e-3) + 1
        assert rig.move(0) == 0
        rig.run_samples(2)
        assert [event.time_us for event in rig.events(0x40)] == [begun * 2048]

    @pytest.mark.parametrize(("acceleration", "maximum"), [(0, 10), (256, 0)])
    def test_without_acceleration_or_maximum_answers_4_when_it_begins(self, rig, acceleration, maximum):
        rig.enter(POSITION, acceleration=acceleration, maximum=maximum)
        assert rig.move(10, start=1) == 4
        assert rig.move(10, start=0) == 0

    def test_bad_values_answer_4(self, rig):
        rig.enter(POSITION)
        assert rig.move(1 << 23) == 4
        assert rig.move(0, start=2) == 4

    def test_a_timer_below_15_answers_4(self, rig):
        rig.enter(POSITION, filter_bytes=(225, 0, 5, 14))
        assert {rig.move(10, start=0), rig.move(10, start=1)} == {4}

    @pytest.mark.parametrize("mode", [0, 2, 3])
    def test_outside_position_mode_answers_6(self, rig, mode):
        if mode:
            rig.enter(mode)
        assert rig.move(10) == rig.move(10, start=0) == 6

    def test_in_a_profile_answers_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.move(10) == rig.move(10, start=0) == 7

    def test_armed_it_waits_and_a_second_one_replaces_its_target(self, rig):
        rig.enter(POSITION)
        rig.move(1000, start=0)
        rig.move(300, start=0)
        rig.run(0.1)
        assert (rig.snapshot().command, rig.settings().armed) == (0, 1)
        rig.ok(0x1A, [1])
        rig.run(0.5)
        assert (rig.snapshot().command, rig.settings().armed) == (300, 0)

    def test_parameters_of_an_armed_one_are_taken_when_it_begins(self, rig):
        rig.enter(POSITION)
        rig.move(1000, start=0)
        rig.profile(256, 1)
        rig.ok(0x1A, [1])
        rig.run_samples(100)
        # At one count a sample.
        assert 90 < rig.snapshot().command < 101

    def test_begun_at_once_it_forgets_what_was_armed(self, rig):
        rig.enter(POSITION)
        rig.move(1000, start=0)
        rig.move(10, start=1)
        assert rig.settings().armed == 0

    @pytest.mark.parametrize(
        "disarm",
        [
            lambda rig: rig.ok(0x20, axis=0),
            lambda rig: rig.ok(0x06, axis=0),
            lambda rig: rig.ok(0x16, [0], 0),
            lambda rig: rig.ok(0x01, b"ab"),
            lambda rig: rig.ok(0x05),
        ],
        ids=["STOP", "CLEAR", "idle", "HELLO", "EMERGENCY_STOP"],
    )
    def test_is_disarmed_by(self, rig, disarm):
        rig.enter(POSITION)
        rig.move(1000, start=0)
        disarm(rig)
        assert rig.settings().armed == 0


class TestStart:
    def test_all_begin_in_the_same_sample(self, rig):
        for axis in range(3):
            rig.enter(POSITION, axis)
            rig.move(-500 * (axis + 1), start=0, axis=axis)
        begun = int(rig.t / 2.048e-3) + 1
        rig.ok(0x1A, [7])
        rig.run(1.0)
        events = {event.axis: event.time_us for event in rig.events(0x40)}
        # N = 2√D: 44.7, 63.2, 77.5.
        assert events == {0: (begun + 45) * 2048, 1: (begun + 64) * 2048, 2: (begun + 78) * 2048}

    def test_only_those_in_the_mask(self, rig):
        for axis in (0, 1):
            rig.enter(POSITION, axis)
            rig.move(500, start=0, axis=axis)
        rig.ok(0x1A, [2])
        assert (rig.settings(0).armed, rig.settings(1).armed) == (1, 0)

    @pytest.mark.parametrize("mask", [0, 8, 0x80])
    def test_a_bad_mask_answers_4(self, rig, mask):
        assert rig.status(0x1A, [mask], WHOLE) == 4

    def test_an_axis_that_is_not_armed_answers_6_and_none_begins(self, rig):
        for axis in (0, 1):
            rig.enter(POSITION, axis)
        rig.move(500, start=0)
        assert rig.status(0x1A, [3], WHOLE) == 6
        assert rig.settings(0).armed == 1
        assert rig.snapshot(0).flags == 0

    def test_unequal_timers_answer_4(self, rig):
        rig.enter(POSITION, 0)
        rig.enter(POSITION, 1, filter_bytes=(225, 0, 5, 254))
        for axis in (0, 1):
            rig.move(500, start=0, axis=axis)
        assert rig.status(0x1A, [3], WHOLE) == 4
        rig.filter(1)
        assert rig.status(0x1A, [3], WHOLE) == 0

    def test_a_timer_below_15_answers_4(self, rig):
        rig.enter(POSITION)
        rig.move(500, start=0)
        rig.filter(filter_bytes=(225, 0, 5, 14))
        assert rig.status(0x1A, [1], WHOLE) == 4

    @pytest.mark.parametrize(("acceleration", "maximum"), [(0, 10), (256, 0)])
    def test_one_axis_that_cannot_go_holds_all(self, rig, acceleration, maximum):
        for axis in (0, 1):
            rig.enter(POSITION, axis)
            rig.move(500, start=0, axis=axis)
        rig.profile(acceleration, maximum, axis=1)
        assert rig.status(0x1A, [3], WHOLE) == 4
        assert [rig.snapshot(axis).flags for axis in (0, 1)] == [0, 0]

    def test_a_running_profile_answers_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.status(0x1A, [1], WHOLE) == 7

    def test_right_after_a_change_of_timer_all_still_begin_together(self, rig):
        for axis in (0, 1):
            rig.enter(POSITION, axis)
            rig.move(500, start=0, axis=axis)
        rig.filter(0, (225, 0, 5, 99))
        rig.filter(1, (225, 0, 5, 99))
        rig.run(0.1)
        # Axis 1 still samples at 0.8 ms when its next timer is written, axis 0 has it already.
        rig.filter(0)
        rig.run(0.01)
        rig.filter(1)
        rig.ok(0x1A, [3])
        rig.run(1.0)
        times = {event.time_us for event in rig.events(0x40)}
        assert len(times) == 1
