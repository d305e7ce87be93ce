"""Commands, settings, positions and the following error, and what refuses them (docs/protocols, the board)."""

import struct

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)


def i32(value):
    return struct.pack("<i", value)


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
