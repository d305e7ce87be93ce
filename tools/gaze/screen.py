"""Real pictures on a swinging screen: does the head keep their target in both foveas, and a still head not?"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from medusa.gaze.coordination import SharedEffort
from medusa.gaze.run.loop import LoopSettings
from medusa.kinematics import Joints
from perception.target import Shape, Target, detect_bright_target
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from tools.gaze.rig import Run, open_rig
from tools.gaze.sweep import COMMAND_PERIOD, predictive_gaze

RATE_HZ = 6.0
SIZE = 256
FIELD_OF_VIEW_DEG = 60.0
FOVEA = 0.10
# Where the disc is in most pictures while the screen is in the middle: the fairest place for a still head.
AT_THE_DISC = Joints(math.radians(10.5), math.radians(14.5), math.radians(-1.9), math.radians(1.9))
# The white disc is some 54 of 384 px wide, so 27° on the screen; the bright background is larger or ragged.
DISC = Shape(least_area_px=400.0, largest_area_px=4000.0, least_roundness=0.93, least_flatness=0.4)


def screen_world(pictures: Path, *, width: int = SIZE) -> WorldConfig:
    """The pictures forth and back, one a sample, 120° x 90°, swinging ±15° at 0.1 Hz."""
    target = TargetConfig(
        kind="screen", pictures=str(pictures), picture_rate_hz=RATE_HZ, screen_deg=(120.0, 90.0),
        azimuth_deg=PathConfig(kind="sine", amplitude=15.0, frequency_hz=0.1),
        elevation_deg=PathConfig(), distance_m=PathConfig(mean=2.0),
    )  # fmt: skip
    cameras = CamerasConfig(
        width=width,
        height=width,
        field_of_view_deg=FIELD_OF_VIEW_DEG,
        rate_hz=RATE_HZ,
        noise=2.0,
        latency_ms=60.0,
    )
    return WorldConfig(target=target, cameras=cameras)


def disc_in(image: NDArray[np.uint8]) -> Target | None:
    """The white disc of the hand-moved box: bright, of its size, and an ellipse."""
    return detect_bright_target(image, 200, size=128, shape=DISC)


def in_fovea(run: Run, *, since: float) -> float:
    """Share of all pictures exposed after ``since`` with the disc within 10 % of the width of both middles."""
    pairs = [
        (left.image, right.image)
        for left, right in zip(run.pictures["left"], run.pictures["right"], strict=True)
        if left.stamp - run.start >= since
    ]
    return sum(_centred(left) and _centred(right) for left, right in pairs) / len(pairs)


def _centred(image: NDArray[np.uint8]) -> bool:
    target = disc_in(image)
    if target is None:
        return False
    height, width = int(image.shape[0]), int(image.shape[1])
    right, down = target.x_px - (width - 1) / 2.0, target.y_px - (height - 1) / 2.0
    return math.hypot(right, down) <= FOVEA * width


async def watch_screen(
    pictures: Path, *, seconds: float = 23.0, still: bool = False, width: int = SIZE
) -> dict[str, Any]:
    """The head before the screen; all pictures forth and back take 23 s."""
    async with open_rig() as rig:
        run = await rig.run(
            screen_world(pictures, width=width), predictive_gaze(RATE_HZ, coordination=SharedEffort()), seconds,
            start=AT_THE_DISC if still else Joints(0.0, 0.0, 0.0, 0.0), detectors=(disc_in, disc_in),
            settings=LoopSettings(COMMAND_PERIOD), keep_pictures=True, still=still,
        )  # fmt: skip
    saccades = [end - run.start for _, end, _ in run.log.saccades]
    return {"in_fovea": in_fovea(run, since=saccades[0] if saccades else 0.0), "run": run}
