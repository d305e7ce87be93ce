"""What can go wrong while homing: each failure has its name and leaves the joint disabled and not homed."""

import asyncio
import math

import pytest

from medusa.head.joint_group import JointGroup
from medusa.mc3000.board import BoardEvent, EventKind
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.homing.search import HomingError, HomingFailure
from medusa.mc3000.mark import NO_MARK
from medusa.simulation import SimulatedHead


async def expect_failure(head: JointGroup, name: str, failure: HomingFailure) -> str:
    with pytest.raises(HomingError) as failed:
        await head.home([name])
    assert failed.value.failure is failure
    assert failed.value.axis == name
    assert not Mc3000Drive.of(head).axes[name].homed
    return str(failed.value)


def assert_left_disabled(sim: SimulatedHead, name: str) -> None:
    joint = sim.bench.state()["head"]["joints"][name]
    assert (joint["mode"], joint["motor_command"], joint["bridge"]) == (0, 0, "inhibited")


async def test_no_sensor_within_travel(sim: SimulatedHead) -> None:
    sim.bench.inject("head.sensor", axis="tilt", stuck="off")
    with sim.machine.record("tilt") as record:
        async with sim.open() as head:
            message = await expect_failure(head, "tilt", HomingFailure.NO_SENSOR)
            assert_left_disabled(sim, "tilt")
            assert await Mc3000Drive.of(head).axes["tilt"].board.read_mark(2) == NO_MARK
    assert "no sensor within travel" in message
    # It went to the positive switch, reversed there, and looked as far as the negative one.
    assert math.degrees(max(record.angle)) >= 40.0
    assert math.degrees(min(record.angle)) <= -40.0


async def test_sensor_stuck_on(sim: SimulatedHead) -> None:
    sim.bench.inject("head.sensor", axis="right_vergence", stuck="on")
    async with sim.open() as head:
        message = await expect_failure(head, "right_vergence", HomingFailure.SENSOR_STUCK_ON)
        assert "sensor stuck on (until the limit switch)" in message
        assert_left_disabled(sim, "right_vergence")


async def test_both_switches_at_once(sim: SimulatedHead) -> None:
    for side in ("negative", "positive"):
        sim.bench.inject("head.switch", axis="pan", side=side, held="closed")
    async with sim.open() as head:
        await expect_failure(head, "pan", HomingFailure.BOTH_SWITCHES)
        assert_left_disabled(sim, "pan")


async def test_still_on_the_limit_switch_after_backing_off(sim: SimulatedHead) -> None:
    sim.bench.inject("head.switch", axis="pan", side="negative", held="closed")
    async with sim.open() as head:
        message = await expect_failure(head, "pan", HomingFailure.STILL_ON_SWITCH)
        assert "limit switch closed after 10°" in message
        assert_left_disabled(sim, "pan")


async def test_still_on_the_sensor_after_retract(sim: SimulatedHead) -> None:
    async with sim.open() as head:

        def stick(event: BoardEvent) -> None:
            if event.kind is EventKind.LATCH_CAUGHT:
                sim.bench.inject("head.sensor", axis="pan", stuck="on")

        Mc3000Drive.of(head).axes["pan"].subscribe(stick)
        message = await expect_failure(head, "pan", HomingFailure.STILL_ON_SWITCH)
        assert "2° before its edge" in message
        assert_left_disabled(sim, "pan")


async def test_a_limit_switch_that_closes_on_the_slow_approach(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        homing = asyncio.ensure_future(expect_failure(head, "pan", HomingFailure.LIMIT))
        # From −23° the edge is met after 0.2 s, and retracting takes 0.2 s more.
        await asyncio.sleep(1.2)
        sim.bench.inject("head.switch", axis="pan", side="positive", held="closed")
        assert "on the slow approach" in await homing
        assert_left_disabled(sim, "pan")


@pytest.mark.parametrize(
    ("verb", "arguments", "failure"),
    [
        ("head.amplifier_fault", {"axis": "pan"}, HomingFailure.AMPLIFIER_FAULT),
        ("head.restart_board", {"board": 2}, HomingFailure.RESTARTED),
        ("wire.unplug", {"line": "mc3000"}, HomingFailure.LINE_LOST),
        ("head.emergency_stop", {}, HomingFailure.EMERGENCY_STOP),
        ("head.encoder_loss", {"axis": "pan"}, HomingFailure.FOLLOWING),
        ("wire.stall", {"line": "mc3000", "seconds": 0.7}, HomingFailure.WATCHDOG),
    ],
)
@pytest.mark.parametrize("after", [0.25, 0.9])
async def test_what_happens_while_homing_is_named(
    sim: SimulatedHead, verb: str, arguments: dict[str, object], failure: HomingFailure, after: float
) -> None:
    async def program() -> None:
        async with sim.open() as head:
            homing = asyncio.ensure_future(expect_failure(head, "pan", failure))
            await asyncio.sleep(after)
            sim.bench.inject(verb, **arguments)
            await homing
            if failure is HomingFailure.LINE_LOST:
                # The watchdog idles the axis; nothing could be inhibited over a pulled cable.
                await asyncio.sleep(1.0)
                joint = sim.bench.state()["head"]["joints"]["pan"]
                assert (joint["mode"], joint["motor_command"]) == (0, 0)
                sim.bench.inject("wire.plug", line="mc3000")
                await asyncio.sleep(3.0)
                await head.disable()
            assert_left_disabled(sim, "pan")

    await program()


async def test_a_fault_of_another_joint_interrupts_homing(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        await head.enable(["tilt"])
        homing = asyncio.ensure_future(expect_failure(head, "pan", HomingFailure.INTERRUPTED))
        await asyncio.sleep(0.25)
        sim.bench.inject("head.amplifier_fault", axis="tilt")
        assert "tilt: amplifier fault" in await homing
        assert_left_disabled(sim, "pan")


async def test_cancelled_homing_leaves_the_joint_disabled_and_unmarked(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        homing = asyncio.ensure_future(head.home(["pan"]))
        await asyncio.sleep(0.3)
        homing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await homing
        assert_left_disabled(sim, "pan")
        assert await Mc3000Drive.of(head).axes["pan"].board.read_mark(0) == NO_MARK


async def test_a_wrong_sign_does_not_home(sim: SimulatedHead) -> None:
    async with sim.open(sim.config.with_axis("pan", sign=-1)) as head:
        # Sought the wrong way round, the sensor goes on, and never off again.
        await expect_failure(head, "pan", HomingFailure.SENSOR_STUCK_ON)


async def test_the_joint_that_failed_is_named_not_the_one_that_it_interrupted(sim: SimulatedHead) -> None:
    """Both eyes home together; the left one's amplifier fails while the right one moves to its home angle."""
    async with sim.open() as head:
        eyes = ["left_vergence", "right_vergence"]
        homing = asyncio.ensure_future(head.home(eyes))
        await asyncio.sleep(0.4)
        sim.bench.inject("head.amplifier_fault", axis="left_vergence")
        with pytest.raises(HomingError) as failed:
            await homing
        assert (failed.value.axis, failed.value.failure) == ("left_vergence", HomingFailure.AMPLIFIER_FAULT)
        for name in eyes:
            assert_left_disabled(sim, name)
            assert not Mc3000Drive.of(head).axes[name].homed
