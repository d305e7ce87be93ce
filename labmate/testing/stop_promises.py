"""What every mobile base promises of stops and of cancellation."""

import asyncio
import random
from dataclasses import replace
from math import inf

import pytest

from labmate.base import BaseReading, Cause, MobileBase
from labmate.errors import MotionStopped, StopNotConfirmed
from labmate.testing.cancellation import PROGRAMS, cancel_at_random
from labmate.testing.opened_base import OpenedBase
from labmate.testing.world import LOOK, SHARE, World, ended, moving, ramp
from medusa.errors import CommandError


class StopPromises(OpenedBase):
    """Stops read back; nothing left moving, however often it is cancelled."""

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
