"""Saccades on the emulated head: joints arrive together, and what is refused or reported."""

import asyncio
import math

import pytest

from medusa.errors import CommandError
from medusa.head.saccade import saccade_targets
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import simulated_head

PERIOD = 2.048e-3


def test_version_and_vergence_keep_what_is_not_given() -> None:
    now = {
        "pan": 0.0,
        "tilt": 0.0,
        "left_vergence": 0.10,
        "right_vergence": 0.16,
    }  # version .13, vergence .06
    assert saccade_targets(now, pan=0.2) == {"pan": 0.2}
    turned = saccade_targets(now, version=0.3)
    assert turned == pytest.approx({"left_vergence": 0.27, "right_vergence": 0.33})
    nearer = saccade_targets(now, vergence=0.2, tilt=-0.1)
    assert nearer == pytest.approx({"tilt": -0.1, "left_vergence": 0.03, "right_vergence": 0.23})


def test_nothing_to_look_at_and_eyes_that_look_apart_are_refused() -> None:
    now = {"left_vergence": 0.0, "right_vergence": 0.0}
    with pytest.raises(CommandError, match="nowhere to look"):
        saccade_targets(now)
    with pytest.raises(CommandError, match="a vergence of -2° is below 0"):
        saccade_targets(now, vergence=math.radians(-2))


async def test_four_joints_end_in_one_sample_of_each_board_and_settle() -> None:
    async with simulated_head(seed=2) as sim, sim.open() as head:
        await head.home()
        targets = {
            "pan": math.radians(20),
            "tilt": math.radians(-5),
            "left_vergence": math.radians(8),
            "right_vergence": math.radians(12),
        }
        with (
            sim.machine.record("left_vergence") as left,
            sim.machine.record("right_vergence") as right,
            sim.machine.record("tilt") as tilt,
            sim.machine.record("pan") as pan,
        ):
            report = await head.move(targets, together=True)
        assert report.all_settled
        assert report.plan.early == ()
        assert report.ends.repeated == ()
        ends = [r.time[r.command.index(r.command[-1])] for r in (left, right, tilt, pan)]
        assert ends[0] == ends[1] == ends[2]  # one board: the very sample
        assert abs(ends[3] - ends[0]) <= 2 * PERIOD + 1e-9  # the two boards
        # What the boards stamped says the same: 1 µs a stamp, and the clocks' estimate is good to one line byte.
        assert report.end_skew == pytest.approx(abs(ends[3] - ends[0]), abs=1e-3)
        for name, angle in sim.machine.joint_angles(asyncio.get_running_loop().time()).items():
            error = abs(angle - targets[name]) * Mc3000Drive.of(head).axes[name].config.counts_per_radian
            assert error <= 2  # one count after settling (page 1.7), and up to one between edge and shaft


@pytest.mark.parametrize(
    ("name", "milliseconds"), [("left_vergence", 333.3), ("pan", 333.3), ("tilt", 475.5)]
)
async def test_a_thirty_degree_saccade_takes_the_time_of_the_page(name: str, milliseconds: float) -> None:
    async with simulated_head(seed=2) as sim, sim.open() as head:
        await head.home([name])
        await head.move({name: math.radians(-15)}, together=True)
        with sim.machine.record(name) as recording:
            report = await head.move({name: math.radians(15)}, together=True)
            await asyncio.sleep(0.2)
        assert report.all_settled
        moving = [i for i, c in enumerate(recording.command[1:]) if c != recording.command[i]]
        # The first command differs one sample after the start at the latest, and the last is that of the first
        # sample at or after N: up to one sample late.
        took = (moving[-1] - moving[0] + 1) * PERIOD * 1e3
        assert milliseconds - PERIOD * 1e3 <= took <= milliseconds + PERIOD * 1e3
        rest = recording.actual[-50:]
        assert max(abs(recording.command[-1] - counts) for counts in rest) <= 1


async def test_a_joint_too_near_to_be_stretched_ends_early_and_is_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async with simulated_head(seed=2) as sim, sim.open() as head:
        await head.home(["pan", "tilt"])
        report = await head.move({"pan": math.radians(30), "tilt": math.radians(0.01)}, together=True)
        assert report.plan.early == ("tilt",)
        assert "tilt: too near to be stretched" in caplog.text
        assert report.all_settled


async def test_targets_out_of_reach_and_joints_not_homed_are_refused_before_anything_moves() -> None:
    async with simulated_head(seed=2) as sim, sim.open() as head:
        await head.home(["pan"])
        with pytest.raises(CommandError, match=r"pan: 120\.00° is outside the soft limits"):
            await head.move({"pan": math.radians(120)}, together=True)
        with pytest.raises(CommandError, match=r"tilt: is (idle; enable it first|not homed)"):
            await head.move({"pan": 0.1, "tilt": 0.0}, together=True)
        with pytest.raises(CommandError, match="no joint 'neck'"):
            await head.move({"neck": 0.0}, together=True)
        snapshot = await head.read()
        assert abs(snapshot.joints["pan"].angle) < 1e-3
