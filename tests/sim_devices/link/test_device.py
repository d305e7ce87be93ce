"""The session's rules from the device's side, one by one (docs/protocols, the serial link)."""

import struct

import pytest

from sim_devices.link.device import LinkDevice, first_boot_count
from sim_devices.link.frame import Kind, encode_frame

HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = range(1, 8)
SET, READ, FAIL = 0x10, 0x11, 0x12
ADDRESS = 0x21


def watchdog(timeout_ms, action=0):
    return struct.pack("<HB", timeout_ms, action)


class TestHello:
    def test_answers_nonce_protocol_type_firmware_boot_count_and_the_devices_own_part(self, hand):
        reply = hand.request(HELLO, b"\x34\x12", sequence=9)
        assert reply[:5] == (ADDRESS, Kind.REPLY, 9, HELLO, 0)
        assert reply.payload == bytes.fromhex("3412 01 09 0403 0700") + b"lamp"

    @pytest.mark.parametrize("operation", [WATCHDOG, CLEAR, EVENT_MASK, 0x08, SET, 0xFF])
    def test_until_then_everything_else_answers_10(self, hand, operation):
        assert hand.status(operation) == 10

    @pytest.mark.parametrize("operation", [PING, STATISTICS, EMERGENCY_STOP])
    def test_until_then_ping_statistics_and_emergency_stop_are_answered(self, hand, operation):
        assert hand.status(operation) == 0

    def test_always_acts_even_when_every_byte_is_repeated(self, greeted):
        greeted.request(SET, b"\x05")
        greeted.request(HELLO, b"ab", sequence=40)
        greeted.request(SET, b"\x05")
        assert greeted.lamp.level == 5
        assert greeted.request(HELLO, b"ab", sequence=40).payload[:2] == b"ab"
        assert greeted.lamp.level == 0

    def test_forgets_kept_replies_events_mask_and_watchdog(self, greeted):
        greeted.request(SET, b"\x05", sequence=50)
        greeted.request(EVENT_MASK, b"\xff\xff\xff\xff")
        greeted.request(WATCHDOG, watchdog(100))
        greeted.lamp.emit(0x50, 0, b"waits")
        greeted.hello()
        greeted.request(SET, b"\x05", sequence=50)
        assert greeted.lamp.set == 2
        greeted.advance(5.0)
        assert greeted.sent == []
        assert greeted.lamp.level == 5
        assert greeted.lamp.watched == [False, True, False]

    def test_keeps_statistics_and_latched_stops(self, greeted):
        greeted.request(EMERGENCY_STOP)
        greeted.device.receive(b"\x02\x00", 0.0)
        greeted.hello()
        assert greeted.lamp.stopped
        assert greeted.statistics()["framing"] == 1

    @pytest.mark.parametrize(("axis", "payload", "status"), [(0, b"ab", 2), (0x0F, b"a", 3), (0, b"", 2)])
    def test_one_that_is_wrong_opens_no_session(self, hand, axis, payload, status):
        assert hand.status(HELLO, payload, axis=axis) == status
        assert hand.status(CLEAR) == 10


class TestKeptReplies:
    def test_a_request_equal_in_every_byte_is_answered_again_and_does_not_act(self, greeted):
        first = greeted.request(SET, b"\x05", sequence=3)
        greeted.lamp.level = 99
        assert greeted.request(SET, b"\x05", sequence=3) == first
        assert (greeted.lamp.level, greeted.lamp.set) == (99, 1)
        assert greeted.statistics()["repeats"] == 1

    def test_the_same_number_with_other_bytes_is_a_new_request(self, greeted):
        greeted.request(SET, b"\x05", sequence=3)
        greeted.request(SET, b"\x06", sequence=3)
        assert (greeted.lamp.level, greeted.lamp.set) == (6, 2)

    def test_a_refusal_is_kept_as_well(self, greeted):
        greeted.request(EMERGENCY_STOP)
        assert greeted.status(SET, b"\x05", sequence=3) == 9
        greeted.request(CLEAR)
        assert greeted.status(SET, b"\x05", sequence=3) == 9
        assert greeted.lamp.set == 0

    def test_eight_are_kept(self, greeted):
        for number in range(8):
            greeted.request(SET, bytes((number,)), sequence=20 + number)
        greeted.request(SET, b"\0", sequence=20)
        assert greeted.lamp.set == 8
        greeted.request(SET, b"\x08", sequence=28)
        greeted.request(SET, b"\0", sequence=20)
        assert greeted.lamp.set == 10

    def test_a_repeat_does_not_renew_its_place(self, greeted):
        for number in range(8):
            greeted.request(SET, bytes((number,)), sequence=20 + number)
        greeted.request(SET, b"\0", sequence=20)
        greeted.request(SET, b"\x08", sequence=28)
        greeted.request(SET, b"\0", sequence=20)
        assert greeted.lamp.set == 10

    def test_hello_and_broadcasts_take_no_place(self, greeted):
        greeted.request(SET, b"\x01", sequence=20)
        for number in range(8):
            greeted.request(PING, address=0, sequence=30 + number)
        greeted.request(SET, b"\x01", sequence=20)
        assert greeted.lamp.set == 1

    def test_before_the_first_hello_nothing_is_kept(self, hand):
        hand.request(PING, sequence=5)
        hand.advance(1.0)
        assert hand.request(PING, sequence=5).payload == struct.pack("<I", 1_000_000)

    def test_the_journal_shows_each_command_that_acted_once(self, greeted):
        greeted.device.journal = []
        greeted.request(SET, b"\x05", sequence=3)
        greeted.request(SET, b"\x05", sequence=3)
        greeted.request(SET, b"\xff", sequence=4)
        assert [(e.sequence, e.operation, e.payload, e.status) for e in greeted.device.journal] == [
            (3, SET, b"\x05", 0),
            (4, SET, b"\xff", 4),
        ]


class TestStatus:
    @pytest.mark.parametrize("operation", [0x00, 0x08, 0x0F])
    def test_an_unknown_operation_answers_1(self, greeted, operation):
        assert greeted.status(operation, b"xyz", axis=3) == 1

    @pytest.mark.parametrize(
        "operation", [HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, EVENT_MASK, CLEAR]
    )
    def test_a_bad_axis_answers_2_before_a_bad_length(self, greeted, operation):
        assert greeted.status(operation, b"wrong length", axis=3) == 2

    @pytest.mark.parametrize(
        "operation", [HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, EVENT_MASK, CLEAR]
    )
    def test_a_bad_length_answers_3_and_changes_nothing(self, greeted, operation):
        assert greeted.status(operation, b"wrong length") == 3
        assert not greeted.lamp.stopped

    def test_the_applications_refusal_is_answered(self, greeted):
        assert greeted.status(SET, b"\xff") == 4

    def test_answers_come_in_order_with_number_and_operation_of_the_request(self, greeted):
        greeted.device.receive(
            encode_frame(ADDRESS, 0, 60, SET, 0, b"\x07") + encode_frame(ADDRESS, 0, 61, READ, 0), 0.0
        )
        assert [(m.sequence, m.operation, m.axis, m.payload) for m in greeted.messages()] == [
            (60, SET, 0, b""),
            (61, READ, 0, b"\x07"),
        ]

    def test_an_exception_in_device_code_is_logged_and_the_device_lives(self, greeted, caplog):
        assert greeted.request(FAIL) is None
        assert "failed in operation 12H" in caplog.text
        assert greeted.status(PING) == 0


class TestOwnOperations:
    def test_ping_tells_the_microseconds_since_power_up(self, hand):
        hand.device.power_up(2.0)
        hand.now = 3.25
        assert hand.request(PING).payload == struct.pack("<I", 1_250_000)

    def test_the_time_wraps_at_32_bits(self, hand):
        hand.now = (2**32 + 17) / 1e6
        assert hand.request(PING).payload == struct.pack("<I", 17)

    def test_clear_takes_one_axis_or_the_whole_device(self, greeted):
        greeted.request(EMERGENCY_STOP)
        assert greeted.status(CLEAR, axis=0) == 0
        assert not greeted.lamp.stopped
        assert greeted.status(CLEAR, axis=1) == 2

    def test_statistics_count_good_frames_for_this_device_and_broadcasts(self, greeted):
        before = greeted.statistics()["frames"]
        greeted.request(PING, address=0)
        greeted.request(PING, address=0x22)
        greeted.request(PING)
        # The broadcast, the ping and the STATISTICS itself; not the neighbour's.
        assert greeted.statistics()["frames"] == before + 3

    @pytest.mark.parametrize(
        ("bytes_in", "counter"),
        [
            (encode_frame(ADDRESS, 0, 1, PING, 15)[:-2] + b"\x99\0", "crc"),
            (encode_frame(0x22, 0, 1, PING, 15)[:-2] + b"\x99\0", "crc"),
            (b"\x09\x01\x02\0", "framing"),
            (b"\x02" * 72 + b"\0", "framing"),
            (b"\x04\x01\x02\x03\0", "framing"),
            (encode_frame(ADDRESS, Kind.REPLY, 1, PING, 15), "framing"),
            (encode_frame(ADDRESS, Kind.EVENT, 1, PING, 15), "framing"),
            (encode_frame(0, 0, 1, HELLO, 15, b"ab"), "framing"),
            (encode_frame(0, 0, 1, CLEAR, 15), "framing"),
            (encode_frame(0, 0, 1, SET, 15, b"\x05"), "framing"),
            (encode_frame(0, Kind.ACKNOWLEDGEMENT, 1, 0x50, 0), "framing"),
        ],
        ids=[
            "bad CRC",
            "bad CRC for a neighbour",
            "bad COBS",
            "too long",
            "too short",
            "a reply",
            "an event",
            "HELLO to all",
            "CLEAR to all",
            "an operation to all",
            "an acknowledgement to all",
        ],
    )
    def test_what_is_dropped_is_counted_once_and_met_with_silence(self, greeted, bytes_in, counter):
        before = greeted.statistics()
        greeted.device.receive(bytes_in, 0.0)
        assert greeted.sent == []
        after = greeted.statistics()
        assert {name: after[name] - before[name] for name in ("crc", "framing")} == {
            "crc": int(counter == "crc"),
            "framing": int(counter == "framing"),
        }
        assert greeted.lamp.set == 0

    def test_empty_frames_are_ignored(self, greeted):
        greeted.device.receive(b"\0\0\0", 0.0)
        assert greeted.statistics()["framing"] == 0

    def test_after_garbage_the_next_delimiter_starts_again(self, greeted):
        greeted.device.receive(b"\x55\xaa\x99\0", 0.0)
        assert greeted.status(PING) == 0

    def test_counters_wrap_at_their_width(self, greeted):
        for _ in range(2**16 + 3):
            greeted.device.receive(b"\x02\0", 0.0)
        assert greeted.statistics()["framing"] == 3


class TestBroadcast:
    def test_emergency_stop_acts_before_a_hello_whatever_axis_and_payload(self, hand):
        assert hand.request(EMERGENCY_STOP, b"anything", axis=7, address=0) is None
        assert hand.lamp.stopped

    def test_ping_feeds_the_watchdog_and_is_not_answered(self, greeted):
        greeted.request(WATCHDOG, watchdog(100))
        for n in range(1, 10):
            greeted.advance(0.09 * n)
            assert greeted.request(PING, address=0) is None
        assert greeted.statistics()["trips"] == 0

    def test_a_malformed_ping_feeds_nothing(self, greeted):
        greeted.request(WATCHDOG, watchdog(100))
        greeted.advance(0.09)
        greeted.request(PING, b"x", address=0)
        greeted.advance(0.11)
        assert greeted.statistics()["trips"] == 1


class TestPower:
    def test_a_restart_raises_the_boot_count_and_loses_session_and_statistics(self, greeted):
        greeted.request(EMERGENCY_STOP)
        greeted.device.restart(5.0)
        greeted.now = 6.0
        assert greeted.status(SET, b"\x05") == 10
        statistics = greeted.statistics()
        assert statistics["frames"] == 2
        assert greeted.request(PING).payload == struct.pack("<I", 1_000_000)
        reply = greeted.hello()
        assert struct.unpack("<H", reply.payload[6:8]) == (8,)
        assert not greeted.lamp.stopped

    def test_the_boot_count_wraps(self, greeted):
        greeted.device.boot_count = 0xFFFF
        greeted.device.restart(1.0)
        assert greeted.device.boot_count == 0

    def test_the_boot_count_comes_from_the_seed_or_from_the_systems_random_source(self):
        assert first_boot_count(4, 1) == first_boot_count(4, 1)
        assert len({first_boot_count(seed, 1) for seed in range(50)}) > 45
        # Fifty draws of 65536 that are all alike: never.
        assert len({first_boot_count(None, 1) for _ in range(50)}) > 1

    def test_neighbours_on_a_line_do_not_hear_each_other(self, greeted):
        other = LinkDevice(0x22, type(greeted.lamp)(), boot_count=1)
        other.send = lambda data, t: pytest.fail("the neighbour spoke")
        other.receive(encode_frame(ADDRESS, 0, 1, HELLO, 15, b"ab"), 0.0)
