"""The host's half of the link, sentence by sentence of its page, on a clock that the tests hold."""

from dataclasses import dataclass, field
from typing import Any

import pytest

from medusa.errors import (
    CommandError,
    DeviceRestarted,
    DeviceSilent,
    MedusaError,
    NoReply,
    PortError,
    ProtocolError,
    Withdrawn,
)
from medusa.link.exchange import Exchange, State
from medusa.link.frame import Decoder, Message, encode_frame
from medusa.link.messages import CLEAR, EMERGENCY_STOP, HELLO, PING, Event
from medusa.link.request import Request

DEADLINE = 0.1
READ, ACT, MOVE, STOP, MODE = 0x31, 0x32, 0x19, 0x20, 0x16


@dataclass
class Desk:
    """Runs an exchange: keeps what it sent and how its requests ended."""

    frames: list[bytes] = field(default_factory=list)
    results: dict[Request, bytes | MedusaError] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    losses: list[MedusaError] = field(default_factory=list)
    stuck: set[bytes] = field(default_factory=set)
    now: float = 0.0

    def __post_init__(self) -> None:
        self.exchange = Exchange(1, self)

    def send(self, frame: bytes) -> None:
        self.frames.append(frame)

    def unsend(self, frame: bytes) -> bool:
        if frame in self.stuck:
            self.stuck.remove(frame)
            return True
        return False

    def finish(self, request: Request, result: bytes | MedusaError) -> None:
        assert request not in self.results, "a request ended twice"
        self.results[request] = result

    def deliver(self, event: Event) -> None:
        self.events.append(event)

    def lost(self, error: MedusaError) -> None:
        self.losses.append(error)

    def name(self, operation: int) -> str:
        return {0x19: "MOVE", 0x31: "READ"}.get(operation, f"operation {operation:02X}H")

    @property
    def sent(self) -> list[Message]:
        return [item for item in Decoder().feed(b"".join(self.frames)) if isinstance(item, Message)]

    def ask(self, operation: int, axis: int = 0x0F, payload: bytes = b"", **how: Any) -> Request:
        request = Request(operation, axis, payload, DEADLINE, **how)
        self.exchange.submit(request, self.now)
        return request

    def answer(self, sequence: int, operation: int, payload: bytes = b"", status: int = 0) -> None:
        self.exchange.receive(Message(1, 1, sequence, operation, status, payload), self.now)

    def answer_last(self, payload: bytes = b"", status: int = 0) -> None:
        self.answer(self.sent[-1].sequence, self.sent[-1].operation, payload, status)

    def let_pass(self, seconds: float) -> None:
        end = self.now + seconds
        while self.exchange.due <= end:
            self.now = self.exchange.due
            self.exchange.expire(self.now)
        self.now = end

    def error(self, request: Request) -> MedusaError:
        result = self.results[request]
        assert isinstance(result, MedusaError)
        return result


@pytest.fixture
def desk() -> Desk:
    """An exchange in an open session; HELLO took number 0."""
    desk = Desk()
    desk.ask(HELLO, payload=b"\x34\x12")
    desk.answer(0, HELLO, b"\x34\x12" + b"\x01\x01\x02\x01\x07\x00")
    assert desk.exchange.state is State.OPEN
    return desk


def sequences(desk: Desk) -> list[int]:
    return [message.sequence for message in desk.sent[1:]]


def test_at_most_four_requests_are_outstanding(desk: Desk) -> None:
    for _ in range(6):
        desk.ask(READ, reads=True)
    assert sequences(desk) == [1, 2, 3, 4]
    desk.answer(1, READ)
    assert sequences(desk) == [1, 2, 3, 4, 5]


def test_answers_reach_the_request_of_their_number(desk: Desk) -> None:
    first, second = desk.ask(READ, reads=True), desk.ask(READ, reads=True)
    desk.answer(1, READ, b"one")
    desk.answer(2, READ, b"two")
    assert (desk.results[first], desk.results[second]) == (b"one", b"two")


def test_numbers_rise_modulo_64_and_skip_those_out_of_use(desk: Desk) -> None:
    lost = desk.ask(READ, reads=True)
    desk.exchange.cancel(lost, desk.now)
    seen = []
    for _ in range(130):
        desk.ask(READ, reads=True)
        seen.append(desk.sent[-1].sequence)
        desk.answer_last()
    # 1 was cancelled and, within the second, never used again.
    ring = [n for n in range(64) if n != 1]
    assert seen == (ring[1:] + 3 * ring)[:130]


def test_an_unanswered_request_is_repeated_in_the_identical_frame_twice_at_most(desk: Desk) -> None:
    request = desk.ask(READ, 2, b"\x12\x03", reads=True)
    desk.let_pass(0.09)
    assert len(desk.frames) == 2
    desk.let_pass(0.25)
    assert desk.frames[1:] == [desk.frames[1]] * 3
    error = desk.error(request)
    assert isinstance(error, NoReply)
    assert error.may_have_acted
    assert error.frame == desk.frames[1]
    assert "READ axis 2" in str(error)
    assert "may have acted" in str(error)
    # 100 ms for each of three sendings.
    assert desk.now == pytest.approx(0.34)


def test_a_late_reply_is_counted_and_never_handed_to_the_next_request(desk: Desk) -> None:
    cancelled = desk.ask(READ, reads=True)
    desk.exchange.cancel(cancelled, desk.now)
    following = desk.ask(READ, reads=True)
    desk.answer(1, READ, b"late")
    assert following not in desk.results
    assert desk.exchange.counters.late_replies == 1
    desk.answer(2, READ, b"mine")
    assert desk.results[following] == b"mine"


def test_a_reply_of_another_operation_is_not_taken(desk: Desk) -> None:
    request = desk.ask(READ, reads=True)
    desk.answer(1, ACT, b"not this")
    assert request not in desk.results
    assert desk.exchange.counters.late_replies == 1


def test_the_number_of_one_given_up_is_free_again_when_all_its_copies_are_answered_or_after_a_second(
    desk: Desk,
) -> None:
    desk.ask(READ, reads=True)
    desk.let_pass(0.35)

    def used_in_one_round() -> set[int]:
        start = len(desk.sent)
        for _ in range(63):
            desk.ask(READ, reads=True)
            desk.answer_last()
        return {message.sequence for message in desk.sent[start:]}

    assert 1 not in used_in_one_round()
    for _ in range(3):
        desk.answer(1, READ)
    assert 1 in used_in_one_round()
    assert desk.exchange.counters.late_replies == 3


def test_the_number_of_one_cancelled_is_free_after_a_second(desk: Desk) -> None:
    desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.ask(READ, reads=True)
    desk.answer_last()
    desk.let_pass(1.01)
    for _ in range(63):
        desk.ask(READ, reads=True)
        desk.answer_last()
    assert sequences(desk).count(1) == 2


def test_the_same_bytes_do_not_return_before_the_device_has_forgotten_them(desk: Desk) -> None:
    # A device keeps eight pairs; 64 equal requests of which few are answered must not come round to one kept.
    for _ in range(64):
        desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
        desk.let_pass(0.11)
        for late in desk.sent[-1:]:
            if late.sequence % 16 == 3:
                desk.answer(late.sequence, READ)
        if desk.exchange.state is not State.OPEN:
            break
    frames = desk.frames[1:]
    assert len(set(frames)) == len(frames)


def test_a_cancelled_request_holds_its_place_in_the_window_until_its_deadline(desk: Desk) -> None:
    for _ in range(4):
        desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.ask(READ, reads=True)
    assert len(desk.sent) == 5
    desk.let_pass(0.101)
    assert len(desk.sent) == 6


def test_at_most_seven_requests_follow_one_that_may_still_be_repeated(desk: Desk) -> None:
    desk.ask(READ, reads=True)
    for _ in range(20):
        desk.ask(READ, reads=True)
    for number in range(2, 9):
        if number in sequences(desk):
            desk.answer(number, READ)
    assert sequences(desk) == list(range(1, 9))
    desk.answer(1, READ)
    assert len(sequences(desk)) > 8


def test_what_a_live_one_may_still_do_by_its_repeat_counts_among_the_seven(desk: Desk) -> None:
    # 1, 2 and 3 were live when 4 went out: had they been lost, their repeats would act after 4. With them only
    # four more may follow 4 before it could fall out of the eight kept.
    for _ in range(20):
        desk.ask(READ, reads=True)
    for number in (1, 2, 3, 5, 6, 7, 8, 9, 10, 11):
        if number in sequences(desk):
            desk.answer(number, READ)
    assert sequences(desk) == [1, 2, 3, 4, 5, 6, 7, 8]


def test_one_lost_request_that_was_cancelled_does_not_make_a_device_silent(desk: Desk) -> None:
    desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.let_pass(5.0)
    assert desk.exchange.state is State.OPEN


def test_cancelling_quickly_does_not_hide_that_a_device_is_silent(desk: Desk) -> None:
    for _ in range(30):
        request = desk.ask(READ, reads=True)
        desk.let_pass(0.05)
        desk.exchange.cancel(request, desk.now)
    assert desk.exchange.state is State.SILENT


def test_hello_goes_out_alone_and_nothing_else_before_its_answer(desk: Desk) -> None:
    desk.ask(READ, reads=True)
    hello = desk.ask(HELLO, payload=b"\x01\x00")
    desk.ask(READ, reads=True)
    assert [message.operation for message in desk.sent[1:]] == [READ]
    desk.answer(1, READ)
    assert [message.operation for message in desk.sent[1:]] == [READ, HELLO]
    desk.answer(2, HELLO, b"\x01\x00" + bytes(8))
    assert desk.results[hello] == b"\x01\x00" + bytes(8)
    assert [message.operation for message in desk.sent[1:]] == [READ, HELLO, READ]


def test_only_the_hello_reply_with_ones_own_nonce_is_taken() -> None:
    desk = Desk()
    hello = desk.ask(HELLO, payload=b"\x34\x12")
    desk.answer(0, HELLO, b"\x35\x12" + bytes(8))
    assert hello not in desk.results
    assert desk.exchange.state is State.GREETING
    desk.answer(0, HELLO, b"\x34\x12" + bytes(8))
    assert desk.exchange.state is State.OPEN


def test_before_the_first_hello_only_hello_and_emergency_stop_go_out() -> None:
    desk = Desk()
    assert "no session is open" in str(desk.error(desk.ask(READ, reads=True)))
    desk.ask(EMERGENCY_STOP)
    assert [message.operation for message in desk.sent] == [EMERGENCY_STOP]


def test_two_requests_that_act_on_one_axis_are_never_unanswered_together(desk: Desk) -> None:
    desk.ask(ACT, 0)
    desk.ask(ACT, 0)
    desk.ask(ACT, 1)
    desk.ask(ACT, 0x0F)
    desk.ask(READ, 0, reads=True)
    assert [(m.operation, m.axis) for m in desk.sent[1:]] == [(ACT, 0), (ACT, 1), (READ, 0)]
    desk.answer(1, ACT)
    assert [(m.operation, m.axis) for m in desk.sent[4:]] == [(ACT, 0)]
    desk.answer(2, ACT)
    desk.answer(4, ACT)
    assert [(m.operation, m.axis) for m in desk.sent[5:]] == [(ACT, 0x0F)]


@pytest.mark.parametrize("stop", [STOP, EMERGENCY_STOP])
def test_a_stop_needs_no_free_place_and_withdraws_every_motion(desk: Desk, stop: int) -> None:
    moves = [desk.ask(MOVE, axis, moves=True) for axis in (0, 1, 2)]
    waiting = desk.ask(MOVE, 0, moves=True)
    reads = [desk.ask(READ, reads=True), desk.ask(READ, reads=True)]
    assert len(desk.sent) == 5
    desk.ask(stop, stops=True)
    assert desk.sent[-1].operation == stop
    for move in moves:
        error = desk.error(move)
        assert isinstance(error, Withdrawn)
        assert error.may_have_acted
    assert not getattr(desk.error(waiting), "may_have_acted", True)
    assert all(read not in desk.results for read in reads)
    desk.let_pass(0.5)
    assert [m.operation for m in desk.sent].count(MOVE) == 3


def test_a_motion_asked_for_after_a_stop_waits_for_its_answer(desk: Desk) -> None:
    desk.ask(STOP, 0x0F, stops=True)
    desk.ask(MOVE, 1, moves=True)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [STOP, STOP]
    desk.answer_last()
    assert desk.sent[-1].operation == MOVE


def test_an_emergency_stop_withdraws_a_clear_whose_repeat_would_release_it(desk: Desk) -> None:
    clear = desk.ask(CLEAR)
    desk.ask(EMERGENCY_STOP)
    assert isinstance(desk.error(clear), Withdrawn)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [CLEAR, EMERGENCY_STOP, EMERGENCY_STOP]


def test_a_clear_waits_for_the_answer_to_the_emergency_stop(desk: Desk) -> None:
    desk.ask(EMERGENCY_STOP)
    desk.ask(CLEAR)
    assert [m.operation for m in desk.sent[1:]] == [EMERGENCY_STOP]
    desk.answer_last()
    assert desk.sent[-1].operation == CLEAR


def test_mode_0_takes_its_place_in_the_window_and_withdraws_the_motion_of_its_axis(desk: Desk) -> None:
    move = desk.ask(MOVE, 0, moves=True)
    reads = [desk.ask(READ, reads=True) for _ in range(3)]
    desk.ask(MODE, 0, b"\0", stops=True, urgent=False)
    assert isinstance(desk.error(move), Withdrawn)
    assert len(desk.sent) == 5
    desk.answer(2, READ)
    assert desk.sent[-1].operation == MODE
    assert desk.results[reads[0]] == b""


def test_mode_0_lets_the_motion_of_another_axis_be_answered_but_not_be_repeated(desk: Desk) -> None:
    other = desk.ask(MOVE, 1, moves=True)
    desk.ask(MODE, 0, b"\0", stops=True, urgent=False)
    assert [m.operation for m in desk.sent[1:]] == [MOVE]
    desk.let_pass(0.101)
    assert isinstance(desk.error(other), Withdrawn)
    assert [m.operation for m in desk.sent[1:]] == [MOVE, MODE]


def test_a_stop_whose_caller_went_away_is_carried_through(desk: Desk) -> None:
    stop = desk.ask(STOP, 0, stops=True)
    desk.exchange.cancel(stop, desk.now)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [STOP, STOP]


def test_an_emergency_stop_does_not_wait_for_a_hello_under_way(desk: Desk) -> None:
    hello = desk.ask(HELLO, payload=b"\x01\x00")
    desk.ask(EMERGENCY_STOP)
    assert desk.sent[-1].operation == EMERGENCY_STOP
    assert isinstance(desk.error(hello), Withdrawn)
    assert desk.exchange.state is State.CLOSED


def test_hello_withdraws_what_can_move_anything(desk: Desk) -> None:
    move = desk.ask(MOVE, 0, moves=True)
    desk.ask(HELLO, payload=b"\x01\x00")
    assert isinstance(desk.error(move), Withdrawn)
    # The withdrawn one still holds its place: HELLO goes out with nothing else outstanding.
    assert desk.sent[-1].operation == MOVE
    desk.let_pass(0.101)
    assert desk.sent[-1].operation == HELLO


def test_a_device_that_answered_nothing_for_a_second_gets_only_hello_and_emergency_stop(desk: Desk) -> None:
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


def test_hello_can_be_tried_for_ever(desk: Desk) -> None:
    for attempt in range(100):
        desk.ask(HELLO, payload=attempt.to_bytes(2, "little"))
        desk.let_pass(0.31)
    assert [m.operation for m in desk.sent].count(HELLO) == 1 + 3 * 100


def test_a_late_reply_shows_that_the_device_is_not_silent(desk: Desk) -> None:
    desk.ask(READ, reads=True)
    desk.let_pass(0.9)
    desk.answer(1, READ)
    desk.let_pass(5.0)
    assert desk.exchange.state is State.OPEN


def test_each_event_is_handed_on_once_and_every_copy_acknowledged(desk: Desk) -> None:
    event = Message(1, 2, 5, 0x41, 2, b"\x01\x02")
    for _ in range(3):
        desk.exchange.receive(event, desk.now)
    assert desk.events == [Event(0x41, 2, b"\x01\x02", 5)]
    assert desk.sent[1:] == [Message(1, 3, 5, 0x41, 0, b"")] * 3
    desk.exchange.receive(event._replace(payload=b"\x01\x03"), desk.now)
    assert len(desk.events) == 2


def test_events_count_from_0_again_after_a_hello(desk: Desk) -> None:
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
def test_a_refusal_names_operation_axis_and_status(desk: Desk, status: int, text: str) -> None:
    request = desk.ask(MOVE, 2, moves=True)
    desk.answer_last(status=status)
    error = desk.error(request)
    assert isinstance(error, CommandError)
    assert (error.status, error.operation, error.axis) == (status, MOVE, 2)
    assert str(error) == f"device 01H, MOVE axis 2: {text} (status {status})"


def test_no_hello_since_power_up_means_restarted(desk: Desk) -> None:
    request, waiting = desk.ask(ACT, 0), desk.ask(ACT, 0)
    desk.answer(1, ACT, status=10)
    assert isinstance(desk.error(request), DeviceRestarted)
    assert not getattr(desk.error(waiting), "may_have_acted", True)
    assert desk.exchange.state is State.CLOSED
    assert [type(loss) for loss in desk.losses] == [DeviceRestarted]


def test_an_unknown_status_is_the_devices_fault_and_shown_with_its_bytes(desk: Desk) -> None:
    request = desk.ask(ACT, 0)
    desk.answer(1, ACT, status=77)
    error = desk.error(request)
    assert isinstance(error, ProtocolError)
    assert error.fault == "device"
    assert error.frame.hex() in str(error).replace(" ", "")


def test_a_port_that_vanishes_ends_everything_at_once_and_says_what_may_have_acted(desk: Desk) -> None:
    sent, waiting = desk.ask(ACT, 0), desk.ask(ACT, 0)
    desk.exchange.lose("/dev/x", "gone", desk.now)
    first, second = desk.error(sent), desk.error(waiting)
    assert isinstance(first, PortError)
    assert isinstance(second, PortError)
    assert (first.may_have_acted, second.may_have_acted) == (True, False)
    desk.let_pass(5)
    assert len(desk.sent) == 2


def test_a_request_whose_bytes_never_left_the_host_says_so(desk: Desk) -> None:
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


def test_a_reply_of_another_size_is_damage_and_asked_for_again(desk: Desk) -> None:
    request = desk.ask(READ, reads=True, reply_size=1)
    desk.answer(1, READ, b"\x05\x12\x34\0\0\x01\x42\x31\0\x06")
    assert request not in desk.results
    desk.let_pass(0.101)
    desk.answer(1, READ, b"\x05")
    assert desk.results[request] == b"\x05"
    assert desk.exchange.counters.damaged == 1


def test_a_device_that_always_answers_another_size_is_told_with_its_bytes(desk: Desk) -> None:
    request = desk.ask(READ, reads=True, reply_size=1)
    for _ in range(3):
        desk.answer(1, READ, b"\x05\x06")
        desk.let_pass(0.101)
    error = desk.error(request)
    assert type(error) is ProtocolError
    assert "answered 2 bytes, 1 expected" in str(error)
    assert error.frame.hex() == encode_frame(Message(1, 1, 1, READ, 0, b"\x05\x06")).hex()


def test_bad_length_to_a_request_that_ran_into_another_is_repeated_at_once(desk: Desk) -> None:
    request = desk.ask(MOVE, 0, moves=True)
    desk.answer(1, MOVE, status=3)
    assert desk.frames[-2:] == [desk.frames[-1]] * 2
    desk.answer(1, MOVE)
    assert desk.results[request] == b""


def test_bad_length_every_time_is_the_callers_fault(desk: Desk) -> None:
    request = desk.ask(MOVE, 0, moves=True)
    for _ in range(3):
        desk.answer(1, MOVE, status=3)
    error = desk.error(request)
    assert isinstance(error, CommandError)
    assert error.status == 3


def test_a_damaged_event_is_not_acknowledged_so_that_it_comes_again(desk: Desk) -> None:
    desk.exchange.event_size = 9
    desk.exchange.receive(Message(1, 2, 0, 0x41, 2, bytes(20)), desk.now)
    assert len(desk.sent) == 1
    assert desk.events == []


def test_a_device_cannot_send_requests_or_acknowledgements(desk: Desk) -> None:
    desk.exchange.receive(Message(1, 0, 1, PING, 15), desk.now)
    desk.exchange.receive(Message(1, 3, 1, PING, 0), desk.now)
    assert desk.exchange.counters.stray == 2
    assert len(desk.sent) == 1
