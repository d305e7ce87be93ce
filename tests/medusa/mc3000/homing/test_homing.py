"""Homing: the zero from the latched edge, over and over; the mark across processes."""

import asyncio
import itertools
import math
import random
from contextlib import ExitStack

import msgspec
import pytest

from medusa.errors import CommandError
from medusa.head.joint_group import JointGroup
from medusa.machines import open_head
from medusa.mc3000.board import Mode
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.mark import NO_MARK, axis_digest, make_mark
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


def all_together(config: Mc3000Config) -> Mc3000Config:
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


async def test_homing_without_friction_sets_straight_ahead_to_zero(
    sim: SimulatedHead, head: JointGroup
) -> None:
    truth = sim.machine.joint_angles(asyncio.get_running_loop().time())
    for name, angle in truth.items():
        # Latch within a count of the edge, and the dead band of 6.6 counts at most.
        assert abs(angle) * Mc3000Drive.of(head).axes[name].config.counts_per_radian <= 8


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
        assert Mc3000Drive.of(head).axes["pan"].homed
        settings = await Mc3000Drive.of(head).axes["pan"].board.settings(0)
        assert settings.limit_enable
    truth = sim.machine.joint_angles(asyncio.get_running_loop().time())["pan"]
    assert math.degrees(truth) == pytest.approx(0.0, abs=8 / 277)


async def test_homing_only_the_named_joints(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        assert set(await head.home(["left_vergence"])) == {"left_vergence"}
        assert {name for name, axis in Mc3000Drive.of(head).axes.items() if axis.homed} == {"left_vergence"}
        with pytest.raises(CommandError, match="there is no joint 'neck'"):
            await head.home(["neck"])


async def test_a_new_process_takes_the_mark_as_valid(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        await head.home()
        await head.move({"pan": 0.3})
    async with sim.open() as head:
        assert all(axis.homed for axis in Mc3000Drive.of(head).axes.values())
        # 0.3 rad within the dead band, zero and rounding; idle in between, it stays where it was.
        assert (await head.read()).joints["pan"].angle == pytest.approx(0.3, abs=6 / 15915)


@pytest.fixture
async def homed(sim: SimulatedHead) -> SimulatedHead:
    async with sim.open() as head:
        await head.home()
    return sim


async def homed_joints(sim: SimulatedHead, config: Mc3000Config | None = None) -> set[str]:
    async with sim.open(config) as head:
        return {name for name, axis in Mc3000Drive.of(head).axes.items() if axis.homed}


async def test_a_restarted_board_makes_the_mark_invalid(homed: SimulatedHead) -> None:
    homed.bench.inject("head.restart_board", board=1)
    assert await homed_joints(homed) == {"pan"}


async def test_another_configuration_makes_the_mark_invalid(homed: SimulatedHead) -> None:
    assert await homed_joints(homed, homed.config.with_axis("tilt", home_edge_deg=-11.0)) == {
        "pan",
        "left_vergence",
        "right_vergence",
    }


async def test_another_port_makes_the_mark_invalid(homed: SimulatedHead) -> None:
    async with open_head(homed.config, homed.boards, homed.amps, port_name="another") as head:
        assert not any(axis.homed for axis in Mc3000Drive.of(head).axes.values())


async def test_a_lost_feedback_zeroes_the_mark(homed: SimulatedHead) -> None:
    homed.bench.inject("head.encoder_loss", axis="tilt", at="both")
    assert await homed_joints(homed) == {"pan", "left_vergence", "right_vergence"}
    async with homed.open() as head:
        assert await Mc3000Drive.of(head).axes["tilt"].board.read_mark(2) == NO_MARK


async def test_a_preset_clears_the_mark(homed: SimulatedHead) -> None:
    async with homed.open() as head:
        await Mc3000Drive.of(head).axes["pan"].board.preset(0, 5)
    assert await homed_joints(homed) == {"tilt", "left_vergence", "right_vergence"}


async def test_the_mark_is_written_last_of_all(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        pan = Mc3000Drive.of(head).axes["pan"]
        marks: list[tuple[bytes, Mode, bool]] = []

        async def watch() -> None:
            while not marks or marks[-1][0] == NO_MARK:
                joint = (await head.read()).joints["pan"]
                mark = await pan.board.read_mark(0)
                at_home = pan.homed and abs(joint.angle) < 0.01
                marks.append((mark, joint.device.mode, at_home))
                await asyncio.sleep(0.02)

        watching = asyncio.ensure_future(watch())
        await head.home(["pan"])
        await watching
        # As long as there was no mark it did not count as homed; with it, the joint is at its home angle.
        assert marks[-1] == (Mc3000Drive.of(head).mark("pan"), Mode.POSITION, True)
        assert all(mark == NO_MARK for mark, _, _ in marks[:-1])


def test_a_mark_depends_on_port_configuration_and_boot_count(sim_config: Mc3000Config) -> None:
    axis = sim_config.axes["pan"]
    marks = {
        make_mark("/dev/ttyUSB0", "pan", axis, 7),
        make_mark("/dev/ttyUSB1", "pan", axis, 7),
        make_mark("/dev/ttyUSB0", "tilt", axis, 7),
        make_mark("/dev/ttyUSB0", "pan", axis, 8),
        make_mark("/dev/ttyUSB0", "pan", msgspec.structs.replace(axis, sign=-1), 7),
    }
    assert len(marks) == 5
    assert all(len(mark) == 4 and mark != NO_MARK for mark in marks)


def test_checks_and_marks_made_before_the_configuration_named_its_drive_stay_valid(
    sim_config: Mc3000Config,
) -> None:
    # Made by the program as it was at 368fa64, before `drive` was a key.
    digest = "7f5fe4a8af63aa72da5c078e0f4d3c0dfc79b8a15449231a05987514db08cb73"
    assert axis_digest("pan", sim_config.axes["pan"]) == digest
    assert make_mark("/dev/ttyUSB0", "pan", sim_config.axes["pan"], 7).hex() == "68a6bafa"
    assert (
        make_mark("/dev/ttyUSB0", "right_vergence", sim_config.axes["right_vergence"], 7).hex() == "33ae043e"
    )


@pytest.fixture
def sim_config() -> Mc3000Config:
    from medusa.mc3000.simulated_config import simulated_config

    return simulated_config()
