"""What the amplifiers' registers take and give, through their line's bytes (docs/protocols)."""

import struct

import pytest

from sim_devices.servo_amp.frame import crc16

READ, WRITE, BOTH = 1, 2, 3
NAMES = {1: "left_vergence", 2: "right_vergence", 3: "tilt", 4: "pan"}
EYE_E, EYE_C, EYE_T_M = 18482.5, 1235.08619, 16.020856e-3


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
