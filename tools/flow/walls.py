"""Images of textured walls from a moving camera: every ray meets its wall, whose grey level is a sum of waves there.

Nothing is interpolated: a pixel is the mean of three rays side by side across its width.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.flow.geometry import Mounting

Levels = NDArray[np.float64]
RAYS = 3
Print = Callable[[Levels, Levels, Levels], Levels]
"""Grey levels (rows, columns), mean 0, of a wall: of the columns' places along it, m, the height, m, that lies between
two rows at each column, and the rows counted upward from the height of the camera."""


def waves(seed: int, contrast: float, finest_m: float, coarsest_m: float = 0.5, count: int = 60) -> Print:
    """Waves of all directions, equally many in every octave, of one amplitude: a 1/f print of σ = 40 × contrast."""
    random = np.random.default_rng(seed)
    length = finest_m * (coarsest_m / finest_m) ** random.random(count)
    direction, phase = random.uniform(0, pi, count), random.uniform(0, 2 * pi, count)
    along, up = 2 * pi * np.cos(direction) / length, 2 * pi * np.sin(direction) / length

    def levels(place: Levels, rise: Levels, rows: Levels) -> Levels:
        wave = np.exp(1j * (along[:, None] * place + up[:, None] * rise * rows[0] + phase[:, None]))
        step = np.exp(1j * up[:, None] * rise * (rows[1] - rows[0]))
        total = np.empty((len(rows), len(place)))
        for row in total:
            row[:] = wave.real.sum(axis=0)
            wave *= step
        return np.asarray(40 * contrast * (2 / count) ** 0.5 * total)

    return levels


def stripes(period_m: float, contrast: float) -> Print:
    """Upright stripes, a cosine of standard deviation 40 × contrast."""
    return lambda place, rise, rows: (
        40 * contrast * 2**0.5 * np.cos(2 * pi * place / period_m) + np.zeros((len(rows), 1))
    )


def bare(place: Levels, rise: Levels, rows: Levels) -> Levels:
    """No print."""
    return np.zeros((len(rows), len(place)))


@dataclass(frozen=True)
class Wall:
    """An upright wall through (x, y), running at `heading` (rad, counter-clockwise from x); m, in the floor's plane."""

    x: float
    y: float
    heading: float
    levels: Print


@dataclass(frozen=True)
class Pose:
    """Place and heading of the body that carries the camera, x forward at heading 0, y left."""

    x: float
    y: float
    heading: float

    def moved_to(self, other: "Pose") -> tuple[float, float, float]:
        """The other pose in this one's axes: forward, left, turn."""
        c, s = cos(self.heading), sin(self.heading)
        dx, dy = other.x - self.x, other.y - self.y
        return c * dx + s * dy, c * dy - s * dx, other.heading - self.heading


def render(wall: Wall, camera: Intrinsics, mounting: Mounting, pose: Pose) -> tuple[Levels, Levels]:
    """Light on the pixels (height, width), mean 128, and every column's 1/Z along the optical axis, 1/m."""
    c, s = cos(pose.heading), sin(pose.heading)
    x = pose.x + c * mounting.forward_m - s * mounting.left_m
    y = pose.y + s * mounting.forward_m + c * mounting.left_m
    axis = pose.heading + mounting.yaw_rad
    columns = np.arange(camera.width * RAYS) / RAYS - (RAYS - 1) / (2 * RAYS)
    ray = (columns - camera.cx) / camera.fx
    # One metre along the axis, and `ray` metres to the right of it.
    along_x, along_y = cos(axis) + ray * sin(axis), sin(axis) - ray * cos(axis)
    across = -sin(wall.heading), cos(wall.heading)
    depth = ((wall.x - x) * across[0] + (wall.y - y) * across[1]) / (
        along_x * across[0] + along_y * across[1]
    )
    place = (x + depth * along_x - wall.x) * cos(wall.heading) + (y + depth * along_y - wall.y) * sin(
        wall.heading
    )
    rows = camera.cy - np.arange(camera.height, dtype=float)
    light = wall.levels(place, depth / camera.fy, rows)
    return 128 + light.reshape(camera.height, camera.width, RAYS).mean(axis=2), 1 / depth[RAYS // 2 :: RAYS]
