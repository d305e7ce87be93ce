"""Registers, bridge, faults and watchdog of an amplifier, through its line's bytes (docs/protocols)."""

import struct
from math import exp, radians

import pytest

from sim_devices.head import HeadConfig, HeadMachine
from sim_devices.servo_amp.frame import crc16

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


class Line:
    """A host's hand on the amplifiers' line; `drive` writes the board's open-loop output."""

    def __init__(self, **config):
        config.setdefault("start_deg", dict.fromkeys(NAMES.values(), 0.0))
        self.machine = HeadMachine(HeadConfig(**config), seed=0)
        self.machine.power_up(0.0)
        self.device = self.machine.amplifier_line
        self.device.send = lambda data, t: self.sent.append(data)
        self.sent = []
        self.t = 0.0

    def send(self, address, kind, index, offset, words, data=b"", sequence=0):
        header = bytes([0xA5, address, sequence << 2 | kind, index, offset, words])
        frame = header + crc16(header).to_bytes(2, "big")
        if data:
            frame += data + crc16(data).to_bytes(2, "big")
        self.device.receive(frame, self.t)
        return self.sent.pop() if self.sent else None

    def status(self, *args, **kwargs):
        return self.send(*args, **kwargs)[3]

    def read(self, index, offset, words=1, address=1):
        reply = self.send(address, READ, index, offset, words)
        assert reply[3] == 1
        return reply[8:-2]

    def word(self, index, offset, address=1):
        return struct.unpack("<H", self.read(index, offset, 1, address))[0]

    def signed(self, index, offset, words=1, address=1):
        return int.from_bytes(self.read(index, offset, words, address), "little", signed=True)

    def write(self, index, offset, value, words=1, address=1):
        return self.status(address, WRITE, index, offset, words, value.to_bytes(2 * words, "little"))

    def enable(self, *addresses):
        for address in addresses or NAMES:
            assert self.write(7, 0, 0x000F, address=address) == 1
            assert self.write(1, 0, 0, address=address) == 1

    def run(self, seconds):
        end = self.t + seconds
        while (due := self.device.next_due()) is not None and due <= end:
            self.t = max(due, self.t)
            self.device.advance_to(self.t)
        self.t = end
        self.machine.advance_to(end)

    def drive(self, name, command):
        self.machine.advance_to(self.t)
        self.machine.joints[name].drive(command)
        channel = self.machine.channels[name]
        channel.chip.motor_command = command

    def inject(self, verb, **arguments):
        self.machine.advance_to(self.t)
        self.machine.verbs[verb](**arguments)

    def board_sees_fault(self, name="left_vergence"):
        return bool(self.machine.channels[name].inputs & 0x08)


@pytest.fixture
def line():
    return Line()


@pytest.fixture
def enabled():
    line = Line()
    line.enable()
    return line


class TestProtocol:
    def test_a_read_echoes_the_sequence_and_says_that_data_follows(self, line):
        reply = line.send(1, READ, 1, 0, 1, sequence=9)
        assert reply[:6] == bytes([0xA5, 0xFF, 9 << 2 | 2, 1, 0, 1])
        assert reply[8:10] == b"\x01\x00"

    def test_a_write_is_answered_without_data(self, line):
        reply = line.send(1, WRITE, 7, 0, 1, b"\x0e\0", sequence=3)
        assert reply[:6] == bytes([0xA5, 0xFF, 3 << 2, 1, 0, 0])
        assert len(reply) == 8

    def test_both_writes_and_answers_what_stands_there_then(self, enabled):
        reply = enabled.send(1, BOTH, 4, 1, 1, b"\x22\x11")
        assert (reply[2:6], reply[8:10]) == (bytes([2, 1, 0, 1]), b"\x22\x11")

    def test_each_address_answers_for_itself(self, line):
        texts = {address: line.read(0x0B, 0, 16, address) for address in NAMES}
        assert len(set(texts.values())) == 4

    @pytest.mark.parametrize("address", [5, 0x3F, 0xFF])
    def test_nobody_answers_for_an_address_that_there_is_not(self, line, address):
        assert line.send(address, READ, 1, 0, 1) is None

    def test_a_broadcast_acts_everywhere_and_is_not_answered(self, line):
        assert line.send(0, WRITE, 7, 0, 1, b"\x0f\0") is None
        assert line.send(0, WRITE, 1, 0, 1, b"\0\0") is None
        assert [line.word(2, 0, address) & 1 for address in NAMES] == [1, 1, 1, 1]

    def test_a_command_is_not_dropped_for_repeating_its_sequence(self, enabled):
        for value in (1, 0, 1):
            enabled.send(1, WRITE, 1, 0, 1, struct.pack("<H", value), sequence=0)
            assert enabled.word(1, 0) == value

    def test_bad_data_answers_8_before_all_and_changes_nothing(self, line):
        header = bytes([0xA5, 1, WRITE, 0x99, 0, 1])
        frame = header + crc16(header).to_bytes(2, "big") + b"\x0f\0\0\0"
        line.device.receive(frame, 0.0)
        assert line.sent.pop()[3] == 8
        assert line.word(7, 0) == 0

    def test_one_exception_in_another_register_leaves_the_line_alive(self, line):
        assert line.status(1, READ, 0x77, 0, 1) == 4
        assert line.word(1, 0) == 1


class TestAccess:
    @pytest.mark.parametrize("value", [0x000E, 0x000F])
    def test_two_values_grant_it(self, line, value):
        assert line.write(1, 0, 0) == 6
        assert line.write(7, 0, value) == 1
        assert line.write(1, 0, 0) == 1
        assert line.word(7, 0) == value

    @pytest.mark.parametrize("value", [0, 1, 0x000D, 0x0F0F])
    def test_others_take_it_away(self, line, value):
        line.write(7, 0, 0x000F)
        line.write(7, 0, value)
        assert line.write(1, 0, 0) == 6

    def test_every_other_write_without_it_answers_6(self, line):
        for index, offset, words in ((1, 0, 1), (4, 1, 1), (0x45, 0, 2), (2, 0, 1), (0x99, 0, 1)):
            assert line.write(index, offset, 0, words) == 6

    def test_each_amplifier_has_its_own(self, line):
        line.write(7, 0, 0x000F, address=1)
        assert line.write(1, 0, 0, address=2) == 6


class TestInvalid:
    @pytest.mark.parametrize(
        ("index", "offset"), [(0x00, 0), (0x03, 0), (0x01, 1), (0x02, 5), (0x10, 1), (0x10, 4), (0x46, 0)]
    )
    def test_an_unknown_register_answers_4(self, enabled, index, offset):
        assert enabled.status(1, READ, index, offset, 1) == 4
        assert enabled.write(index, offset, 0) == 4

    @pytest.mark.parametrize(
        ("index", "offset", "words"),
        [(2, 0, 1), (2, 4, 1), (0x0B, 0, 1), (0x0F, 0, 1), (0x10, 2, 1), (0x11, 2, 2), (0x12, 0, 2)],
    )
    def test_a_write_to_a_read_only_one_answers_4(self, enabled, index, offset, words):
        assert enabled.write(index, offset, 0, words) == 4

    @pytest.mark.parametrize(("offset", "words"), [(0, 1), (1, 1), (0, 3)])
    def test_a_write_to_part_of_one_or_beyond_it_answers_4(self, enabled, offset, words):
        assert enabled.write(0x45, offset, 0, words) == 4

    def test_type_0_and_0_words_answer_4(self, enabled):
        assert enabled.status(1, 0, 1, 0, 1) == 4
        assert enabled.status(1, READ, 1, 0, 0) == 4
        assert enabled.status(1, WRITE, 1, 0, 0) == 4

    def test_a_read_beyond_the_end_answers_4(self, line):
        assert line.status(1, READ, 2, 0, 5) == 1
        assert line.status(1, READ, 2, 0, 6) == 4
        assert line.status(1, READ, 0x0B, 0, 128) == 1
        assert line.status(1, READ, 0x0B, 1, 128) == 4


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


class TestPosition:
    def test_is_zero_at_power_up_and_a_preset_of_the_board_does_not_change_it(self, line):
        assert line.signed(0x12, 0, 2) == 0
        line.inject("place", axis="left_vergence", angle=0.1)
        counted = line.signed(0x12, 0, 2)
        # 0.1 rad from exactly 0.
        assert counted == int(0.1 * EYE_E)
        line.machine.channels["left_vergence"].chip.load_position(-5)
        assert line.signed(0x12, 0, 2) == counted
        line.inject("restart_amplifier", axis="left_vergence")
        assert line.signed(0x12, 0, 2) == 0

    def test_counts_fall_as_the_mirrored_eye_turns_left(self, line):
        line.inject("place", axis="right_vergence", angle=0.1)
        assert line.signed(0x12, 0, 2, address=2) < 0


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

    def test_the_peak_limits_and_after_two_seconds_the_continuous_current(self):
        line = Line(peak_current=4.0, continuous_current=2.0, start_deg=dict.fromkeys(NAMES.values(), 0.0))
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


class TestTexts:
    def test_name_and_firmware_are_text_of_256_bytes(self, line):
        text = line.read(0x0B, 0, 128)
        assert len(text) == 256
        assert text[:255].rstrip(b"\0").isascii()
        assert b"pan" in line.read(0x0B, 0, 128, address=4)

    def test_product_information_has_its_ten_strings(self, line):
        data = line.read(0x8C, 0, 176)
        assert len(data) == 352
        assert (data[:2], data[162:192]) == (bytes(2), bytes(30))
        assert data[2:34].rstrip(b"\0")

    def test_the_interface_input_keeps_what_is_written_and_drives_nothing(self, enabled):
        assert enabled.write(0x45, 0, 123456, 2) == 1
        assert enabled.signed(0x45, 0, 2) == 123456
        enabled.run(0.1)
        assert enabled.signed(0x12, 0, 2) == 0
