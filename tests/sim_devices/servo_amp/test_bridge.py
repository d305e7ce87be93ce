"""The bridge: what drives, brakes and limits the motor (docs/protocols)."""

from math import radians

import pytest

READ, WRITE, BOTH = 1, 2, 3
NAMES = {1: "left_vergence", 2: "right_vergence", 3: "tilt", 4: "pan"}
EYE_E, EYE_C, EYE_T_M = 18482.5, 1235.08619, 16.020856e-3


class TestBridge:
    def test_power_up_is_inhibited_and_shows_that_it_was_reset(self, line):
        assert line.word(1, 0) == 1
        assert [line.word(2, offset) for offset in range(4)] == [0, 1, 0, 2]

    def test_multi_word_reads_run_over_consecutive_offsets(self, line):
        assert line.read(2, 0, 4) == bytes([0, 0, 1, 0, 0, 0, 2, 0])

    def test_enabled_it_follows_the_boards_output(self, enabled):
        assert enabled.word(2, 0) == 1
        enabled.drive("left_vergence", 50)
        enabled.run(0.2)
        expected = 50 * EYE_C
        # DS1 = 2¹⁷/20000 units per count/s; e^(−200/16) of the step is left.
        assert enabled.signed(0x11, 2, 2) == pytest.approx(expected * 2**17 / 20000, rel=1e-4)
        assert enabled.signed(0x12, 0, 2) == pytest.approx(expected * (0.2 - EYE_T_M), abs=2)
        assert enabled.word(2, 4) == 2

    def test_inhibited_it_does_not(self, line):
        line.drive("left_vergence", 50)
        line.run(0.1)
        assert line.signed(0x12, 0, 2) == 0
        assert line.word(2, 4) == 1

    def test_the_brake_shows_bit_1_without_bit_0(self, enabled):
        enabled.drive("left_vergence", 50)
        enabled.run(0.1)
        assert enabled.write(1, 0, 2) == 1
        assert enabled.word(2, 0) == 2
        assert enabled.word(2, 3) == 1 << 12
        enabled.run(0.5)
        assert enabled.word(2, 4) & 1

    def test_an_inhibited_bridge_does_not_brake(self, enabled):
        enabled.write(1, 0, 3)
        assert enabled.word(2, 0) == 0
        assert enabled.word(2, 3) == 1 << 12 | 2

    def test_the_commanded_stop_holds_0_v(self, enabled):
        enabled.write(1, 0, 1 << 6)
        assert enabled.word(2, 0) == 1
        enabled.drive("left_vergence", 50)
        enabled.run(0.1)
        assert enabled.signed(0x12, 0, 2) == 0

    def test_set_position_does_nothing(self, enabled):
        enabled.drive("left_vergence", 20)
        enabled.run(0.1)
        before = enabled.signed(0x12, 0, 2)
        enabled.write(1, 0, 1 << 3)
        assert enabled.signed(0x12, 0, 2) == before > 0

    def test_a_user_inhibit_shows_and_is_no_fault(self, enabled):
        enabled.inject("user_inhibit", axis="left_vergence")
        assert (enabled.word(2, 0), enabled.word(2, 3)) == (0, 1 << 2)
        assert not enabled.board_sees_fault()

    @pytest.mark.parametrize(
        ("angle", "bridge", "drive"), [(41, 1 | 1 << 5, 1 << 3), (-41, 1 | 1 << 6, 1 << 4)]
    )
    def test_a_closed_switch_shows_and_inhibits_its_direction(self, enabled, angle, bridge, drive):
        enabled.inject("place", axis="left_vergence", angle=radians(angle))
        assert (enabled.word(2, 0), enabled.word(2, 3)) == (bridge, drive)
        before = enabled.signed(0x12, 0, 2)
        way = 1 if angle > 0 else -1
        enabled.drive("left_vergence", 20 * way)
        enabled.run(0.1)
        assert enabled.signed(0x12, 0, 2) == before
        enabled.drive("left_vergence", -20 * way)
        enabled.run(0.02)
        assert (enabled.signed(0x12, 0, 2) - before) * way < 0

    def test_the_mirrored_eye_goes_by_counts(self, enabled):
        enabled.inject("place", axis="right_vergence", angle=radians(-41))
        assert enabled.word(2, 3, address=2) == 1 << 3


class TestCurrent:
    def test_demand_and_measured_are_in_parts_of_the_peak(self, enabled):
        enabled.inject("place", axis="pan", angle=radians(94.999))
        enabled.inject("switch", axis="pan", side="positive", held="open")
        enabled.drive("pan", 100)
        enabled.run(0.5)
        # Against the hard stop: 100·20/256·3.56 V over 4 Ω, 2¹³ counts are the peak of 20 A.
        expected = 100 * 20 / 256 * 3.56 / 4 * 2**13 / 20
        assert enabled.signed(0x10, 2, address=4) == pytest.approx(expected, abs=1)
        assert enabled.signed(0x10, 3, address=4) == pytest.approx(expected, abs=1)

    def test_the_peak_limits_and_after_two_seconds_the_continuous_current(self, make_line):
        line = make_line(
            peak_current=4.0, continuous_current=2.0, start_deg=dict.fromkeys(NAMES.values(), 0.0)
        )
        line.enable()
        line.inject("place", axis="pan", angle=radians(94.999))
        line.inject("switch", axis="pan", side="positive", held="open")
        line.drive("pan", 100)
        line.run(1.9)
        assert line.word(2, 3, address=4) == 1 << 5
        assert line.signed(0x10, 3, address=4) == 1 << 13
        line.run(0.5)
        assert line.word(2, 3, address=4) == 1 << 5 | 1 << 6
        assert line.signed(0x10, 3, address=4) == 1 << 12

    def test_a_lower_bus_cuts_the_range_of_pan(self, enabled):
        enabled.inject("bus_voltage", volts=24.0, axis="pan")
        enabled.drive("pan", 127)
        enabled.run(0.2)
        units = enabled.signed(0x11, 2, 2, address=4)
        assert units * 20000 / 2**17 / 15915.5 == pytest.approx(24 / 10.26312, rel=1e-3)
