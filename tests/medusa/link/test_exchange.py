"""The host's half of the link, by the sentences of its page: window, sequence numbers, repeats, handshake, order."""

from typing import Any

import pytest

from medusa.errors import NoReply
from medusa.link.exchange import State

HELLO, EMERGENCY_STOP = 0x01, 0x05
READ, ACT = 0x31, 0x32


def test_at_most_four_requests_are_outstanding(desk: Any) -> None:
    for _ in range(6):
        desk.ask(READ, reads=True)
    assert desk.sequences == [1, 2, 3, 4]
    desk.answer(1, READ)
    assert desk.sequences == [1, 2, 3, 4, 5]


def test_answers_reach_the_request_of_their_number(desk: Any) -> None:
    first, second = desk.ask(READ, reads=True), desk.ask(READ, reads=True)
    desk.answer(1, READ, b"one")
    desk.answer(2, READ, b"two")
    assert (desk.results[first], desk.results[second]) == (b"one", b"two")


def test_numbers_rise_modulo_64_and_skip_those_out_of_use(desk: Any) -> None:
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


def test_an_unanswered_request_is_repeated_in_the_identical_frame_twice_at_most(desk: Any) -> None:
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


def test_a_late_reply_is_counted_and_never_handed_to_the_next_request(desk: Any) -> None:
    cancelled = desk.ask(READ, reads=True)
    desk.exchange.cancel(cancelled, desk.now)
    following = desk.ask(READ, reads=True)
    desk.answer(1, READ, b"late")
    assert following not in desk.results
    assert desk.exchange.counters.late_replies == 1
    desk.answer(2, READ, b"mine")
    assert desk.results[following] == b"mine"


def test_a_reply_of_another_operation_is_not_taken(desk: Any) -> None:
    request = desk.ask(READ, reads=True)
    desk.answer(1, ACT, b"not this")
    assert request not in desk.results
    assert desk.exchange.counters.late_replies == 1


def test_the_number_of_one_given_up_is_free_again_when_all_its_copies_are_answered_or_after_a_second(
    desk: Any,
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


def test_the_number_of_one_cancelled_is_free_after_a_second(desk: Any) -> None:
    desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.ask(READ, reads=True)
    desk.answer_last()
    desk.let_pass(1.01)
    for _ in range(63):
        desk.ask(READ, reads=True)
        desk.answer_last()
    assert desk.sequences.count(1) == 2


def test_the_same_bytes_do_not_return_before_the_device_has_forgotten_them(desk: Any) -> None:
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


def test_a_cancelled_request_holds_its_place_in_the_window_until_its_deadline(desk: Any) -> None:
    for _ in range(4):
        desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.ask(READ, reads=True)
    assert len(desk.sent) == 5
    desk.let_pass(0.101)
    assert len(desk.sent) == 6


def test_at_most_seven_requests_follow_one_that_may_still_be_repeated(desk: Any) -> None:
    desk.ask(READ, reads=True)
    for _ in range(20):
        desk.ask(READ, reads=True)
    for number in range(2, 9):
        if number in desk.sequences:
            desk.answer(number, READ)
    assert desk.sequences == list(range(1, 9))
    desk.answer(1, READ)
    assert len(desk.sequences) > 8


def test_what_a_live_one_may_still_do_by_its_repeat_counts_among_the_seven(desk: Any) -> None:
    # 1, 2 and 3 were live when 4 went out: had they been lost, their repeats would act after 4. With them only
    # four more may follow 4 before it could fall out of the eight kept.
    for _ in range(20):
        desk.ask(READ, reads=True)
    for number in (1, 2, 3, 5, 6, 7, 8, 9, 10, 11):
        if number in desk.sequences:
            desk.answer(number, READ)
    assert desk.sequences == [1, 2, 3, 4, 5, 6, 7, 8]


def test_one_lost_request_that_was_cancelled_does_not_make_a_device_silent(desk: Any) -> None:
    desk.exchange.cancel(desk.ask(READ, reads=True), desk.now)
    desk.let_pass(5.0)
    assert desk.exchange.state is State.OPEN


def test_cancelling_quickly_does_not_hide_that_a_device_is_silent(desk: Any) -> None:
    for _ in range(30):
        request = desk.ask(READ, reads=True)
        desk.let_pass(0.05)
        desk.exchange.cancel(request, desk.now)
    assert desk.exchange.state is State.SILENT


def test_hello_goes_out_alone_and_nothing_else_before_its_answer(desk: Any) -> None:
    desk.ask(READ, reads=True)
    hello = desk.ask(HELLO, payload=b"\x01\x00")
    desk.ask(READ, reads=True)
    assert [message.operation for message in desk.sent[1:]] == [READ]
    desk.answer(1, READ)
    assert [message.operation for message in desk.sent[1:]] == [READ, HELLO]
    desk.answer(2, HELLO, b"\x01\x00" + bytes(8))
    assert desk.results[hello] == b"\x01\x00" + bytes(8)
    assert [message.operation for message in desk.sent[1:]] == [READ, HELLO, READ]


def test_only_the_hello_reply_with_ones_own_nonce_is_taken(new_desk: Any) -> None:
    desk = new_desk
    hello = desk.ask(HELLO, payload=b"\x34\x12")
    desk.answer(0, HELLO, b"\x35\x12" + bytes(8))
    assert hello not in desk.results
    assert desk.exchange.state is State.HANDSHAKE
    desk.answer(0, HELLO, b"\x34\x12" + bytes(8))
    assert desk.exchange.state is State.OPEN


def test_before_the_first_hello_only_hello_and_emergency_stop_go_out(new_desk: Any) -> None:
    desk = new_desk
    assert "no session is open" in str(desk.error(desk.ask(READ, reads=True)))
    desk.ask(EMERGENCY_STOP)
    assert [message.operation for message in desk.sent] == [EMERGENCY_STOP]


def test_two_requests_that_act_on_one_axis_are_never_unanswered_together(desk: Any) -> None:
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
