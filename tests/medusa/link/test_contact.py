"""A device that was not fed in time has stopped: noticed before anything else leaves, and nothing moves it again."""

import asyncio
import os
import pty
import tty
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import count
from typing import Any

import pytest

from medusa.errors import HostGap, Withdrawn
from medusa.link import Line, Session
from medusa.link.contact import Contact, seconds_suspended
from medusa.link.frame import EVENT, Message, decode_body, encode_frame
from sim_devices.clock import VirtualTimeLoop
from sim_devices.link.device import LinkDevice
from sim_devices.link.faults import FaultPlan
from sim_devices.link.line import Line as EmulatedLine
from tests.medusa.link import toy_operations

HELLO, PING, WATCHDOG = 0x01, 0x02, 0x04
READ, STOP, ACT, MOVE = 0x31, 0x20, 0x32, 0x19
MS_500 = b"\xf4\x01\x00"


@pytest.fixture
def watched(desk: Any) -> Any:
    """An open session whose watchdog of 500 ms was switched on, and answered, at 0 s."""
    desk.ask(WATCHDOG, payload=MS_500)
    desk.answer_last()
    return desk


# What an exchange does, by a clock that the test holds.


def test_a_gap_is_reported_once_and_before_anything_else_leaves(watched: Any) -> None:
    watched.now = 0.61
    frames = len(watched.frames)
    watched.ask(READ, reads=True)
    (gap,) = watched.gaps
    assert watched.frames_at_gap == frames
    assert (gap.device, gap.gap, gap.watchdog) == ("device 01H", pytest.approx(0.61), 0.5)
    assert str(gap) == "device 01H was not fed for 0.61 s: its watchdog of 500 ms stops it"
    watched.now = 3.0
    watched.ask(READ, reads=True)
    watched.let_pass(0.05)
    assert len(watched.gaps) == 1


def test_a_gap_withdraws_every_live_and_queued_motion(watched: Any) -> None:
    live, queued = watched.ask(MOVE, 0, moves=True), watched.ask(MOVE, 0, moves=True)
    read = watched.ask(READ, reads=True)
    sent = len(watched.frames)
    watched.now = 0.6
    # What is due is a repeat of each: the read's goes out, the motion's does not.
    watched.exchange.expire(watched.now)
    for request, may_have_acted in ((live, True), (queued, False)):
        error = watched.error(request)
        assert isinstance(error, Withdrawn)
        assert error.may_have_acted is may_have_acted
        assert "withdrawn after a gap" in str(error)
    assert [m.operation for m in watched.sent[sent:]] == [READ]
    assert read not in watched.results


def test_after_a_gap_reads_and_stops_go_out_and_motion_is_refused_until_a_hello(watched: Any) -> None:
    watched.now = 0.6
    refused = watched.ask(MOVE, 0, moves=True)
    assert isinstance(watched.error(refused), HostGap)
    for operation, does in ((READ, "reads"), (ACT, "urgent"), (STOP, "stops")):
        watched.ask(operation, 0, **({} if does == "urgent" else {does: True}))
        assert watched.sent[-1].operation == operation
        watched.answer_last()
    assert isinstance(watched.error(watched.ask(MOVE, 0, moves=True)), HostGap)
    watched.ask(HELLO, payload=b"\x01\x00")
    watched.answer_last(b"\x01\x00" + bytes(8))
    watched.ask(MOVE, 0, moves=True)
    assert watched.sent[-1].operation == MOVE


def test_a_hello_ends_the_watching_too_for_it_switches_the_watchdog_off(watched: Any) -> None:
    watched.ask(HELLO, payload=b"\x01\x00")
    watched.answer_last(b"\x01\x00" + bytes(8))
    watched.now = 100.0
    watched.ask(MOVE, 0, moves=True)
    assert watched.gaps == []


def test_a_watchdog_that_is_off_or_refused_is_not_watched(desk: Any) -> None:
    desk.ask(WATCHDOG, payload=MS_500)
    desk.answer_last(status=4)
    desk.now = 10.0
    desk.ask(READ, reads=True)
    desk.answer_last()
    desk.ask(WATCHDOG, payload=MS_500)
    desk.answer_last()
    desk.ask(WATCHDOG, payload=b"\0\0\0")
    desk.answer_last()
    desk.now = 20.0
    desk.ask(MOVE, 0, moves=True)
    assert desk.gaps == []


def test_a_device_was_fed_by_the_first_sending_of_the_last_answered_request(watched: Any) -> None:
    watched.now = 0.3
    watched.ask(READ, reads=True)
    watched.let_pass(0.15)
    # Sent again at 0.4 s and answered now: the answer may be to either sending.
    watched.answer_last()
    watched.now = 0.3 + 0.48
    watched.ask(READ, reads=True)
    assert watched.gaps == []
    watched.now = 0.3 + 0.51
    watched.ask(READ, reads=True)
    assert len(watched.gaps) == 1


def test_nobody_is_fed_by_what_is_not_answered(watched: Any) -> None:
    for _ in range(6):
        watched.ask(READ, reads=True)
        watched.let_pass(0.08)
    assert watched.gaps == []
    watched.let_pass(0.02)
    # The repeat that was due at 0.5 s found it.
    assert len(watched.gaps) == 1
    assert isinstance(watched.error(watched.ask(MOVE, 0, moves=True)), HostGap)


def test_what_would_arrive_too_late_leaves_too_late(watched: Any) -> None:
    # A frame takes a moment to its device: 5 ms before the end is no time.
    watched.now = 0.495
    assert isinstance(watched.error(watched.ask(MOVE, 0, moves=True)), HostGap)


def test_an_answer_after_the_watchdogs_time_shows_a_gap_too(watched: Any) -> None:
    watched.now = 0.48
    watched.ask(MOVE, 0, moves=True)
    assert watched.gaps == []
    # Slow on the line: whether it came in time nobody knows.
    watched.now = 0.52
    watched.answer_last()
    assert len(watched.gaps) == 1


def test_a_gap_is_noticed_before_an_event_is_acknowledged(watched: Any) -> None:
    frames = len(watched.frames)
    watched.now = 2.0
    watched.exchange.receive(Message(1, EVENT, 0, 0x44, 0, b"\0"), watched.now)
    assert (len(watched.gaps), watched.frames_at_gap, len(watched.frames)) == (1, frames, frames + 1)


def test_time_in_suspension_counts(watched: Any) -> None:
    watched.now = 0.1
    watched.suspended = 30.0
    watched.ask(READ, reads=True)
    (gap,) = watched.gaps
    assert gap.gap == pytest.approx(30.1)


def test_the_clocks_jitter_is_no_suspension(watched: Any) -> None:
    # Two clocks that are read one after the other differ by a little more or less each time.
    for step, jitter in enumerate((0.004, -0.003, 0.009, 0.0)):
        watched.now, watched.suspended = 0.488 * (step + 1), jitter
        watched.ask(READ, reads=True)
        watched.answer_last()
    assert watched.gaps == []


def test_this_hosts_suspension_is_read_from_its_own_clocks() -> None:
    readings = [seconds_suspended() for _ in range(100)]
    assert min(readings) > -1e-3
    # Nobody suspends this machine between two lines; a pause between two clocks only makes less of it.
    assert max(readings) - readings[0] < 1e-2
    contact = Contact("device 01H")
    assert contact.time(5.0) == 5.0


# What a session and a line do, in virtual time.


@asynccontextmanager
async def moving(
    device: LinkDevice, suspended: Callable[[], float] = lambda: 0.0, faults: FaultPlan | None = None
) -> AsyncIterator[tuple[Line, Session, list[HostGap]]]:
    """A session with a watchdog of 500 ms whose device has been told to move."""
    device.journal = []
    async with (
        EmulatedLine([device], faults=faults) as emulated,
        Line(emulated.path, seed=1, suspended=suspended) as line,
    ):
        session = line.session(1)
        gaps: list[HostGap] = []
        session.on_gap(gaps.append)
        await session.open()
        await session.event_mask(0xFFFFFFFF)
        await session.watchdog(500)
        await session.request(toy_operations.MOVE, 0)
        yield line, session, gaps


def executed(device: LinkDevice) -> list[int]:
    return [entry.operation for entry in device.journal or []]


async def assert_nothing_moves_before_open(device: LinkDevice, session: Session) -> None:
    before = executed(device).count(toy_operations.MOVE.code)
    for _ in range(20):
        with pytest.raises(HostGap, match="was not fed for"):
            await session.request(toy_operations.MOVE, 0)
        await session.ping()
        await asyncio.sleep(0.1)
    assert not session.may_move
    assert executed(device).count(toy_operations.MOVE.code) == before
    await session.open()
    await session.request(toy_operations.MOVE, 0)
    assert executed(device).count(toy_operations.MOVE.code) == before + 1


async def test_a_suspended_host_moves_nothing_when_it_wakes_up(toy: Any) -> None:
    device, away = LinkDevice(1, toy, boot_count=7), [0.0]
    async with moving(device, suspended=lambda: away[0]) as (_, session, gaps):
        # A jump of the clock alone: the emulated device sees no time pass, so its event cannot help.
        away[0] = 3600.0
        with pytest.raises(HostGap, match=r"not fed for 3600\.0. s"):
            await session.request(toy_operations.MOVE, 0)
        assert len(gaps) == 1
        await assert_nothing_moves_before_open(device, session)


@pytest.mark.parametrize("event", ["kept", "lost"])
async def test_an_event_loop_blocked_by_its_own_work_moves_nothing_afterwards(toy: Any, event: str) -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    device = LinkDevice(1, toy, boot_count=7)
    # Six copies of the watchdog's event within half a second of its end at 0.52 s.
    lost = (
        FaultPlan(seed=1, drop=1.0, direction="to_host", start_s=0.1, end_s=1.2) if event == "lost" else None
    )
    async with moving(device, faults=lost) as (_, session, gaps):
        renewing = asyncio.create_task(_renew(session))
        await asyncio.sleep(0.07)
        loop.block(1.5)
        with pytest.raises((HostGap, Withdrawn)):
            await renewing
        assert len(gaps) == 1
        # The emulated device sees the time pass when its line is next served.
        await asyncio.sleep(0.001)
        assert not toy.moving
        await assert_nothing_moves_before_open(device, session)


async def _renew(session: Session) -> None:
    while True:
        await session.request(toy_operations.MOVE, 0)
        await asyncio.sleep(0.05)


async def test_polls_that_find_the_gap_first_do_not_hide_it(toy: Any) -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    device = LinkDevice(1, toy, boot_count=7)
    async with moving(device) as (line, session, gaps):
        loop.block(0.7)
        assert line.ping_all()
        assert len(gaps) == 1
        for _ in range(3):
            await session.request(toy_operations.READ)
        await session.request(toy_operations.STOP)
        await assert_nothing_moves_before_open(device, session)
        assert len(gaps) == 1


async def test_a_broadcast_ping_feeds_nobody_of_whom_nothing_is_heard(toy: Any) -> None:
    device = LinkDevice(1, toy, boot_count=7)
    async with moving(device) as (line, session, gaps):
        for _ in range(4):
            await asyncio.sleep(0.1)
            line.ping_all()
        assert gaps == []
        await asyncio.sleep(0.1)
        line.ping_all()
        assert len(gaps) == 1
        assert not session.may_move


async def test_how_long_a_device_has_not_been_fed_can_be_asked(toy: Any) -> None:
    device = LinkDevice(1, toy, boot_count=7)
    async with moving(device) as (_, session, _gaps):
        await asyncio.sleep(0.2)
        # The motion was sent at once before its answer, two milliseconds on the line.
        assert session.unfed == pytest.approx(0.202, abs=0.002)
        await session.ping()
        assert session.unfed == pytest.approx(0.002, abs=0.001)


async def test_a_motion_that_waits_in_a_stuck_port_does_not_leave_after_a_gap() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    try:
        async with Line(os.ttyname(slave)) as line:
            session = line.session(1)

            def reply(number: int, operation: int, payload: bytes = b"") -> None:
                os.write(master, encode_frame(Message(1, 1, number, operation, 0, payload)))

            opening = asyncio.create_task(session.open())
            await asyncio.sleep(0.001)
            nonce = os.read(master, 100)
            reply(0, HELLO, _nonce_of(nonce) + b"\x01\x09\x02\x01\x07\x00")
            await opening
            arming = asyncio.create_task(session.watchdog(500))
            await asyncio.sleep(0.001)
            reply(1, WATCHDOG)
            await arming
            os.read(master, 100)
            # The peer stops reading until the driver takes no more; then a motion is asked for.
            while not line._port.backlog_bytes:
                line.write(b"\x01" * 63 + b"\0")
            motion = asyncio.create_task(session.request(toy_operations.MOVE, 0))
            await asyncio.sleep(0)
            loop.block(2.0)
            got = b""
            for _ in count():
                try:
                    got += os.read(master, 4096)
                except BlockingIOError:
                    if not line._port.backlog_bytes:
                        break
                    await asyncio.sleep(0)
            with pytest.raises(Withdrawn, match="it did not act"):
                await motion
            assert bytes((1, 2, toy_operations.MOVE.code)) not in got
            assert len(got) % 64 == 0
    finally:
        os.close(master)
        os.close(slave)


def _nonce_of(frame: bytes) -> bytes:
    message = decode_body(frame[:-1])
    assert isinstance(message, Message)
    return message.payload
