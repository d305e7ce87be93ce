"""Faults and the watchdog of an amplifier (docs/protocols)."""

from math import exp

import pytest

READ, WRITE, BOTH = 1, 2, 3
NAMES = {1: "left_vergence", 2: "right_vergence", 3: "tilt", 4: "pan"}
EYE_E, EYE_C, EYE_T_M = 18482.5, 1235.08619, 16.020856e-3
PROTECTION = {
    "internal_error": 1,
    "short_circuit": 2,
    "current_overshoot": 3,
    "under_voltage": 4,
    "over_voltage": 5,
    "over_temperature": 6,
}
SYSTEM = {
    "motor_over_temperature": 4,
    "feedback_error": 6,
    "over_speed": 7,
    "communication_error": 10,
}


class TestFaults:
    @pytest.mark.parametrize(("fault", "bit"), PROTECTION.items())
    def test_of_protection(self, enabled, fault, bit):
        enabled.inject("amplifier_fault", axis="left_vergence", fault=fault)
        assert enabled.word(2, 1) == 1 | 1 << bit
        assert enabled.word(2, 2) == 0
        assert enabled.word(2, 0) == 0
        assert enabled.board_sees_fault()

    @pytest.mark.parametrize(("fault", "bit"), SYSTEM.items())
    def test_of_the_system(self, enabled, fault, bit):
        enabled.inject("amplifier_fault", axis="left_vergence", fault=fault)
        assert (enabled.word(2, 1), enabled.word(2, 2)) == (1, 1 << bit)
        assert enabled.board_sees_fault()

    def test_latches_until_events_are_reset_with_the_cause_gone(self, enabled):
        enabled.inject("amplifier_fault", axis="left_vergence", fault="over_temperature")
        enabled.write(1, 0, 1 << 12)
        enabled.write(1, 0, 0)
        assert enabled.word(2, 1) == 1 << 6
        enabled.inject("amplifier_fault", axis="left_vergence", fault="over_temperature", on=False)
        assert enabled.word(2, 1) == 1 << 6
        assert enabled.word(2, 0) == 0
        enabled.write(1, 0, 1 << 12)
        assert enabled.word(2, 1) == 1 << 6
        enabled.write(1, 0, 0)
        assert (enabled.word(2, 1), enabled.word(2, 0)) == (0, 1)
        assert not enabled.board_sees_fault()

    def test_was_reset_goes_with_the_events_and_comes_with_a_power_up(self, enabled):
        enabled.write(1, 0, 1 << 12)
        assert enabled.word(2, 1) == 1
        enabled.write(1, 0, 0)
        assert enabled.word(2, 1) == 0
        enabled.inject("restart_amplifier", axis="left_vergence")
        assert (enabled.word(2, 1), enabled.word(1, 0), enabled.word(7, 0)) == (1, 1, 0)
        assert not enabled.board_sees_fault()

    @pytest.mark.parametrize(("volts", "bit", "shown"), [(10.0, 4, 100), (70.0, 5, 700)])
    def test_a_bus_out_of_range_is_one(self, enabled, volts, bit, shown):
        assert enabled.word(0x0F, 0) == 480
        enabled.inject("bus_voltage", volts=volts)
        assert enabled.word(0x0F, 0) == shown
        assert enabled.word(2, 1) == 1 | 1 << bit

    def test_encoder_loss_at_the_board_alone_is_none_at_the_amplifier_sets_bit_6(self, enabled):
        enabled.inject("encoder_loss", axis="left_vergence", at="board")
        assert enabled.word(2, 2) == 0
        enabled.inject("encoder_loss", axis="left_vergence", at="both")
        assert enabled.word(2, 2) == 1 << 6
        assert enabled.board_sees_fault()

    def test_a_lost_encoder_stops_counting_and_goes_on_from_there(self, enabled):
        enabled.inject("place", axis="left_vergence", angle=0.1)
        counted = enabled.signed(0x12, 0, 2)
        enabled.inject("encoder_loss", axis="left_vergence", at="amplifier")
        enabled.inject("place", axis="left_vergence", angle=0.2)
        assert enabled.signed(0x12, 0, 2) == counted
        enabled.inject("encoder_loss", axis="left_vergence", at="amplifier", on=False)
        assert enabled.signed(0x12, 0, 2) == counted
        enabled.inject("place", axis="left_vergence", angle=0.3)
        # Each end of the way is floored.
        assert enabled.signed(0x12, 0, 2) - counted == pytest.approx(0.1 * EYE_E, abs=1)


class TestWatchdog:
    def test_is_off_at_power_up_and_needs_access(self, line):
        assert line.word(4, 1) == 0
        assert line.write(4, 1, 100) == 6
        assert line.device.next_due() is None

    def test_expiring_it_inhibits_latches_and_shows_a_communication_error(self, enabled):
        assert enabled.write(4, 1, 100) == 1
        assert enabled.device.next_due() == pytest.approx(0.1)
        enabled.run(0.2)
        assert enabled.board_sees_fault()
        assert enabled.device.next_due() is None
        assert (enabled.word(2, 2), enabled.word(2, 0)) == (1 << 10, 0)
        enabled.write(1, 0, 1 << 12)
        enabled.write(1, 0, 0)
        assert (enabled.word(2, 2), enabled.word(2, 0)) == (0, 1)

    def test_acts_at_its_very_time(self, enabled):
        enabled.drive("left_vergence", 20)
        enabled.write(4, 1, 50)
        enabled.run(0.3)
        joint = enabled.machine.joints["left_vergence"]
        # Driven for 50 ms, then the board's axis goes idle with the fault; 10 T_M later 1/e is left.
        at_expiry = 20 * EYE_C * (1 - exp(-0.05 / EYE_T_M))
        assert joint.w == pytest.approx(at_expiry * exp(-0.25 / (10 * EYE_T_M)), rel=1e-6)

    def test_is_fed_by_any_command_to_its_address_that_is_answered_1(self, enabled):
        enabled.write(4, 1, 100)
        for _ in range(5):
            enabled.run(0.08)
            enabled.word(2, 0)
        assert enabled.word(2, 2) == 0

    @pytest.mark.parametrize("useless", ["refused", "other address", "broadcast"])
    def test_nothing_else_feeds_it(self, enabled, useless):
        enabled.write(4, 1, 100)
        enabled.run(0.08)
        if useless == "refused":
            assert enabled.status(1, READ, 0x77, 0, 1) == 4
        elif useless == "other address":
            enabled.word(2, 0, address=2)
        else:
            enabled.send(0, WRITE, 7, 0, 1, b"\x0f\0")
        enabled.run(0.03)
        assert enabled.word(2, 2) == 1 << 10

    def test_0_switches_it_off(self, enabled):
        enabled.write(4, 1, 100)
        enabled.write(4, 1, 0)
        enabled.run(1.0)
        assert enabled.word(2, 2) == 0
