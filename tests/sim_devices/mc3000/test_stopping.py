"""STOP in every mode, the watchdog, and what a new session leaves (docs/protocols, the board and the link)."""

import struct

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
SAMPLE_US = 2048


class TestStopInAProfile:
    def test_decelerates_at_its_acceleration_without_event_40_and_ends_in_position_mode(self, rig):
        rig.enter(POSITION)
        begun = int(rig.t / 2.048e-3) + 1
        rig.move(5000)
        rig.run_samples(21)
        n = int(rig.t / 2.048e-3) - begun
        # a = 1 count/sample²: s = n²/2, and as far again to rest, floored: n².
        assert rig.snapshot().command == n * n // 2
        rig.ok(0x20, axis=0)
        rig.run_samples(n - 1)
        assert rig.snapshot().flags == 0x01
        rig.run_samples(1)
        shown = rig.snapshot()
        assert (shown.flags, shown.command, rig.settings().mode) == (0, n * n, POSITION)
        rig.run(0.2)
        assert rig.events(0x40) == []
        assert rig.command(n * n + 5) == 0

    def test_until_then_modes_and_command_data_answer_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        rig.run_samples(20)
        rig.ok(0x20, axis=0)
        assert {rig.status(0x16, [1]), rig.command(1), rig.velocity(1), rig.move(1)} == {7}
        assert rig.status(0x16, [IDLE]) == 0

    def test_before_its_first_sample_it_ends_where_it_is(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        rig.ok(0x20, axis=0)
        rig.run_samples(2)
        shown = rig.snapshot()
        assert (shown.command, shown.flags, rig.events(0x40)) == (0, 0, [])

    def test_a_second_one_changes_nothing(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        rig.run_samples(20)
        rig.ok(0x20, axis=0)
        rig.run_samples(5)
        rig.ok(0x20, axis=0)
        rig.run(0.2)
        assert rig.settings().mode == POSITION
        assert rig.snapshot().flags == 0


class TestStopInIntegralVelocity:
    def test_ramps_to_0_and_ends_in_position_mode_at_the_command_reached(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(10)
        rig.run_samples(20)
        before = rig.snapshot().command
        rig.ok(0x20, axis=0)
        rig.run_samples(9)
        assert (rig.settings().mode, rig.snapshot().flags) == (INTEGRAL, 0x20)
        assert {rig.status(0x16, [1]), rig.status(0x16, [3]), rig.command(1), rig.velocity(1)} == {7}
        assert rig.write(0x3C, 0) == 7
        rig.run_samples(1)
        # 9 + 8 + … + 1.
        shown = rig.snapshot()
        assert (rig.settings().mode, shown.flags, shown.command) == (POSITION, 0, before + 45)

    def test_at_rest_it_leaves_the_mode_with_the_next_sample(self, rig):
        rig.enter(INTEGRAL)
        rig.run_samples(2)
        rig.ok(0x20, axis=0)
        rig.run_samples(1)
        assert rig.settings().mode == POSITION

    def test_a_profile_setting_may_change_meanwhile(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(10)
        rig.run_samples(20)
        rig.ok(0x20, axis=0)
        rig.profile(5 * 256, 10)
        assert rig.status(0x18, bytes(3)) == 4
        rig.run_samples(2)
        assert rig.settings().mode == POSITION


class TestStopInProportionalVelocity:
    def test_takes_velocity_0_and_goes_idle_when_the_axis_stands(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.velocity(16 * 40)
        rig.run_samples(50)
        rig.ok(0x20, axis=0)
        assert rig.read(0x23, 2) == b"\0\0"
        rig.run_samples(3)
        assert rig.settings().mode == PROPORTIONAL
        assert {rig.status(0x16, [1]), rig.status(0x16, [2]), rig.velocity(1), rig.write(0x23, 1)} == {7}
        rig.run(0.3)
        assert rig.settings().mode == IDLE
        assert rig.snapshot().motor == 0x80

    def test_standing_is_four_samples_of_at_most_one_count(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.run_samples(5)
        rig.ok(0x20, axis=0)
        rig.run_samples(3)
        assert rig.settings().mode == PROPORTIONAL
        rig.run_samples(1)
        assert rig.settings().mode == IDLE


class TestStopElsewhere:
    def test_position_mode_stays_and_a_step_runs_on_to_its_end(self, rig):
        rig.enter(POSITION)
        rig.command(2000)
        rig.run_samples(3)
        rig.ok(0x20, axis=0)
        rig.run(0.4)
        shown = rig.snapshot()
        # Dead band of equations §1.6.
        assert (rig.settings().mode, shown.command, abs(shown.actual - 2000) <= 7) == (POSITION, 2000, True)

    def test_idle_stays_but_an_open_loop_command_becomes_80h(self, rig):
        rig.watchdog(1000)
        assert rig.write(0x08, 0x90, 5) == 0
        assert rig.snapshot().motor == 0x90
        rig.ok(0x20, axis=0)
        assert rig.read(0x08, 2) == b"\x80\x00"
        rig.run(0.3)
        before = rig.snapshot().actual
        rig.run(0.3)
        assert rig.snapshot().actual == before

    def test_on_0fh_it_acts_on_all_axes(self, rig):
        for axis in range(3):
            rig.enter(INTEGRAL, axis)
            rig.velocity(5, axis)
        rig.run_samples(10)
        rig.ok(0x20)
        rig.run_samples(6)
        assert [rig.settings(axis).mode for axis in range(3)] == [POSITION] * 3

    @pytest.mark.parametrize("axis", [0, WHOLE])
    def test_is_accepted_in_every_state(self, rig, axis):
        rig.ok(0x20, axis=axis)
        rig.enter(POSITION)
        rig.move(3000)
        rig.ok(0x20, axis=axis)
        rig.inject("switch", axis="left_vergence", side="positive", held="closed")
        rig.ok(0x20, axis=axis)
        rig.inject("amplifier_fault", axis="left_vergence")
        rig.ok(0x20, axis=axis)
        rig.ok(0x05)
        rig.ok(0x20, axis=axis)

    def test_raises_no_event_42(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.run_samples(10)
        rig.ok(0x20)
        rig.run(0.1)
        assert rig.events() == []


class TestStopInput:
    def test_raises_event_42_shows_in_the_status_and_holds_the_velocity(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.run_samples(10)
        rig.inject("stop_input", axis="left_vergence")
        rig.run_samples(10)
        (event,) = rig.events()
        assert (event.operation, event.axis, event.detail) == (0x42, 0, 0)
        shown = rig.snapshot()
        assert (shown.status & 0x40, rig.settings().mode) == (0, INTEGRAL)
        rig.run_samples(5)
        assert rig.snapshot().command == shown.command

    @pytest.mark.parametrize("release", ["CLEAR", "07H"])
    def test_is_released_with_the_pin_high_and_then_needs_a_new_velocity(self, rig, release):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.inject("stop_input", axis="left_vergence")
        rig.inject("stop_input", axis="left_vergence", on=False)
        rig.run_samples(10)
        assert rig.snapshot().status & 0x40 == 0
        if release == "CLEAR":
            rig.ok(0x06, axis=0)
        else:
            assert rig.write(0x07, 0) == 0
        assert rig.snapshot().status & 0x40
        rig.run_samples(5)
        stood = rig.snapshot().command
        rig.velocity(5)
        rig.run_samples(5)
        assert rig.snapshot().command > stood


class TestWatchdog:
    def test_action_0_sends_every_axis_idle(self, rig):
        rig.enter(POSITION, 0)
        rig.enter(INTEGRAL, 1)
        rig.velocity(5, 1)
        rig.watchdog(50, action=0)
        expiry = rig.t + 0.05
        rig.run(0.2)
        (event,) = rig.events()
        assert event == (0x44, WHOLE, round(expiry * 1e6), 0, 0)
        assert [rig.settings(axis).mode for axis in range(3)] == [IDLE] * 3

    def test_action_1_stops_every_axis_but_one_off_its_switches_goes_idle(self, rig):
        rig.enter(INTEGRAL, 0)
        rig.ok(0x1E, [0], 1)
        rig.enter(INTEGRAL, 1)
        for axis in (0, 1):
            rig.velocity(5, axis)
        rig.watchdog(50, action=1)
        rig.run(0.2)
        assert [event[:2] + event[3:] for event in rig.events()] == [(0x44, WHOLE, 0, 1)]
        assert [rig.settings(axis).mode for axis in (0, 1)] == [POSITION, IDLE]
        assert rig.settings(1).limit_enable == 1

    def test_other_actions_answer_4(self, rig):
        assert {rig.watchdog(50, action) for action in (2, 3, 0xFF)} == {4}

    def test_sets_input_7_on_every_axis_until_its_next_mode(self, rig):
        rig.watchdog(50)
        rig.run(0.1)
        assert [rig.inputs(axis) & 0x80 for axis in range(3)] == [0x80] * 3
        rig.ok(0x06)
        assert rig.inputs(0) & 0x80
        rig.ok(0x16, [IDLE], 0)
        rig.enter(POSITION, 1)
        assert [rig.inputs(axis) & 0x80 for axis in range(3)] == [0, 0, 0x80]

    def test_nothing_that_it_stopped_resumes(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.watchdog(50, action=1)
        rig.run(0.2)
        stood = rig.snapshot().command
        rig.run(0.04)
        assert rig.snapshot().command == stood

    def test_switched_off_it_takes_back_an_open_loop_command(self, rig):
        rig.watchdog(1000)
        rig.write(0x08, 0x90, 0x10)
        rig.watchdog(0)
        assert rig.read(0x08, 2) == b"\x80\x00"

    def test_feeding_it_keeps_the_axis_moving(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.watchdog(50)
        for _ in range(10):
            rig.run(0.03)
            rig.ok(0x02)
        assert rig.settings().mode == INTEGRAL


class TestNewSession:
    def test_every_axis_stands_idle_and_nothing_is_armed(self, rig):
        rig.enter(INTEGRAL, 0)
        rig.enter(POSITION, 1)
        rig.move(500, start=0, axis=1)
        rig.ok(0x1D, [1], 2)
        rig.watchdog(500)
        rig.ok(0x01, b"xy")
        assert [tuple(rig.settings(axis)) for axis in range(3)] == [(IDLE, 0, 1, 0)] * 3
        assert rig.ok(0x21, axis=2)[0] == 0
        assert rig.write(0x08, 0x90) == 6

    def test_positions_settings_and_latched_stops_stay(self, rig):
        rig.filter(filter_bytes=(1, 2, 3, 99))
        rig.profile(77, 9)
        rig.ok(0x1F, struct.pack("<H", 500), 0)
        rig.ok(0x1B, struct.pack("<i", -44), 0)
        rig.ok(0x05)
        rig.ok(0x01, b"xy")
        assert rig.read(0x20, 3) + rig.read(0x26, 3) == bytes([1, 2, 3, 77, 0, 9])
        assert rig.settings().following == 500
        assert rig.snapshot().actual == -44
        assert rig.inputs() & 0x20
