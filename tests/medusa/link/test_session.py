"""Sessions on an emulated line: opening, losing, coming back, stopping everybody."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from medusa.errors import CommandError, DeviceRestarted, DeviceSilent, MedusaError, NoReply, PortError
from medusa.link import Event, Line, Operation
from medusa.link.messages import EMERGENCY_STOP
from sim_devices.link.device import Application, LinkDevice
from sim_devices.link.faults import FaultPlan
from sim_devices.link.line import Line as EmulatedLine
from tests.medusa.link.toy_operations import MOVE, RAISE_EVENT, READ, SET


@asynccontextmanager
async def connected(
    *devices: LinkDevice, faults: FaultPlan | None = None
) -> AsyncIterator[tuple[EmulatedLine, Line]]:
    for device in devices:
        device.journal = []
    async with (
        EmulatedLine(list(devices), faults=faults) as emulated,
        Line(emulated.path, seed=1) as line,
    ):
        yield emulated, line


def journal(device: LinkDevice, operation: Operation) -> list[object]:
    return [entry for entry in device.journal or [] if entry.operation == operation.code]


async def test_hello_tells_what_the_device_is(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        hello = await line.session(1).open()
        assert (hello.protocol, hello.device_type, hello.firmware, hello.boot_count) == (1, 9, 0x0102, 7)
        assert hello.part == b"toy"
        assert line.session(1).generation == 1


async def test_the_shared_operations_have_their_names(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        session = line.session(1)
        await session.open()
        await asyncio.sleep(1.0)
        # Microseconds since power-up at 0; the emulator stamps it a byte's time or more after it was asked.
        assert 1_000_000 < await session.ping() < 1_010_000
        assert (await session.statistics()).frames == 3
        await session.watchdog(500)
        await session.watchdog(0)
        await session.emergency_stop()
        await session.clear()
        with pytest.raises(CommandError, match="device 01H, WATCHDOG: out of range"):
            await session.watchdog(500, action=3)


async def test_before_open_nothing_can_be_asked(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        with pytest.raises(CommandError, match="no session is open"):
            await line.session(1).ping()
        with pytest.raises(CommandError, match="no motion before"):
            await line.session(1).request(MOVE, 0)


async def test_an_operation_on_one_axis_is_refused_when_none_is_given(toy: Application) -> None:
    device = LinkDevice(1, toy, boot_count=7)
    async with connected(device) as (_, line):
        await line.session(1).open()
        with pytest.raises(CommandError, match="device 01H, MOVE: is for one axis, none was given"):
            await line.session(1).request(MOVE)
        assert journal(device, MOVE) == []


async def test_a_line_that_is_not_open_says_so() -> None:
    with pytest.raises(PortError, match="not open"):
        await Line("/dev/x").session(1).ping()


@pytest.mark.parametrize("address", [0, 0x7F, -1])
def test_addresses_go_from_01_to_7e(address: int) -> None:
    with pytest.raises(ValueError, match="allowed 01H–7EH"):
        Line("/dev/x").session(address)


async def test_forty_four_of_fifty_answers_are_not_wrong_after_one_late_reply(toy: Application) -> None:
    # The usual lock-write-read driver answers every later request with its predecessor's reply.
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        session = line.session(1)
        await session.open()
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.001):
                await session.request(READ, payload=b"lost")
        for number in range(50):
            mark = number.to_bytes(4, "little")
            assert (await session.request(READ, payload=mark))[4:] == mark
        assert session.counters.late_replies == 1


async def test_requests_of_many_tasks_each_get_their_own_reply(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        session = line.session(1)
        await session.open()
        marks = [number.to_bytes(4, "little") for number in range(200)]
        replies = await asyncio.gather(*(session.request(READ, payload=mark) for mark in marks))
        assert [reply[4:] for reply in replies] == marks


async def test_events_reach_every_stream_and_subscriber_once(toy: Application) -> None:
    # Each frame comes twice, so that acknowledgements and copies cross.
    async with connected(LinkDevice(1, toy, boot_count=7), faults=FaultPlan(seed=1, double=1.0)) as (_, line):
        session = line.session(1)
        await session.open()
        await session.event_mask(0xFFFFFFFF)
        called: list[Event] = []
        leave = session.subscribe(called.append)
        first, second = session.events(), session.events()
        for number in range(3):
            await session.request(RAISE_EVENT, 1, bytes([0x41, number]))
        await asyncio.sleep(1.0)
        leave()
        await session.request(RAISE_EVENT, 1, b"\x42x")
        assert [event.payload for event in called] == [b"\0", b"\1", b"\2"]
        for stream in (first, second):
            assert [(await anext(stream)).payload for _ in range(4)] == [b"\0", b"\1", b"\2", b"x"]
        assert session.counters.events_repeated > 0


async def test_a_stream_ends_with_the_line(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        stream = line.session(1).events()
        reader = asyncio.create_task(anext(stream, None))
        await asyncio.sleep(0)
        await line.close()
        assert await reader is None


async def test_a_callback_that_fails_does_not_keep_the_others_from_hearing(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (_, line):
        session = line.session(1)
        await session.open()
        await session.event_mask(0xFFFFFFFF)
        heard: list[Event] = []
        session.subscribe(lambda event: 1 / 0)
        session.subscribe(heard.append)
        await session.request(RAISE_EVENT, 1, b"\x41")
        assert len(heard) == 1


async def test_a_vanished_port_ends_every_pending_request_at_once(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=7)) as (emulated, line):
        session = line.session(1)
        await session.open()
        lost: list[MedusaError] = []
        session.on_lost(lost.append)
        loop = asyncio.get_running_loop()
        pending = [asyncio.create_task(session.request(READ)) for _ in range(8)]
        await asyncio.sleep(0)
        start = loop.time()
        emulated.unplug()
        results = await asyncio.gather(*pending, return_exceptions=True)
        assert loop.time() - start < 0.01
        assert all(isinstance(result, PortError) for result in results)
        # Four had been sent, four waited for a place.
        assert [result.may_have_acted for result in results] == [True] * 4 + [False] * 4
        assert [type(error) for error in lost] == [PortError]
        with pytest.raises(PortError, match="being opened again"):
            await session.ping()


async def test_a_port_that_comes_back_is_opened_and_greeted_and_nothing_moves_before_open(
    toy: Application,
) -> None:
    device = LinkDevice(1, toy, boot_count=7)
    async with connected(device) as (emulated, line):
        session = line.session(1)
        await session.open()
        moving = asyncio.create_task(session.request(MOVE, 0))
        await asyncio.sleep(0)
        emulated.unplug()
        with pytest.raises(PortError, match="may have acted"):
            await moving
        before = len(journal(device, MOVE))
        await asyncio.sleep(5.0)
        emulated.plug()
        await asyncio.sleep(3.0)
        assert session.is_open
        assert session.generation == 2
        await session.ping()
        with pytest.raises(CommandError, match="no motion before"):
            await session.request(MOVE, 0)
        assert len(journal(device, MOVE)) == before
        await session.open()
        await session.request(MOVE, 0)
        assert len(journal(device, MOVE)) == before + 1


async def test_reopening_is_tried_with_growing_pauses(
    toy: Application, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG", "medusa.link.line")
    async with connected(LinkDevice(1, toy, boot_count=7)) as (emulated, line):
        await line.session(1).open()
        emulated.unplug()
        await asyncio.sleep(60.0)
        tries = [record for record in caplog.records if "not recovered" in record.message]
        # 0.1, 0.2, 0.4 … 1.6 s, then every 2 s: 5 + 28 or so in a minute.
        assert 25 < len(tries) < 40


async def test_a_restarted_device_is_reported_with_both_boot_counts(toy: Application) -> None:
    device = LinkDevice(1, toy, boot_count=7)
    async with connected(device) as (_, line):
        session = line.session(1)
        await session.open()
        restarts: list[MedusaError] = []
        lost: list[MedusaError] = []
        session.on_restart(restarts.append)
        session.on_lost(lost.append)
        device.restart(asyncio.get_running_loop().time())
        with pytest.raises(DeviceRestarted):
            await session.request(SET, 0, b"\x05")
        await asyncio.sleep(1.0)
        (restart,) = restarts
        assert isinstance(restart, DeviceRestarted)
        assert (restart.before, restart.now) == (7, 8)
        assert "boot count 7, now 8" in str(restart)
        assert [type(error) for error in lost] == [DeviceRestarted]
        assert not session.may_move


async def test_a_silent_device_is_greeted_until_it_answers_and_no_broadcast_ping_goes_out(
    toy: Application,
) -> None:
    # Loses everything for three seconds.
    deaf = FaultPlan(seed=1, drop=1.0, start_s=1.0, end_s=4.0)
    device = LinkDevice(1, toy, boot_count=7)
    async with connected(device, faults=deaf) as (_, line):
        session = line.session(1)
        await session.open()
        assert line.ping_all()
        await asyncio.sleep(1.1)
        with pytest.raises(NoReply):
            await session.ping()
        assert line.ping_all()
        await asyncio.sleep(0.8)
        assert session.is_silent
        assert not line.ping_all()
        with pytest.raises(DeviceSilent):
            await session.ping()
        await asyncio.sleep(5.0)
        assert session.is_open
        assert line.ping_all()
        await session.ping()
        assert not session.may_move


async def test_a_broadcast_ping_feeds_every_watchdog(toy: Application) -> None:
    devices = LinkDevice(1, toy, boot_count=1), LinkDevice(2, type(toy)(), boot_count=2)
    async with connected(*devices) as (_, line):
        sessions = line.session(1), line.session(2)
        for session in sessions:
            await session.open()
            await session.watchdog(200)
        for _ in range(20):
            await asyncio.sleep(0.1)
            assert line.ping_all()
        assert [(await session.statistics()).watchdog_trips for session in sessions] == [0, 0]
        await asyncio.sleep(0.5)
        assert [(await session.statistics()).watchdog_trips for session in sessions] == [1, 1]


async def test_an_emergency_stop_of_the_line_is_sent_three_times_and_then_to_each_address(
    toy: Application,
) -> None:
    first, second = LinkDevice(1, toy, boot_count=1), LinkDevice(2, type(toy)(), boot_count=2)
    async with connected(first, second) as (_, line):
        await line.session(1).open()
        line.session(2)
        moving = [asyncio.create_task(line.session(1).request(MOVE, axis)) for axis in (0, 1, 2)]
        await asyncio.sleep(0)
        await line.emergency_stop()
        results = await asyncio.gather(*moving, return_exceptions=True)
        assert all(isinstance(result, NoReply) for result in results)
        # Also a device that no HELLO opened stops.
        assert len(journal(first, EMERGENCY_STOP)) == len(journal(second, EMERGENCY_STOP)) == 4
        assert toy.latched


async def test_an_emergency_stop_that_a_device_does_not_confirm_names_it(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=1)) as (_, line):
        line.session(1)
        line.session(0x22)
        with pytest.raises(NoReply, match="not confirmed by 22H"):
            await line.emergency_stop()
        assert toy.latched


async def test_an_emergency_stop_on_a_vanished_port_is_a_port_error(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=1)) as (emulated, line):
        await line.session(1).open()
        emulated.unplug()
        await asyncio.sleep(0.01)
        with pytest.raises(PortError):
            await line.emergency_stop()


async def test_two_devices_on_one_line_are_asked_at_once(toy: Application) -> None:
    async with connected(LinkDevice(1, toy, boot_count=1), LinkDevice(2, type(toy)(), boot_count=2)) as (
        _,
        line,
    ):
        one, two = line.session(1), line.session(2)
        await asyncio.gather(one.open(), two.open())
        loop = asyncio.get_running_loop()
        start = loop.time()
        await one.ping()
        alone = loop.time() - start
        start = loop.time()
        await asyncio.gather(one.ping(), two.ping())
        assert loop.time() - start < 1.8 * alone


async def test_several_clients_in_turn_find_the_line_free(toy: Application) -> None:
    async with EmulatedLine([LinkDevice(1, toy, boot_count=7)]) as emulated:
        for _ in range(3):
            async with Line(emulated.path) as line:
                assert (await line.session(1).open()).boot_count == 7
            with pytest.raises(PortError, match="closed"):
                await line.session(1).ping()
