"""Everything that stops the base in motion: where it stands then, how it is told, and that it stays there."""

import asyncio
import logging
from collections.abc import Callable
from math import degrees, radians

import msgspec
import pytest

from labmate.base.events import Cause, Event, LowBattery, TravelEnded
from labmate.base.mobile_base import MobileBase
from labmate.driver import messages as m
from labmate.errors import BatteryLow, MotionStopped, StopNotConfirmed
from labmate.odometry import Pose
from labmate.simulation import SimulatedBase, simulated_base
from medusa.errors import CommandError, DeviceFault, DeviceRestarted, MedusaError
from medusa.link import Line
from sim_devices.labmate import BaseConfig as EmulatedConfig
from sim_devices.link.faults import FaultPlan

SPEED = 0.3
RAMP = SPEED / 0.25
RUN_ON = SPEED * 0.032
"""Way (m) after a stop at once: speed × 32 ms, the drive's pole (docs/protocols)."""
POLE = 0.032
WATCHDOG = 0.5


async def assert_it_stays(sim: SimulatedBase, seconds: float = 3.0) -> None:
    stood = sim.true_pose()
    await asyncio.sleep(seconds)
    assert sim.true_pose() == stood


async def rest_after(sim: SimulatedBase, limit: float) -> float:
    """Seconds until the true pose no longer changes; fails beyond the limit."""
    start, last = sim.clock(), sim.true_pose()
    while True:
        await asyncio.sleep(0.02)
        now = sim.true_pose()
        if now == last:
            return sim.clock() - start - 0.02
        assert sim.clock() - start < limit + 0.02, f"still moving after {limit} s"
        last = now


def outcome_of(task: asyncio.Task[object]) -> MotionStopped:
    error = task.exception()
    assert isinstance(error, MotionStopped)
    return error


async def going(base: MobileBase, seconds: float = 2.0) -> asyncio.Task[object]:
    """A GO of 3 m, at full speed by now."""
    task: asyncio.Task[object] = asyncio.create_task(base.go(3.0))
    await asyncio.sleep(seconds)
    assert not task.done()
    return task


@pytest.mark.parametrize("side", ["front", "rear", "left", "right"])
async def test_any_bumper_stops_a_go_at_once_and_is_named(
    base: MobileBase, sim: SimulatedBase, side: str
) -> None:
    task = await going(base)
    before = sim.true_pose()
    sim.bench.inject("base.press_bumper", side=side)
    await asyncio.wait([task])
    stopped = outcome_of(task)
    assert stopped.reason == f"{side} bumper"
    assert stopped.report is not None
    assert stopped.report.ending is Cause.BUMPER
    # The page's way of a stop at once, and a little for rounding of the pose and the mean of the wheels.
    assert sim.true_pose().distance_to(before) == pytest.approx(RUN_ON, abs=1e-3)
    sim.bench.inject("base.release_bumper", side=side)
    await assert_it_stays(sim)


async def test_a_wall_stops_a_go_before_the_base_is_through_it(base: MobileBase, sim: SimulatedBase) -> None:
    # The body is 0.75 m long: its front is at 0.375 m, the box's face at 0.9 m.
    sim.bench.inject("base.place_box", x=1.0, y=0.0, length=0.2, width=2.0)
    with pytest.raises(MotionStopped, match=r"GO 3\.000 m ended after 0\.5.. m: front bumper") as caught:
        await base.go(3.0)
    assert caught.value.reason == "front bumper"
    # The bumper gives way by 15 mm, a stop at once takes 9.6: within that, and never further than the face.
    assert 0.9 - 0.375 < sim.true_pose().x <= 0.9 - 0.375 + 0.015
    with pytest.raises(CommandError, match="GO: the front bumper is pressed") as refused:
        await base.go(0.1)
    assert refused.value.status == 8
    with pytest.raises(CommandError, match="TURN: the front bumper is pressed"):
        await base.turn(0.1)
    assert (await base.go(-0.3)).ending is Cause.REACHED


async def test_a_bumper_ends_a_motion_until_a_new_one_is_asked_for(
    base: MobileBase, sim: SimulatedBase
) -> None:
    async def drive() -> None:
        async with base.motion(hold=0.5) as motion:
            for tick in range(40):
                motion.twist(0.2, 0.0)
                await asyncio.sleep(0.1)
                if tick == 20:
                    sim.bench.inject("base.press_bumper", side="front")
                if tick == 22:
                    sim.bench.inject("base.release_bumper", side="front")

    with pytest.raises(MotionStopped, match="the front bumper was pressed") as caught:
        await drive()
    assert caught.value.reason == "bumper"
    await assert_it_stays(sim)
    async with base.motion() as again:
        again.twist(-0.1, 0.0)
        await asyncio.sleep(0.5)
    assert (await base.read()).at_rest


async def test_the_button_stops_a_go_and_only_a_clear_after_its_release_helps(
    base: MobileBase, sim: SimulatedBase
) -> None:
    task = await going(base)
    before = sim.true_pose()
    sim.bench.inject("base.press_emergency_stop")
    await asyncio.wait([task])
    assert outcome_of(task).reason == "emergency stop"
    assert sim.true_pose().distance_to(before) == pytest.approx(RUN_ON, abs=1e-3)
    snapshot = await base.read()
    assert Cause.EMERGENCY_STOP in snapshot.latched
    assert snapshot.details["motor_power"] is False
    for attempt in (base.go(0.1), base.turn(0.1)):
        with pytest.raises(CommandError, match="emergency stop is latched; clear it first"):
            await attempt
    with pytest.raises(CommandError):
        await base.twist(0.1, 0.0)
    assert Cause.EMERGENCY_STOP in (await base.clear()).latched
    sim.bench.inject("base.release_emergency_stop")
    assert Cause.EMERGENCY_STOP not in (await base.clear()).latched
    await assert_it_stays(sim)
    assert (await base.go(0.1)).ending is Cause.REACHED


async def test_the_hosts_emergency_stop_latches_is_confirmed_and_ends_the_motion(
    base: MobileBase, sim: SimulatedBase
) -> None:
    task = await going(base)
    before = sim.true_pose()
    stopped = await base.emergency_stop()
    assert stopped.at_rest
    assert Cause.EMERGENCY_STOP in stopped.latched
    await asyncio.wait([task])
    assert outcome_of(task).reason == "emergency stop"
    # The broadcast of six bytes takes half a millisecond on the line.
    assert sim.true_pose().distance_to(before) == pytest.approx(RUN_ON, abs=2e-3)
    await assert_it_stays(sim)


async def test_a_stop_ramps_down_is_confirmed_and_ends_the_motion(
    base: MobileBase, sim: SimulatedBase
) -> None:
    task = await going(base)
    before, at = sim.true_pose(), sim.clock()
    stopped = await base.stop()
    assert stopped.at_rest
    # Ramp of 1.2 s and 0.18 m, the drive's lag, one look in 50 ms.
    assert sim.clock() - at == pytest.approx(RAMP + 4 * POLE, abs=0.15)
    assert sim.true_pose().distance_to(before) == pytest.approx(SPEED**2 / (2 * 0.25) + RUN_ON, abs=5e-3)
    await asyncio.wait([task])
    assert outcome_of(task).reason == "stop"
    await assert_it_stays(sim)


@pytest.mark.parametrize("turn_of_the_loop", range(8))
async def test_a_go_that_is_stopped_before_it_was_sent_is_never_sent(
    base: MobileBase, sim: SimulatedBase, turn_of_the_loop: int
) -> None:
    device = sim.machine.device
    device.journal = []
    task: asyncio.Task[object] = asyncio.create_task(base.go(3.0))
    # Its first reading takes 6 ms: it has not been sent yet.
    await asyncio.sleep(turn_of_the_loop * 7e-4)
    await base.stop()
    await asyncio.wait([task])
    assert outcome_of(task).reason == "stop"
    assert m.GO.code not in [entry.operation for entry in device.journal]


async def test_a_stall_is_told(base: MobileBase, sim: SimulatedBase) -> None:
    task = await going(base)
    sim.bench.inject("base.hold_wheels", held=True)
    done, _ = await asyncio.wait([task], timeout=5.0)
    assert done, "a stall has to be noticed"
    assert outcome_of(task).reason == "stalled"
    assert Cause.STALLED in (await base.read()).latched
    sim.bench.inject("base.hold_wheels", held=False)
    await assert_it_stays(sim)
    with pytest.raises(CommandError, match="GO: the wheels stalled; clear it first") as refused:
        await base.go(0.1)
    assert refused.value.status == 8
    with pytest.raises(CommandError, match="DRIVE: the wheels stalled; clear it first"):
        await base.twist(0.1, 0.0)
    await base.clear()
    assert (await base.go(0.1)).ending is Cause.REACHED


async def test_the_watchdog_stops_a_go_that_the_host_no_longer_feeds(
    base: MobileBase, sim: SimulatedBase
) -> None:
    task = await going(base)
    at = sim.clock()
    sim.bench.inject("wire.stall", line="labmate", seconds=0.8)
    # Nothing fed since the last poll at most 0.25 s before; then the ramp.
    await rest_after(sim, WATCHDOG + RAMP + 6 * POLE)
    assert sim.clock() - at > WATCHDOG - 0.25 + RAMP
    await asyncio.wait([task])
    assert outcome_of(task).reason == "watchdog"
    assert (await base.driver.counters())["watchdog_trips"] == 1
    await assert_it_stays(sim)


async def test_a_timeout_around_a_turn_stops_the_base(base: MobileBase, sim: SimulatedBase) -> None:
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(2.0):
            await base.turn(radians(180.0))
    assert degrees(sim.true_pose().heading) < 60.0
    await assert_it_stays(sim)


async def test_leaving_the_context_leaves_the_base_standing_and_its_watchdog_off(sim: SimulatedBase) -> None:
    async def fail_in_motion() -> None:
        async with sim.open() as base:
            await base.twist(0.3, 0.0)
            await asyncio.sleep(0.25)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail_in_motion()
    assert sim.bench.state()["base"]["mode"] == "idle"
    await assert_it_stays(sim)
    async with sim.open() as again:
        assert (await again.driver.counters())["watchdog_trips"] == 0


async def test_a_pulled_cable_is_told_at_once_and_the_base_stops_by_itself(
    sim: SimulatedBase, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL, "medusa")
    async with sim.open() as base:
        task = await going(base)
        at = sim.clock()
        sim.bench.inject("wire.unplug", line="labmate")
        await asyncio.wait([task])
        assert outcome_of(task).reason == "line lost"
        # "At once": the next poll of the port, not a deadline.
        assert sim.clock() - at < 0.3
        await rest_after(sim, WATCHDOG + RAMP + 6 * POLE)
        with pytest.raises(MedusaError):
            await base.go(0.1)
        sim.bench.inject("wire.plug", line="labmate")
        await assert_it_stays(sim, 5.0)
        with pytest.raises(DeviceFault, match=r"recover\(\) before it moves"):
            await base.go(0.1)
        await base.recover()
        await assert_it_stays(sim)
        assert (await base.go(0.1)).ending is Cause.REACHED


async def test_leaving_with_the_cable_pulled_says_that_the_stop_is_not_confirmed(sim: SimulatedBase) -> None:
    async def lose_the_line() -> None:
        async with sim.open() as base:
            await base.twist(0.1, 0.0)
            sim.bench.inject("wire.unplug", line="labmate")
            await asyncio.sleep(0.1)

    with pytest.raises(StopNotConfirmed, match="the stop is not confirmed"):
        await lose_the_line()


async def test_a_restart_in_motion_is_told_and_voids_the_pose(base: MobileBase, sim: SimulatedBase) -> None:
    await base.turn(radians(30.0))
    task = await going(base)
    before = sim.true_pose()
    sim.bench.inject("base.restart")
    await asyncio.wait([task])
    assert outcome_of(task).reason == "restart"
    # Without power the base stands at once: the way of the drive's pole at most.
    assert sim.true_pose().distance_to(before) <= RUN_ON + 1e-3
    for attempt in (base.go(0.1), base.turn(0.1), base.twist(0.1, 0.0)):
        with pytest.raises(DeviceRestarted, match="its pose is invalid"):
            await attempt
    await rest_after(sim, 8 * POLE)
    await assert_it_stays(sim)
    snapshot = await base.recover()
    # It counts from the restart on, and ran on without power.
    assert snapshot.own_pose.distance_to(Pose(0.0, 0.0, 0.0)) <= RUN_ON + 1e-3
    assert snapshot.pose == snapshot.own_pose
    assert (await base.go(0.2)).travelled == pytest.approx(0.2, abs=2e-3)


async def test_a_restart_during_a_motion_is_reported(base: MobileBase, sim: SimulatedBase) -> None:
    async def drive() -> None:
        async with base.motion() as motion:
            for tick in range(20):
                motion.twist(0.2, 0.0)
                await asyncio.sleep(0.1)
                if tick == 10:
                    sim.bench.inject("base.restart")

    with pytest.raises(MotionStopped) as caught:
        await drive()
    assert isinstance(caught.value.__cause__, DeviceRestarted)
    await rest_after(sim, 8 * POLE)
    await assert_it_stays(sim)
    # The stop on the way out was confirmed, without latching an emergency stop.
    assert Cause.EMERGENCY_STOP not in (await base.recover()).latched


async def test_a_low_battery_is_reported_and_forbids_a_new_go_only(
    base: MobileBase, sim: SimulatedBase
) -> None:
    reported: list[Event] = []
    forget = base.subscribe(reported.append)
    task = await going(base, 1.0)
    sim.bench.inject("base.drain_battery", volts=21.9)
    assert (await task) is not None  # the GO under way goes on to its end
    forget()
    assert [type(event) for event in reported] == [LowBattery, TravelEnded]
    assert (await base.read()).battery_low
    with pytest.raises(BatteryLow, match=r"the battery is low \(21\.9 V\)") as refused:
        await base.go(0.1)
    assert refused.value.status == 6
    stood = sim.true_pose()
    assert (await base.turn(radians(10.0))).ending is Cause.REACHED
    await base.twist(-0.1, 0.0)
    await asyncio.sleep(1.5)
    assert sim.true_pose().distance_to(stood) > 0.01


async def test_an_emulated_battery_that_starts_low_refuses_at_once() -> None:
    async with simulated_base(seed=1, emulated=EmulatedConfig(battery=21.0)) as sim, sim.open() as base:
        with pytest.raises(BatteryLow):
            await base.go(0.1)


FAULTS: dict[str, Callable[[SimulatedBase], object]] = {
    "bumper": lambda sim: sim.bench.inject("base.press_bumper", side="left"),
    "emergency stop": lambda sim: sim.bench.inject("base.press_emergency_stop"),
    "stalled": lambda sim: sim.bench.inject("base.hold_wheels", held=True),
    "watchdog": lambda sim: sim.bench.inject("wire.stall", line="labmate", seconds=0.8),
    "restart": lambda sim: sim.bench.inject("base.restart"),
    "line lost": lambda sim: sim.bench.inject("wire.hang_up", line="labmate", seconds=1.0),
}


@pytest.mark.parametrize("kind", FAULTS)
async def test_every_fault_ends_a_turn_too_and_nothing_moves_afterwards(kind: str) -> None:
    async with simulated_base(seed=2) as sim:
        opened = sim.open()
        base = await opened.__aenter__()
        task: asyncio.Task[object] = asyncio.create_task(base.turn(radians(170.0)))
        await asyncio.sleep(3.0)
        FAULTS[kind](sim)
        done, _ = await asyncio.wait([task], timeout=6.0)
        assert done
        assert outcome_of(task).reason.endswith(kind)
        # 15°/s and 30°/s²: half a second of ramp after the watchdog's half.
        await rest_after(sim, WATCHDOG + 0.5 + 6 * POLE)
        await assert_it_stays(sim, 4.0)
        if kind != "restart":
            await opened.__aexit__(None, None, None)


@pytest.mark.parametrize("seed", range(3))
async def test_a_hostile_line_loses_no_motion_and_no_outcome(seed: int) -> None:
    faults = FaultPlan(seed=seed, drop=0.1, flip=0.05, double=0.05, split=0.1, start_s=1.0, end_s=60.0)
    async with simulated_base(seed=seed, faults=faults) as sim:
        # A line that loses every sixth frame needs a watchdog with room for the repeats.
        patient = msgspec.structs.replace(
            sim.config, safety=msgspec.structs.replace(sim.config.safety, watchdog_ms=1500)
        )
        async with sim.open(patient) as base:
            travelled = 0.0
            for distance in (0.3, -0.2, 0.4):
                travelled += (await base.go(distance)).travelled
                await base.turn(radians(20.0))
                await base.turn(radians(-20.0))
            assert travelled == pytest.approx(0.5, abs=6e-3)
            # What was told and what was done are the same: 0.5 m ahead, within the body's own odometry error.
            assert sim.true_pose().x == pytest.approx(0.5, abs=0.01)


async def test_mode_stopping_is_seen_on_the_way_to_rest(base: MobileBase) -> None:
    seen: list[str] = []
    base.observe(lambda reading: seen.append(reading.details["mode"]))
    task = await going(base)
    await base.stop()
    await asyncio.wait([task])
    assert "go" in seen
    assert "stopping" in seen
    assert seen[-1] == "idle"
    assert outcome_of(task).reason == "stop"


async def test_a_host_that_connects_to_a_moving_base_finds_it_standing(sim: SimulatedBase) -> None:
    async with Line(sim.port, seed=3) as line:
        earlier = line.session(m.DEFAULT_ADDRESS)
        await earlier.open()
        await earlier.request(m.GO, payload=m.Go(5.0).encode())
        await asyncio.sleep(2.0)
        # The earlier host vanishes without a word; it had set no watchdog.
    assert sim.bench.state()["base"]["mode"] == "go"
    async with sim.open() as base:
        assert (await base.read()).at_rest
        await assert_it_stays(sim)
        assert (await base.go(0.1)).ending is Cause.REACHED
