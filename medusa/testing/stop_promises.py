"""What every drive promises of stops, faults, cancellation and a host that was away."""

import asyncio

import pytest

from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.drive import MoveEnds, MovePlan
from medusa.head.faults import Cause, Fault, JointFault
from medusa.head.joint_group import JointGroup
from medusa.head.moves import MoveStopped
from medusa.testing.bench import REST_RATE, Bench
from medusa.testing.opened import Opened


class StopPromises(Opened):
    """Stops read back, faults named, nothing left moving."""

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

    async def test_disabling_lets_go_of_joints_at_rest_only(self, bench: Bench) -> None:
        await bench.turn(bench.joints[0])
        await bench.group.disable()
        assert bench.group.enabled == frozenset()
        assert await bench.at_rest()
        with pytest.raises(CommandError, match="idle; enable it first"):
            await bench.group.move({bench.joints[0]: 0.0})

    async def test_a_move_that_fails_half_way_is_at_rest_when_it_raises(self, bench: Bench) -> None:
        drive, run = bench.group.drive, bench.group.drive.run

        async def fail_half_way(plan: MovePlan) -> MoveEnds:
            running = asyncio.ensure_future(run(plan))
            await asyncio.sleep(0.12)
            running.cancel()
            raise DeviceFault("a reply that makes no sense")

        drive.run = fail_half_way  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="makes no sense"):
            await bench.group.move({name: bench.target(name, 0.8) for name in bench.joints})
        assert await bench.at_rest()

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
