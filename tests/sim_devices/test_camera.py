"""The emulated camera: exposes in virtual time where the head stands, late, noisy and lossy by a seed."""

import asyncio
from math import radians

import numpy as np
import pytest

from sim_devices.camera import Picture, Sensor, SimulatedCamera
from sim_devices.chain import HeadGeometry, Mount, optical_frame
from sim_devices.stereo import StereoWorld
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import Placement, facing, still
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.texture import noise, plain
from sim_devices.worlds.world import World

STRAIGHT = {"pan": 0.0, "tilt": 0.0, "left_vergence": 0.0, "right_vergence": 0.0}
OPTICS = Optics.centred_deg(64, 64, 40.0)


def camera(sensor: Sensor, *, seed: int = 1, world: World | None = None) -> SimulatedCamera:
    room = (
        World([Rectangle(6.0, 6.0, noise(256, 1), still(facing((2.0, 0.0, 0.0))))])
        if world is None
        else world
    )
    return SimulatedCamera(
        "left", room, OPTICS, sensor, lambda t: facing((0.0, 0.0, 0.0), 0.1 * t), seed=seed
    )


async def collect(source: SimulatedCamera, seconds: float) -> list[tuple[float, Picture]]:
    loop = asyncio.get_running_loop()
    got: list[tuple[float, Picture]] = []
    source.deliver_to(lambda picture: got.append((loop.time(), picture)))
    source.start()
    await asyncio.sleep(seconds)
    source.stop()
    return got


async def test_exposures_keep_their_rate_and_arrive_after_the_latency() -> None:
    start = asyncio.get_running_loop().time()
    got = await collect(camera(Sensor(rate=10.0, latency=0.03)), 1.05)
    stamps = [picture.stamp - start for _, picture in got]
    assert stamps == pytest.approx([0.1 * k for k in range(1, 11)])
    assert [t - p.stamp for t, p in got] == pytest.approx([0.03] * 10)
    assert [p.sequence for _, p in got] == list(range(10))


async def test_the_same_seed_gives_the_same_pictures_and_another_gives_others() -> None:
    sensor = Sensor(rate=10.0, noise=3.0)
    first, again, other = [
        camera(sensor, seed=seed).expose([0.5], 7).image for seed in (1, 1, 2)
    ]  # fmt: skip
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


async def test_noise_has_the_deviation_that_was_asked_for() -> None:
    grey = World([Rectangle(6.0, 6.0, plain(128.0), still(facing((2.0, 0.0, 0.0))))])
    image = camera(Sensor(noise=4.0), world=grey).expose([0.0], 0).image
    # Rounding to whole grey levels adds 1/12; 4096 pixels know a deviation to 1.1 %.
    assert image.std() == pytest.approx((16.0 + 1.0 / 12.0) ** 0.5, rel=0.04)


async def test_vignette_and_gain_act_on_the_corner_and_the_middle() -> None:
    grey = World([Rectangle(6.0, 6.0, plain(100.0), still(facing((2.0, 0.0, 0.0))))])
    image = camera(Sensor(gain=1.5, vignette=0.4), world=grey).expose([0.0], 0).image
    assert image[32, 32] == 150
    # Half a pixel off the corner itself: 150 (1 - .4 (31.5/32)^2) = 91.9.
    assert int(image[0, 0]) == 92


async def test_motion_during_the_exposure_blurs_along_the_motion() -> None:
    def sharpness(sensor: Sensor) -> float:
        turning = SimulatedCamera(
            "c", World([Rectangle(6.0, 6.0, noise(256, 1), still(facing((2.0, 0.0, 0.0))))]), OPTICS, sensor,
            lambda t: facing((0.0, 0.0, 0.0), radians(30.0) * t),
        )  # fmt: skip
        picture = turning.expose(turning.instants(1.0), 0)
        assert picture.stamp == pytest.approx(1.0)
        return float(np.abs(np.diff(picture.image.astype(float), axis=1)).mean())

    assert sharpness(Sensor(exposure=0.1, blur_samples=8)) < 0.8 * sharpness(Sensor())


async def test_dropped_frames_leave_gaps_in_the_sequence() -> None:
    got = await collect(camera(Sensor(rate=50.0, drop=0.3)), 4.01)
    numbers = [picture.sequence for _, picture in got]
    assert numbers == sorted(set(numbers))
    # 200 exposures, 30 % lost: three standard deviations of the binomial are 19.
    assert 140 - 20 <= len(numbers) <= 140 + 20


async def test_a_dead_camera_sends_nothing_and_comes_back_with_the_right_number() -> None:
    source = camera(Sensor(rate=10.0))
    loop = asyncio.get_running_loop()
    loop.call_later(0.55, setattr, source, "dead", True)
    loop.call_later(1.55, setattr, source, "dead", False)
    got = await collect(source, 2.05)
    assert [picture.sequence for _, picture in got] == [*range(5), *range(15, 20)]


@pytest.mark.parametrize("bad", [{"rate": 0.0}, {"exposure": 1.0}, {"vignette": 1.0}, {"noise": -1.0}])
def test_an_impossible_sensor_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"\d"):
        Sensor(**bad)  # type: ignore[arg-type]


def test_the_chain_turns_the_way_the_conventions_say() -> None:
    def axis(**joints: float) -> np.ndarray:
        return optical_frame(HeadGeometry(), "left", {**STRAIGHT, **joints}).rotation[:, 2]

    assert axis() == pytest.approx([1.0, 0.0, 0.0])
    assert axis(pan=0.1)[1] > 0.0  # pan positive left
    assert axis(tilt=0.1)[2] < 0.0  # tilt positive down
    assert axis(left_vergence=0.1)[1] > 0.0  # eyes positive left
    assert axis(right_vergence=0.1) == pytest.approx([1.0, 0.0, 0.0])


def test_optical_centres_stand_a_baseline_apart_and_off_the_axes_by_the_offset() -> None:
    plainly = HeadGeometry(0.2)
    left, right = (
        optical_frame(plainly, side, {**STRAIGHT, "pan": 0.3}).position for side in ("left", "right")
    )  # type: ignore[arg-type]
    assert np.linalg.norm(left - right) == pytest.approx(0.2)
    assert left == pytest.approx(0.1 * np.array([-np.sin(0.3), np.cos(0.3), 0.0]))
    shifted = HeadGeometry(0.2, Mount((0.02, 0.0, 0.0)))
    turned = optical_frame(shifted, "left", {**STRAIGHT, "left_vergence": np.pi / 6})
    # 20 mm before the axis, turned 30 degrees left: 17.32 mm forward, 10 mm left.
    assert turned.position == pytest.approx([0.0173205, 0.11, 0.0], abs=1e-6)


def test_a_baseline_the_mechanics_do_not_allow_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.25 m"):
        HeadGeometry(0.25)


async def test_both_eyes_expose_together_where_the_joints_are_then() -> None:
    asked: list[float] = []

    def joints(t: float) -> dict[str, float]:
        asked.append(t)
        return {**STRAIGHT, "pan": 0.2 * t}

    still_lamp = TargetConfig(azimuth_deg=PathConfig(), elevation_deg=PathConfig())
    stage = StereoWorld(WorldConfig(target=still_lamp, cameras=CamerasConfig(rate_hz=10.0)), joints)
    stage.power_up(0.0)
    brightest: dict[str, list[float]] = {"left": [], "right": []}
    for side, eye in stage.cameras.items():
        eye.deliver_to(
            lambda p, s=side: brightest[s].append(float(np.mean(np.nonzero(p.image > 200)[1])))  # type: ignore[misc]
        )
    stage.start()
    await asyncio.sleep(0.55)
    stage.stop()
    assert asked == sorted(asked)
    expected = {}
    for side, shift in (("left", 0.065), ("right", -0.065)):
        x = []
        for t in (0.1, 0.2, 0.3, 0.4, 0.5):
            c, s = np.cos(0.2 * t), np.sin(0.2 * t)
            eye_at = shift * np.array([-s, c])
            forward, leftward = np.array([[c, s], [-s, c]]) @ (np.array([1.2, 0.0]) - eye_at)
            x.append(stage.optics.cx - stage.optics.fx * leftward / forward)
        expected[side] = x
    # The threshold cuts the rim to whole pixels: half a pixel.
    for side in ("left", "right"):
        assert brightest[side] == pytest.approx(expected[side], abs=0.5)


def test_verbs_of_the_world_are_checked() -> None:
    stage = StereoWorld(WorldConfig(), lambda t: STRAIGHT)
    with pytest.raises(ValueError, match="no 'third' camera"):
        stage.camera("third", dead=True)
    with pytest.raises(ValueError, match="-1"):
        stage.lights(-1.0)
    with pytest.raises(ValueError, match="positive time"):
        stage.hide(0.0)
    stage.advance_to(2.0)
    stage.hide(1.0)
    pose = Placement(facing((0.0, 0.0, 0.0)).rotation)
    seen = [
        int(
            (
                SimulatedCamera("c", stage.world, stage.optics, Sensor(), still(pose)).expose([t], 0).image
                > 200
            ).sum()
        )
        for t in (1.9, 2.5, 3.1)
    ]
    assert seen[1] == 0
    assert min(seen[0], seen[2]) > 20
