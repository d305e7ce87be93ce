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


class TestWatchdog:
    def test_is_off_at_power_up(self, greeted):
        greeted.request(SET, b"\x05")
        greeted.advance(1000.0)
        assert greeted.lamp.level == 5

    def test_expires_once_at_its_time_and_counts_again_from_the_next_feeding_frame(self, greeted):
        greeted.request(WATCHDOG, watchdog(500, 1))
        greeted.request(SET, b"\x05")
        assert greeted.device.next_due() == pytest.approx(0.5)
        greeted.advance(0.499)
        assert greeted.lamp.level == 5
        greeted.advance(10.0)
        assert greeted.lamp.level == 0
        greeted.request(SET, b"\x06")
        greeted.advance(10.4)
        assert greeted.lamp.level == 6
        greeted.advance(10.6)
        assert greeted.lamp.level == 0
        assert greeted.statistics()["trips"] == 2

    @pytest.mark.parametrize(
        "frame",
        [
            encode_frame(ADDRESS, 0, 9, READ, 0),
            encode_frame(ADDRESS, 0, 9, 0x0F, 3),
            encode_frame(ADDRESS, Kind.ACKNOWLEDGEMENT, 9, 0x50, 0),
            encode_frame(0, 0, 9, PING, 15),
        ],
        ids=["a request", "a refused request", "an acknowledgement", "a ping to all"],
    )
    def test_is_fed_by(self, greeted, frame):
        greeted.request(WATCHDOG, watchdog(100))
        greeted.advance(0.08)
        greeted.device.receive(frame, greeted.now)
        greeted.sent.clear()
        greeted.advance(0.17)
        assert greeted.statistics()["trips"] == 0

    @pytest.mark.parametrize(
        "frame",
        [
            encode_frame(0x22, 0, 9, READ, 0),
            encode_frame(ADDRESS, Kind.REPLY, 9, READ, 0),
            encode_frame(ADDRESS, 0, 9, READ, 0)[:-2] + b"\x77\0",
            encode_frame(0, 0, 9, CLEAR, 15),
        ],
        ids=["a neighbour's request", "a reply", "a spoilt request", "another broadcast"],
    )
    def test_is_not_fed_by(self, greeted, frame):
        greeted.request(WATCHDOG, watchdog(100))
        greeted.advance(0.08)
        greeted.device.receive(frame, greeted.now)
        greeted.sent.clear()
        greeted.advance(0.17)
        assert greeted.statistics()["trips"] == 1

    def test_a_repeat_answered_from_the_kept_replies_feeds_it_too(self, greeted):
        greeted.request(WATCHDOG, watchdog(100))
        greeted.request(READ, sequence=33)
        greeted.advance(0.08)
        greeted.request(READ, sequence=33)
        greeted.advance(0.17)
        assert greeted.statistics()["trips"] == 0

    def test_timeout_0_switches_it_off(self, greeted):
        greeted.request(WATCHDOG, watchdog(100))
        greeted.request(WATCHDOG, watchdog(0))
        greeted.advance(10.0)
        assert greeted.statistics()["trips"] == 0
        assert greeted.lamp.watched[-2:] == [True, False]

    def test_an_action_that_the_device_has_not_answers_4_and_changes_nothing(self, greeted):
        greeted.request(WATCHDOG, watchdog(100))
        assert greeted.status(WATCHDOG, watchdog(0, 2)) == 4
        greeted.advance(1.0)
        assert greeted.statistics()["trips"] == 1


class TestEvents:
    def messages(self, hand):
        return [(m.kind, m.sequence, m.operation, m.axis, m.payload) for m in hand.messages()]

    def test_none_is_made_before_a_hello_or_while_masked_out(self, hand):
        hand.lamp.emit(0x50, 0, b"early")
        hand.hello()
        hand.lamp.emit(0x50, 0, b"masked")
        hand.request(EVENT_MASK, struct.pack("<I", 1 << 0x10))
        hand.lamp.emit(0x51, 0, b"other")
        hand.lamp.emit(0x50, 0, b"this")
        assert self.messages(hand) == [(Kind.EVENT, 0, 0x50, 0, b"this")]

    def test_comes_six_times_100_ms_apart_and_is_then_given_up(self, hand):
        hand.hello(mask=1 << 0x10)
        hand.advance(1.0)
        hand.lamp.emit(0x50, 3, b"x")
        hand.advance(10.0)
        assert [t for t, _ in hand.sent] == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
        assert len({data for _, data in hand.sent}) == 1
        assert hand.statistics()["given_up"] == 1

    def test_is_given_up_100_ms_after_its_last_sending(self, hand):
        hand.hello(mask=1 << 0x10)
        hand.lamp.emit(0x50, 3, b"x")
        hand.advance(0.59)
        assert hand.statistics()["given_up"] == 0
        hand.advance(0.61)
        assert hand.statistics()["given_up"] == 1

    def test_an_acknowledgement_ends_it_whatever_its_axis_and_payload(self, hand):
        hand.hello(mask=1 << 0x10)
        hand.lamp.emit(0x50, 3, b"x")
        hand.sent.clear()
        hand.request(0x50, b"ignored", axis=9, kind=Kind.ACKNOWLEDGEMENT, sequence=0)
        hand.advance(1.0)
        assert hand.sent == []
        assert hand.statistics()["given_up"] == 0

    @pytest.mark.parametrize(("operation", "sequence"), [(0x51, 0), (0x50, 1)])
    def test_an_acknowledgement_of_another_does_not(self, hand, operation, sequence):
        hand.hello(mask=1 << 0x10)
        hand.lamp.emit(0x50, 3, b"x")
        hand.request(operation, kind=Kind.ACKNOWLEDGEMENT, sequence=sequence)
        hand.advance(0.15)
        assert len(hand.sent) == 1

    def test_numbers_rise_from_0_at_hello_modulo_64(self, hand):
        hand.hello(mask=1 << 0x10)
        numbers = []
        for _ in range(66):
            hand.lamp.emit(0x50, 0, b"")
            (message,) = hand.messages()
            numbers.append(message.sequence)
            hand.request(0x50, kind=Kind.ACKNOWLEDGEMENT, sequence=message.sequence)
        assert numbers == [*range(64), 0, 1]
        hand.hello(mask=1 << 0x10)
        hand.lamp.emit(0x50, 0, b"")
        assert hand.messages()[0].sequence == 0

    def test_at_most_eight_are_unacknowledged_and_the_others_wait_oldest_first(self, hand):
        hand.hello(mask=1 << 0x10)
        for number in range(11):
            hand.lamp.emit(0x50, 0, bytes((number,)))
        assert [m.payload[0] for m in hand.messages()] == list(range(8))
        hand.request(0x50, kind=Kind.ACKNOWLEDGEMENT, sequence=5)
        hand.lamp.emit(0x50, 0, b"\x0b")
        hand.device.receive(encode_frame(ADDRESS, 3, 2, 0x50, 0), hand.now)
        assert [(m.sequence, m.payload[0]) for m in hand.messages()] == [(9, 9)]
        # 100 ms after their last sending the eight are given up and the last two come.
        hand.advance(0.61)
        late = {m.payload[0] for m in hand.messages()}
        assert {10, 11} <= late
        assert hand.statistics()["given_up"] == 8

    def test_is_sent_when_the_device_notices_and_carries_the_time_at_which_it_happened(self, hand):
        hand.hello(mask=1 << 0x10)
        hand.lamp.due = 0.25
        hand.device.advance_to(0.254)
        ((t, _),) = hand.sent
        assert t == 0.254
        assert hand.messages()[0].payload == struct.pack("<I", 250_000)

    def test_the_answer_of_a_new_mask_lets_waiting_events_come(self, hand):
        hand.hello(mask=1 << 0x10)
        hand.lamp.emit(0x50, 0, b"made")
        hand.request(EVENT_MASK, bytes(4))
        hand.advance(0.11)
        assert len(hand.sent) == 1


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
