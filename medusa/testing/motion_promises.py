"""What every drive promises of readings, moves, rates and steps."""

import asyncio
import math
from collections.abc import Mapping

import pytest

from medusa.errors import CommandError, NoReply
from medusa.head.drive import Speeds
from medusa.head.faults import Cause
from medusa.head.joint_group import JointGroup
from medusa.testing.bench import Bench
from medusa.testing.opened import Opened

BRAKING_EXCESS = 1.1
WINDOW_SECONDS = 0.02
"""A deceleration is the mean over so long: a drive's quantised command makes single samples rougher."""


class MotionPromises(Opened):
    """Readings, moves, rates, steps; soft limits and accelerations kept."""

    async def test_connecting_and_reading_move_nothing_and_enable_nothing(self) -> None:
        async with self.machine() as machine:
            names = list(machine.drive.traits)
            before = {name: machine.truth(name) for name in names}
            async with JointGroup.open(machine.drive) as group:
                reading = await group.read()
                await asyncio.sleep(0.5)
                assert group.enabled == frozenset()
                assert not any(joint.moving or joint.enabled for joint in reading.joints.values())
                assert all(math.isfinite(joint.raw) for joint in reading.joints.values())
                assert {name: machine.truth(name) for name in names} == before

    async def test_angles_are_unknown_until_homed(self) -> None:
        async with self.machine() as machine, JointGroup.open(machine.drive) as group:
            known = group.can.homing == "absolute"
            for joint in (await group.read()).joints.values():
                assert joint.homed == known
                assert math.isfinite(joint.angle) == known
                assert math.isfinite(joint.commanded) == known
            await group.home()
            for name, joint in (await group.read()).joints.items():
                assert joint.homed
                assert joint.angle == pytest.approx(machine.truth(name), abs=group.traits[name].settle)

    async def test_enabling_holds_every_joint_where_it_is(self, bench: Bench) -> None:
        await bench.group.disable()
        before = {name: bench.machine.truth(name) for name in bench.joints}
        await bench.group.enable()
        await asyncio.sleep(0.3)
        assert bench.group.enabled == frozenset(bench.joints)
        for name, angle in before.items():
            assert bench.machine.truth(name) == pytest.approx(
                angle, abs=2 * bench.group.traits[name].resolution
            )

    async def test_a_move_arrives_with_all_joints(self, bench: Bench) -> None:
        targets = {name: bench.target(name, 0.3) for name in bench.joints}
        report = await bench.group.move(targets)
        assert report.all_settled
        assert report.start_skew <= bench.group.can.start_skew + bench.group.can.stamp_error
        for name, angle in targets.items():
            traits = bench.group.traits[name]
            # Settled, and the zero of a homing search is good to two steps of the encoder.
            assert bench.machine.truth(name) == pytest.approx(
                angle, abs=traits.settle + 3 * traits.resolution
            )
            assert abs(report.errors[name]) <= traits.settle + traits.resolution

    async def test_joints_that_move_together_arrive_together(self, bench: Bench) -> None:
        shares = dict(zip(bench.joints, (0.5, 0.1, 0.3, 0.2), strict=False))
        report = await bench.group.move({n: bench.target(n, s) for n, s in shares.items()}, together=True)
        assert report.all_settled
        assert report.plan.early == ()
        can = bench.group.can
        assert report.end_skew <= can.end_skew + 2 * can.stamp_error

    async def test_a_slower_move_takes_longer(self, bench: Bench) -> None:
        name = bench.joints[0]
        traits = bench.group.traits[name]
        await bench.group.move({name: bench.target(name, 0.0)})
        slow = await bench.group.move(
            {name: bench.target(name, 0.3)}, {name: Speeds(max_speed=traits.speed / 5)}
        )
        distance = abs(bench.target(name, 0.3) - bench.target(name, 0.0))
        assert slow.plan.seconds[name] >= 0.8 * distance / (traits.speed / 5)

    @pytest.mark.parametrize("wrong", ["angle", "speed", "acceleration", "joint", "nan"])
    async def test_a_wrong_move_is_refused_and_moves_nothing(self, bench: Bench, wrong: str) -> None:
        first, second = bench.joints[:2]
        traits = bench.group.traits[second]
        targets = {first: bench.target(first, 0.2), second: bench.target(second, 0.2)}
        speeds: dict[str, Speeds] = {}
        if wrong == "angle":
            targets[second] = traits.high + 0.01
        elif wrong == "nan":
            targets[second] = math.nan
        elif wrong == "speed":
            speeds[second] = Speeds(max_speed=1.01 * traits.speed)
        elif wrong == "acceleration":
            speeds[second] = Speeds(acceleration=1.01 * traits.acceleration)
        else:
            targets["neck"] = 0.0
        before = {name: bench.machine.truth(name) for name in bench.joints}
        with pytest.raises(CommandError, match="neck" if wrong == "joint" else second):
            await bench.group.move(targets, speeds)
        await asyncio.sleep(0.3)
        for name, angle in before.items():
            assert bench.machine.truth(name) == pytest.approx(
                angle, abs=3 * bench.group.traits[name].resolution
            )

    async def test_a_rate_is_what_was_taken_and_its_stamps_are_right(self, bench: Bench) -> None:
        name = bench.joints[0]
        rate = await bench.turn(name)
        traits, can = bench.group.traits[name], bench.group.can
        assert rate == pytest.approx(bench.speed(name), abs=traits.rate_step / 2)
        loop = asyncio.get_running_loop()
        times, readings, truths = [], [], []
        for _ in range(5):
            truths.append((loop.time(), bench.machine.truth(name)))
            readings.append((await bench.group.read()).joints[name])
            times.append(loop.time())
            await asyncio.sleep(0.01)
        (t0, x0), (t1, x1) = truths[0], truths[-1]
        true = (x1 - x0) / (t1 - t0)
        assert true == pytest.approx(rate, rel=0.02)
        for reading, (before, _), after in zip(readings, truths, times, strict=True):
            assert before - can.stamp_error <= reading.time <= after + can.stamp_error
            where = x0 + true * (reading.time - t0)
            assert abs(reading.angle - where) <= abs(rate) * can.stamp_error + 3 * traits.resolution
            assert reading.rate == pytest.approx(rate)
            assert reading.moving

    @pytest.mark.parametrize("direction", [1, -1])
    async def test_a_rate_ends_before_the_soft_limit_and_is_named(self, bench: Bench, direction: int) -> None:
        if bench.group.can.keeps_limits:
            pytest.skip("the machine keeps its limits itself")
        name = bench.joints[0]
        traits = bench.group.traits[name]
        limit = traits.high if direction > 0 else traits.low
        await bench.group.move({name: limit - direction * 0.25 * (traits.high - traits.low)})
        rate = direction * bench.speed(name)
        await bench.group.velocity({name: rate})
        await asyncio.sleep(1.5 + abs(0.25 * (traits.high - traits.low) / rate))
        true = bench.machine.truth(name)
        assert (limit - true) * direction >= -3 * traits.resolution
        assert (limit - true) * direction < abs(rate) * 0.1 + rate**2 / (2 * traits.acceleration)
        assert [(f.cause, f.joints) for f in bench.faults] == [(Cause.SOFT_LIMIT, (name,))]
        with pytest.raises(CommandError, match="soft limit"):
            await bench.group.velocity({name: rate})
        assert (await bench.group.drive_rates({name: rate})).limited == {name}
        assert await bench.at_rest()

    async def test_a_rate_whose_reply_is_lost_ends_before_the_soft_limit_too(self, bench: Bench) -> None:
        name, drive = bench.joints[0], bench.group.drive
        set_rates = drive.set_rates

        async def lose_the_reply(rates: Mapping[str, float]) -> dict[str, float]:
            await set_rates(rates)
            raise NoReply("no reply")

        await bench.group.move({name: bench.target(name, 0.5)})
        drive.set_rates = lose_the_reply  # type: ignore[method-assign]
        with pytest.raises(NoReply):
            await bench.group.velocity({name: bench.speed(name)})
        drive.set_rates = set_rates  # type: ignore[method-assign]
        traits = bench.group.traits[name]
        await asyncio.sleep(0.5 * (traits.high - traits.low) / bench.speed(name))
        assert await bench.at_rest()
        assert (await bench.group.read()).joints[name].angle <= traits.high

    @pytest.mark.parametrize("end", ["stop", "move", "together", "zero", "disable", "park"])
    async def test_whatever_ends_a_rate_keeps_to_the_acceleration(self, bench: Bench, end: str) -> None:
        name = bench.joints[0]
        group = bench.group
        await bench.turn(name)
        ends = {
            "stop": group.stop,
            "move": lambda: group.move({name: bench.target(name, 0.0)}),
            "together": lambda: group.move({name: bench.target(name, -0.6)}, together=True),
            "zero": lambda: group.drive_rates({name: 0.0}),
            "disable": group.disable,
            "park": group.park,
        }
        rates: list[float] = []

        async def record() -> None:
            while True:
                rates.append(await bench.true_rate(name, WINDOW_SECONDS / 10))

        recording = asyncio.ensure_future(record())
        await ends[end]()
        await asyncio.sleep(0.3)
        recording.cancel()
        changes = [abs(b) - abs(a) for a, b in zip(rates, rates[10:], strict=False) if a * b >= 0]
        worst = max(-change for change in changes) / WINDOW_SECONDS
        assert worst <= BRAKING_EXCESS * group.traits[name].acceleration

    async def test_a_step_arrives_at_once(self, bench: Bench) -> None:
        name = bench.joints[0]
        traits = bench.group.traits[name]
        size = min(traits.largest_step / 2, 5 * traits.settle)
        before = (await bench.group.read()).joints[name].commanded
        await bench.group.step({name: before + size})
        await asyncio.sleep(0.3)
        assert (await bench.group.read()).joints[name].angle == pytest.approx(
            before + size, abs=traits.settle
        )
        with pytest.raises(CommandError, match="outside the soft limits"):
            await bench.group.step({name: traits.high + 0.01})

    async def test_an_idle_machine_that_is_enabled_stays_so(self, bench: Bench) -> None:
        await asyncio.sleep(10.0)
        assert bench.faults == []
        assert all(joint.enabled for joint in (await bench.group.read()).joints.values())
