"""A body that passes a wall with a camera to the side: what its lateral flow measures, beside the truth."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import cos, isfinite, pi, sin

import numpy as np

from perception.camera.intrinsics import Intrinsics
from perception.flow.geometry import STILL, CameraMotion, Mounting
from perception.flow.lateral import LateralFlow, LateralSettings, SideMeasurement
from tools.flow.textures import sense
from tools.flow.walls import Levels, Pose, Print, Wall, render, waves

CAMERA = Intrinsics(160, 40, 192.0, 192.0, 79.5, 19.5)
"""The rows and columns around the window of a 256×256 image, focal length 192 px."""
LEFT, RIGHT = Mounting(0.323, 0.105, pi / 2), Mounting(0.323, -0.105, -pi / 2)
"""The thesis's cameras: ρ .34 m at 72° from the side, one on each."""
FINEST_PX = 2.6


@dataclass(frozen=True)
class Drive:
    """A body that passes a wall, at first straight and `distance` m from its camera.

    slant, turn: of the wall away from the way, rad, and of the body, rad/s. speed m/s, rate images/s. levels: the
    wall's print, else waves of `contrast` down to 2.6 px. light: factor on the light of image k. scale: what the
    odometry makes of a metre; deviations: what it states, of the way ahead, aside and of the turn between two images.
    """

    mounting: Mounting = LEFT
    distance: float = 0.7
    slant: float = 0.0
    levels: Print | None = None
    contrast: float = 0.5
    speed: float = 0.08
    turn: float = 0.0
    rate: float = 12.5
    seed: int = 0
    settings: LateralSettings = field(default_factory=LateralSettings)
    light: Callable[[int], float | Levels] = lambda k: 1.0
    scale: float = 1.0
    deviations: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def run(self, images: int) -> Iterator[tuple[SideMeasurement, float]]:
        """Every image's measurement, and the true 1/Z of what the window's middle shows."""
        side = 1 if self.mounting.left_m > 0 else -1
        print_ = self.levels or waves(self.seed, self.contrast, FINEST_PX * self.distance / CAMERA.fx)
        wall = Wall(0.0, side * (abs(self.mounting.left_m) + self.distance), side * self.slant, print_)
        random, flow = np.random.default_rng(self.seed), LateralFlow(CAMERA, settings=self.settings)
        pose, before = Pose(-self.mounting.forward_m, 0.0, 0.0), None
        for k in range(images):
            light, inverse_depth = render(wall, CAMERA, self.mounting, pose)
            image = sense(light * self.light(k), random)
            motion = STILL if before is None else self._motion(before, pose)
            yield flow.step(image, k / self.rate, motion), float(inverse_depth[79:81].mean())
            before, pose = pose, self._next(pose)

    def _motion(self, before: Pose, after: Pose) -> CameraMotion:
        forward, left, turn = before.moved_to(after)
        return self.mounting.motion(self.scale * forward, self.scale * left, turn, self.deviations)

    def _next(self, pose: Pose) -> Pose:
        way, turn = self.speed / self.rate, self.turn / self.rate
        heading = pose.heading + turn / 2
        return Pose(pose.x + way * cos(heading), pose.y + way * sin(heading), pose.heading + turn)


@dataclass(frozen=True)
class Outcome:
    """Of all images after each first one: how many there are, errors as parts of the truth, over their deviations."""

    images: int
    part: Levels
    strength: Levels


def outcome(drives: list[Drive], images: int) -> Outcome:
    """Run some drives and compare with the truth."""
    pairs = [pair for drive in drives for pair in list(drive.run(images))[1:]]
    known = [(m.inverse_depth, m.deviation, truth) for m, truth in pairs if isfinite(m.inverse_depth)]
    value, deviation, truth = np.array(known, float).reshape(-1, 3).T
    return Outcome(len(pairs), value / truth - 1, (value - truth) / deviation)
