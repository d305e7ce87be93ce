"""Every operation and refusal of the base's page, asked for over the link by the driver's messages."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from math import radians

import pytest

from labmate.driver import messages as m
from labmate.driver.messages import BaseEvent, Ending, Flags, Message, Mode, SetLimits
from labmate.simulation import SimulatedBase, simulated_base
from medusa.errors import CommandError, NoReply
from medusa.link import Event, Line, Operation, Session


@pytest.fixture
async def sim() -> AsyncIterator[SimulatedBase]:
    async with simulated_base(seed=1) as simulated:
        yield simulated


@pytest.fixture
async def session(sim: SimulatedBase) -> AsyncIterator[Session]:
    async with Line(sim.port, seed=1) as line:
        opened = line.session(m.DEFAULT_ADDRESS)
        await opened.open()
        await opened.event_mask(m.EVENT_MASK)
        yield opened


async def ask(
    session: Session, operation: Operation, message: Message | bytes = b"", axis: int = 0x0F
) -> bytes:
    payload = message if isinstance(message, bytes) else message.encode()
    return await session.request(operation, axis, payload)


async def status(session: Session) -> m.StatusReply:
    return m.StatusReply.decode(await ask(session, m.STATUS))


async def nothing(session: Session, sim: SimulatedBase) -> None:
    assert (await status(session)).mode is Mode.IDLE


async def driving(session: Session, sim: SimulatedBase) -> None:
    await ask(session, m.DRIVE, m.Drive(0.1, 0.0, 2.0))
    await asyncio.sleep(0.5)
    assert (await status(session)).mode is Mode.DRIVE


async def going(session: Session, sim: SimulatedBase) -> None:
    await ask(session, m.GO, m.Go(1.0))
    await asyncio.sleep(0.5)
    assert (await status(session)).mode is Mode.GO


async def turning(session: Session, sim: SimulatedBase) -> None:
    await ask(session, m.TURN, m.Turn(1.0))
    await asyncio.sleep(0.5)
    assert (await status(session)).mode is Mode.TURN


async def stopping(session: Session, sim: SimulatedBase) -> None:
    await going(session, sim)
    await ask(session, m.STOP)
    await asyncio.sleep(0.05)
    assert (await status(session)).mode is Mode.STOPPING


async def latched(session: Session, sim: SimulatedBase) -> None:
    await session.emergency_stop()
    found = await status(session)
    assert found.flags & Flags.EMERGENCY_STOP
    assert not found.flags & Flags.MOTOR_POWER


async def low(session: Session, sim: SimulatedBase) -> None:
    sim.bench.inject("base.drain_battery", volts=21.5)
    assert (await status(session)).flags & Flags.BATTERY_LOW


def touching(side: str, flag: Flags) -> Callable[[Session, SimulatedBase], Awaitable[None]]:
    async def press(session: Session, sim: SimulatedBase) -> None:
        sim.bench.inject("base.press_bumper", side=side)
        assert (await status(session)).flags & flag

    press.__name__ = f"touching_{side}"
    return press


front, rear = touching("front", Flags.FRONT_BUMPER), touching("rear", Flags.REAR_BUMPER)
left, right = touching("left", Flags.LEFT_BUMPER), touching("right", Flags.RIGHT_BUMPER)

OK = SetLimits(0.2, radians(10.0), 0.2, radians(20.0))
SLOW, BACK, SPIN = m.Drive(0.05, 0.0, 0.3), m.Drive(-0.05, 0.0, 0.3), m.Drive(0.0, 0.1, 0.3)
GO, BACK_UP, TURN, SET = m.Go(0.1), m.Go(-0.1), m.Turn(0.1), m.SetPose(1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("setting", "operation", "message", "answer"),
    [
        (nothing, Operation(0x39, "unknown"), b"", 1),
        (nothing, Operation(0x2F, "unknown"), b"", 1),
        (nothing, m.POSE, b"\0", 3),
        (nothing, m.GO, b"\0\0", 3),
        (nothing, m.DRIVE, b"", 3),
        (nothing, m.STOP, b"\0", 3),
        # SET_POSE: mode 0 and both wheels at rest, else 6.
        (nothing, m.SET_POSE, SET, 0),
        (driving, m.SET_POSE, SET, 6),
        (going, m.SET_POSE, SET, 6),
        (stopping, m.SET_POSE, SET, 6),
        (latched, m.SET_POSE, SET, 0),
        # DRIVE: modes 0, 1 and 4; valid 1–2000 ms; within the limits.
        (nothing, m.DRIVE, SLOW, 0),
        (driving, m.DRIVE, SLOW, 0),
        (stopping, m.DRIVE, SLOW, 0),
        (going, m.DRIVE, SLOW, 11),
        (turning, m.DRIVE, SLOW, 11),
        (latched, m.DRIVE, SLOW, 9),
        (low, m.DRIVE, SLOW, 0),
        (nothing, m.DRIVE, m.Drive(0.05, 0.0, 0.0), 4),
        (nothing, m.DRIVE, m.Drive(0.05, 0.0, 2.001), 4),
        (nothing, m.DRIVE, m.Drive(0.05, 0.0, 2.0), 0),
        (nothing, m.DRIVE, m.Drive(0.3001, 0.0, 0.3), 4),
        (nothing, m.DRIVE, m.Drive(-0.3001, 0.0, 0.3), 4),
        (nothing, m.DRIVE, m.Drive(0.0, radians(15.01), 0.3), 4),
        (nothing, m.DRIVE, m.Drive(0.3, radians(-15.0), 0.3), 0),
        # GO and TURN: mode 0, else 11.
        (nothing, m.GO, GO, 0),
        (driving, m.GO, GO, 11),
        (going, m.GO, GO, 11),
        (turning, m.GO, GO, 11),
        (stopping, m.GO, GO, 11),
        (latched, m.GO, GO, 9),
        (low, m.GO, GO, 6),
        (nothing, m.TURN, TURN, 0),
        (driving, m.TURN, TURN, 11),
        (going, m.TURN, TURN, 11),
        (stopping, m.TURN, TURN, 11),
        (latched, m.TURN, TURN, 9),
        (low, m.TURN, TURN, 0),
        # Bumpers refuse motion toward them and every turn, and allow motion away.
        (front, m.GO, GO, 8),
        (front, m.GO, BACK_UP, 0),
        (front, m.TURN, TURN, 8),
        (front, m.DRIVE, SLOW, 8),
        (front, m.DRIVE, BACK, 0),
        (front, m.DRIVE, SPIN, 8),
        (rear, m.GO, BACK_UP, 8),
        (rear, m.GO, GO, 0),
        (rear, m.DRIVE, BACK, 8),
        (rear, m.DRIVE, SLOW, 0),
        (rear, m.TURN, TURN, 8),
        (left, m.TURN, TURN, 8),
        (left, m.GO, GO, 0),
        (left, m.DRIVE, SPIN, 8),
        (right, m.TURN, TURN, 8),
        (right, m.DRIVE, BACK, 0),
        # LIMITS: mode 0 only, else 6; a zero, over 1 m/s or 327.67 °/s: 4.
        (nothing, m.LIMITS, OK, 0),
        (driving, m.LIMITS, OK, 6),
        (going, m.LIMITS, OK, 6),
        (latched, m.LIMITS, OK, 0),
        (nothing, m.LIMITS, SetLimits(1.0, radians(327.67), 0.2, 0.2), 0),
        (nothing, m.LIMITS, SetLimits(1.0001, 0.2, 0.2, 0.2), 4),
        (nothing, m.LIMITS, SetLimits(0.2, radians(327.68), 0.2, 0.2), 4),
        (nothing, m.LIMITS, SetLimits(0.0, 0.2, 0.2, 0.2), 4),
        (nothing, m.LIMITS, SetLimits(0.2, 0.0, 0.2, 0.2), 4),
        (nothing, m.LIMITS, SetLimits(0.2, 0.2, 0.0, 0.2), 4),
        (nothing, m.LIMITS, SetLimits(0.2, 0.2, 0.2, 0.0), 4),
        # Always accepted.
        (nothing, m.STOP, b"", 0),
        (latched, m.STOP, b"", 0),
        (front, m.STOP, b"", 0),
        (turning, m.STOP, b"", 0),
        (latched, m.POSE, b"", 0),
        (going, m.ENCODERS, b"", 0),
    ],
)
async def test_the_base_answers_as_its_page_says(
    session: Session,
    sim: SimulatedBase,
    setting: Callable[[Session, SimulatedBase], Awaitable[None]],
    operation: Operation,
    message: Message | bytes,
    answer: int,
) -> None:
    await setting(session, sim)
    if answer == 0:
        await ask(session, operation, message)
        return
    with pytest.raises(CommandError) as refused:
        await ask(session, operation, message)
    assert refused.value.status == answer


@pytest.mark.parametrize("operation", [m.POSE, m.STOP, m.STATUS, m.ENCODERS])
async def test_another_axis_is_refused(session: Session, operation: Operation) -> None:
    with pytest.raises(CommandError) as refused:
        await ask(session, operation, axis=0)
    assert refused.value.status == 2


async def test_clear_takes_the_whole_device_only_and_the_watchdog_only_its_ramp(session: Session) -> None:
    with pytest.raises(CommandError) as refused:
        await session.clear(0)
    assert refused.value.status == 2
    with pytest.raises(CommandError) as refused:
        await session.watchdog(500, 1)
    assert refused.value.status == 4
    await session.watchdog(500, 0)


@pytest.mark.parametrize(
    ("verb", "arguments", "event", "detail", "ending"),
    [
        ("base.press_bumper", {"side": "front"}, m.EVENT_BUMPER, m.Bumper.FRONT, Ending.BUMPER),
        ("base.press_bumper", {"side": "rear"}, m.EVENT_BUMPER, m.Bumper.REAR, Ending.BUMPER),
        ("base.press_bumper", {"side": "left"}, m.EVENT_BUMPER, m.Bumper.LEFT, Ending.BUMPER),
        ("base.press_bumper", {"side": "right"}, m.EVENT_BUMPER, m.Bumper.RIGHT, Ending.BUMPER),
        ("base.press_emergency_stop", {}, m.EVENT_EMERGENCY_STOP, None, Ending.EMERGENCY_STOP),
        ("base.hold_wheels", {"held": True}, m.EVENT_STALLED, None, Ending.STALLED),
        ("wire.stall", {"line": "labmate", "seconds": 0.7}, m.EVENT_WATCHDOG, None, Ending.WATCHDOG),
        ("base.drain_battery", {"volts": 21.0}, m.EVENT_BATTERY_LOW, None, Ending.REACHED),
    ],
)
async def test_every_event_comes_once_with_the_end_of_the_motion(
    session: Session,
    sim: SimulatedBase,
    verb: str,
    arguments: dict[str, object],
    event: int,
    detail: int,
    ending: Ending,
) -> None:
    heard: list[Event] = []
    session.subscribe(heard.append)
    await session.watchdog(300, 0)
    await ask(session, m.GO, m.Go(0.6))

    async def feed() -> None:
        while True:
            with suppress(NoReply):
                await session.ping()
            await asyncio.sleep(0.1)

    feeding = asyncio.create_task(feed())
    await asyncio.sleep(1.0)
    sim.bench.inject(verb, **arguments)
    await asyncio.sleep(4.0)
    feeding.cancel()
    assert sorted(e.operation for e in heard) == sorted([event, m.EVENT_MOTION_DONE])
    contents = {e.operation: BaseEvent.decode(e.payload) for e in heard}
    assert contents[m.EVENT_MOTION_DONE].detail == ending
    if detail is not None:
        assert contents[event].detail == detail
    assert {e.axis for e in heard} == {0}
    assert contents[event].time_us <= contents[m.EVENT_MOTION_DONE].time_us


async def test_a_stop_and_a_drive_end_a_go_with_one_event(session: Session) -> None:
    heard: list[Event] = []
    session.subscribe(heard.append)
    await ask(session, m.GO, m.Go(1.0))
    await asyncio.sleep(1.0)
    await ask(session, m.STOP)
    await asyncio.sleep(0.1)
    # A DRIVE in mode 4 after the STOP of a GO makes that GO's event 50 at once.
    await ask(session, m.DRIVE, m.Drive(0.1, 0.0, 0.3))
    await asyncio.sleep(0.02)
    assert [BaseEvent.decode(e.payload).detail for e in heard] == [Ending.STOP]
    await asyncio.sleep(3.0)
    assert len(heard) == 1
