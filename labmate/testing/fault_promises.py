"""What every mobile base promises when something happens to it, or to its host."""

import asyncio
import contextlib

import pytest

from labmate.base import Cause, MobileBase
from labmate.base.events import Event, Stopped
from labmate.errors import MotionStopped
from labmate.testing.opened_base import OpenedBase
from labmate.testing.world import SHARE, World, block, ended, moving, ramp
from medusa.errors import CommandError, DeviceFault, HostGap, MedusaError

REASONS = {
    "front bumper pressed": ("bumper",),
    "emergency stop pressed": ("emergency stop",),
    "wheels held": ("stalled",),
    # Whether its watchdog or the missing answers are noticed first is the line's matter.
    "host not heard for 0.8 s": ("watchdog", "line lost"),
    "line lost": ("line lost",),
    "restart": ("restart",),
}


class FaultPromises(OpenedBase):
    """What stops a motion is named; nothing moves before it is asked to."""

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
