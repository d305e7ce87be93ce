"""How requests end when they are not answered as they should: silence, refusals, damage, a vanished port; events."""

from typing import Any

import pytest

from medusa.errors import CommandError, DeviceRestarted, DeviceSilent, NoReply, PortError, ProtocolError
from medusa.link.exchange import State
from medusa.link.frame import Decoder, Message, encode_frame
from medusa.link.messages import Event

HELLO, PING, EMERGENCY_STOP = 0x01, 0x02, 0x05
READ, ACT, MOVE = 0x31, 0x32, 0x19


def test_a_host_that_was_away_does_not_take_its_absence_for_the_devices_silence(desk: Any) -> None:
    request = desk.ask(READ, reads=True)
    # The reply was lost, and this host was stopped for five seconds: its next look is late.
    desk.now = 5.0
    desk.exchange.expire(desk.now)
    assert desk.exchange.state is State.OPEN
    assert [m.operation for m in desk.sent[1:]] == [READ, READ]
    desk.answer_last(b"x")
    assert desk.results[request] == b"x"
    # What is silent from then on is silent a second later.
    desk.ask(READ, reads=True)
    desk.let_pass(0.99)
    assert desk.exchange.state is State.OPEN
    desk.let_pass(0.02)
    assert desk.exchange.state is State.SILENT


def test_a_device_that_answered_nothing_for_a_second_gets_only_hello_and_emergency_stop(desk: Any) -> None:
    under_way = desk.ask(READ, reads=True)
    desk.let_pass(0.9)
    later = desk.ask(READ, reads=True)
    desk.let_pass(0.11)
    assert desk.exchange.state is State.SILENT
    assert isinstance(desk.error(under_way), NoReply)
    assert isinstance(desk.error(later), DeviceSilent)
    assert [type(loss) for loss in desk.losses] == [DeviceSilent]
    before = len(desk.frames)
    refused = desk.error(desk.ask(READ, reads=True))
    assert isinstance(refused, DeviceSilent)
    assert not refused.may_have_acted
    assert len(desk.frames) == before
    desk.ask(EMERGENCY_STOP)
    assert desk.sent[-1].operation == EMERGENCY_STOP
    desk.let_pass(0.31)
    desk.ask(HELLO, payload=b"\x02\x00")
    desk.answer_last(b"\x02\x00" + bytes(8))
    assert desk.exchange.state is State.OPEN


def test_hello_can_be_tried_for_ever(desk: Any) -> None:
    for attempt in range(100):
        desk.ask(HELLO, payload=attempt.to_bytes(2, "little"))
        desk.let_pass(0.31)
    assert [m.operation for m in desk.sent].count(HELLO) == 1 + 3 * 100


def test_a_late_reply_shows_that_the_device_is_not_silent(desk: Any) -> None:
    desk.ask(READ, reads=True)
    desk.let_pass(0.9)
    desk.answer(1, READ)
    desk.let_pass(5.0)
    assert desk.exchange.state is State.OPEN


def test_each_event_is_handed_on_once_and_every_copy_acknowledged(desk: Any) -> None:
    event = Message(1, 2, 5, 0x41, 2, b"\x01\x02")
    for _ in range(3):
        desk.exchange.receive(event, desk.now)
    assert desk.events == [Event(0x41, 2, b"\x01\x02", 5)]
    assert desk.sent[1:] == [Message(1, 3, 5, 0x41, 0, b"")] * 3
    desk.exchange.receive(event._replace(payload=b"\x01\x03"), desk.now)
    assert len(desk.events) == 2


def test_events_count_from_0_again_after_a_hello(desk: Any) -> None:
    event = Message(1, 2, 0, 0x41, 2, b"\x01")
    desk.exchange.receive(event, desk.now)
    desk.ask(HELLO, payload=b"\x07\x00")
    desk.exchange.receive(event, desk.now)
    desk.answer_last(b"\x07\x00" + bytes(8))
    desk.exchange.receive(event, desk.now)
    # The one between HELLO and its answer belonged to the old session.
    assert len(desk.events) == 2
    assert desk.exchange.counters.events_dropped == 1


@pytest.mark.parametrize(
    ("status", "text"),
    [(4, "out of range"), (8, "limit or fault latched"), (9, "emergency stop latched"), (11, "busy")],
)
def test_a_refusal_names_operation_axis_and_status(desk: Any, status: int, text: str) -> None:
    request = desk.ask(MOVE, 2, moves=True)
    desk.answer_last(status=status)
    error = desk.error(request)
    assert isinstance(error, CommandError)
    assert (error.status, error.operation, error.axis) == (status, MOVE, 2)
    assert str(error) == f"device 01H, MOVE axis 2: {text} (status {status})"


def test_no_hello_since_power_up_means_restarted(desk: Any) -> None:
    request, waiting = desk.ask(ACT, 0), desk.ask(ACT, 0)
    desk.answer(1, ACT, status=10)
    assert isinstance(desk.error(request), DeviceRestarted)
    assert not getattr(desk.error(waiting), "may_have_acted", True)
    assert desk.exchange.state is State.CLOSED
    assert [type(loss) for loss in desk.losses] == [DeviceRestarted]


def test_an_unknown_status_is_the_devices_fault_and_shown_with_its_bytes(desk: Any) -> None:
    request = desk.ask(ACT, 0)
    desk.answer(1, ACT, status=77)
    error = desk.error(request)
    assert isinstance(error, ProtocolError)
    assert error.origin == "device"
    assert error.frame.hex() in str(error).replace(" ", "")


def test_a_port_that_vanishes_ends_everything_at_once_and_says_what_may_have_acted(desk: Any) -> None:
    sent, waiting = desk.ask(ACT, 0), desk.ask(ACT, 0)
    desk.exchange.lose("/dev/x", "gone", desk.now)
    first, second = desk.error(sent), desk.error(waiting)
    assert isinstance(first, PortError)
    assert isinstance(second, PortError)
    assert (first.may_have_acted, second.may_have_acted) == (True, False)
    desk.let_pass(5)
    assert len(desk.sent) == 2


def test_a_request_whose_bytes_never_left_the_host_says_so(desk: Any) -> None:
    request = desk.ask(ACT, 0)
    desk.stuck.add(desk.frames[-1])
    desk.let_pass(0.11)
    error = desk.error(request)
    assert isinstance(error, NoReply)
    assert not error.may_have_acted
    assert "takes no bytes" in str(error)


def test_a_frame_whose_end_was_hit_runs_into_the_next_and_the_crc_does_not_notice() -> None:
    # The 00 between two replies turned into 01. The CRC begins at 0 and is 0 after the first reply and its CRC,
    # so the second one's fits too: link.md's frames have this hole, and lengths have to close it.
    first, second = Message(1, 1, 1, READ, 0, b"\x05"), Message(1, 1, 2, READ, 0, b"\x06")
    (joined,) = Decoder().feed(encode_frame(first)[:-1] + b"\x01" + encode_frame(second))
    assert isinstance(joined, Message)
    assert joined[:5] == first[:5]
    assert joined.payload[:1] == b"\x05"
    assert len(joined.payload) == 1 + 2 + 2 + 5


def test_a_reply_of_another_size_is_damage_and_asked_for_again(desk: Any) -> None:
    request = desk.ask(READ, reads=True, reply_size=1)
    desk.answer(1, READ, b"\x05\x12\x34\0\0\x01\x42\x31\0\x06")
    assert request not in desk.results
    desk.let_pass(0.101)
    desk.answer(1, READ, b"\x05")
    assert desk.results[request] == b"\x05"
    assert desk.exchange.counters.damaged == 1


def test_a_device_that_always_answers_another_size_is_told_with_its_bytes(desk: Any) -> None:
    request = desk.ask(READ, reads=True, reply_size=1)
    for _ in range(3):
        desk.answer(1, READ, b"\x05\x06")
        desk.let_pass(0.101)
    error = desk.error(request)
    assert type(error) is ProtocolError
    assert "answered 2 bytes, 1 expected" in str(error)
    assert error.frame.hex() == encode_frame(Message(1, 1, 1, READ, 0, b"\x05\x06")).hex()


def test_bad_length_to_a_request_that_ran_into_another_is_repeated_at_once(desk: Any) -> None:
    request = desk.ask(MOVE, 0, moves=True)
    desk.answer(1, MOVE, status=3)
    assert desk.frames[-2:] == [desk.frames[-1]] * 2
    desk.answer(1, MOVE)
    assert desk.results[request] == b""


def test_bad_length_every_time_is_the_callers_fault(desk: Any) -> None:
    request = desk.ask(MOVE, 0, moves=True)
    for _ in range(3):
        desk.answer(1, MOVE, status=3)
    error = desk.error(request)
    assert isinstance(error, CommandError)
    assert error.status == 3


def test_a_damaged_event_is_not_acknowledged_so_that_it_comes_again(desk: Any) -> None:
    desk.exchange.event_size = 9
    desk.exchange.receive(Message(1, 2, 0, 0x41, 2, bytes(20)), desk.now)
    assert len(desk.sent) == 1
    assert desk.events == []


def test_a_device_cannot_send_requests_or_acknowledgements(desk: Any) -> None:
    desk.exchange.receive(Message(1, 0, 1, PING, 15), desk.now)
    desk.exchange.receive(Message(1, 3, 1, PING, 0), desk.now)
    assert desk.exchange.counters.stray == 2
    assert len(desk.sent) == 1
