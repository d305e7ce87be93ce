"""What every mobile base has to do: one body of tests, over any driver. Tolerances come from its capabilities.

A base subclasses `MobileBaseContract` as a `Test…` class and gives `machine()`. An incident that it cannot have is
named in `lacks`; what needs it is skipped by that name.
"""

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from math import degrees, inf, nan

import pytest

from labmate.base import BaseReading, Cause, MobileBase, Motion
from labmate.base.events import Event, Stopped
from labmate.errors import MotionStopped, StalePose, StopNotConfirmed
from labmate.odometry import Pose
from labmate.testing.cancellation import PROGRAMS, cancel_at_random
from medusa.errors import CommandError, DeviceFault, HostGap, MedusaError
from sim_devices.clock import VirtualTimeLoop

INCIDENTS = frozenset(
    {
        "front bumper pressed",
        "front bumper released",
        "emergency stop pressed",
        "emergency stop released",
        "wheels held",
        "wheels released",
        "host not heard for 0.8 s",
        "what the machine sends is lost for 2 s",
        "line lost",
        "line back",
        "restart",
        "host suspended for an hour",
    }
)
REASONS = {
    "front bumper pressed": ("bumper",),
    "emergency stop pressed": ("emergency stop",),
    "wheels held": ("stalled",),
    # Whether its watchdog or the missing answers are noticed first is the line's matter.
    "host not heard for 0.8 s": ("watchdog", "line lost"),
    "line lost": ("line lost",),
    "restart": ("restart",),
}
SHARE = 0.8
"""Of the limits, for what is driven by twists."""
LOOK = 0.1
"""Two looks at the base in 50 ms, s: how late a confirmation may be."""


@dataclass(frozen=True)
class Truth:
    """Where the machine really is and how it really moves; m, rad, m/s, rad/s."""

    pose: Pose
    speed: float
    turn_rate: float

    @property
    def moving(self) -> bool:
        return self.speed != 0.0 or self.turn_rate != 0.0


@dataclass
class World:
    """One machine under test: how a host opens it, the truth about it, and what can happen to it."""

    open: Callable[[], AbstractAsyncContextManager[MobileBase]]
    truth: Callable[[], Truth]
    incidents: Mapping[str, Callable[[], None]]

    def happen(self, name: str) -> None:
        """Disturb the machine; skips the test where it cannot be disturbed so."""
        if name not in self.incidents:
            pytest.skip(f"no incident: {name}")
        self.incidents[name]()

    def require(self, *names: str) -> None:
        """Skip before anything is begun."""
        for name in names:
            if name not in self.incidents:
                pytest.skip(f"no incident: {name}")

    async def record(self, seconds: float, every: float = 0.01) -> list[Truth]:
        """The truth over a time."""
        found = [self.truth()]
        for _ in range(round(seconds / every)):
            await asyncio.sleep(every)
            found.append(self.truth())
        return found

    async def assert_stays(self, seconds: float = 1.5) -> None:
        """Nothing moves, not a hair, for a time."""
        poses = {truth.pose for truth in await self.record(seconds, 0.05)}
        assert len(poses) == 1

    async def assert_rests_within(self, seconds: float) -> None:
        """It comes to rest within a time, and stays."""
        await asyncio.sleep(seconds)
        assert not self.truth().moving
        await self.assert_stays()


@asynccontextmanager
async def moving(world: World, base: MobileBase, turn_rate: float = 0.0) -> AsyncIterator[Motion]:
    """A motion at speed, held for longer than the body takes: what ends it is what the test does."""
    limits = base.limits
    async with base.motion(hold=2.0) as motion:
        motion.twist(SHARE * limits.speed, turn_rate)
        await asyncio.sleep(SHARE * limits.stop_seconds + 5.0 * base.can.lag + 0.2)
        assert world.truth().speed > 0.5 * limits.speed
        motion.twist(SHARE * limits.speed, turn_rate)
        yield motion


@asynccontextmanager
async def ended(reason: str) -> AsyncIterator[None]:
    """The motion inside is expected to end for this reason."""
    with pytest.raises(MotionStopped) as stopped:
        yield
    assert stopped.value.reason == reason


def ramp(base: MobileBase) -> float:
    """Time to come to rest by its ramp: the limits', the body's lag (six of it: 0.25 %), two looks."""
    return base.limits.stop_seconds + 6.0 * base.can.lag + LOOK + base.can.notice


def block(seconds: float) -> None:
    """The event loop's own work takes a while."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    loop.block(seconds)


class MobileBaseContract:
    """The tests; `machine` is what a base gives."""

    lacks: frozenset[str] = frozenset()

    def machine(self) -> AbstractAsyncContextManager[World]:
        """Start the machine, at rest, with nobody connected."""
        raise NotImplementedError("a base gives its machine")

    @pytest.fixture
    async def world(self) -> AsyncIterator[World]:
        async with self.machine() as world:
            yield world

    @pytest.fixture
    async def base(self, world: World) -> AsyncIterator[MobileBase]:
        opened = world.open()
        base = await opened.__aenter__()
        yield base
        # What a test has broken on purpose may keep the stop from being confirmed.
        with contextlib.suppress(MedusaError):
            await opened.__aexit__(None, None, None)

    async def test_every_incident_is_there_or_named_as_lacking(self, world: World) -> None:
        assert set(world.incidents) == INCIDENTS - self.lacks
        # One that lacked everything would be held to nothing.
        assert len(self.lacks) < len(INCIDENTS) / 2

    # Stopping.

    @pytest.mark.parametrize("turning", [0.0, 0.5])
    async def test_a_stop_is_confirmed_when_the_base_is_at_rest_and_not_before(
        self, world: World, base: MobileBase, turning: float
    ) -> None:
        async with ended("stop"), moving(world, base, turning * base.limits.turn_rate):
            loop = asyncio.get_running_loop()
            called = loop.time()
            reading = await base.stop()
            assert not world.truth().moving
            assert reading.at_rest
            assert reading.time >= called
            assert loop.time() - called <= ramp(base)
            await world.assert_stays()

    async def test_a_stop_and_a_start_keep_to_the_acceleration(self, world: World, base: MobileBase) -> None:
        limits = base.limits
        recording = asyncio.create_task(world.record(2.0 * limits.stop_seconds + 1.0, 0.02))
        async with ended("stop"), moving(world, base, SHARE * limits.turn_rate):
            await base.stop()
        seen = await recording
        faster = max(abs(b.speed - a.speed) / 0.02 for a, b in pairwise(seen))
        turning = max(abs(b.turn_rate - a.turn_rate) / 0.02 for a, b in pairwise(seen))
        # The speed of a body whose wheels follow with a lag changes no faster than their reference does.
        assert 0.8 * limits.acceleration < faster <= 1.01 * limits.acceleration
        assert 0.8 * limits.turn_acceleration < turning <= 1.01 * limits.turn_acceleration

    async def test_a_stop_of_a_base_at_rest_is_confirmed_at_once(
        self, world: World, base: MobileBase
    ) -> None:
        loop = asyncio.get_running_loop()
        called = loop.time()
        assert (await base.stop()).at_rest
        assert loop.time() - called < LOOK
        await world.assert_stays(0.5)

    async def test_an_emergency_stop_is_at_once_latched_and_bars_motion_until_it_is_cleared(
        self, world: World, base: MobileBase
    ) -> None:
        async with ended("emergency stop"), moving(world, base):
            before = world.truth()
            reading = await base.emergency_stop()
            assert reading.at_rest
            assert Cause.EMERGENCY_STOP in reading.latched
            run_on = before.speed * (base.can.lag + base.can.notice) + 1e-3
            assert world.truth().pose.distance_to(before.pose) <= run_on
        for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.05, 0.0)):
            with pytest.raises(CommandError, match="emergency stop is latched"):
                await attempt
        await world.assert_stays()
        assert Cause.EMERGENCY_STOP not in (await base.clear()).latched
        await world.assert_stays()
        assert (await base.go(0.1)).ending is Cause.REACHED

    async def test_an_emergency_stop_that_is_not_read_as_latched_is_not_confirmed(
        self, world: World, base: MobileBase
    ) -> None:
        latched = base.driver.read

        async def read() -> BaseReading:
            return replace(await latched(), latched=frozenset())

        base.driver.read = read  # type: ignore[method-assign]
        with pytest.raises(StopNotConfirmed, match="not latched"):
            await base.emergency_stop()
        await world.assert_stays(0.5)

    async def test_who_remembers_an_emergency_stop_over_a_new_connection_is_what_it_says(
        self, world: World
    ) -> None:
        async with world.open() as base:
            await base.emergency_stop()
        async with world.open() as again:
            reading = await again.read()
            assert (Cause.EMERGENCY_STOP in reading.latched) is (again.can.latch == "device")
            await again.clear()

    async def test_an_emergency_stop_whose_cause_remains_is_not_cleared(
        self, world: World, base: MobileBase
    ) -> None:
        world.happen("emergency stop pressed")
        await asyncio.sleep(base.can.notice)
        assert Cause.EMERGENCY_STOP in (await base.read()).latched
        assert Cause.EMERGENCY_STOP in (await base.clear()).latched
        world.happen("emergency stop released")
        assert Cause.EMERGENCY_STOP not in (await base.clear()).latched

    async def test_an_old_reading_confirms_no_stop(self, world: World, base: MobileBase) -> None:
        driver = base.driver
        at_rest = await driver.read()
        fresh, until = driver.read, asyncio.get_running_loop().time() + inf

        async def read() -> BaseReading:
            # What a kept reply or a cache would answer: the base as it was before it moved.
            return at_rest if asyncio.get_running_loop().time() < until else await fresh()

        async with ended("stop"), moving(world, base):
            driver.read = read  # type: ignore[method-assign]
            until = asyncio.get_running_loop().time() + 0.3
            assert world.truth().moving
            await base.stop()
            assert not world.truth().moving

    async def test_leaving_the_base_leaves_it_at_rest(self, world: World) -> None:
        async def fail_in_motion() -> None:
            async with world.open() as base:
                await base.twist(SHARE * base.limits.speed, 0.0)
                await asyncio.sleep(0.8 * base.can.expires)
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            await fail_in_motion()
        assert not world.truth().moving
        await world.assert_stays()

    # Limits.

    @pytest.mark.parametrize(
        ("speed", "turn_rate"), [(1.01, 0.0), (-1.01, 0.0), (0.0, 1.01), (0.0, -1.01), (nan, 0.0), (0.0, inf)]
    )
    async def test_a_twist_over_the_limits_is_refused_and_moves_nothing(
        self, world: World, base: MobileBase, speed: float, turn_rate: float
    ) -> None:
        twist = speed * base.limits.speed, turn_rate * base.limits.turn_rate
        with pytest.raises(CommandError):
            await base.twist(*twist)
        with pytest.raises(CommandError):
            async with base.motion() as motion:
                motion.twist(*twist)
        await world.assert_stays()

    async def test_a_validity_a_hold_or_a_way_out_of_range_is_refused_and_moves_nothing(
        self, world: World, base: MobileBase
    ) -> None:
        for valid in (0.0, -1.0, base.can.expires * 1.01, nan):
            with pytest.raises(CommandError):
                await base.twist(0.05, 0.0, valid)
        for hold in (0.0, 2.01, nan):
            with pytest.raises(CommandError):
                base.motion(hold)
        for way in (nan, inf, -inf):
            with pytest.raises(CommandError):
                await base.go(way)
            with pytest.raises(CommandError):
                await base.turn(way)
        await world.assert_stays()

    # Motion by twists.

    @pytest.mark.parametrize(("ahead", "left"), [(1, 0), (-1, 0), (0, 1), (0, -1), (0.5, 0.5), (1, -1)])
    async def test_a_twist_is_held_forward_and_to_the_left_being_positive(
        self, world: World, base: MobileBase, ahead: float, left: float
    ) -> None:
        speed, turn_rate = ahead * SHARE * base.limits.speed, left * SHARE * base.limits.turn_rate
        async with base.motion(hold=2.0) as motion:
            motion.twist(speed, turn_rate)
            await asyncio.sleep(base.limits.stop_seconds + 6.0 * base.can.lag)
            true, reading = world.truth(), await base.read()
            # Six lags leave 0.25 % of the change; the rest is the rounding of the twist, and of the reading.
            step, turn_step = base.can.twist_step
            assert true.speed == pytest.approx(speed, abs=2 * step + 0.005 * abs(speed))
            assert true.turn_rate == pytest.approx(turn_rate, abs=2 * turn_step + 0.005 * abs(turn_rate))
            assert reading.speed == pytest.approx(true.speed, abs=2 * step + 1e-3)
            assert reading.turn_rate == pytest.approx(true.turn_rate, abs=2 * turn_step + 6e-3)
            assert not reading.at_rest

    async def test_one_twist_runs_out_by_itself(self, world: World, base: MobileBase) -> None:
        await base.twist(SHARE * base.limits.speed, 0.0)
        await asyncio.sleep(0.9 * base.can.expires)
        before = world.truth()
        assert before.moving
        await asyncio.sleep(0.1 * base.can.expires)
        await world.assert_rests_within(ramp(base))

    async def test_a_shorter_validity_ends_sooner(self, world: World, base: MobileBase) -> None:
        await base.twist(SHARE * base.limits.speed, 0.0, base.can.expires / 3.0)
        speeds = [truth.speed for truth in await world.record(base.can.expires)]
        # It was accelerating for a third of the time only.
        reached = base.limits.acceleration * (base.can.expires / 3.0 + LOOK)
        assert 0.0 < max(speeds) <= reached

    async def test_a_task_that_hangs_drives_no_longer_than_its_hold(
        self, world: World, base: MobileBase
    ) -> None:
        async with base.motion(hold=0.5) as motion:
            motion.twist(SHARE * base.limits.speed, 0.0)
            await asyncio.sleep(0.45)
            assert world.truth().speed > 0.0
            await world.assert_rests_within(0.05 + 2.0 * base.can.expires + ramp(base))
            # It wakes up and gives a twist again: that is a new command.
            motion.twist(SHARE * base.limits.speed, 0.0)
            await asyncio.sleep(0.3)
            assert world.truth().speed > 0.0

    async def test_a_task_that_has_ended_drives_no_longer(self, world: World, base: MobileBase) -> None:
        async def drive() -> None:
            motion = await base.motion(hold=2.0).__aenter__()
            motion.twist(SHARE * base.limits.speed, 0.0)
            await asyncio.sleep(1.0)

        await asyncio.create_task(drive())
        assert world.truth().moving
        await world.assert_rests_within(2.0 * base.can.expires + ramp(base))

    async def test_a_twist_by_a_reading_older_than_200_ms_is_refused(
        self, world: World, base: MobileBase
    ) -> None:
        async with base.motion() as motion:
            reading = await base.read()
            motion.twist(0.05, 0.0, by=reading)
            await asyncio.sleep(0.21)
            with pytest.raises(StalePose, match="at most 200 ms"):
                motion.twist(0.05, 0.0, by=reading)

    async def test_one_motion_at_a_time(self, world: World, base: MobileBase) -> None:
        async with moving(world, base):
            for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.05, 0.0)):
                with pytest.raises(CommandError, match="already being moved"):
                    await attempt
            with pytest.raises(CommandError, match="already being moved"):
                async with base.motion():
                    pass
        going = asyncio.create_task(base.go(0.5))
        await asyncio.sleep(0.5)
        for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.05, 0.0)):
            with pytest.raises(CommandError, match="already being moved"):
                await attempt
        assert (await going).ending is Cause.REACHED

    # GO and TURN.

    @pytest.mark.parametrize("distance", [0.6, -0.35, 0.02, 0.0])
    async def test_go_arrives_and_keeps_to_the_limits(
        self, world: World, base: MobileBase, distance: float
    ) -> None:
        arrival = base.can.arrival[0]
        start = world.truth().pose
        going = asyncio.create_task(base.go(distance))
        seen = await world.record(0.5 + abs(distance) / base.limits.speed + base.limits.stop_seconds)
        report = await going
        assert report.ending is Cause.REACHED
        assert report.travelled == pytest.approx(distance, abs=arrival)
        assert world.truth().pose.seen_from(start).x == pytest.approx(distance, abs=2 * arrival)
        assert not world.truth().moving
        assert max(abs(truth.speed) for truth in seen) <= 1.01 * base.limits.speed

    @pytest.mark.parametrize("angle", [0.9, -0.5, 0.01, 0.0])
    async def test_turn_arrives_and_keeps_to_the_limits(
        self, world: World, base: MobileBase, angle: float
    ) -> None:
        arrival = base.can.arrival[1]
        start = world.truth().pose
        turning = asyncio.create_task(base.turn(angle))
        seen = await world.record(0.5 + abs(angle) / base.limits.turn_rate + base.limits.stop_seconds)
        report = await turning
        assert report.ending is Cause.REACHED
        assert report.travelled == pytest.approx(angle, abs=arrival)
        assert world.truth().pose.heading - start.heading == pytest.approx(angle, abs=2 * arrival)
        assert not world.truth().moving
        assert max(abs(truth.turn_rate) for truth in seen) <= 1.01 * base.limits.turn_rate

    async def test_go_and_turn_in_a_row_end_where_they_should(self, world: World, base: MobileBase) -> None:
        start = world.truth().pose
        for _ in range(2):
            await base.go(0.3)
            await base.turn(1.0)
            await base.turn(-1.0)
        end = world.truth().pose.seen_from(start)
        assert end.x == pytest.approx(0.6, abs=4 * base.can.arrival[0])
        assert end.heading == pytest.approx(0.0, abs=8 * base.can.arrival[1])

    async def test_go_is_refused_while_the_base_still_moves(self, world: World, base: MobileBase) -> None:
        await base.twist(SHARE * base.limits.speed, 0.0)
        await asyncio.sleep(0.1)
        with pytest.raises(CommandError, match="it must be idle"):
            await base.go(0.5)

    # What stops it by itself.

    @pytest.mark.parametrize("incident", REASONS)
    async def test_what_stops_a_motion_is_named_and_nothing_moves_afterwards(
        self, world: World, base: MobileBase, incident: str
    ) -> None:
        world.require(incident)
        watchdog = base.can.watchdog

        async def drive() -> None:
            async with moving(world, base) as motion:
                world.happen(incident)
                while True:
                    await asyncio.sleep(0.1)
                    motion.twist(SHARE * base.limits.speed, 0.0)

        with pytest.raises(MotionStopped) as stopped:
            await asyncio.wait_for(drive(), 20.0)
        assert stopped.value.reason in REASONS[incident]
        await world.assert_rests_within(watchdog + ramp(base))

    @pytest.mark.parametrize("incident", REASONS)
    @pytest.mark.parametrize("kind", ["go", "turn"])
    async def test_what_stops_a_go_or_turn_is_named_and_nothing_moves_afterwards(
        self, world: World, base: MobileBase, incident: str, kind: str
    ) -> None:
        world.require(incident)
        travelling = asyncio.ensure_future(base.go(3.0) if kind == "go" else base.turn(3.0))
        await asyncio.sleep(base.limits.stop_seconds + 0.3)
        assert world.truth().moving
        world.happen(incident)
        done, _ = await asyncio.wait((travelling,), timeout=20.0)
        assert done, "it has to end"
        error = travelling.exception()
        assert isinstance(error, MotionStopped)
        assert error.reason.endswith(REASONS[incident])
        await world.assert_rests_within(base.can.watchdog + ramp(base))

    async def test_a_stop_at_once_runs_on_by_the_bodys_lag_only(self, world: World, base: MobileBase) -> None:
        world.require("front bumper pressed")
        async with ended("bumper"), moving(world, base):
            before = world.truth()
            world.happen("front bumper pressed")
            await asyncio.sleep(10.0 * base.can.lag + base.can.notice)
            assert not world.truth().moving
        assert world.truth().pose.distance_to(before.pose) <= before.speed * base.can.lag + 1e-3

    async def test_a_pressed_bumper_bars_motion_toward_it_only(self, world: World, base: MobileBase) -> None:
        world.happen("front bumper pressed")
        await asyncio.sleep(base.can.notice)
        reading = await base.read()
        assert [side.name for side in reading.touching] == ["FRONT"]
        for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.05, 0.0), base.twist(0.0, 0.1)):
            with pytest.raises(CommandError, match="front bumper is pressed"):
                await attempt
        await world.assert_stays()
        assert (await base.go(-0.1)).ending is Cause.REACHED
        world.happen("front bumper released")
        assert (await base.go(0.1)).ending is Cause.REACHED

    async def test_held_wheels_are_latched_until_cleared(self, world: World, base: MobileBase) -> None:
        world.require("wheels held")
        async with ended("stalled"), moving(world, base):
            world.happen("wheels held")
            await asyncio.sleep(2.0)
        world.happen("wheels released")
        assert Cause.STALLED in (await base.read()).latched
        with pytest.raises(CommandError, match="the wheels stalled"):
            await base.go(0.1)
        await base.clear()
        assert (await base.go(0.1)).ending is Cause.REACHED

    @pytest.mark.parametrize("incident", ["restart", "line lost"])
    async def test_after_a_loss_nothing_moves_before_the_base_is_recovered(
        self, world: World, base: MobileBase, incident: str
    ) -> None:
        world.require(incident, "line back")
        with contextlib.suppress(MedusaError):
            async with moving(world, base):
                world.happen(incident)
                await asyncio.sleep(0.3)
                await base.read()
        await world.assert_rests_within(base.can.watchdog + ramp(base))
        world.happen("line back")
        await asyncio.sleep(4.0)
        for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.05, 0.0)):
            with pytest.raises(DeviceFault, match=r"recover\(\) before it moves"):
                await attempt
        with pytest.raises(DeviceFault, match=r"recover\(\) before it moves"):
            async with base.motion():
                pass
        await world.assert_stays()
        await base.recover()
        await world.assert_stays()
        assert (await base.go(0.2)).ending is Cause.REACHED

    # A host that was away.

    @pytest.mark.parametrize("away", ["suspended", "blocked", "blocked, what the machine sent lost"])
    @pytest.mark.parametrize("doing", ["motion", "go", "turn"])
    async def test_a_host_that_was_away_moves_nothing_when_it_is_back(
        self, world: World, base: MobileBase, away: str, doing: str
    ) -> None:
        if "lost" in away:
            world.require("what the machine sends is lost for 2 s")
        if away == "suspended":
            world.require("host suspended for an hour")

        async def drive() -> None:
            if doing == "go":
                await base.go(3.0)
            elif doing == "turn":
                await base.turn(3.0)
            else:
                async with base.motion() as motion:
                    while True:
                        motion.twist(SHARE * base.limits.speed, 0.0)
                        await asyncio.sleep(0.05)

        driving = asyncio.create_task(drive())
        await asyncio.sleep(base.limits.stop_seconds + 0.317)
        assert world.truth().moving
        if away == "suspended":
            # The clock jumps while the machine sees no time pass: it is the host that stops it.
            world.happen("host suspended for an hour")
        else:
            if "lost" in away:
                world.happen("what the machine sends is lost for 2 s")
            # Its watchdog, its ramp, and a while at rest.
            block(base.can.watchdog + ramp(base) + 1.0)
            at_rest = world.truth()
            assert not at_rest.moving
        done, _ = await asyncio.wait((driving,), timeout=20.0)
        assert done, "it has to end"
        error = driving.exception()
        assert isinstance(error, MotionStopped)
        assert error.reason == "watchdog"
        assert "not fed for" in str(error)
        assert not world.truth().moving
        if away != "suspended":
            assert world.truth().pose == at_rest.pose
        await world.assert_stays(2.5)
        for attempt in (base.go(0.1), base.twist(0.05, 0.0)):
            with pytest.raises(DeviceFault, match=r"not fed for .* recover\(\) before it moves"):
                await attempt
        await base.recover()
        await world.assert_stays(0.5)
        assert (await base.go(0.1)).ending is Cause.REACHED

    async def test_a_reading_that_comes_first_after_a_gap_does_not_hide_it(
        self, world: World, base: MobileBase
    ) -> None:
        reported: list[Event] = []
        base.subscribe(reported.append)
        block(base.can.watchdog + 0.5)
        for _ in range(3):
            await base.read()
        gaps = [event for event in reported if isinstance(event, Stopped) and event.error is not None]
        assert [type(event.error) for event in gaps] == [HostGap]
        with pytest.raises(DeviceFault):
            await base.go(0.1)
        await world.assert_stays()

    async def test_a_base_that_is_open_and_idle_stays_fed(self, world: World, base: MobileBase) -> None:
        reported: list[Event] = []
        base.subscribe(reported.append)
        await asyncio.sleep(20.0 * base.can.watchdog)
        assert reported == []
        assert (await base.go(0.1)).ending is Cause.REACHED

    # No motion survives a stop, however they meet.

    @pytest.mark.parametrize("kind", ["go", "turn", "twist", "motion"])
    async def test_no_motion_that_was_begun_before_a_stop_goes_on_after_it(
        self, world: World, base: MobileBase, kind: str
    ) -> None:
        async def motion() -> None:
            async with base.motion() as motion:
                for _ in range(20):
                    motion.twist(SHARE * base.limits.speed, 0.0)
                    await asyncio.sleep(0.05)

        for tick in range(25):
            begun = asyncio.ensure_future(
                {
                    "go": lambda: base.go(0.5),
                    "turn": lambda: base.turn(0.5),
                    "twist": lambda: base.twist(SHARE * base.limits.speed, 0.0),
                    "motion": motion,
                }[kind]()
            )
            # From the same turn of the loop to after its first exchanges with the slowest of bases.
            await asyncio.sleep(tick * 1e-3)
            await base.stop()
            assert not world.truth().moving
            stopped = world.truth().pose
            await asyncio.wait((begun,), timeout=10.0)
            assert begun.done()
            if kind != "twist":
                assert isinstance(begun.exception(), MotionStopped)
                assert "STOP was called" in str(begun.exception()) or "stop" in str(begun.exception())
            await asyncio.sleep(0.2)
            assert world.truth().pose == stopped

    async def test_nothing_is_begun_while_a_stop_is_under_way(self, world: World, base: MobileBase) -> None:
        await base.twist(SHARE * base.limits.speed, 0.0)
        await asyncio.sleep(0.9 * base.can.expires)
        stopping = asyncio.create_task(base.stop())
        await asyncio.sleep(0.05)
        for attempt in (base.twist(0.05, 0.0), base.go(0.1), base.turn(0.1)):
            with pytest.raises(CommandError, match="being stopped"):
                await attempt
        with pytest.raises(CommandError, match="being stopped"):
            async with base.motion():
                pass
        await stopping
        assert not world.truth().moving
        await world.assert_stays(0.5)

    async def test_a_motion_ends_with_a_stop_called_from_elsewhere(
        self, world: World, base: MobileBase
    ) -> None:
        async with moving(world, base) as motion:
            await asyncio.create_task(base.stop())
            assert not world.truth().moving
            with pytest.raises(MotionStopped, match="STOP was called"):
                motion.twist(0.05, 0.0)
            await world.assert_stays()

    # Cancellation.

    @pytest.mark.parametrize("program", [*PROGRAMS, *(f"{name} in its context" for name in PROGRAMS)])
    async def test_cancelled_one_to_three_times_it_is_at_rest_when_the_program_returns(
        self, world: World, program: str
    ) -> None:
        rng = random.Random(f"contract {program}")
        outcomes = [
            await cancel_at_random(
                rng, world.open, lambda: world.truth().moving, program, rng.randint(1, 3), span=4.5
            )
            for _ in range(15)
        ]
        assert [outcome for outcome in outcomes if outcome.moving or outcome.moved_later] == []
        assert any(outcome.ended == "cancelled" for outcome in outcomes)

    # Readings.

    async def test_a_reading_is_of_its_time_and_agrees_with_the_truth(
        self, world: World, base: MobileBase
    ) -> None:
        loop = asyncio.get_running_loop()
        start = world.truth().pose
        async with base.motion(hold=2.0) as motion:
            motion.twist(SHARE * base.limits.speed, SHARE * base.limits.turn_rate)
            for _ in range(30):
                asked, before = loop.time(), world.truth()
                reading = await base.read()
                answered = loop.time()
                assert asked <= reading.time <= answered
                way = before.speed * (answered - asked) + 2e-3
                assert reading.pose.distance_to(before.pose.seen_from(start)) <= way
                turned = degrees(reading.pose.heading - (before.pose.heading - start.heading))
                assert turned == pytest.approx(0.0, abs=degrees(before.turn_rate * (answered - asked)) + 0.1)
                await asyncio.sleep(0.05)
            assert before.moving
            assert not reading.at_rest
        assert (await base.read()).at_rest

    async def test_readings_come_at_their_rate(self, world: World, base: MobileBase) -> None:
        loop = asyncio.get_running_loop()
        started, times = loop.time(), []
        async for reading in base.readings(20.0):
            times.append(reading.time)
            if len(times) == 21:
                break
        assert loop.time() - started == pytest.approx(1.0, abs=0.03)
        assert all(b > a for a, b in pairwise(times))
