"""What every mobile base promises of twists, GO, TURN and readings."""

import asyncio
from itertools import pairwise
from math import degrees, inf, nan

import pytest

from labmate.base import Cause, MobileBase
from labmate.base.events import Event
from labmate.errors import StalePose
from labmate.testing.opened_base import OpenedBase
from labmate.testing.world import LOOK, SHARE, World, ended, moving, ramp
from medusa.errors import CommandError


class MotionPromises(OpenedBase):
    """Twists held and let run out, GO and TURN that arrive, readings of their time."""

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

    async def test_a_base_that_is_open_and_idle_stays_fed(self, world: World, base: MobileBase) -> None:
        reported: list[Event] = []
        base.subscribe(reported.append)
        await asyncio.sleep(20.0 * base.can.watchdog)
        assert reported == []
        assert (await base.go(0.1)).ending is Cause.REACHED

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
