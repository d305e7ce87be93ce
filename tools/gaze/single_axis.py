"""Thesis 6.6 on one vergence axis: table 6.4 on ramps, figure 6.14 on slow periodic targets."""

import math
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from medusa.gaze.command import Command, Pursue, Sighting
from medusa.gaze.pid import TABLE_6_4, Gains
from medusa.gaze.pursuit import JointPursuit
from medusa.kinematics import HeadGeometry, Joints
from medusa.mc3000.config import FilterConfig, Filters, Mc3000Config
from medusa.servo.position_filter import design_double_pole, nearest_registers
from medusa.servo.thesis import TILT, VERGENCE
from perception.target import Target, detect_bright_target
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from tools.gaze.rig import Rig, Run, open_rig

FRAME_PERIOD = 2.0 / 3.0
SKIPPED_FRAMES = 6
DISTANCE = 10.0
RAMP_DEG = 35.0
ACCELERATION_DEG_S2 = math.degrees(1.3 * math.pi)
# At this sample period T = 124 and T = 255 of the chip's timer.
TIMERS = {"1 ms": 124, "2.048 ms": 255}


class OneEye:
    """The left eye alone: PID pursuit of its vergence axis, everything else at rest."""

    def __init__(self, gains: Gains, least_speed: float, *, microsaccades: bool) -> None:
        self._pursuit = JointPursuit(gains, FRAME_PERIOD, least_speed, microsaccades=microsaccades)

    def step(self, now: float, joints: Joints, sighting: Sighting | None) -> Command | None:
        """A command a picture; one without the target changes nothing."""
        if sighting is None or sighting.left is None:
            return None
        error = -math.atan(sighting.left[0])
        return Pursue({"left_vergence": self._pursuit.step(error, sighting.joints.left)})

    def saccade_ended(self, now: float) -> None:
        """There are none."""


@dataclass(frozen=True)
class AxisTrack:
    """Target and eye of the left axis at the exposures, degrees; time in seconds."""

    times: NDArray[np.float64]
    target: NDArray[np.float64]
    eye: NDArray[np.float64]

    @property
    def rms(self) -> float:
        """Root mean square error after the first six pictures, degrees."""
        error = (self.target - self.eye)[SKIPPED_FRAMES:]
        return float(np.sqrt(np.mean(error**2)))


def with_timer(config: Mc3000Config, timer: int) -> Mc3000Config:
    """The axes of the left eye's board at one sample period, its filters designed for it; START asks for equal T.

    The left vergence gets the thesis's gaze acceleration.
    """
    for name, joint in (("left_vergence", VERGENCE), ("right_vergence", VERGENCE), ("tilt", TILT)):
        registers = nearest_registers(design_double_pole(joint.plant.at_timer(timer)), timer)
        position = FilterConfig(A=registers.zero, B=registers.pole, K=registers.gain, T=timer)
        slow = msgspec.structs.replace(config.axes[name].filters.proportional_velocity, T=timer)
        filters = Filters(position=position, proportional_velocity=slow, integral_velocity=position)
        config = config.with_axis(name, filters=filters)
    return config.with_axis("left_vergence", acceleration_deg_s2=ACCELERATION_DEG_S2)


def spot(azimuth: PathConfig) -> WorldConfig:
    """A spot of 4 px in 64 px and 40 degrees, at the height of the eyes, nothing behind it."""
    lamp = TargetConfig(
        kind="lamp", size_m=2.0 * DISTANCE * math.tan(math.radians(1.25)), azimuth_deg=azimuth,
        elevation_deg=PathConfig(), distance_m=PathConfig(mean=DISTANCE), walls=False,
    )  # fmt: skip
    cameras = CamerasConfig(
        width=64, height=64, field_of_view_deg=40.0, rate_hz=1.0 / FRAME_PERIOD, noise=1.0
    )
    return WorldConfig(target=lamp, cameras=cameras)


def spot_in(image: NDArray[np.uint8]) -> Target | None:
    """The spot before the dark sky, whose grey level is 40."""
    return detect_bright_target(image, 80)


async def follow(
    rig: Rig, azimuth: PathConfig, gains: Gains, seconds: float, *, microsaccades: bool
) -> AxisTrack:
    """One run of the left eye from where its target begins."""

    def make(rig: Rig, _: HeadGeometry) -> OneEye:
        return OneEye(gains, rig.least_speeds.left, microsaccades=microsaccades)

    first = math.radians(azimuth.mean)
    run = await rig.run(
        spot(azimuth), make, seconds, start=Joints(0.0, 0.0, first, 0.0), detectors=(spot_in, spot_in)
    )
    return _track(run)


def _track(run: Run) -> AxisTrack:
    stamps = np.array([row.stamp - run.start for row in run.log.rows])
    centre = np.array([0.0, run.geometry.baseline / 2.0, 0.0])
    bearing = np.degrees(np.arctan2(run.target[:, 1] - centre[1], run.target[:, 0]))
    eye = np.degrees([joints.left for joints in run.joints])
    return AxisTrack(stamps, np.interp(stamps, run.times, bearing), np.interp(stamps, run.times, eye))


def ramp(speed_deg_s: float) -> tuple[PathConfig, float]:
    """From -35 to +35 degrees, and how long that takes."""
    return PathConfig(
        kind="ramp", mean=-RAMP_DEG, speed=speed_deg_s, stop=RAMP_DEG
    ), 2.0 * RAMP_DEG / speed_deg_s


SLOW_SINE = PathConfig(kind="sine", amplitude=15.0, frequency_hz=1.0 / 60.0)
SLOW_TRIANGLE = PathConfig(kind="triangle", amplitude=15.0, speed=1.0)


async def table_6_4(speeds_deg_s: tuple[float, ...] = (1.0, 2.0, 5.0), timer: str = "1 ms") -> dict[str, Any]:
    """RMS error, degrees, of the six settings on each ramp, and the tracks of the last speed but one."""
    rms: dict[str, dict[str, float]] = {}
    tracks: dict[str, AxisTrack] = {}
    async with open_rig(change=lambda config: with_timer(config, TIMERS[timer])) as rig:
        for speed in speeds_deg_s:
            path, seconds = ramp(speed)
            rms[f"{speed:g}"] = {}
            for name, gains in TABLE_6_4.items():
                track = await follow(rig, path, gains, seconds, microsaccades=False)
                rms[f"{speed:g}"][name] = track.rms
                if speed == speeds_deg_s[min(1, len(speeds_deg_s) - 1)]:
                    tracks[name] = track
    return {"rms_deg": rms, "tracks": tracks}


async def figure_6_14(seconds: float = 60.0) -> dict[str, Any]:
    """Setting iv at 1 ms, at 2.048 ms and there with microsaccades, on a slow sine and a slow triangle."""
    rms: dict[str, dict[str, float]] = {"sine": {}, "triangle": {}}
    tracks: dict[str, dict[str, AxisTrack]] = {"sine": {}, "triangle": {}}
    for label, timer, micro in (
        ("1 ms", "1 ms", False),
        ("2.048 ms", "2.048 ms", False),
        ("2.048 ms, microsaccades", "2.048 ms", True),
    ):
        async with open_rig(change=lambda config, t=timer: with_timer(config, TIMERS[t])) as rig:  # type: ignore[misc]
            for wave, path in (("sine", SLOW_SINE), ("triangle", SLOW_TRIANGLE)):
                track = await follow(rig, path, TABLE_6_4["iv"], seconds, microsaccades=micro)
                rms[wave][label], tracks[wave][label] = track.rms, track
    return {"rms_deg": rms, "tracks": tracks}
