"""Pairs of images of a floor from a camera that drives over it, empty, or with a box on it or a hole in it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.plane.metric_plane import MetricPlane
from sim_devices.worlds.placement import Placement, facing, rotation_about, still
from sim_devices.worlds.surface import Rectangle, box
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.truth import meet
from sim_devices.worlds.world import World
from tools.plane.images import expose, look, square_optics, texture_of

Image = NDArray[np.uint8]
Field = NDArray[np.float32]
SIDE, FOCAL, HEIGHT_M, BOX_M = 128, 160.0, 0.5, 0.12
CAMERA = Intrinsics(SIDE, SIDE, FOCAL, FOCAL, (SIDE - 1) / 2, (SIDE - 1) / 2)
TEXEL_M = {"noise": 0.0008, "photo": 0.0011}
TURN_DEG = 0.3
"""Standard deviation of how the camera turns in a step."""


@dataclass(frozen=True)
class FloorCase:
    """What is to be seen: texture of floor and box, the box's height over that of the camera, step, pitch, seed."""

    texture: str
    height: float
    step_m: float
    pitch_deg: float
    seed: int
    noise: float = 2.0


@dataclass(frozen=True, eq=False)
class FloorPair:
    """Both images, what the base says that it did, and where the box is in the first."""

    first: Image
    second: Image
    motion: Motion
    """Odometry: the true motion with an error of 1 % and .05°."""
    floor: MetricPlane
    obstacle: NDArray[np.bool_]


def floor_plane(pitch_deg: float) -> MetricPlane:
    """The floor in the frame of a camera pitched down."""
    pitch = np.radians(pitch_deg)
    return MetricPlane.at(np.array([0.0, np.cos(pitch), np.sin(pitch)]), HEIGHT_M)


def floor_flow_px(step_m: float, pitch_deg: float) -> float:
    """Motion of the floor in the middle of the image: f sin²δ T/H."""
    return float(FOCAL * np.sin(np.radians(pitch_deg)) ** 2 * step_m / HEIGHT_M)


def drive(case: FloorCase) -> FloorPair:
    """Render a case."""
    rng = np.random.default_rng(case.seed)
    pitch = float(np.radians(case.pitch_deg))
    reach = 0.08 if case.pitch_deg > 50 else 0.25
    ahead = HEIGHT_M / np.tan(pitch) + rng.uniform(-reach, reach) + case.step_m / 2
    place = np.array([ahead, rng.uniform(-0.09, 0.09), case.height * HEIGHT_M / 2])
    world = _world(case, place, rng)
    turn = float(rng.normal() * np.radians(TURN_DEG))
    cameras = [
        facing((0.0, 0.0, HEIGHT_M), 0.0, pitch),
        facing((case.step_m, 0.0, HEIGHT_M), turn, pitch),
    ]
    optics = square_optics(SIDE, FOCAL)
    lights = [look(world, optics, camera) for camera in cameras]
    inward = cameras[1].rotation.T
    rotation = inward @ cameras[0].rotation
    translation = inward @ (cameras[0].position - cameras[1].position)
    told = cv2.Rodrigues(rng.normal(size=3) * np.radians(0.05))[0] @ rotation
    motion = Motion(told, translation * (1 + 0.01 * rng.normal()))
    first, second = (expose(light, case.noise, rng) for light in lights)
    obstacle = meet(world, optics, cameras[0], 0.0).surface > 0
    return FloorPair(first, second, motion, floor_plane(case.pitch_deg), obstacle)


def _world(case: FloorCase, place: NDArray[np.float64], rng: np.random.Generator) -> World:
    photo = not case.texture.startswith("noise")
    texture = texture_of(case.texture, repeat=4, mirrored=photo)
    texel = TEXEL_M["photo" if photo else "noise"]
    height, width = (float(side * 4 * texel) for side in texture.picture.shape)
    shift = (float(rng.uniform(-0.3, 0.3)), float(rng.uniform(-0.3, 0.3)), 0.0)
    floor = Rectangle(width, height, texture, still(facing(shift, float(rng.uniform(-3, 3)), np.pi / 2)))
    world = World([floor], sky=90.0)
    if case.height > 0:
        side = int(BOX_M / texel)
        row, column = (int(rng.integers(0, size - side)) for size in texture.picture.shape)
        part = texture.picture[row : row + side, column : column + side]
        top = Texture(np.ascontiguousarray(part, np.float32))
        stands = Placement(rotation_about(2, float(rng.uniform(-0.7, 0.7))), place)
        world.extend(box((BOX_M, BOX_M, case.height * HEIGHT_M), top, still(stands)))
    return world
