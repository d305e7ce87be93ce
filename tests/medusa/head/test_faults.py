"""What goes wrong in the middle of a move: each with its named outcome, and the motor command at zero."""

import asyncio
import math

import pytest

from medusa.errors import MedusaError, PortError
from medusa.head.faults import Cause, Fault, JointFault
from medusa.head.joint_group import JointGroup
from medusa.mc3000.board import Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import SimulatedHead

DEGREE = math.radians(1)
LONG_MOVE = {
    "pan": 80 * DEGREE,
    "tilt": -35 * DEGREE,
    "left_vergence": 35 * DEGREE,
    "right_vergence": -35 * DEGREE,
}
IN_THE_MIDDLE = 0.25
ALL = ("tilt", "left_vergence", "right_vergence", "pan")

WATCHDOG = 0.4
RAMP = 0.21
"""The longest programmed deceleration: 111.6°/s at 540°/s² (tilt)."""


async def fail(
    sim: SimulatedHead, head: JointGroup, verb: str, **arguments: object
) -> tuple[JointFault, list[Fault]]:
    """Run a move, inject something in its middle; how the move ended, and every fault reported."""
    faults: list[Fault] = []
    head.subscribe(faults.append)
    moving = asyncio.ensure_future(head.move(LONG_MOVE))
    await asyncio.sleep(IN_THE_MIDDLE)
    assert all(abs(float(joint["velocity"])) > 5 * DEGREE for joint in truth(sim).values())
    sim.bench.inject(verb, **arguments)
    with pytest.raises(JointFault) as ended:
        await moving
    return ended.value, faults


def truth(sim: SimulatedHead) -> dict[str, dict[str, float]]:
    joints: dict[str, dict[str, float]] = sim.bench.state()["head"]["joints"]
    return joints


def assert_standing(sim: SimulatedHead, *, idle: tuple[str, ...]) -> None:
    """All joints at rest; those of `idle` idle with a motor command of exactly zero."""
    for name, joint in truth(sim).items():
        # One count in a sample of 2.048 ms of the finest joint is 0.9°/s; the limit cycle stays under it.
        assert abs(joint["velocity"]) < 0.9 * DEGREE, name
        if name in idle:
            assert (joint["mode"], joint["motor_command"]) == (0, 0), name
            assert joint["velocity"] == pytest.approx(0.0, abs=0.1 * DEGREE)
        else:
            # Held in position mode: the dead band leaves at most one DAC count (thesis, servo loop).
            assert joint["mode"] == 1
            assert abs(joint["motor_command"]) <= 1


async def assert_homing_void(sim: SimulatedHead, head: JointGroup, name: str) -> None:
    """Neither this host nor a later one believes the count of a joint that may have lost it."""
    assert {other for other, axis in Mc3000Drive.of(head).axes.items() if not axis.homed} == {name}
    axis = Mc3000Drive.of(head).axes[name]
    assert await axis.board.read_mark(axis.channel) == bytes(4)


async def test_amplifier_fault(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "head.amplifier_fault", axis="tilt", fault="over_temperature")
    assert ended.report.cause is Cause.DRIVE
    assert ended.axis == "tilt"
    assert "the amplifier reports over-temperature" in str(ended)
    assert [(fault.cause, fault.joints) for fault in faults] == [(Cause.DRIVE, ("tilt",))]
    # The inhibited bridge brakes no more: the speed decays with ten times T_M, 0.14 s (docs/protocols).
    await asyncio.sleep(1.0)
    assert_standing(sim, idle=("tilt",))
    sim.bench.inject("head.amplifier_fault", axis="tilt", fault="over_temperature", on=False)
    assert await head.clear() == {}
    await head.enable()
    await head.move({"tilt": 0.0})


async def test_emergency_stop_of_one_board_stops_both(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "head.emergency_stop", board=2)
    assert ended.report.cause is Cause.EMERGENCY_STOP
    assert ended.axis == "pan"
    assert {name for fault in faults for name in fault.joints} == set(ALL)
    assert_standing(sim, idle=ALL)
    await head.clear()
    await head.enable()
    await head.move({"pan": 0.0})


async def test_board_restarted(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "head.restart_board", board=1)
    assert ended.report.cause is Cause.RESTARTED
    assert ended.report.joints == ("tilt", "left_vergence", "right_vergence")
    assert [fault.cause for fault in faults] == [Cause.RESTARTED]
    assert_standing(sim, idle=("tilt", "left_vergence", "right_vergence"))
    # Homing is void on the board that restarted, and on that one only.
    await head.enable()
    assert {name for name, axis in Mc3000Drive.of(head).axes.items() if axis.homed} == {"pan"}


async def test_cable_pulled(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "wire.unplug", line="mc3000")
    assert ended.report.cause is Cause.LOST
    assert "could not be confirmed" in str(ended)
    assert {name for fault in faults for name in fault.joints} == set(ALL)
    await asyncio.sleep(WATCHDOG + RAMP)
    assert_standing(sim, idle=ALL)
    with pytest.raises(PortError):
        await head.read()
    before = sim.machine.joint_angles(asyncio.get_running_loop().time())
    sim.bench.inject("wire.plug", line="mc3000")
    # Reconnected by itself, greeted, and nothing moves.
    await asyncio.sleep(5.0)
    assert sim.machine.joint_angles(asyncio.get_running_loop().time()) == before
    assert {joint.device.mode for joint in (await head.read()).joints.values()} == {Mode.IDLE}
    with pytest.raises(MedusaError, match="pan: is idle; enable it first"):
        await head.move({"pan": 0.0})
    await head.enable()
    assert all(axis.homed for axis in Mc3000Drive.of(head).axes.values())
    await head.move({"pan": 0.0})


async def test_cable_of_the_amplifiers_pulled(sim: SimulatedHead, head: JointGroup) -> None:
    ended, _ = await fail(sim, head, "wire.unplug", line="servo-amps")
    assert ended.report.cause is Cause.LOST
    assert "amplifier does not answer" in str(ended)
    assert_standing(sim, idle=())
    # The amplifiers' own watchdog of 3 s then switches their bridges off.
    await asyncio.sleep(3.5)
    assert {str(joint["bridge"]) for joint in truth(sim).values()} == {"inhibited"}
    assert_standing(sim, idle=ALL)
    sim.bench.inject("wire.plug", line="servo-amps")
    await asyncio.sleep(2.0)
    await head.clear()
    await head.enable()
    await head.move({"pan": 0.0})


async def test_encoder_lost(sim: SimulatedHead, head: JointGroup) -> None:
    ended, _ = await fail(sim, head, "head.encoder_loss", axis="left_vergence")
    assert ended.report.cause is Cause.FOLLOWING
    assert ended.axis == "left_vergence"
    assert_standing(sim, idle=("left_vergence",))
    await assert_homing_void(sim, head, "left_vergence")


async def test_limit_switch_reached(sim: SimulatedHead, head: JointGroup) -> None:
    ended, _ = await fail(sim, head, "head.switch", axis="pan", side="positive", held="closed")
    assert ended.report.cause is Cause.LIMIT
    assert "pan: positive limit switch reached at" in str(ended)
    assert_standing(sim, idle=("pan",))
    await assert_homing_void(sim, head, "pan")


async def test_a_host_that_is_not_heard_in_time(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "wire.stall", line="mc3000", seconds=0.7)
    assert ended.report.cause is Cause.WATCHDOG
    assert {fault.cause for fault in faults} == {Cause.WATCHDOG}
    assert {name for fault in faults for name in fault.joints} == set(ALL)
    assert_standing(sim, idle=ALL)
    await head.enable()
    await head.move({"pan": 0.0})


async def test_a_silent_line(sim: SimulatedHead, head: JointGroup) -> None:
    ended, faults = await fail(sim, head, "wire.stall", line="mc3000", seconds=4.0)
    # After 0.4 s unanswered the boards' watchdogs have expired; after a second nothing is expected to answer any more.
    assert ended.report.cause is Cause.WATCHDOG
    assert {fault.cause for fault in faults} == {Cause.WATCHDOG, Cause.LOST}
    assert_standing(sim, idle=ALL)
    await asyncio.sleep(6.0)
    await head.clear()
    await head.enable()
    await head.move({"pan": 0.0})


async def test_a_power_cycled_amplifier(sim: SimulatedHead, head: JointGroup) -> None:
    ended, _ = await fail(sim, head, "head.restart_amplifier", axis="pan")
    assert ended.report.joints == ("pan",)
    assert_standing(sim, idle=("pan",))
    await head.home(["pan"])
    await head.move({"pan": 0.0})


@pytest.mark.parametrize(
    ("verb", "arguments", "kind"),
    [
        ("head.amplifier_fault", {"axis": "pan"}, Cause.DRIVE),
        ("head.emergency_stop", {}, Cause.EMERGENCY_STOP),
        ("head.restart_board", {"board": 2}, Cause.RESTARTED),
        ("head.encoder_loss", {"axis": "pan"}, Cause.FOLLOWING),
    ],
)
async def test_a_fault_while_jogging_stops_the_other_joints_too(
    sim: SimulatedHead, head: JointGroup, verb: str, arguments: dict[str, object], kind: Cause
) -> None:
    faults: list[Fault] = []
    head.subscribe(faults.append)
    await head.velocity({"pan": 20 * DEGREE, "tilt": 10 * DEGREE, "left_vergence": 10 * DEGREE})
    await asyncio.sleep(0.2)
    sim.bench.inject(verb, **arguments)
    # Seen at the next feeding at the latest (0.13 s), but for the lost encoder: 5° at 20°/s; then the ramp.
    await asyncio.sleep(1.2)
    assert faults[0].cause is kind
    for joint in truth(sim).values():
        assert abs(joint["velocity"]) < 0.9 * DEGREE


async def test_faults_of_one_board_do_not_stop_a_machine_that_rests(
    sim: SimulatedHead, head: JointGroup
) -> None:
    faults: list[Fault] = []
    head.subscribe(faults.append)
    sim.bench.inject("head.amplifier_fault", axis="pan")
    await asyncio.sleep(1.0)
    assert [fault.cause for fault in faults] == [Cause.DRIVE]
    await head.move({"tilt": 0.1})
