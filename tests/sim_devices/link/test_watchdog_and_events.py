"""What a device does on its own: its watchdog and its events (docs/protocols, the serial link)."""

import struct

import pytest

from sim_devices.link.frame import Kind, encode_frame

HELLO, PING, STATISTICS, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = range(1, 8)
SET, READ = 0x10, 0x11
ADDRESS = 0x21


def watchdog(timeout_ms, action=0):
    return struct.pack("<HB", timeout_ms, action)


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
