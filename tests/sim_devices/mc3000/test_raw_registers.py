"""Raw READ and WRITE: the rules of the named operations, byte by byte (docs/protocols, the board)."""

import struct

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
RESERVED = (0x01, 0x04, 0x06, 0x0A, 0x10, 0x11, 0x25, 0x2C, 0x33, 0x36, 0x3B, 0x3D, 0x40, 0xFF)


class TestRead:
    @pytest.mark.parametrize("register", [*RESERVED, 0x05, 0x15, 0x16, 0x17])
    def test_reserved_and_write_only_ones_answer_5(self, rig, register):
        assert rig.status(0x10, [register, 1]) == 5

    def test_a_count_of_0_answers_4(self, rig):
        assert rig.status(0x10, [0x20, 0]) == 4

    def test_a_bad_register_goes_before_a_bad_count(self, rig):
        assert {rig.status(0x10, [0x18, 255]), rig.status(0x10, [0x10, 0])} == {5}

    def test_nine_good_registers_answer_4(self, rig):
        # 18H–1FH and 20H: every one of them can be read.
        assert rig.status(0x10, [0x18, 9]) == 4

    def test_eight_come_in_ascending_order(self, rig):
        rig.write(0x18, *range(10, 18))
        assert rig.read(0x18, 8) == bytes(range(10, 18))

    def test_covering_14h_latches_the_position_first(self, rig):
        rig.ok(0x1B, struct.pack("<i", 0x123456), 0)
        assert rig.read(0x12, 2) == b"\0\0"
        assert rig.read(0x12, 3) == b"\x12\x34\x56"
        rig.ok(0x1B, struct.pack("<i", -1), 0)
        assert rig.read(0x12, 2) == b"\x12\x34"
        assert rig.read(0x14) == b"\xff"
        assert rig.read(0x12, 2) == b"\xff\xff"

    def test_power_up_values(self, rig):
        assert rig.read(0x00) + rig.read(0x07, 3) == bytes([0x02, 0xE0, 0x80, 0x00])
        assert rig.read(0x0F) + rig.read(0x20, 3) == bytes([0x40, 0xE5, 0x40, 0x40])


class TestWriteInGeneral:
    @pytest.mark.parametrize("register", [*RESERVED, 0x12, 0x14, 0x34, 0x35])
    def test_reserved_and_read_only_ones_answer_5(self, rig, register):
        assert rig.write(register, 0) == 5

    def test_one_that_runs_into_a_reserved_register_changes_nothing(self, rig):
        assert rig.write(0x22, 9, 0, 0, 1) == 5
        assert rig.read(0x22) == b"\x40"

    def test_it_is_checked_whole_before_the_first_byte_acts(self, rig):
        rig.enter(INTEGRAL)
        assert rig.write(0x26, 0x10, 0x02, 0x80) == 4
        assert rig.read(0x26, 3) == bytes([0, 1, 100])

    def test_bytes_act_in_ascending_order(self, rig):
        rig.write(0x18, 7)
        # 17H loads the position and clears 18H, which the next byte then sets.
        assert rig.write(0x15, 0, 1, 2, 9) == 0
        assert rig.read(0x18) == b"\x09"
        assert rig.ok(0x12, axis=0) == struct.pack("<i", 0x102)

    @pytest.mark.parametrize("register", [0x20, 0x21, 0x22])
    def test_filter_bytes_are_written_always(self, rig, register):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.write(register, 3) == 0
        assert rig.read(register) == b"\x03"


class TestFlags:
    def test_f0_begins_a_move_to_29h(self, rig):
        rig.enter(POSITION)
        assert rig.write(0x29, 0xF4, 0x01, 0x00) == 0
        rig.move(9, start=0)
        assert rig.write(0x00, 0x08) == 0
        assert rig.settings().armed == 0
        rig.run(0.4)
        assert rig.snapshot().command == 500

    def test_f0_obeys_move(self, rig):
        assert rig.write(0x00, 0x08) == 6
        rig.enter(POSITION, acceleration=0)
        rig.write(0x29, 1, 0, 0)
        assert rig.write(0x00, 0x08) == 4
        rig.profile(256, 100)
        rig.write(0x29, 0, 0x20, 0)
        assert rig.write(0x00, 0x08) == 0
        assert rig.write(0x00, 0x08) == 7

    def test_clearing_f0_in_a_profile_answers_7_and_in_idle_clears_it(self, rig):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.write(0x00, 0x00) == 7
        rig.ok(0x16, [IDLE], 0)
        assert rig.snapshot().flags == 0x03
        assert rig.write(0x00, 0x00) == 0
        assert rig.snapshot().flags == 0x02

    @pytest.mark.parametrize(("value", "mode", "flag"), [(0x0B, PROPORTIONAL, 0x08), (0x0D, INTEGRAL, 0x20)])
    def test_f3_and_f5_in_control_are_modes_2_and_3_and_cleared_mode_1(self, rig, value, mode, flag):
        rig.enter(POSITION)
        assert rig.write(0x00, value) == 0
        assert (rig.settings().mode, rig.snapshot().flags) == (mode, flag)
        assert rig.write(0x00, value & 7) == 0
        assert (rig.settings().mode, rig.snapshot().flags) == (POSITION, 0)

    def test_f5_obeys_mode_3(self, rig):
        rig.enter(POSITION, acceleration=0)
        assert rig.write(0x00, 0x0D) == 4
        rig.profile(256, 10)
        rig.move(5000)
        assert rig.write(0x00, 0x0D) == 7

    @pytest.mark.parametrize(("value", "flag"), [(0x0B, 0x08), (0x0D, 0x20)])
    def test_f3_and_f5_in_idle_are_only_stored(self, rig, value, flag):
        rig.ok(0x05)
        assert rig.write(0x00, value) == 0
        assert rig.snapshot().flags == 0x02 | flag
        assert rig.settings().mode == IDLE
        assert rig.write(0x00, value & 7) == 0
        assert rig.snapshot().flags == 0x02

    def test_f2_and_f4_are_stored(self, rig):
        for value in (0x0A, 0x0C):
            assert rig.write(0x00, value) == 0
        assert rig.snapshot().flags == 0x16

    @pytest.mark.parametrize("value", [0x01, 0x09, 0x0E, 0x0F, 0x06, 0x07, 0x18, 0x80])
    def test_f1_bits_7_to_4_and_flags_6_and_7_answer_4(self, rig, value):
        assert rig.write(0x00, value) == 4


class TestProgramCounter:
    def test_03_is_mode_1_and_01_is_mode_0(self, rig):
        assert rig.write(0x05, 0x03) == 6
        rig.filter()
        assert rig.write(0x05, 0x03) == 0
        assert rig.settings().mode == POSITION
        assert rig.write(0x05, 0x01) == 0
        assert rig.settings().mode == IDLE

    def test_03_from_another_mode_is_mode_1_too(self, rig):
        rig.enter(INTEGRAL)
        assert rig.write(0x05, 0x03) == 0
        assert (rig.settings().mode, rig.snapshot().flags) == (POSITION, 0)

    @pytest.mark.parametrize("value", [0x02, 0x04, 0xFF])
    def test_02_and_others_answer_4(self, rig, value):
        assert rig.write(0x05, value) == 4

    def test_00_zeroes_the_chip_and_keeps_the_boards_settings(self, rig):
        rig.ok(0x1F, struct.pack("<H", 300), 0)
        rig.enter(INTEGRAL)
        rig.velocity(20)
        rig.run(0.2)
        rig.write(0x18, 1, 2, 3, 4)
        assert rig.write(0x05, 0x00) == 0
        shown = rig.snapshot()
        assert (shown.actual, shown.command, shown.status, shown.flags, shown.motor) == (0, 0, 0xE0, 2, 0x80)
        assert rig.read(0x18, 8) + rig.read(0x26, 3) + rig.read(0x3C) == bytes(12)
        assert rig.read(0x0F) + rig.read(0x20, 3) == bytes([0x40, 0xE5, 0x40, 0x40])
        assert rig.settings() == (IDLE, 300, 1, 0)
        # Nobody has chosen this filter.
        assert rig.status(0x16, [1]) == 6

    def test_00_releases_limit_only_with_its_pin_high(self, rig):
        rig.inject("switch", axis="left_vergence", side="negative", held="closed")
        rig.write(0x05, 0x00)
        assert rig.inputs() & 0x10
        rig.inject("switch", axis="left_vergence", side="negative", held="free")
        rig.write(0x05, 0x00)
        assert not rig.inputs() & 0x10


class TestStatusRegister:
    def test_bit_3_answers_4(self, rig):
        assert rig.write(0x07, 0x08) == 4

    def test_sets_the_nibble_and_releases_limit_as_clear_does(self, rig):
        rig.inject("switch", axis="left_vergence", side="negative", held="closed")
        assert rig.write(0x07, 0x01) == 0
        assert rig.read(0x07) == b"\x61"
        rig.inject("switch", axis="left_vergence", side="negative", held="free")
        assert rig.write(0x07, 0x00) == 0
        assert rig.read(0x07) == b"\xe0"

    def test_releases_nothing_of_the_boards(self, rig):
        rig.ok(0x05)
        rig.write(0x07, 0x00)
        assert rig.inputs() & 0x20


class TestOpenLoop:
    def test_drives_the_motor_with_the_watchdog_on(self, rig):
        rig.watchdog(1000)
        assert rig.write(0x08, 0x84) == 0
        rig.run(0.1)
        # 4 counts of command for 100 ms, T_M = 16.02 ms, C = 1235.09 counts/s each.
        assert rig.snapshot().actual == pytest.approx(4 * 1235.08619 * (0.1 - 0.01602 * (1 - 0.00195)), abs=1)

    def test_with_the_watchdog_off_answers_6_unless_zero(self, rig):
        assert {rig.write(0x08, 0x81), rig.write(0x09, 1)} == {6}
        assert {rig.write(0x08, 0x80), rig.write(0x09, 0), rig.write(0x08, 0x80, 0)} == {0}

    def test_in_control_it_is_refused(self, rig):
        rig.watchdog(1000)
        rig.enter(POSITION)
        assert {rig.write(0x08, 0x90), rig.write(0x08, 0x80), rig.write(0x09, 0)} == {6}

    @pytest.mark.parametrize(("value", "status"), [(100, 0), (0x9C, 0), (101, 4), (0x9B, 4), (0x80, 4)])
    def test_pwm_goes_from_minus_100_to_100_per_cent(self, rig, value, status):
        rig.watchdog(1000)
        assert rig.write(0x09, value) == status

    def test_going_idle_ends_it(self, rig):
        rig.watchdog(1000)
        rig.write(0x08, 0x90, 9)
        rig.ok(0x16, [IDLE], 0)
        assert rig.read(0x08, 2) == b"\x80\x00"


class TestPositionRegisters:
    def test_0ch_obeys_command(self, rig):
        assert rig.write(0x0C, 0, 0, 5) == 6
        rig.enter(POSITION)
        rig.move(100, start=0)
        assert rig.write(0x0C, 0xFF, 0xFF, 0xF6) == 0
        assert (rig.snapshot().command, rig.settings().armed) == (-10, 0)
        rig.move(5000)
        assert rig.write(0x0E, 5) == 7

    def test_13h_zeroes_and_15h_presets_but_not_in_control(self, rig):
        rig.ok(0x1B, struct.pack("<i", 99), 0)
        assert rig.write(0x13, 0xAA) == 0
        assert rig.snapshot().actual == 0
        assert rig.write(0x15, 0xFF, 0xFF, 0xFE) == 0
        assert rig.snapshot().actual == -2
        rig.enter(POSITION)
        assert {rig.write(register, 0) for register in (0x13, 0x15, 0x16, 0x17)} == {6}

    @pytest.mark.parametrize(
        "void",
        [
            lambda rig: rig.ok(0x1B, bytes(4), 0),
            lambda rig: rig.write(0x13, 0),
            lambda rig: rig.write(0x15, 0),
            lambda rig: rig.write(0x17, 0),
            lambda rig: rig.write(0x05, 0),
            lambda rig: rig.inject("restart_board", board=1) or rig.ok(0x01, b"ab"),
        ],
        ids=["PRESET", "13H", "15H", "17H", "soft reset", "power-up"],
    )
    def test_a_mark_in_18h_to_1bh_is_cleared_by_whatever_voids_the_count(self, rig, void):
        assert rig.write(0x18, 1, 2, 3, 4) == 0
        rig.enter(POSITION)
        rig.ok(0x05)
        rig.ok(0x06)
        assert rig.read(0x18, 4) == b"\1\2\3\4"
        void(rig)
        assert rig.read(0x18, 4) == bytes(4)

    def test_1ch_to_1fh_are_plain_storage(self, rig):
        rig.write(0x1C, 5, 6, 7, 8)
        rig.write(0x13, 0)
        assert rig.read(0x1C, 4) == bytes([5, 6, 7, 8])


class TestVelocityRegisters:
    def test_23h_obeys_velocity_of_mode_2(self, rig):
        assert rig.write(0x23, 1, 0) == 6
        rig.enter(INTEGRAL)
        assert rig.write(0x24, 1) == 6
        rig.ok(0x16, [PROPORTIONAL], 0)
        assert rig.write(0x23, 0xF0, 0xFF) == 0
        assert rig.read(0x23, 2) == b"\xf0\xff"

    def test_3ch_obeys_velocity_of_mode_3(self, rig):
        assert rig.write(0x3C, 1) == 6
        rig.enter(INTEGRAL)
        assert rig.write(0x3C, 0x80) == 4
        assert rig.write(0x3C, 0xFF) == 0
        assert rig.write(0x3C, 0x80) == 0
        assert rig.write(0x3C, 0x00) == 4

    def test_34h_reads_the_velocity_of_mode_2(self, rig):
        rig.enter(PROPORTIONAL, filter_bytes=(0, 0, 12, 255))
        rig.velocity(16 * 30)
        rig.run_samples(50)
        # Steady ratio of equations §1.7: .88, truncation included some less.
        assert struct.unpack("<h", rig.read(0x34, 2))[0] == pytest.approx(26, abs=1)


class TestProfileRegisters:
    def test_26h_to_28h_obey_profile(self, rig):
        assert rig.write(0x26, 1, 2, 3) == 0
        assert rig.read(0x26, 3) == b"\1\2\3"
        assert {rig.write(0x27, 0x80), rig.write(0x28, 0x80)} == {4}
        rig.enter(INTEGRAL)
        assert rig.write(0x27, 0) == 4
        assert rig.write(0x26, 5, 0) == 0

    def test_0fh_obeys_filter(self, rig):
        rig.enter(INTEGRAL)
        assert rig.write(0x0F, 14) == 4
        rig.ok(0x16, [POSITION], 0)
        assert rig.write(0x0F, 6) == 4
        assert rig.write(0x0F, 7) == 0

    @pytest.mark.parametrize("register", [0x0F, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x0C, 0x23, 0x3C])
    def test_in_a_profile_they_answer_7(self, rig, register):
        rig.enter(POSITION)
        rig.move(5000)
        assert rig.write(register, 0x80) == 7
