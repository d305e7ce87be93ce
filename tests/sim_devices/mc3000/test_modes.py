"""What every operation takes, and MODE (docs/protocols, the board)."""

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
