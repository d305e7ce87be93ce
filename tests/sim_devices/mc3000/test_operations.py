"""Every named operation of the board and what refuses it (docs/protocols, the board)."""

import struct

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
LENGTHS = {
    0x10: {2},
    0x11: set(range(2, 10)),
    0x12: {0},
    0x13: {4},
    0x14: {0},
    0x15: {4},
    0x16: {1},
    0x17: {2},
    0x18: {3},
    0x19: {5},
    0x1A: {1},
    0x1B: {4},
    0x1C: {0},
    0x1D: {1},
    0x1E: {1},
    0x1F: {2},
    0x20: {0},
    0x21: {0},
    0x22: {0},
}
WHOLE_ONLY, BOTH = {0x14, 0x1A}, {0x20}


def i32(value):
    return struct.pack("<i", value)


class TestFraming:
    def test_hello_tells_three_axes_at_2_mhz(self, rig):
        reply = rig.ok(0x01, b"\xef\xbe")
        assert reply[:4] == b"\xef\xbe\x01\x01"
        assert reply[8:] == struct.pack("<BI", 3, 2000000)

    @pytest.mark.parametrize("operation", [0x23, 0x30, 0x0F, 0xFF])
    def test_an_unknown_operation_answers_1(self, rig, operation):
        assert rig.status(operation, bytes(70)[:9], axis=9) == 1

    @pytest.mark.parametrize("operation", sorted(LENGTHS))
    def test_a_wrong_axis_answers_2_before_a_wrong_length(self, rig, operation):
        wrong = [3, 0x0E, 0x10, 0xFF]
        if operation in WHOLE_ONLY:
            wrong += [0, 1, 2]
        elif operation not in BOTH:
            wrong += [WHOLE]
        assert {rig.status(operation, bytes(12), axis) for axis in wrong} == {2}

    @pytest.mark.parametrize("operation", sorted(LENGTHS))
    def test_every_wrong_length_answers_3(self, rig, operation):
        axis = WHOLE if operation in WHOLE_ONLY else 0
        statuses = {n: rig.status(operation, bytes(n), axis) for n in range(12)}
        assert {n for n, status in statuses.items() if status != 3} == LENGTHS[operation]

    def test_before_the_first_hello_everything_answers_10(self, make_rig):
        rig = make_rig(hello=False)
        assert {rig.status(operation, bytes(12), 9) for operation in LENGTHS} == {10}


class TestMode:
    def test_from_idle_it_copies_actual_into_command_and_clears_the_flags(self, rig):
        rig.ok(0x1B, i32(-700), 0)
        assert rig.write(0x00, 0x0B) == 0
        rig.enter(POSITION)
        shown = rig.snapshot()
        assert (shown.command, shown.actual, shown.flags, shown.status) == (-700, -700, 0, 0xC0)
        assert rig.settings().mode == POSITION

    @pytest.mark.parametrize(("mode", "flags"), [(1, 0x00), (2, 0x08), (3, 0x20)])
    def test_each_mode_sets_its_flag(self, rig, mode, flags):
        rig.enter(mode)
        assert rig.snapshot().flags == flags
        rig.ok(0x16, [IDLE], 0)
        assert rig.snapshot().flags == flags | 0x02

    def test_over_3_answers_4(self, rig):
        assert rig.status(0x16, [4]) == 4

    @pytest.mark.parametrize("mode", [1, 2, 3])
    def test_without_a_filter_that_somebody_chose_it_answers_6(self, rig, mode):
        rig.profile(256, 10)
        assert rig.status(0x16, [mode]) == 6
        assert rig.write(0x20, 225, 0, 5) == 0
        assert rig.status(0x16, [mode]) == 6
        assert rig.write(0x0F, 255) == 0
        assert rig.status(0x16, [mode]) == 0

    @pytest.mark.parametrize(("mode", "least"), [(1, 7), (2, 7), (3, 15)])
    def test_a_timer_below_the_modes_minimum_answers_4(self, rig, mode, least):
        rig.profile(256, 10)
        rig.filter(filter_bytes=(225, 0, 5, least - 1))
        assert rig.status(0x16, [mode]) == 4
        rig.filter(filter_bytes=(225, 0, 5, least))
        assert rig.status(0x16, [mode]) == 0

    def test_mode_3_without_acceleration_answers_4(self, rig):
        rig.filter()
        assert rig.status(0x16, [INTEGRAL]) == 4

    def test_from_1_to_3_the_command_position_is_kept(self, rig):
        rig.enter(POSITION)
        rig.command(40)
        rig.ok(0x16, [INTEGRAL], 0)
        rig.run_samples(3)
        assert rig.snapshot().command == 40

    def test_from_3_to_1_it_is_kept_with_zero_velocity(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(10)
        rig.run_samples(20)
        rig.ok(0x16, [POSITION], 0)
        stood = rig.snapshot().command
        rig.run_samples(5)
        assert rig.snapshot().command == stood > 100
        rig.ok(0x16, [INTEGRAL], 0)
        rig.run_samples(5)
        assert rig.snapshot().command == stood
        assert rig.read(0x3C) == b"\0"

    def test_leaving_2_takes_the_actual_position_as_command(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.velocity(16 * 30)
        rig.run_samples(40)
        rig.ok(0x16, [POSITION], 0)
        shown = rig.snapshot()
        assert shown.command == shown.actual > 500

    def test_in_2_the_command_follows_the_actual_position(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.velocity(16 * 30)
        rig.run_samples(40)
        shown = rig.snapshot()
        # The middle between two samples: less than one sample of some 27 counts behind.
        assert 0 < shown.actual - shown.command < 30

    def test_the_mode_already_set_disarms_and_clears_input_7_and_nothing_else(self, rig):
        rig.enter(POSITION)
        rig.watchdog(10, action=1)
        rig.run(0.1)
        assert rig.inputs() & 0x80
        rig.command(33)
        rig.move(1000, start=0)
        assert rig.settings().armed == 1
        rig.ok(0x16, [POSITION], 0)
        assert rig.settings().armed == 0
        assert not rig.inputs() & 0x80
        assert rig.snapshot().command == 33

    @pytest.mark.parametrize("mode", [1, 2, 3])
    def test_while_a_profile_runs_every_mode_but_0_answers_7(self, rig, mode):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.status(0x16, [mode]) == 7
        assert rig.status(0x16, [IDLE]) == 0

    def test_f0_left_set_in_idle_runs_nothing_and_mode_clears_it(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        rig.run_samples(10)
        rig.ok(0x16, [IDLE], 0)
        assert rig.snapshot().flags == 0x03
        rig.run(0.3)
        assert rig.events(0x40) == []
        rig.ok(0x16, [POSITION], 0)
        assert rig.snapshot().flags == 0x00

    def test_idle_drives_nothing_and_the_command_position_stands(self, rig):
        rig.enter(POSITION)
        rig.command(3000)
        rig.run_samples(3)
        assert rig.snapshot().motor == 0xFF
        rig.ok(0x16, [IDLE], 0)
        assert rig.snapshot().motor == 0x80


class TestCommand:
    def test_a_step_is_gone_to(self, rig):
        rig.enter(POSITION)
        assert rig.command(200) == 0
        rig.run(0.3)
        shown = rig.snapshot()
        # Dead band of equations §1.6.
        assert (shown.command, abs(shown.actual - 200) <= 7) == (200, True)

    @pytest.mark.parametrize("position", [-(1 << 23) - 1, 1 << 23])
    def test_beyond_24_bits_answers_4(self, rig, position):
        rig.enter(POSITION)
        assert rig.command(position) == 4

    def test_the_ends_of_24_bits_are_taken(self, rig):
        rig.enter(POSITION)
        for position in (-(1 << 23), (1 << 23) - 1):
            assert rig.command(position) == 0
            assert rig.snapshot().command == position

    @pytest.mark.parametrize("mode", [0, 2, 3])
    def test_outside_position_mode_answers_6(self, rig, mode):
        if mode:
            rig.enter(mode)
        assert rig.command(1 << 30) == 6

    def test_in_a_profile_answers_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.command(1 << 30) == 7

    def test_disarms(self, rig):
        rig.enter(POSITION)
        rig.move(500, start=0)
        rig.command(1)
        assert rig.settings().armed == 0


class TestFilter:
    def test_writes_four_registers(self, rig):
        rig.filter(filter_bytes=(1, 2, 3, 99))
        assert rig.read(0x20, 3) + rig.read(0x0F) == bytes([1, 2, 3, 99])

    def test_a_timer_too_short_for_what_runs_answers_4(self, rig):
        rig.enter(INTEGRAL)
        assert rig.status(0x15, [1, 2, 3, 14]) == 4
        assert rig.read(0x20, 3) == bytes([225, 0, 5])
        rig.ok(0x16, [POSITION], 0)
        assert rig.status(0x15, [1, 2, 3, 14]) == 0
        assert rig.status(0x15, [1, 2, 3, 6]) == 4
        rig.ok(0x16, [IDLE], 0)
        assert rig.status(0x15, [1, 2, 3, 0]) == 0

    def test_in_a_profile_answers_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.status(0x15, [1, 2, 3, 4]) == 7


class TestVelocity:
    def test_in_2_it_counts_sixteenths(self, rig):
        rig.enter(PROPORTIONAL)
        assert rig.velocity(-0x123) == 0
        assert rig.read(0x23, 2) == struct.pack("<h", -0x123)

    def test_in_3_it_counts_whole_ones(self, rig):
        rig.enter(INTEGRAL)
        assert rig.velocity(-5) == 0
        assert rig.read(0x3C) == b"\xfb"

    @pytest.mark.parametrize("value", [128, -129])
    def test_in_3_beyond_a_byte_answers_4(self, rig, value):
        rig.enter(INTEGRAL)
        rig.velocity(100 if value > 0 else -100)
        assert rig.velocity(value) == 4

    def test_in_3_more_than_127_from_the_last_answers_4(self, rig):
        rig.enter(INTEGRAL)
        assert rig.velocity(-128) == 4
        assert rig.velocity(-1) == 0
        assert rig.velocity(-128) == 0
        assert rig.velocity(0) == 4
        assert rig.velocity(-1) == 0

    @pytest.mark.parametrize("mode", [0, 1])
    def test_elsewhere_answers_6(self, rig, mode):
        if mode:
            rig.enter(mode)
        assert rig.velocity(1) == 6


class TestProfile:
    def test_writes_acceleration_and_maximum(self, rig):
        rig.profile(0x7FFF, 0x7F)
        assert rig.read(0x26, 3) == b"\xff\x7f\x7f"

    @pytest.mark.parametrize(("acceleration", "maximum"), [(0x8000, 1), (1, 0x80)])
    def test_beyond_its_registers_answers_4(self, rig, acceleration, maximum):
        assert rig.status(0x18, struct.pack("<HB", acceleration, maximum)) == 4

    def test_acceleration_0_answers_4_in_mode_3_only(self, rig):
        rig.enter(INTEGRAL)
        assert rig.status(0x18, bytes(3)) == 4
        rig.ok(0x16, [POSITION], 0)
        assert rig.status(0x18, bytes(3)) == 0

    def test_in_a_profile_answers_7(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.status(0x18, struct.pack("<HB", 0x8000, 1)) == 7


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


class TestPreset:
    def test_sets_the_position_in_idle(self, rig):
        rig.ok(0x1B, i32(-4711), 0)
        assert rig.ok(0x12, axis=0) == i32(-4711)

    def test_in_control_answers_6(self, rig):
        rig.enter(POSITION)
        assert rig.status(0x1B, i32(1 << 30)) == 6
        rig.move(5000)
        assert rig.status(0x1B, i32(0)) == 6

    def test_beyond_24_bits_answers_4(self, rig):
        assert rig.status(0x1B, i32(1 << 23)) == 4


class TestSnapshot:
    def test_shows_all_axes_of_one_instant(self, rig):
        rig.enter(INTEGRAL, 0)
        rig.velocity(20)
        rig.run(0.2003)
        reply = rig.ok(0x14)
        time_us, *values = struct.unpack("<I" + "iiBBBB" * 3, reply)
        assert time_us == round(rig.t * 1e6)
        assert rig.ok(0x12, axis=0) == i32(values[0])
        assert values[8:12] == [0xE0, 0x02, 0x80, 0x04]

    def test_its_position_is_that_of_the_instant_not_of_the_last_sample(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(50)
        rig.run_samples(100)
        first = rig.snapshot().actual
        rig.run(0.9e-3)
        # At 50 counts a sample of 2.048 ms.
        assert rig.snapshot().actual - first == pytest.approx(22, abs=2)


class TestFollowing:
    def test_a_larger_error_sends_the_axis_idle_and_says_so(self, rig):
        rig.enter(POSITION)
        rig.ok(0x1F, struct.pack("<H", 99), 0)
        rig.command(99)
        rig.run(0.2)
        assert rig.settings()[:2] == (POSITION, 99)
        actual = rig.snapshot().actual
        rig.command(actual + 100)
        tick = int(rig.t / 2.048e-3) + 1
        rig.run_samples(1)
        (event,) = rig.events(0x47)
        assert event == (0x47, 0, tick * 2048, actual, 0)
        assert rig.settings().mode == IDLE
        assert rig.snapshot().motor == 0x80

    def test_0_is_off_and_the_value_at_power_up(self, rig):
        assert rig.settings().following == 0
        rig.enter(POSITION)
        rig.command(10000)
        rig.run(0.3)
        assert rig.events(0x47) == []

    def test_does_not_act_in_mode_2(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.ok(0x1F, struct.pack("<H", 1), 0)
        rig.velocity(16 * 50)
        rig.run(0.2)
        assert rig.settings().mode == PROPORTIONAL

    def test_a_profile_that_cannot_be_followed_trips_it_before_it_is_done(self, rig):
        rig.enter(POSITION)
        rig.ok(0x1F, struct.pack("<H", 100), 0)
        rig.inject("user_inhibit", axis="left_vergence")
        rig.move(2000)
        rig.run(0.5)
        assert [event.operation for event in rig.events()] == [0x47]


class TestSpareAxes:
    def test_have_no_pulses_and_open_switches(self, make_rig):
        rig = make_rig(board=2)
        for axis in (1, 2):
            assert rig.inputs(axis) == 0
            rig.enter(POSITION, axis)
            rig.command(50, axis)
            rig.run(0.05)
            shown = rig.snapshot(axis)
            assert (shown.actual, shown.command, shown.inputs) == (0, 50, 0)
            assert shown.motor > 0x80

    def test_can_be_written_like_any_other(self, make_rig):
        rig = make_rig(board=2)
        rig.ok(0x1B, i32(77), 2)
        assert rig.ok(0x12, axis=2) == i32(77)
