"""What every drive promises, as tests: subclass `DriveContract`, say how a machine is opened, and run pytest.

Tolerances come from the drive's capabilities and traits; truth comes from outside the drive. An incident that a
machine cannot stage is left out of its mapping, and the tests of it are skipped by name.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass, field

import pytest

from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.drive import Drive, Reading, Speeds
from medusa.head.faults import Cause, Fault, JointFault
from medusa.head.joint_group import JointGroup
from medusa.head.moves import MoveStopped

REST_RATE = math.radians(0.9)
"""At rest in control: one count in a sample of 2.048 ms of the finest joint; a limit cycle is under it. rad/s."""
BRAKING_EXCESS = 1.1
WINDOW_SECONDS = 0.02
"""A deceleration is the mean over so long: a drive's quantised command makes single samples rougher."""


@dataclass(frozen=True)
class Machine:
    """A drive that is not open yet, and what is known of its machine out of band.

    truth: a joint's true angle now, rad, from the zero of its raw angle or its angle. incidents: by the cause that
    has to be reported, what makes it happen to the joint given.
    """

    drive: Drive
    truth: Callable[[str], float]
    incidents: Mapping[Cause, Callable[[str], None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Bench:
    """An open, homed and enabled machine with what it has reported so far."""

    group: JointGroup
    machine: Machine
    faults: list[Fault]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.group.traits)

    def speed(self, name: str, share: float = 0.4) -> float:
        """A rate that every test may use, a multiple of the rate step, rad/s."""
        traits = self.group.traits[name]
        return max(1, round(share * traits.speed / traits.rate_step)) * traits.rate_step

    async def true_rate(self, name: str, seconds: float = 0.01) -> float:
        """Mean true rate over the next `seconds`, rad/s."""
        before = self.machine.truth(name)
        await asyncio.sleep(seconds)
        return (self.machine.truth(name) - before) / seconds

    async def at_rest(self) -> bool:
        """No joint moves, by the truth."""
        before = {name: self.machine.truth(name) for name in self.joints}
        await asyncio.sleep(0.05)
        return all(abs(self.machine.truth(n) - before[n]) / 0.05 < REST_RATE for n in self.joints)

    async def turn(self, name: str, seconds: float = 0.2, *, direction: int = 1) -> float:
        """Turn a joint for a while, from the other side of its middle; its rate."""
        traits = self.group.traits[name]
        middle, half = (traits.low + traits.high) / 2, (traits.high - traits.low) / 2
        await self.group.move({name: middle - direction * 0.5 * half})
        rate = (await self.group.velocity({name: direction * self.speed(name)}))[name]
        await asyncio.sleep(seconds)
        return rate

    def target(self, name: str, share: float) -> float:
        """An angle at a share (−1..1) of the way from the middle to the soft limits, rad."""
        traits = self.group.traits[name]
        return (traits.low + traits.high) / 2 + share * (traits.high - traits.low) / 2

    def incident(self, cause: Cause) -> Callable[[str], None]:
        """What makes a fault of a joint happen; skips the test when the machine cannot stage it."""
        if cause not in self.machine.incidents:
            pytest.skip(f"this machine cannot stage: {cause.value}")
        return self.machine.incidents[cause]


class DriveContract:
    """The promises; a subclass overrides `machine`."""

    def machine(self) -> AbstractAsyncContextManager[Machine]:
        """A machine as it is after power-up, its drive not open."""
        raise NotImplementedError

    @asynccontextmanager
    async def open(self) -> AsyncIterator[Bench]:
        """An open machine, homed and enabled."""
        async with self.machine() as machine, JointGroup.open(machine.drive) as group:
            faults: list[Fault] = []
            group.subscribe(faults.append)
            await group.home()
            yield Bench(group, machine, faults)

    @pytest.fixture
    async def bench(self) -> AsyncIterator[Bench]:
        async with self.open() as bench:
            yield bench

    async def test_the_contract_is_not_empty(self) -> None:
        """A machine that stages nothing tests nothing: one joint's own fault and a lost line are the least."""
        async with self.machine() as machine:
            assert {Cause.DRIVE, Cause.LOST} <= set(machine.incidents)

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

    @pytest.mark.parametrize("what", ["rate", "move"])
    async def test_a_stop_is_at_rest_when_it_returns(self, bench: Bench, what: str) -> None:
        name = bench.joints[0]
        if what == "rate":
            await bench.turn(name)
            await bench.group.stop()
        else:
            moving = asyncio.ensure_future(bench.group.move({n: bench.target(n, 0.8) for n in bench.joints}))
            await asyncio.sleep(0.15)
            await bench.group.stop()
            with pytest.raises(MoveStopped):
                await moving
        assert await bench.at_rest()
        assert not any(joint.moving for joint in (await bench.group.read()).joints.values())
        assert (await bench.group.move({name: bench.target(name, 0.0)})).all_settled

    async def test_no_move_that_was_about_to_begin_survives_a_stop(self, bench: Bench) -> None:
        targets = {name: bench.target(name, 0.5) for name in bench.joints}
        for turns in range(1, 12):
            before = {name: bench.machine.truth(name) for name in bench.joints}
            moving = asyncio.ensure_future(bench.group.move(targets))
            for _ in range(turns):
                await asyncio.sleep(0)
            await bench.group.stop()
            with pytest.raises((MoveStopped, CommandError, MedusaError)):
                await moving
            await asyncio.sleep(0.2)
            for name, angle in before.items():
                bound = 5 * bench.group.traits[name].resolution
                assert bench.machine.truth(name) == pytest.approx(angle, abs=bound)

    async def test_an_old_reading_confirms_no_stop(self, bench: Bench) -> None:
        name = bench.joints[0]
        await bench.group.move({name: bench.target(name, 0.0)})
        drive, read = bench.group.drive, bench.group.drive.read
        old = [await read()]
        await asyncio.sleep(0.03)
        old.append(await read())

        async def repeat(names: object = None) -> Reading:
            return old.pop(0) if len(old) > 1 else old[0]

        await bench.group.velocity({name: bench.speed(name, 0.1)})
        drive.read = repeat  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="could not be confirmed"):
            await bench.group.stop()
        drive.read = read  # type: ignore[method-assign]
        await bench.group.clear()
        await bench.group.enable()

    async def test_an_emergency_stop_is_latched_until_it_is_cleared(self, bench: Bench) -> None:
        name = bench.joints[0]
        await bench.turn(name)
        await bench.group.emergency_stop()
        assert await bench.at_rest()
        joints = (await bench.group.read()).joints
        assert all(Cause.EMERGENCY_STOP in joint.latched for joint in joints.values())
        if bench.group.can.emergency == "limp":
            assert not any(joint.enabled for joint in joints.values())
        with pytest.raises(CommandError, match="emergency stop is latched"):
            await bench.group.enable()
        assert await bench.group.clear() == {}
        await bench.group.enable()
        assert (await bench.group.move({name: bench.target(name, 0.0)})).all_settled

    async def test_an_emergency_stop_that_is_not_latched_is_an_error(self, bench: Bench) -> None:
        drive = bench.group.drive
        drive.emergency_stop = lambda: drive.stop(bench.joints)  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="emergency stop could not be confirmed"):
            await bench.group.emergency_stop()

    async def test_disabling_lets_go_of_joints_at_rest_only(self, bench: Bench) -> None:
        await bench.turn(bench.joints[0])
        await bench.group.disable()
        assert bench.group.enabled == frozenset()
        assert await bench.at_rest()
        with pytest.raises(CommandError, match="idle; enable it first"):
            await bench.group.move({bench.joints[0]: 0.0})

    @pytest.mark.parametrize("cancels", [1, 2, 3])
    async def test_a_cancelled_move_is_at_rest_when_it_ends(self, bench: Bench, cancels: int) -> None:
        moving = asyncio.ensure_future(bench.group.move({n: bench.target(n, 0.8) for n in bench.joints}))
        await asyncio.sleep(0.12)
        for _ in range(cancels):
            moving.cancel()
            await asyncio.sleep(0.002)
        with pytest.raises(asyncio.CancelledError):
            await moving
        assert await bench.at_rest()

    @pytest.mark.parametrize("cancels", [1, 2, 3])
    @pytest.mark.parametrize("what", ["move", "stop", "context"])
    async def test_however_often_it_is_cancelled_the_head_is_at_rest_afterwards(
        self, what: str, cancels: int
    ) -> None:
        async with self.machine() as machine:
            begun = asyncio.Event()

            async def program() -> None:
                async with JointGroup.open(machine.drive) as group:
                    bench = Bench(group, machine, [])
                    await group.home()
                    names = bench.joints
                    if what == "move":
                        asyncio.get_running_loop().call_later(0.1, begun.set)
                        await group.move({n: bench.target(n, 0.8) for n in names})
                    rate = await bench.turn(names[0])
                    assert rate
                    begun.set()
                    if what == "stop":
                        await group.stop()
                    await asyncio.sleep(1.0)

            task = asyncio.ensure_future(program())
            await begun.wait()
            for _ in range(cancels):
                task.cancel()
                await asyncio.sleep(0.003)
            await asyncio.gather(task, return_exceptions=True)
            truth = {name: machine.truth(name) for name in machine.drive.traits}
            await asyncio.sleep(0.1)
            for name, angle in truth.items():
                assert abs(machine.truth(name) - angle) / 0.1 < REST_RATE

    @pytest.mark.parametrize("cause", [Cause.DRIVE, Cause.EMERGENCY_STOP, Cause.FOLLOWING, Cause.LIMIT])
    async def test_one_joints_fault_is_named_in_time_and_stops_all(self, bench: Bench, cause: Cause) -> None:
        name, stage = bench.joints[0], bench.incident(cause)
        targets = {n: bench.target(n, 0.8) for n in bench.joints}
        moving = asyncio.ensure_future(bench.group.move(targets))
        await asyncio.sleep(0.1)
        happened = asyncio.get_running_loop().time()
        stage(name)
        with pytest.raises(JointFault) as ended:
            await moving
        assert ended.value.report.cause is cause
        assert name in ended.value.report.joints
        # What is noticed by its effect, a following error, needs its effect first.
        effect = 0.1 if cause is Cause.FOLLOWING else 0.0
        assert ended.value.report.time - happened <= bench.group.can.notice + effect
        # The stop is confirmed when the move ends, of joints that a fault has left limp, too.
        assert await bench.at_rest()
        assert bench.faults

    async def test_a_lost_line_is_named_and_the_machine_stops_by_itself(self) -> None:
        async with self.machine() as machine:
            faults: list[Fault] = []

            async def program() -> None:
                async with JointGroup.open(machine.drive) as group:
                    bench = Bench(group, machine, faults)
                    group.subscribe(faults.append)
                    await group.home()
                    await bench.turn(bench.joints[0])
                    bench.incident(Cause.LOST)(bench.joints[0])
                    await asyncio.sleep(3.0)
                    await group.read()

            with pytest.raises(MedusaError):
                await program()
            assert Cause.LOST in [fault.cause for fault in faults]
            truth = {name: machine.truth(name) for name in machine.drive.traits}
            await asyncio.sleep(0.2)
            assert {name: machine.truth(name) for name in truth} == truth

    @pytest.mark.parametrize("share", [1.2, 3.0])
    async def test_after_a_gap_longer_than_the_watchdog_nothing_moves_until_it_is_asked_for(
        self, bench: Bench, share: float
    ) -> None:
        watchdog = bench.group.can.watchdog
        if watchdog is None:
            pytest.skip("this machine has no watchdog")
        name = bench.joints[0]
        await bench.turn(name, 0.05)
        loop = asyncio.get_running_loop()
        loop.block(share * watchdog)  # type: ignore[attr-defined]
        await asyncio.sleep(0.6)
        assert Cause.WATCHDOG in [fault.cause for fault in bench.faults]
        assert await bench.at_rest()
        where = bench.machine.truth(name)
        with pytest.raises(MedusaError):
            await bench.group.velocity({name: bench.speed(name)})
        with pytest.raises(MedusaError):
            await bench.group.move({name: bench.target(name, 0.1)})
        await asyncio.sleep(0.3)
        assert bench.machine.truth(name) == pytest.approx(where, abs=3 * bench.group.traits[name].resolution)
        await bench.group.clear()
        await bench.group.enable()
        assert (await bench.group.move({name: bench.target(name, 0.1)})).all_settled

    async def test_a_failing_listener_keeps_no_fault_from_the_others(self, bench: Bench) -> None:
        def fail(fault: Fault) -> None:
            raise RuntimeError("a listener's own mistake")

        name, later = bench.joints[0], list[Fault]()
        bench.group.subscribe(fail)
        bench.group.subscribe(later.append)
        bench.incident(Cause.DRIVE)(name)
        await asyncio.sleep(bench.group.can.notice + 0.05)
        assert Cause.DRIVE in [fault.cause for fault in later]

    async def test_an_idle_machine_that_is_enabled_stays_so(self, bench: Bench) -> None:
        await asyncio.sleep(10.0)
        assert bench.faults == []
        assert all(joint.enabled for joint in (await bench.group.read()).joints.values())
