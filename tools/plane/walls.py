"""Pairs of images of a wall that a camera nears, as it is and with something before it or in other light."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import facing, still
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.world import World
from tools.plane.images import expose, look, square_optics, texture_of

Image = NDArray[np.uint8]
Field = NDArray[np.float32]
Vector = NDArray[np.float64]
SIDE, FOCAL, WINDOW = 128, 128.0, 80
CAMERA = Intrinsics(SIDE, SIDE, FOCAL, FOCAL, (SIDE - 1) / 2, (SIDE - 1) / 2)
WALL_M = 1.5
"""Height of the texture on a wall 1 m away: the window shows half of it."""


@dataclass(frozen=True, eq=False)
class WallPair:
    """Two views of a wall before noise, and what is true of them."""

    lights: tuple[Field, Field]
    plane: Vector
    """n/D in the first view, 1/m."""
    motion: Motion

    @property
    def approach(self) -> float:
        """Part of the distance that the step covers."""
        return float(-self.plane @ self.motion.rotation.T @ self.motion.translation)

    def exposed(self, seed: int, noise: float = 2.0, change: "Change | None" = None) -> tuple[Image, Image]:
        """Both images with noise; `change` is what the light does to the first (0) and second (1)."""
        rng = np.random.default_rng(seed)
        first, second = (light if change is None else change(light, k) for k, light in enumerate(self.lights))
        return expose(first, noise, rng), expose(second, noise, rng)


Change = Callable[[Field, int], Field]


def approach_wall(
    texture: str, seed: int, frames: float, yaw_deg: float, obstacle: float = 0.0, before: str = ""
) -> WallPair:
    """A wall about 1 m ahead, `frames` steps away along the axis, turned by `yaw_deg`; seed places the texture.

    Args:
        obstacle: part of the window that a rectangle covers, at .5 to .8 of the distance of the wall.
        before: the rectangle's texture.
    """
    rng = np.random.default_rng(seed)
    yaw = float(np.radians(yaw_deg))
    across, up = float(rng.uniform(-0.2, 0.2)), float(rng.uniform(-0.12, 0.12))
    picture = texture_of(texture)
    width = WALL_M * picture.picture.shape[1] / picture.picture.shape[0]
    world = World([Rectangle(width, WALL_M, picture, still(facing((1.0, across, up), yaw)))])
    if obstacle:
        world.add(_rectangle_before(texture_of(before), obstacle, rng))
    normal = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    ahead = float(normal @ (1.0, across, up) / normal[0])
    step = ahead / frames
    optics = square_optics(SIDE, FOCAL)
    lights = tuple(look(world, optics, facing((x, 0.0, 0.0))) for x in (0.0, step))
    # world x forward, y left, z up; camera x right, y down, z forward
    plane = np.array([-normal[1], 0.0, normal[0]]) / float(normal @ (1.0, across, up))
    return WallPair((lights[0], lights[1]), plane, Motion(np.eye(3), np.array([0.0, 0.0, -step])))


def _rectangle_before(texture: object, part: float, rng: np.random.Generator) -> Rectangle:
    half = WINDOW / 2 / FOCAL
    distance, shape = float(rng.uniform(0.5, 0.8)), float(np.exp(rng.uniform(-0.5, 0.5)))
    area = part * (2 * half) ** 2
    wide = min(np.sqrt(area * shape), 2 * half)
    high = min(area / wide, 2 * half)
    wide = area / high
    x = float(rng.uniform(-half + wide / 2, half - wide / 2))
    y = float(rng.uniform(-half + high / 2, half - high / 2))
    place = facing((distance, -x * distance, -y * distance))
    return Rectangle(float(wide * distance), float(high * distance), texture, still(place))  # type: ignore[arg-type]


def pitched_at_wall(texture: str, seed: int, ratio: float, heading_deg: float) -> WallPair:
    """A camera pitched 30° down that goes straight ahead; the wall is 1 to 2 m away and turned by `heading_deg`.

    Args:
        ratio: the wall's distance along its normal over the step.
    """
    rng = np.random.default_rng(seed)
    heading, pitch = float(np.radians(heading_deg)), float(np.radians(30))
    distance = float(rng.uniform(1, 2))
    picture = texture_of(texture, mirrored=True)
    high = 6.0
    width = high * picture.picture.shape[1] / picture.picture.shape[0]
    normal = np.array([np.cos(heading), np.sin(heading), 0.0])
    foot = distance * normal + np.array([-normal[1], normal[0], 0.0]) * rng.uniform(-0.7, 0.7)
    place = (float(foot[0]), float(foot[1]), float(-distance * np.tan(pitch) + rng.uniform(-0.7, 0.7)))
    world = World([Rectangle(width, high, picture, still(facing(place, heading)))])
    step = distance / ratio
    cameras = [facing((0.0, 0.0, 0.0), 0.0, pitch), facing((step, 0.0, 0.0), 0.0, pitch)]
    optics = Optics(SIDE, SIDE, FOCAL, FOCAL, CAMERA.cx, CAMERA.cy)
    lights = tuple(look(world, optics, camera) for camera in cameras)
    inward = cameras[0].rotation.T
    motion = Motion(np.eye(3), -inward @ np.array([step, 0.0, 0.0]))
    return WallPair((lights[0], lights[1]), inward @ normal / distance, motion)


def heading_of(normal: Vector, pitch_deg: float = 30.0) -> float:
    """By how much a wall is turned to the left, deg, from its normal in the frame of a camera pitched down."""
    pitch = np.radians(pitch_deg)
    forward = normal[2] * np.cos(pitch) - normal[1] * np.sin(pitch)
    return float(np.degrees(np.arctan2(-normal[0], forward)))


def _ramp(light: Field, k: int, both: bool = False) -> Field:
    across = np.linspace(0, 1, light.shape[1], dtype=np.float32)
    return light * (1 - np.float32(0.4) * across) if k or both else light


def _lamp(light: Field, k: int) -> Field:
    x, y = np.meshgrid(*(np.linspace(0, 1, side, dtype=np.float32) for side in light.shape[::-1]))
    return (
        light * (1 - np.float32(0.47) * ((x - np.float32(0.3)) ** 2 + (y - np.float32(0.4)) ** 2))
        if k
        else light
    )


def contrast(part: float) -> Change:
    """The contrast about grey 128 reduced to a part."""
    return lambda light, k: 128 + np.float32(part) * (light - 128)


LIGHTS: dict[str, Change] = {
    "gain .8": lambda light, k: light * np.float32(0.8) if k else light,
    "ramp of 40 %": _ramp,
    "ramp of 40 % in both": lambda light, k: _ramp(light, k, both=True),
    "lamp, 40 % at the rim": _lamp,
    "blur 2 px": lambda light, k: np.asarray(cv2.GaussianBlur(light, (0, 0), 2.0), np.float32),
    "contrast .5": contrast(0.5),
    "contrast .2": contrast(0.2),
    "contrast .1": contrast(0.1),
    "contrast .05": contrast(0.05),
}
"""What changes between the images, or makes both poorer."""
