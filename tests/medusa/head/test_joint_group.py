"""The head as one machine: enabling, moving together, snapshots, stopping, leaving it."""

import asyncio
import logging
import math

import pytest

from medusa.errors import CommandError, DeviceFault
from medusa.head.drive import Speeds
from medusa.head.faults import Cause, Fault
from medusa.head.joint_group import JointGroup
from medusa.head.moves import MoveStopped
from medusa.machines import open_head
from medusa.mc3000.board import Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices.head_config import HeadConfig
from sim_devices.link.faults import FaultPlan

DEGREE = math.radians(1)
TARGETS = {
    "pan": 30 * DEGREE,
    "tilt": -10 * DEGREE,
    "left_vergence": 5 * DEGREE,
    "right_vergence": -5 * DEGREE,
}


def joints(sim: SimulatedHead) -> dict[str, dict[str, object]]:
    truth: dict[str, dict[str, object]] = sim.bench.state()["head"]["joints"]
    return truth


def assert_standing_idle_and_inhibited(sim: SimulatedHead) -> None:
    for joint in joints(sim).values():
        assert (joint["mode"], joint["motor_command"], joint["bridge"]) == (0, 0, "inhibited")
        assert joint["velocity"] == pytest.approx(0.0, abs=1e-4)


async def test_connecting_moves_nothing_and_switches_nothing_on(sim: SimulatedHead) -> None:
    before = sim.machine.joint_angles(0.0)
    async with sim.open():
        await asyncio.sleep(1.0)
        assert sim.machine.joint_angles(asyncio.get_running_loop().time()) == before
        assert_standing_idle_and_inhibited(sim)


async def test_enabling_holds_every_joint_where_it_stands(sim: SimulatedHead) -> None:
    before = sim.machine.joint_angles(0.0)
    async with sim.open() as head:
        await head.enable()
        snapshot = await head.read()
        assert {joint.device.mode for joint in snapshot.joints.values()} == {Mode.POSITION}
        assert {joint["bridge"] for joint in joints(sim).values()} == {"enabled"}
        await asyncio.sleep(0.5)
        after = sim.machine.joint_angles(asyncio.get_running_loop().time())
        for name, angle in before.items():
            # Less than one count of the coarsest joint.
            assert after[name] == pytest.approx(angle, abs=1 / 15915)


async def test_without_amplifiers_the_head_is_only_looked_at(sim: SimulatedHead) -> None:
    async with open_head(sim.config, sim.boards) as head:
        assert (await head.read()).joints["pan"].device.mode is Mode.IDLE
        with pytest.raises(CommandError, match="no port for the amplifiers"):
            await head.enable()


async def test_a_move_brings_all_joints_to_their_angles(sim: SimulatedHead, head: JointGroup) -> None:
    report = await head.move(TARGETS)
    assert all(report.settled.values())
    truth = sim.machine.joint_angles(asyncio.get_running_loop().time())
    for name, angle in TARGETS.items():
        # The dead band of 6.6 counts at most (thesis, nearest registers), the zero, and half a count.
        assert truth[name] == pytest.approx(
            angle, abs=9 / Mc3000Drive.of(head).axes[name].config.counts_per_radian
        )
        assert abs(report.errors[name]) <= 8 / Mc3000Drive.of(head).axes[name].config.counts_per_radian
        assert report.plan.seconds[name] <= report.ends.ended[name] - report.ends.started[name] + 1e-3


async def test_joints_of_one_board_start_in_the_same_sample_and_the_boards_within_two(
    sim: SimulatedHead, head: JointGroup
) -> None:
    names = ("pan", "tilt", "left_vergence")
    firsts = {}
    with (
        sim.machine.record("pan") as pan,
        sim.machine.record("tilt") as tilt,
        sim.machine.record("left_vergence") as left,
    ):
        report = await head.move(dict.fromkeys(names, 10 * DEGREE))
    for name, recording in zip(names, (pan, tilt, left), strict=True):
        start = recording.command[0]
        firsts[name] = next(t for t, c in zip(recording.time, recording.command, strict=True) if c != start)
    assert firsts["tilt"] == pytest.approx(firsts["left_vergence"], abs=1e-9)
    # Each board has its own clock's phase and its own START frame: two samples of 2.048 ms.
    assert abs(firsts["pan"] - firsts["tilt"]) <= 2 * 0.002048 + 1e-9
    assert report.ends.repeated == ()
    # The reported skew comes from stamps of two boards, each known to about a millisecond.
    assert report.start_skew == pytest.approx(abs(firsts["pan"] - firsts["tilt"]), abs=0.0035)


async def test_a_start_that_had_to_be_repeated_is_reported_with_its_skew(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Frames to the devices are lost one in ten: some START of twenty moves has to be repeated."""
    start = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}
    lossy = {"mc3000": FaultPlan(drop=0.1, direction="to_device", start_s=12.0)}
    async with (
        simulated_head(seed=5, config=HeadConfig(start_deg=start), faults=lossy) as sim,
        sim.open() as head,
    ):
        await head.home()
        await asyncio.sleep(12.0 - asyncio.get_running_loop().time())
        reports = []
        for turn in range(20):
            angle = (2 if turn % 2 else -2) * DEGREE
            reports.append(await head.move({"pan": angle, "tilt": angle}))
    repeated = [report for report in reports if report.ends.repeated]
    assert repeated
    assert "START had to be repeated on" in caplog.text
    # A request is repeated after 100 ms, so the boards began about that far apart (or the reply was lost).
    assert max(report.start_skew for report in repeated) == pytest.approx(0.1, abs=0.01)
    assert all(report.start_skew < 0.01 for report in reports if not report.ends.repeated)


async def test_speeds_of_a_move_may_be_lower_than_configured(head: JointGroup) -> None:
    slow = await head.move({"pan": 10 * DEGREE}, {"pan": Speeds(max_speed=20 * DEGREE)})
    # 10° at 11 counts a sample (19.3°/s) and 18 ms of ramp.
    assert slow.plan.seconds["pan"] == pytest.approx(10 / 19.34 + 0.018, abs=0.005)
    fast = await head.move({"pan": 0.0})
    # Triangle of 10° at 1080°/s²: 2 √(10/1080).
    assert fast.plan.seconds["pan"] == pytest.approx(2 * math.sqrt(10 / 1080), abs=0.003)


async def test_a_move_of_no_distance_ends_at_once(head: JointGroup) -> None:
    await head.move({"pan": 0.1})
    report = await head.move({"pan": 0.1})
    assert report.plan.seconds == {"pan": 0.0}
    assert report.settled == {"pan": True}


async def test_one_wrong_target_moves_nothing(sim: SimulatedHead, head: JointGroup) -> None:
    before = joints(sim)["pan"]["command_counts"]
    with pytest.raises(CommandError, match=r"tilt: 50.00° is outside"):
        await head.move({"pan": 0.2, "tilt": 50 * DEGREE})
    with pytest.raises(CommandError, match="there is no joint 'neck'"):
        await head.move({"pan": 0.2, "neck": 0.0})
    await asyncio.sleep(0.3)
    assert joints(sim)["pan"]["command_counts"] == before
    axis = Mc3000Drive.of(head).axes["pan"]
    assert not (await axis.board.settings(axis.channel)).armed


async def test_a_second_move_of_a_moving_joint_is_refused_and_the_first_goes_on(head: JointGroup) -> None:
    first = asyncio.ensure_future(head.move({"pan": 40 * DEGREE}))
    await asyncio.sleep(0.1)
    with pytest.raises(CommandError, match="pan: is moving already"):
        await head.move({"pan": 0.0, "tilt": 0.1})
    assert (await head.move({"tilt": 0.1})).settled == {"tilt": True}
    assert (await first).settled == {"pan": True}


async def test_a_joint_that_cannot_be_armed_leaves_the_others_where_they_are(
    sim: SimulatedHead, head: JointGroup
) -> None:
    other = asyncio.ensure_future(head.move({"left_vergence": 30 * DEGREE}))
    await asyncio.sleep(0.05)
    # Behind the driver's back the axis is idle: the board refuses its MOVE.
    await Mc3000Drive.of(head).axes["tilt"].board.write(2, 0x05, b"\x01")
    with pytest.raises(CommandError) as refused:
        await head.move({"pan": 0.2, "tilt": 0.2})
    assert "tilt" in str(refused.value) or refused.value.status == 6
    axis = Mc3000Drive.of(head).axes["pan"]
    assert not (await axis.board.settings(axis.channel)).armed
    assert (await other).settled == {"left_vergence": True}
    assert (await head.read()).joints["pan"].angle == pytest.approx(0.0, abs=6 / 15915)


async def test_a_cancelled_move_stops_the_head(sim: SimulatedHead, head: JointGroup) -> None:
    moving = asyncio.ensure_future(head.move(TARGETS))
    await asyncio.sleep(0.15)
    moving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await moving
    assert all(abs(float(str(joint["velocity"]))) < 0.01 for joint in joints(sim).values())
    assert all(not joint.moving for joint in (await head.read()).joints.values())


async def test_stop_in_a_move_is_confirmed_and_ends_the_move(sim: SimulatedHead, head: JointGroup) -> None:
    moving = asyncio.ensure_future(head.move({"pan": 90 * DEGREE}))
    await asyncio.sleep(0.2)
    await head.stop()
    standing = joints(sim)["pan"]
    assert abs(float(str(standing["velocity"]))) < 0.01
    assert standing["mode"] == 1
    with pytest.raises(MoveStopped, match="the head was stopped on the way"):
        await moving


async def test_emergency_stop_idles_everything_until_clear(sim: SimulatedHead, head: JointGroup) -> None:
    await head.velocity({"pan": 30 * DEGREE, "tilt": 10 * DEGREE})
    await asyncio.sleep(0.2)
    await head.emergency_stop()
    for joint in joints(sim).values():
        assert (joint["mode"], joint["motor_command"]) == (0, 0)
        assert joint["velocity"] == pytest.approx(0.0, abs=0.01)
    with pytest.raises(CommandError, match="an emergency stop is latched; clear it first"):
        await head.enable()
    assert await head.clear() == {}
    await head.enable()
    await head.move({"pan": 0.0})


async def test_clear_tells_what_remains_latched(sim: SimulatedHead, head: JointGroup) -> None:
    sim.bench.inject("head.switch", axis="pan", side="positive", held="closed")
    await asyncio.sleep(0.3)
    assert await head.clear() == {"pan": frozenset({Cause.LIMIT})}
    sim.bench.inject("head.switch", axis="pan", side="positive", held="free")
    assert await head.clear() == {}


async def test_a_stop_that_cannot_be_confirmed_is_an_error_that_names_the_joints(sim: SimulatedHead) -> None:
    async def program() -> None:
        async with sim.open() as head:
            await head.home()
            sim.bench.inject("wire.unplug", line="mc3000")
            await head.stop()

    with pytest.raises(DeviceFault) as unconfirmed:
        await program()
    assert "pan" in str(unconfirmed.value)
    assert "tilt" in str(unconfirmed.value)
    assert "the stop could not be confirmed" in str(unconfirmed.value)
    assert set(str(unconfirmed.value.axis).split(", ")) == {"pan", "tilt", "left_vergence", "right_vergence"}


async def test_park_ends_idle_and_inhibited_at_the_park_angles(sim: SimulatedHead, head: JointGroup) -> None:
    await head.move(TARGETS)
    await head.park()
    assert_standing_idle_and_inhibited(sim)
    for name, angle in sim.machine.joint_angles(asyncio.get_running_loop().time()).items():
        # Straight ahead, within the dead band and the zero.
        assert angle == pytest.approx(0.0, abs=9 / Mc3000Drive.of(head).axes[name].config.counts_per_radian)
    await head.enable()
    await head.move(TARGETS)


async def test_leaving_a_moving_head_leaves_it_stopped_and_says_so(
    sim: SimulatedHead, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    async with sim.open() as head:
        await head.home()
        await head.velocity({"pan": 60 * DEGREE, "tilt": -20 * DEGREE})
        await asyncio.sleep(0.2)
    assert_standing_idle_and_inhibited(sim)
    assert "stopped, confirmed" in caplog.text
    assert "every amplifier inhibited at rest" in caplog.text


async def test_an_error_in_the_callers_program_leaves_the_head_stopped(sim: SimulatedHead) -> None:
    async def program() -> None:
        async with sim.open() as head:
            await head.home()
            await head.velocity({"pan": 60 * DEGREE})
            await asyncio.sleep(0.2)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await program()
    assert_standing_idle_and_inhibited(sim)


async def test_bridges_are_inhibited_only_at_rest(sim: SimulatedHead, head: JointGroup) -> None:
    await head.velocity({"pan": 100 * DEGREE})
    await asyncio.sleep(0.3)
    fastest = []

    async def watch() -> None:
        while True:
            joint = joints(sim)["pan"]
            if joint["bridge"] == "inhibited":
                fastest.append(abs(float(str(joint["velocity"]))))
                return
            await asyncio.sleep(0.001)

    watching = asyncio.ensure_future(watch())
    await head.disable()
    await watching
    # One count in 25 ms is 0.14°/s.
    assert fastest[0] < 0.0026


@pytest.mark.parametrize("rate", [50.0, 80.0])
async def test_snapshots_stream_at_fifty_hertz_and_more(head: JointGroup, rate: float) -> None:
    times = []
    await head.velocity({"pan": 20 * DEGREE})
    async for snapshot in head.readings(rate):
        times.append(snapshot)
        if len(times) == 51:
            break
    span = times[-1].time - times[0].time
    # 51 instants span 50 periods; each is known to a millisecond or two.
    assert span == pytest.approx(50 / rate, abs=0.005)
    speed = (times[-1].joints["pan"].angle - times[10].joints["pan"].angle) / (
        times[-1].time - times[10].time
    )
    # 11 counts a sample; the quotient of 40 periods carries the stamps' error.
    assert math.degrees(speed) == pytest.approx(19.34, rel=0.005)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, 2000.0])
async def test_a_rate_that_makes_no_sense_is_refused(head: JointGroup, rate: float) -> None:
    with pytest.raises(CommandError, match=r"not in \(0, 1000\] Hz"):
        await anext(aiter(head.readings(rate)))


async def test_an_idle_but_enabled_head_keeps_its_watchdogs_fed(sim: SimulatedHead, head: JointGroup) -> None:
    faults: list[Fault] = []
    head.subscribe(faults.append)
    await asyncio.sleep(20.0)
    assert faults == []
    statistics = await Mc3000Drive.of(head).boards[1].session.statistics()
    assert statistics.watchdog_trips == 0
    # Fed three times a watchdog of 400 ms, and by nothing else: no busy polling.
    before = statistics.frames
    await asyncio.sleep(20.0)
    assert (await Mc3000Drive.of(head).boards[1].session.statistics()).frames - before <= 20 / 0.133 + 2


async def test_a_head_disabled_is_fed_no_more(head: JointGroup) -> None:
    await head.disable()
    before = (await Mc3000Drive.of(head).boards[1].session.statistics()).frames
    await asyncio.sleep(5.0)
    assert (await Mc3000Drive.of(head).boards[1].session.statistics()).frames == before + 1


async def test_faults_arrive_as_a_stream(sim: SimulatedHead, head: JointGroup) -> None:
    stream = head.faults()
    first = asyncio.ensure_future(anext(stream))
    await asyncio.sleep(0)
    sim.bench.inject("head.amplifier_fault", axis="tilt")
    fault = await first
    assert (fault.cause, fault.joints) == (Cause.DRIVE, ("tilt",))
    await stream.aclose()
