"""The driver on the emulated base: motions, limits, readings. What stops it stands in test_stopping."""

import asyncio
from itertools import pairwise
from math import degrees, radians

import msgspec
import pytest

from labmate.base.events import Cause
from labmate.base.mobile_base import MobileBase
from labmate.base.reading import BaseReading
from labmate.driver.labmate import Labmate
from labmate.errors import MotionStopped, StalePose
from labmate.machines import open_base
from labmate.odometry import Pose, WheelGeometry
from labmate.simulation import SimulatedBase
from medusa.errors import CommandError, PortError
from medusa.link import Line
from sim_devices.bench import Bench
from sim_devices.head import HeadMachine
from sim_devices.labmate import BaseConfig as EmulatedConfig
from sim_devices.labmate import BaseMachine

Watched = list[BaseReading]


async def watch(base: MobileBase, into: Watched) -> None:
    async for snapshot in base.readings(50.0):
        into.append(snapshot)


async def watched(base: MobileBase, kind: str, amount: float) -> Watched:
    seen: Watched = []
    watcher = asyncio.create_task(watch(base, seen))
    try:
        await (base.go(amount) if kind == "GO" else base.turn(amount))
    finally:
        watcher.cancel()
    return seen


@pytest.mark.parametrize("distance", [1.0, -0.6, 0.2, 0.0203, -0.001, 0.0])
async def test_go_ends_within_two_millimetres_of_the_bases_own_odometry(
    base: MobileBase, distance: float
) -> None:
    report = await base.go(distance)
    assert report.ending is Cause.REACHED
    # The criterion.
    assert report.travelled == pytest.approx(distance, abs=2e-3)
    assert report.end.distance_to(report.start) == pytest.approx(abs(distance), abs=2e-3)


@pytest.mark.parametrize("angle", [90.0, -90.0, 5.0, -0.4, 200.0, 0.0])
async def test_turn_ends_within_a_tenth_of_a_degree(base: MobileBase, angle: float) -> None:
    report = await base.turn(radians(angle))
    # The criterion; a turn on the spot goes nowhere but by the rounding of counts.
    assert degrees(report.travelled) == pytest.approx(angle, abs=0.1)
    assert report.end.distance_to(report.start) < 2e-3


async def test_go_keeps_to_the_configured_limits_all_the_way(base: MobileBase) -> None:
    seen = await watched(base, "GO", 1.0)
    speeds = [snapshot.speed for snapshot in seen]
    # The wire rounds speeds to 0.1 mm/s, the encoders' speed to a count in a sample.
    assert 0.29 < max(speeds) <= 0.3 + 1e-3
    assert min(speeds) >= -1e-3
    rates = [(b.speed - a.speed) / (b.stamp - a.stamp) for a, b in pairwise(seen)]
    # 20 ms apart, two roundings of 0.1 mm/s are 0.01 m/s².
    assert max(map(abs, rates)) <= 0.25 + 0.011
    assert max(map(abs, rates)) > 0.24


async def test_turn_keeps_to_the_configured_limits_all_the_way(base: MobileBase) -> None:
    seen = await watched(base, "TURN", radians(60.0))
    rates = [degrees(snapshot.turn_rate) for snapshot in seen]
    assert 14.9 < max(rates) <= 15.0 + 0.02
    changes = [(degrees(b.turn_rate) - degrees(a.turn_rate)) / (b.stamp - a.stamp) for a, b in pairwise(seen)]
    # 20 ms apart, two roundings of 0.01°/s are 1°/s².
    assert max(map(abs, changes)) <= 30.0 + 1.1


async def test_lower_limits_are_sent_and_kept(sim: SimulatedBase) -> None:
    slow = msgspec.structs.replace(sim.config.limits, speed_m_s=0.1, turn_rate_deg_s=5.0)
    async with sim.open(msgspec.structs.replace(sim.config, limits=slow)) as base:
        seen = await watched(base, "GO", 0.3)
        assert 0.099 < max(snapshot.speed for snapshot in seen) <= 0.1 + 1e-3
        with pytest.raises(CommandError, match=r"speed 0\.2 m/s is over the limit of 0\.1 m/s"):
            await base.twist(0.2, 0.0)


async def test_a_turn_rate_of_7_1_degrees_a_second_is_held_within_a_hundredth(
    base: MobileBase, sim: SimulatedBase
) -> None:
    async def drive(seconds: float) -> None:
        end = sim.clock() + seconds
        while sim.clock() < end - 1e-6:
            motion.twist(0.08, radians(7.1))
            await asyncio.sleep(0.1)

    async with base.motion() as motion:
        await drive(1.5)
        before = await base.read()
        await drive(10.0)
        after = await base.read()
    seconds = after.stamp - before.stamp
    held = degrees(after.own_pose.heading - before.own_pose.heading) / seconds
    # The criterion is 1 %; what is left is the rounding of two headings.
    assert held == pytest.approx(7.1, rel=0.01)
    assert degrees(after.turn_rate) == pytest.approx(7.1, rel=0.01)
    way = before.own_pose.distance_to(after.own_pose)
    # The chord of an arc of 71° and radius 0.08/0.1239 m.
    assert way == pytest.approx(2 * 0.08 / radians(7.1) * 0.5807, rel=0.02)


@pytest.mark.parametrize(
    ("speed", "turn_rate", "valid", "told"),
    [
        (0.31, 0.0, 0.3, "speed 0.31 m/s is over the limit of 0.3 m/s"),
        (-0.31, 0.0, 0.3, "speed -0.31 m/s is over"),
        (0.0, radians(15.1), 0.3, "turn rate 15.1°/s is over the limit of 15°/s"),
        (0.1, 0.0, 0.5, "valid for 1 to 300 ms, not 500 ms"),
        (0.1, 0.0, 0.0, "valid for 1 to 300 ms, not 0 ms"),
        (float("nan"), 0.0, 0.3, "finite"),
    ],
)
async def test_a_drive_over_the_limits_is_refused_and_moves_nothing(
    base: MobileBase, sim: SimulatedBase, speed: float, turn_rate: float, valid: float, told: str
) -> None:
    with pytest.raises(CommandError, match=told.replace(".", r"\.")):
        await base.twist(speed, turn_rate, valid)
    with pytest.raises(CommandError):
        async with base.motion() as motion:
            motion.twist(speed, turn_rate if valid == 0.3 else radians(99.0))
    await asyncio.sleep(0.5)
    assert sim.true_pose() == Pose(0.0, 0.0, 0.0)


async def test_one_drive_runs_out_by_itself(base: MobileBase, sim: SimulatedBase) -> None:
    await base.twist(0.1, 0.0)
    await asyncio.sleep(0.29)
    assert (await base.read()).speed > 0.05
    # 0.3 s valid, 0.1/0.25 = 0.4 s of ramp, the drive's pole of 32 ms five times.
    await asyncio.sleep(0.01 + 0.4 + 0.16)
    assert (await base.read()).at_rest
    stood = sim.true_pose()
    await asyncio.sleep(2.0)
    assert sim.true_pose() == stood


async def test_go_on_a_base_that_still_runs_out_a_drive_is_refused(base: MobileBase) -> None:
    await base.twist(0.2, 0.0)
    with pytest.raises(CommandError, match="mode DRIVE, it must be idle"):
        await base.go(0.1)
    await asyncio.sleep(0.45)
    assert (await base.read()).details["mode"] == "stopping"
    with pytest.raises(CommandError, match="mode STOPPING"):
        await base.turn(0.1)


async def test_the_pose_is_set_only_on_a_standing_base(base: MobileBase) -> None:
    await base.set_pose(Pose(1.0, -2.0, radians(30.0)))
    snapshot = await base.read()
    assert (snapshot.own_pose.x, snapshot.own_pose.y, degrees(snapshot.own_pose.heading)) == pytest.approx(
        (1.0, -2.0, 30.0)
    )
    assert snapshot.pose == Pose(1.0, -2.0, radians(30.0))
    report = await base.go(0.1)
    # 0.1 m along 30°.
    assert (report.end.x, report.end.y) == pytest.approx((1.0866, -1.95), abs=2e-3)
    await base.twist(0.1, 0.0)
    with pytest.raises(CommandError) as refused:
        await base.set_pose(Pose(0.0, 0.0, 0.0))
    assert refused.value.status == 6


async def test_the_hosts_odometry_and_the_bases_own_agree_on_a_winding_way(base: MobileBase) -> None:
    for distance, angle in ((0.3, 40.0), (-0.1, -100.0), (0.25, 15.0)):
        await base.go(distance)
        await base.turn(radians(angle))
    snapshot = await base.read()
    # Both reckon from the same counts; the base's are rounded to 0.1 mm and 0.01°.
    assert snapshot.pose.distance_to(snapshot.own_pose) < 0.5e-3
    assert degrees(snapshot.pose.heading - snapshot.own_pose.heading) == pytest.approx(0.0, abs=0.02)
    assert snapshot.covariance[0][0] > 0.0


async def test_the_covariance_of_an_uncalibrated_base_covers_where_it_really_is(
    base: MobileBase, sim: SimulatedBase
) -> None:
    for _ in range(3):
        await base.go(1.5)
        await base.turn(radians(90.0))
    snapshot, true = await base.read(), sim.true_pose()
    off = true.x - snapshot.pose.x, true.y - snapshot.pose.y, true.heading - snapshot.pose.heading
    for i in range(3):
        deviation = snapshot.covariance[i][i] ** 0.5
        # Its constants are a little less than one deviation off (2.8 of 3 mm, 0.00121 of 0.002).
        assert abs(off[i]) < 2.0 * deviation
        # 4.5 m of way and 3° of heading per metre at the very most: not merely a large number.
        assert deviation < (0.3, 0.3, 0.1)[i]


async def test_a_pose_older_than_200_ms_is_an_error_to_whoever_steers_by_it(
    base: MobileBase, sim: SimulatedBase
) -> None:
    async with base.motion() as motion:
        snapshot = await base.read()
        motion.twist(0.1, 0.0, by=snapshot)
        await asyncio.sleep(0.19)
        motion.twist(0.1, 0.0, by=snapshot)
        # The answer took a few milliseconds of the 200.
        await asyncio.sleep(0.02)
        with pytest.raises(StalePose, match="at most 200 ms may be steered by"):
            motion.twist(0.1, 0.0, by=snapshot)
        with pytest.raises(StalePose):
            base.steerable()
        fresh = await base.read()
        assert base.steerable() is fresh
        # The refused command is not driven on: the last one runs out.
        await asyncio.sleep(0.3 + 0.4 + 0.2)
        assert (await base.read()).at_rest


async def test_snapshots_come_at_their_rate(base: MobileBase, sim: SimulatedBase) -> None:
    seen: Watched = []
    started = sim.clock()
    async for snapshot in base.readings(20.0):
        seen.append(snapshot)
        if len(seen) == 21:
            break
    assert sim.clock() - started == pytest.approx(1.0, abs=0.02)
    with pytest.raises(CommandError, match="up to 50 Hz"):
        await anext(base.readings(51.0))


async def test_without_a_configuration_it_is_read_and_stopped_but_not_moved(sim: SimulatedBase) -> None:
    async with open_base(sim.port, None) as base:
        assert base.wheels == WheelGeometry(0.34, 1.0, 50_000)
        assert (await base.stop()).at_rest
        for attempt in (base.go(1.0), base.turn(1.0), base.twist(0.1, 0.0)):
            with pytest.raises(CommandError, match="needs a configuration"):
                await attempt


async def test_a_servo_board_on_the_port_is_named() -> None:
    async with Bench({"head": HeadMachine(None, 0)}, seed=0) as bench:
        with pytest.raises(
            PortError, match="no base answers at address 10H; at 01H answers an MC3000 servo board"
        ):
            async with open_base(bench.ports["mc3000"], None):
                pass


async def test_a_servo_board_at_the_configured_address_is_named(sim: SimulatedBase) -> None:
    port = msgspec.structs.replace(sim.config.port, address=1)
    config = msgspec.structs.replace(sim.config, port=port)
    async with Bench({"head": HeadMachine(None, 0)}, seed=0) as bench:
        with pytest.raises(
            PortError, match="at address 01H answers an MC3000 servo board, not a Labmate base"
        ):
            async with open_base(bench.ports["mc3000"], config):
                pass


async def test_a_base_at_another_address_is_named(sim: SimulatedBase) -> None:
    port = msgspec.structs.replace(sim.config.port, address=0x20)
    with pytest.raises(PortError, match="no base answers at address 20H; at 10H answers a Labmate base"):
        async with sim.open(msgspec.structs.replace(sim.config, port=port)):
            pass


async def test_two_bases_on_one_line_drive_at_once(sim: SimulatedBase) -> None:
    machines = {
        "first": BaseMachine(EmulatedConfig(address=0x10), 1),
        "second": BaseMachine(EmulatedConfig(address=0x11, start_y=3.0), 2),
    }
    async with (
        Bench(machines, seed=0) as bench,
        Line(bench.ports["labmate"], seed=0) as line,
        MobileBase(Labmate(line, sim.config)) as first,
        MobileBase(Labmate(line, sim.config, address=0x11)) as second,
    ):
        reports = await asyncio.gather(first.go(0.5), second.go(-0.3))
        assert [report.travelled for report in reports] == pytest.approx([0.5, -0.3], abs=2e-3)
        loop = asyncio.get_running_loop()
        assert machines["second"].pose(loop.time()).x == pytest.approx(-0.3, abs=5e-3)
        # An emergency stop is for everybody on the line.
        going = asyncio.create_task(second.go(1.0))
        await asyncio.sleep(1.0)
        assert (await first.emergency_stop()).at_rest
        with pytest.raises(MotionStopped) as stopped:
            await going
        assert stopped.value.reason == "emergency stop"
