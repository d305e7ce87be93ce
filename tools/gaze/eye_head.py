"""All joints together: coordination of neck and eyes, vergence in depth, and where saccades land."""

import math
from typing import Any

import numpy as np

from medusa.gaze.command import Command, Saccade, Sighting
from medusa.gaze.coordination import COORDINATIONS
from medusa.gaze.run.loop import LoopSettings
from medusa.kinematics import HeadGeometry, Joints, look_at, retinal_errors, triangulate
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from tools.gaze.rig import Rig, Run, open_rig
from tools.gaze.single_axis import spot_in
from tools.gaze.sweep import COMMAND_PERIOD, LATENCY, predictive_gaze

RATE_HZ = 6.0
NEAR, FAR = 0.3, 3.0


def lamp(
    azimuth: PathConfig, elevation: PathConfig, distance: PathConfig, *, size_m: float = 0.06, **cameras: Any
) -> WorldConfig:
    """A lamp on a dark sky before 64² cameras of 40° at 6 Hz."""
    target = TargetConfig(
        kind="lamp",
        size_m=size_m,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        distance_m=distance,
        walls=False,
    )
    seeing = {
        "width": 64, "height": 64, "field_of_view_deg": 40.0, "rate_hz": RATE_HZ,
        "noise": 1.0, "latency_ms": 1e3 * LATENCY, **cameras,
    }  # fmt: skip
    return WorldConfig(target=target, cameras=CamerasConfig(**seeing))


async def coordination(seconds: float = 40.0) -> dict[str, Any]:
    """The three ways of 6.5.3 on one path: a target that swings ±40° to the sides and ±10° in height."""
    world = lamp(
        PathConfig(kind="sine", amplitude=40.0, frequency_hz=0.05),
        PathConfig(kind="sine", amplitude=10.0, frequency_hz=0.03),
        PathConfig(mean=1.2),
    )
    figures, runs = {}, {}
    async with open_rig() as rig:
        for name, way in COORDINATIONS.items():
            make = predictive_gaze(RATE_HZ, coordination=way)
            run = await rig.run(
                world, make, seconds, detectors=(spot_in, spot_in), settings=LoopSettings(COMMAND_PERIOD)
            )
            pan = np.degrees([q.pan for q in run.joints])
            version = np.degrees([q.version for q in run.joints])
            figures[name] = {
                **run.figures(2.0),
                "pan_travel_deg": float(np.abs(np.diff(pan)).sum()),
                "pan_peak_speed_deg_s": float(np.abs(np.diff(pan)).max() / np.diff(run.times).mean()),
                "largest_version_deg": float(np.abs(version).max()),
                "mean_version_deg": float(np.abs(version).mean()),
            }
            runs[name] = run
    return {"figures": figures, "runs": runs}


async def vergence(seconds: float = 40.0) -> dict[str, Any]:
    """A target that comes from 3 m to 0.3 m and goes again, a little to the side."""
    mean, amplitude = (FAR + NEAR) / 2.0, (FAR - NEAR) / 2.0
    world = lamp(
        PathConfig(mean=4.0), PathConfig(mean=2.0),
        PathConfig(kind="sine", mean=mean, amplitude=amplitude, frequency_hz=0.05), size_m=0.03,
    )  # fmt: skip
    async with open_rig() as rig:
        run = await rig.run(
            world, predictive_gaze(RATE_HZ), seconds,
            detectors=(spot_in, spot_in), settings=LoopSettings(COMMAND_PERIOD),
        )  # fmt: skip
    return {"figures": run.figures(2.0), "run": run}


class JumpOnly:
    """Every sighting is jumped at: by full kinematics from both eyes, or by the simplified ones of the thesis."""

    def __init__(self, rig: Rig, geometry: HeadGeometry, *, simplified: bool = False) -> None:
        self._rig, self._geometry, self._simplified = rig, geometry, simplified

    def step(self, now: float, joints: Joints, sighting: Sighting | None) -> Command | None:
        """A saccade to where the target was seen."""
        if sighting is None or sighting.left is None or sighting.right is None:
            return None
        at = sighting.joints
        if self._simplified:
            left, right, tilt = retinal_errors(sighting.left, sighting.right)
            assert left is not None
            assert right is not None
            assert tilt is not None
            wanted = Joints(at.pan, at.tilt + tilt, at.left + left, at.right + right)
        else:
            point = triangulate(self._geometry, at, sighting.left, sighting.right)
            if point is None:
                return None
            wanted = look_at(self._geometry, point, at.pan)
        return Saccade(self._rig.limits.confine(wanted)[0], "target seen")

    def saccade_ended(self, now: float) -> None:
        """The next sighting is the next target."""


def landings(run: Run) -> list[float]:
    """True error of the worse eye, degrees, 50 ms after each saccade has ended."""
    worse = np.degrees(run.eye_errors().max(axis=1))
    return [float(np.interp(end - run.start + 0.05, run.times, worse)) for _, end, _ in run.log.saccades]


async def saccades() -> dict[str, Any]:
    """First and second landing on resting targets, and with optical centres 20 mm off the axes nobody knows of."""
    places = [(12.0, 5.0, 1.2), (-14.0, -6.0, 0.8), (8.0, -12.0, 2.5), (-5.0, 10.0, 0.5), (15.0, 0.0, 1.5)]
    off_axis = {"left_offset_m": (0.02, 0.0, 0.0), "right_offset_m": (0.02, 0.0, 0.0)}
    found: dict[str, Any] = {}
    async with open_rig() as rig:
        for label, offsets, simplified in (
            ("full kinematics", {}, False),
            ("simplified kinematics (6.24), (6.25)", {}, True),
            ("centres 20 mm off, unknown", off_axis, False),
            ("centres 20 mm off, calibrated", off_axis, False),
        ):
            first, second = [], []
            for azimuth, elevation, distance in places:
                world = lamp(
                    PathConfig(mean=azimuth), PathConfig(mean=elevation), PathConfig(mean=distance),
                    size_m=0.05 * distance, **offsets,
                )  # fmt: skip
                believed = HeadGeometry(0.130) if "unknown" in label else None
                run = await rig.run(
                    world, lambda r, g, s=simplified: JumpOnly(r, g, simplified=s), 2.0,  # type: ignore[misc]
                    start=Joints(0.0, 0.0, 0.0, 0.0), detectors=(spot_in, spot_in), geometry=believed,
                )  # fmt: skip
                landed = landings(run)
                first.append(landed[0])
                second.append(landed[1])
            found[label] = {"first_deg": max(first), "next_deg": max(second)}
    return found


def degrees_of(run: Run) -> dict[str, Any]:
    """Pan, tilt, version and vergence of a run in degrees."""
    return {
        "pan": [math.degrees(q.pan) for q in run.joints],
        "tilt": [math.degrees(q.tilt) for q in run.joints],
        "version": [math.degrees(q.version) for q in run.joints],
        "vergence": [math.degrees(q.vergence) for q in run.joints],
    }
