"""What goes wrong while the head follows, and that it never is left moving."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from medusa.errors import PortError
from medusa.gaze.run.assembly import patch_detectors
from medusa.kinematics import Joints
from perception.camera.errors import CameraError
from sim_devices.stereo import StereoWorld
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from tools.gaze.eye_head import RATE_HZ, lamp
from tools.gaze.rig import Rig, Run, open_rig
from tools.gaze.single_axis import spot_in
from tools.gaze.sweep import predictive_gaze

SWINGING = PathConfig(kind="sine", amplitude=12.0, frequency_hz=0.1)
LEVEL, NEAR = PathConfig(), PathConfig(mean=1.2)
Stage = Callable[[StereoWorld, asyncio.AbstractEventLoop], None]


def after(seconds: float, verb: str, *arguments: Any) -> Stage:
    """Call a verb of the world so long after the path has begun."""

    def stage(world: StereoWorld, loop: asyncio.AbstractEventLoop) -> None:
        def happen() -> None:
            world.advance_to(loop.time())
            world.verbs[verb](*arguments)

        loop.call_later(seconds, happen)

    return stage


def both(*stages: Stage) -> Stage:
    def stage(world: StereoWorld, loop: asyncio.AbstractEventLoop) -> None:
        for each in stages:
            each(world, loop)

    return stage


async def follow(rig: Rig, world: WorldConfig, seconds: float, stage: Stage | None, **more: Any) -> Run:
    run = await rig.run(
        world, predictive_gaze(RATE_HZ), seconds, stage=stage, **{"detectors": (spot_in, spot_in), **more}
    )
    await assert_at_rest(rig)
    return run


async def assert_at_rest(rig: Rig) -> None:
    """Half a second later every joint stands where it stood: true angles, out of band."""
    machine, loop = rig.simulation.machine, asyncio.get_running_loop()
    await asyncio.sleep(0.5)
    before = machine.joint_angles(loop.time())
    await asyncio.sleep(0.5)
    later = machine.joint_angles(loop.time())
    # A servo at rest may hunt by a count or two: 0.02 degrees.
    assert all(abs(later[name] - before[name]) < math.radians(0.02) for name in before)


def worst_eye(run: Run, eye: int, since: float, until: float) -> float:
    chosen = (run.times >= since) & (run.times < until)
    return float(np.degrees(run.eye_errors()[chosen, eye].max()))


async def test_with_one_camera_dead_the_other_eye_leads_and_both_keep_looking_at_the_target() -> None:
    async with open_rig() as rig:
        run = await follow(rig, lamp(SWINGING, LEVEL, NEAR), 10.0, after(4.0, "camera", "right", True))
    blind = [row for row in run.log.rows if row.stamp - run.start > 4.2]
    assert blind
    assert all(row.right is None and row.left is not None for row in blind)
    # The distance is remembered, so the blind eye goes along; 1 degree is the bound for a saccade off the axes.
    assert worst_eye(run, 0, 5.0, 10.0) < 1.0
    assert worst_eye(run, 1, 5.0, 10.0) < 1.0


async def test_with_both_cameras_dead_the_run_ends_with_their_error_and_the_head_at_rest() -> None:
    async with open_rig() as rig:
        stage = both(after(3.0, "camera", "left", True), after(3.0, "camera", "right", True))
        with pytest.raises(CameraError, match="no frame for"):
            await follow(rig, lamp(SWINGING, LEVEL, NEAR), 10.0, stage)
        await assert_at_rest(rig)


async def test_with_the_lights_out_the_head_holds_and_finds_the_target_again() -> None:
    patch_world = WorldConfig(
        target=TargetConfig(
            kind="texture", size_m=0.3, azimuth_deg=SWINGING, elevation_deg=LEVEL, distance_m=NEAR
        ),
        cameras=CamerasConfig(width=64, height=64, field_of_view_deg=40.0, rate_hz=RATE_HZ, latency_ms=60.0),
    )
    async with open_rig() as rig:
        example = StereoWorld(patch_world, rig.simulation.machine.joint_angles)
        assert example.target is not None
        assert not callable(example.target.painting)
        side = round(0.3 / 1.2 * example.optics.fx)
        picture = cv2.resize(example.target.painting.levels[0], (side, side), interpolation=cv2.INTER_AREA)
        detectors = patch_detectors(np.asarray(picture, np.uint8))
        stage = both(after(3.0, "lights", 0.0), after(5.0, "lights", 1.0))
        run = await follow(rig, patch_world, 9.0, stage, detectors=detectors)
    held = [t - run.start for t, _ in run.log.holds]
    assert any(3.4 < t < 5.1 for t in held)
    dark = (run.times > 4.2) & (run.times < 5.0)
    gaze = np.degrees(run.gaze_azimuth())[dark]
    assert np.ptp(gaze) < 0.1  # at rest in the dark
    assert worst_eye(run, 0, 6.5, 9.0) < 1.0


async def test_a_target_hidden_for_a_second_is_awaited_and_followed_again() -> None:
    async with open_rig() as rig:
        run = await follow(rig, lamp(SWINGING, LEVEL, NEAR), 9.0, after(4.0, "hide", 1.0))
    unseen = [row for row in run.log.rows if row.left is None and row.right is None]
    assert 4 <= len(unseen) <= 7  # six pictures a second, one more or less at either end
    assert worst_eye(run, 0, 6.0, 9.0) < 1.0


async def test_a_target_behind_the_limit_of_travel_is_looked_at_as_far_as_it_goes_and_the_joint_is_named() -> (
    None
):
    far_left = PathConfig(kind="ramp", mean=20.0, speed=8.0, stop=55.0)
    async with open_rig() as rig:
        run = await follow(rig, lamp(far_left, LEVEL, NEAR), 8.0, None)
    assert run.log.limited & {"left_vergence", "right_vergence"}
    eyes = np.degrees([[q.left, q.right] for q in run.joints])
    assert eyes.max() < 38.0  # the soft limit
    assert eyes[-1].min() > 35.0  # and nearly there


async def test_pictures_late_by_200_ms_are_still_good_for_pursuit() -> None:
    async with open_rig() as rig:
        stage = both(after(3.0, "delay", "left", 0.2), after(3.0, "delay", "right", 0.2))
        run = await follow(rig, lamp(SWINGING, LEVEL, NEAR), 10.0, stage)
    late = [row.acted - row.stamp for row in run.log.rows if row.stamp - run.start > 3.5]
    assert min(late) > 0.2
    assert worst_eye(run, 0, 5.0, 10.0) < 2.0


async def test_a_cable_pulled_in_pursuit_ends_the_run_by_name_and_the_boards_stop_by_themselves() -> None:
    velocities: list[float] = []
    with pytest.raises(PortError):
        await pursue_until_the_cable_is_pulled(velocities)
    assert len(velocities) == 4
    assert max(abs(v) for v in velocities) < math.radians(0.1)


async def pursue_until_the_cable_is_pulled(velocities: list[float]) -> None:
    """True joint velocities a second after the run has ended go into the list."""
    async with open_rig() as rig:

        def pull(world: StereoWorld, loop: asyncio.AbstractEventLoop) -> None:
            loop.call_later(3.0, lambda: rig.simulation.bench.inject("wire.unplug", line="mc3000"))

        try:
            await rig.run(
                lamp(SWINGING, LEVEL, NEAR), predictive_gaze(RATE_HZ), 8.0,
                start=Joints(0.0, 0.0, 0.0, 0.0), detectors=(spot_in, spot_in), stage=pull,
            )  # fmt: skip
        finally:
            await asyncio.sleep(1.0)
            truth = rig.simulation.bench.state()["head"]["joints"]
            velocities.extend(joint["velocity"] for joint in truth.values())
