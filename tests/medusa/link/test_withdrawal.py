"""What a stop overrules: every sentence of the page on STOP, MODE 0, EMERGENCY_STOP, CLEAR and HELLO."""

from typing import Any

import pytest

from medusa.errors import Withdrawn
from medusa.link.exchange import State

HELLO, EMERGENCY_STOP, CLEAR = 0x01, 0x05, 0x06
READ, MOVE, STOP, MODE = 0x31, 0x19, 0x20, 0x16


@pytest.mark.parametrize("stop", [STOP, EMERGENCY_STOP])
def test_a_stop_needs_no_free_place_and_withdraws_every_motion(desk: Any, stop: int) -> None:
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


def test_a_motion_asked_for_after_a_stop_waits_for_its_answer(desk: Any) -> None:
    desk.ask(STOP, 0x0F, stops=True)
    desk.ask(MOVE, 1, moves=True)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [STOP, STOP]
    desk.answer_last()
    assert desk.sent[-1].operation == MOVE


def test_an_emergency_stop_withdraws_a_clear_whose_repeat_would_release_it(desk: Any) -> None:
    clear = desk.ask(CLEAR)
    desk.ask(EMERGENCY_STOP)
    assert isinstance(desk.error(clear), Withdrawn)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [CLEAR, EMERGENCY_STOP, EMERGENCY_STOP]


def test_a_clear_waits_for_the_answer_to_the_emergency_stop(desk: Any) -> None:
    desk.ask(EMERGENCY_STOP)
    desk.ask(CLEAR)
    assert [m.operation for m in desk.sent[1:]] == [EMERGENCY_STOP]
    desk.answer_last()
    assert desk.sent[-1].operation == CLEAR


def test_mode_0_takes_its_place_in_the_window_and_withdraws_the_motion_of_its_axis(desk: Any) -> None:
    move = desk.ask(MOVE, 0, moves=True)
    reads = [desk.ask(READ, reads=True) for _ in range(3)]
    desk.ask(MODE, 0, b"\0", stops=True, urgent=False)
    assert isinstance(desk.error(move), Withdrawn)
    assert len(desk.sent) == 5
    desk.answer(2, READ)
    assert desk.sent[-1].operation == MODE
    assert desk.results[reads[0]] == b""


def test_mode_0_lets_the_motion_of_another_axis_be_answered_but_not_be_repeated(desk: Any) -> None:
    other = desk.ask(MOVE, 1, moves=True)
    desk.ask(MODE, 0, b"\0", stops=True, urgent=False)
    assert [m.operation for m in desk.sent[1:]] == [MOVE]
    desk.let_pass(0.101)
    assert isinstance(desk.error(other), Withdrawn)
    assert [m.operation for m in desk.sent[1:]] == [MOVE, MODE]


def test_a_stop_whose_caller_went_away_is_carried_through(desk: Any) -> None:
    stop = desk.ask(STOP, 0, stops=True)
    desk.exchange.cancel(stop, desk.now)
    desk.let_pass(0.15)
    assert [m.operation for m in desk.sent[1:]] == [STOP, STOP]


def test_an_emergency_stop_does_not_wait_for_a_hello_under_way(desk: Any) -> None:
    hello = desk.ask(HELLO, payload=b"\x01\x00")
    desk.ask(EMERGENCY_STOP)
    assert desk.sent[-1].operation == EMERGENCY_STOP
    assert isinstance(desk.error(hello), Withdrawn)
    assert desk.exchange.state is State.CLOSED


def test_hello_withdraws_what_can_move_anything(desk: Any) -> None:
    move = desk.ask(MOVE, 0, moves=True)
    desk.ask(HELLO, payload=b"\x01\x00")
    assert isinstance(desk.error(move), Withdrawn)
    # The withdrawn one still holds its place: HELLO goes out with nothing else outstanding.
    assert desk.sent[-1].operation == MOVE
    desk.let_pass(0.101)
    assert desk.sent[-1].operation == HELLO
