"""Homing: the zero from the latched edge, over and over; each named failure; the mark across processes."""

import asyncio
import itertools
import math
import random
from contextlib import ExitStack

import msgspec
import pytest

from medusa.config import HeadConfig
from medusa.errors import CommandError
from medusa.head import Head
from medusa.homing_mark import NO_MARK, make_mark
from medusa.homing_search import HomingError, HomingFailure
from medusa.mc3000 import BoardEvent, Mode, Operation
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices import head_config

EDGES_DEG = {"pan": -20.0, "tilt": -10.0, "left_vergence": -15.0, "right_vergence": -12.0}
SWITCHES_DEG = {"pan": 95.0, "tilt": 40.0, "left_vergence": 40.0, "right_vergence": 40.0}
RANDOM_STARTS = 50

FRICTION_DAC_COUNTS = 2.0
# Dead band on the nearest registers (thesis, §1.6 of the equations) and friction/(K (1 − A/256)), counts.
RESTING = {
    "pan": 2.5 + FRICTION_DAC_COUNTS / (1.75 * (1 - 197 / 256)),
    "tilt": 5.7 + FRICTION_DAC_COUNTS / (1.25 * (1 - 220 / 256)),
    "left_vergence": 6.6 + FRICTION_DAC_COUNTS / (1.25 * (1 - 225 / 256)),
    "right_vergence": 6.6 + FRICTION_DAC_COUNTS / (1.25 * (1 - 225 / 256)),
}


def all_together(config: HeadConfig) -> HeadConfig:
    homing = msgspec.structs.replace(config.homing, order=(tuple(EDGES_DEG),))
    return msgspec.structs.replace(config, homing=homing)


def true_edge_count(times_angles_counts: list[tuple[float, int]], edge: float, near: int) -> float:
    """Encoder count at which the true joint angle passed the edge upward, on the pass nearest to `near`."""
    passes = []
    for (before, count_before), (after, count_after) in itertools.pairwise(times_angles_counts):
        if before < edge <= after:
            part = (edge - before) / (after - before)
            passes.append(count_before + part * (count_after - count_before))
    return min(passes, key=lambda count: abs(count - near))


async def test_the_zero_repeats_within_two_counts_with_friction_and_backlash() -> None:
    rng = random.Random(1994)
    machine = head_config.HeadConfig(friction_counts=FRICTION_DAC_COUNTS, backlash_deg=0.02)
    zero: dict[str, list[float]] = {name: [] for name in EDGES_DEG}
    async with simulated_head(seed=2, config=machine) as sim, sim.open(all_together(sim.config)) as head:
        for _ in range(RANDOM_STARTS):
            for name, switch in SWITCHES_DEG.items():
                angle = math.radians(rng.uniform(-switch, switch))
                sim.bench.inject("head.place", axis=name, angle=angle)
            with ExitStack() as stack:
                records = {name: stack.enter_context(sim.machine.record(name)) for name in EDGES_DEG}
                results = await head.home()
            await asyncio.sleep(0.2)
            for name, joint in sim.bench.state()["head"]["joints"].items():
                record, latched = records[name], results[name].latched_counts
                samples = list(zip(record.angle, record.actual, strict=True))
                zero[name].append(latched - true_edge_count(samples, math.radians(EDGES_DEG[name]), latched))
                assert abs(joint["command_counts"] - joint["actual_counts"]) <= RESTING[name]
            await head.disable()
    for name, errors in zero.items():
        assert len(errors) == RANDOM_STARTS
        assert max(abs(error) for error in errors) <= 2, name


async def test_homing_without_friction_sets_straight_ahead_to_zero(sim: SimulatedHead, head: Head) -> None:
    truth = sim.machine.joint_angles(asyncio.get_running_loop().time())
    for name, angle in truth.items():
        # Latch within a count of the edge, and the dead band of 6.6 counts at most.
        assert abs(angle) * head.axes[name].config.counts_per_radian <= 8


async def test_joints_home_in_the_order_that_keeps_them_apart(sim: SimulatedHead) -> None:
    with ExitStack() as stack:
        records = {name: stack.enter_context(sim.machine.record(name)) for name in EDGES_DEG}
        async with sim.open() as head:
            await head.home()

    def moved(name: str) -> tuple[float, float]:
        """When the joint was last less than 0.3° from its first, and first less than that from its last angle."""
        record, near = records[name], math.radians(0.3)
        away = [t for t, a in zip(record.time, record.angle, strict=True) if abs(a - record.angle[0]) > near]
        back = [t for t, a in zip(record.time, record.angle, strict=True) if abs(a - record.angle[-1]) > near]
        return away[0], back[-1]

    spans = {name: moved(name) for name in EDGES_DEG}
    assert spans["tilt"][1] < min(spans["left_vergence"][0], spans["right_vergence"][0])
    assert spans["left_vergence"][0] == pytest.approx(spans["right_vergence"][0], abs=0.05)
    assert max(spans["left_vergence"][1], spans["right_vergence"][1]) < spans["pan"][0]


@pytest.mark.parametrize("angle_deg", [97.0, -97.0, 99.9, -99.9])
async def test_a_joint_that_starts_beyond_a_limit_switch_backs_off_and_homes(
    sim: SimulatedHead, angle_deg: float
) -> None:
    sim.bench.inject("head.place", axis="pan", angle=math.radians(angle_deg))
    async with sim.open() as head:
        await head.home(["pan"])
        assert head.axes["pan"].homed
        settings = await head.axes["pan"].board.settings(0)
        assert settings.limit_enable
    truth = sim.machine.joint_angles(asyncio.get_running_loop().time())["pan"]
    assert math.degrees(truth) == pytest.approx(0.0, abs=8 / 277)


async def test_homing_only_the_named_joints(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        assert set(await head.home(["left_vergence"])) == {"left_vergence"}
        assert {name for name, axis in head.axes.items() if axis.homed} == {"left_vergence"}
        with pytest.raises(CommandError, match="there is no joint 'neck'"):
            await head.home(["neck"])


async def expect_failure(head: Head, name: str, failure: HomingFailure) -> str:
    with pytest.raises(HomingError) as failed:
        await head.home([name])
    assert failed.value.failure is failure
    assert failed.value.axis == name
    assert not head.axes[name].homed
    return str(failed.value)


def assert_left_disabled(sim: SimulatedHead, name: str) -> None:
    joint = sim.bench.state()["head"]["joints"][name]
    assert (joint["mode"], joint["motor_command"], joint["bridge"]) == (0, 0, "inhibited")


async def test_no_sensor_within_travel(sim: SimulatedHead) -> None:
    sim.bench.inject("head.sensor", axis="tilt", stuck="off")
    with sim.machine.record("tilt") as record:
        async with sim.open() as head:
            told = await expect_failure(head, "tilt", HomingFailure.NO_SENSOR)
            assert_left_disabled(sim, "tilt")
            assert await head.axes["tilt"].board.read_mark(2) == NO_MARK
    assert "no sensor within travel" in told
    # It went to the positive switch, reversed there, and looked as far as the negative one.
    assert math.degrees(max(record.angle)) >= 40.0
    assert math.degrees(min(record.angle)) <= -40.0


async def test_sensor_stuck_on(sim: SimulatedHead) -> None:
    sim.bench.inject("head.sensor", axis="right_vergence", stuck="on")
    async with sim.open() as head:
        told = await expect_failure(head, "right_vergence", HomingFailure.SENSOR_STUCK_ON)
        assert "sensor stuck on (until the limit switch)" in told
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
        told = await expect_failure(head, "pan", HomingFailure.STILL_ON_SWITCH)
        assert "limit switch closed after 10°" in told
        assert_left_disabled(sim, "pan")


async def test_still_on_the_sensor_after_retract(sim: SimulatedHead) -> None:
    async with sim.open() as head:

        def stick(event: BoardEvent) -> None:
            if event.operation is Operation.LATCH_CAUGHT:
                sim.bench.inject("head.sensor", axis="pan", stuck="on")

        head.axes["pan"].subscribe(stick)
        told = await expect_failure(head, "pan", HomingFailure.STILL_ON_SWITCH)
        assert "2° before its edge" in told
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
        assert await head.axes["pan"].board.read_mark(0) == NO_MARK


async def test_a_wrong_sign_does_not_home(sim: SimulatedHead) -> None:
    async with sim.open(sim.config.with_axis("pan", sign=-1)) as head:
        # Sought the wrong way round, the sensor goes on, and never off again.
        await expect_failure(head, "pan", HomingFailure.SENSOR_STUCK_ON)


async def test_a_new_process_believes_the_mark(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        await head.home()
        await head.move({"pan": 0.3})
    async with sim.open() as head:
        assert all(axis.homed for axis in head.axes.values())
        # 0.3 rad within the dead band, zero and rounding; idle in between, it stands where it stood.
        assert (await head.snapshot()).joints["pan"].angle == pytest.approx(0.3, abs=6 / 15915)


@pytest.fixture
async def homed(sim: SimulatedHead) -> SimulatedHead:
    async with sim.open() as head:
        await head.home()
    return sim


async def homed_joints(sim: SimulatedHead, config: HeadConfig | None = None) -> set[str]:
    async with sim.open(config) as head:
        return {name for name, axis in head.axes.items() if axis.homed}


async def test_a_restarted_board_is_not_believed(homed: SimulatedHead) -> None:
    homed.bench.inject("head.restart_board", board=1)
    assert await homed_joints(homed) == {"pan"}


async def test_another_configuration_is_not_believed(homed: SimulatedHead) -> None:
    assert await homed_joints(homed, homed.config.with_axis("tilt", home_edge_deg=-11.0)) == {
        "pan",
        "left_vergence",
        "right_vergence",
    }


async def test_another_port_is_not_believed(homed: SimulatedHead) -> None:
    async with Head.open(homed.config, homed.boards, homed.amps, port_name="another") as head:
        assert not any(axis.homed for axis in head.axes.values())


async def test_a_lost_feedback_zeroes_the_mark(homed: SimulatedHead) -> None:
    homed.bench.inject("head.encoder_loss", axis="tilt", at="both")
    assert await homed_joints(homed) == {"pan", "left_vergence", "right_vergence"}
    async with homed.open() as head:
        assert await head.axes["tilt"].board.read_mark(2) == NO_MARK


async def test_a_preset_voids_the_mark(homed: SimulatedHead) -> None:
    async with homed.open() as head:
        await head.axes["pan"].board.preset(0, 5)
    assert await homed_joints(homed) == {"tilt", "left_vergence", "right_vergence"}


async def test_the_mark_is_written_last_of_all(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        pan = head.axes["pan"]
        marks: list[tuple[bytes, Mode, bool]] = []

        async def watch() -> None:
            while not marks or marks[-1][0] == NO_MARK:
                joint = (await head.snapshot()).joints["pan"]
                mark = await pan.board.read_mark(0)
                at_home = pan.homed and abs(joint.angle) < 0.01
                marks.append((mark, joint.mode, at_home))
                await asyncio.sleep(0.02)

        watching = asyncio.ensure_future(watch())
        await head.home(["pan"])
        await watching
        # As long as there was no mark there was no trust; with it, the joint stood at its home angle.
        assert marks[-1] == (head.mark("pan"), Mode.POSITION, True)
        assert all(mark == NO_MARK for mark, _, _ in marks[:-1])


def test_a_mark_depends_on_port_configuration_and_boot_count(sim_config: HeadConfig) -> None:
    axis = sim_config.axes.pan
    marks = {
        make_mark("/dev/ttyUSB0", "pan", axis, 7),
        make_mark("/dev/ttyUSB1", "pan", axis, 7),
        make_mark("/dev/ttyUSB0", "tilt", axis, 7),
        make_mark("/dev/ttyUSB0", "pan", axis, 8),
        make_mark("/dev/ttyUSB0", "pan", msgspec.structs.replace(axis, sign=-1), 7),
    }
    assert len(marks) == 5
    assert all(len(mark) == 4 and mark != NO_MARK for mark in marks)


@pytest.fixture
def sim_config() -> HeadConfig:
    from medusa.config_simulated import simulated_config

    return simulated_config()


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
            assert not head.axes[name].homed
