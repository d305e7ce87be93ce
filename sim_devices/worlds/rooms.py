"""Surroundings to look at: a room with a lamp or a textured target, and a screen that plays pictures."""

from collections.abc import Sequence
from math import pi, radians, tan
from pathlib import Path

import cv2
import numpy as np

from sim_devices.worlds.config import PathConfig, TargetConfig
from sim_devices.worlds.placement import (
    Motion,
    Placement,
    Signal,
    constant,
    facing,
    on_bearing,
    ramp,
    sine,
    still,
    triangle,
)
from sim_devices.worlds.surface import Rectangle, Surface, play
from sim_devices.worlds.texture import Texture, disc, noise
from sim_devices.worlds.world import World

PICTURE_SUFFIXES = {".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff"}


def signal(path: PathConfig, scale: float = 1.0) -> Signal:
    """The path as a function of time, its values multiplied by ``scale``."""
    mean, amplitude, speed = path.mean * scale, path.amplitude * scale, path.speed * scale
    match path.kind:
        case "sine":
            return sine(amplitude, path.frequency_hz, mean)
        case "triangle":
            return triangle(amplitude, speed, mean) if amplitude else constant(mean)
        case "ramp":
            return ramp(mean, speed, None if path.stop is None else path.stop * scale)
        case "still":
            return constant(mean)


def target_motion(target: TargetConfig, *, turned: bool = True) -> Motion:
    """How the target moves about the head, from its configuration."""
    degree = pi / 180.0
    return on_bearing(
        signal(target.azimuth_deg, degree),
        signal(target.elevation_deg, degree),
        signal(target.distance_m),
        turned,
    )


def walls(seed: int, *, mean: float = 90.0, contrast: float = 25.0) -> list[Surface]:
    """Two textured walls that meet in a corner ahead: one across, one along the left side."""
    return [
        Rectangle(
            9.0, 6.0, noise(512, seed + 1, mean=mean, contrast=contrast), still(facing((3.5, -1.0, 0.0)))
        ),
        Rectangle(
            8.0,
            6.0,
            noise(512, seed + 2, mean=mean, contrast=contrast),
            still(facing((0.5, 3.4, 0.0), pi / 2)),
        ),
    ]


def target_surface(target: TargetConfig, seed: int, motion: Motion) -> Surface:
    """The lamp, the textured patch or the screen that the head follows."""
    if target.kind == "lamp":
        return Rectangle(
            target.size_m, target.size_m, disc(64, light=255.0, dark=255.0), motion, elliptic=True, glows=True
        )
    if target.kind == "texture":
        return Rectangle(
            target.size_m, target.size_m, noise(128, seed + 3, mean=140.0, contrast=55.0, finest=6.0), motion
        )
    pictures = read_pictures(Path(target.pictures))
    distance = target.distance_m.mean
    width, height = (2.0 * distance * tan(radians(angle) / 2.0) for angle in target.screen_deg)
    return Rectangle(width, height, play(pictures, target.picture_rate_hz), motion, glows=True)


def make_world(target: TargetConfig, *, seed: int = 0, light: float = 1.0) -> tuple[World, Surface | None]:
    """The room for a target, and the target's surface in it."""
    world = World(light=light)
    surface = add_target(world, target, seed=seed)
    if target.walls and target.kind != "screen":
        world.extend(walls(seed))
    return world, surface


def add_target(
    world: World, target: TargetConfig, *, seed: int = 0, about: Placement | None = None
) -> Surface | None:
    """Put the target's surface into a world, on its path about the origin or another place."""
    if target.kind == "none":
        return None
    motion = target_motion(target)
    surface = target_surface(target, seed, motion if about is None else _about(about, motion))
    world.add(surface)
    return surface


def _about(place: Placement, motion: Motion) -> Motion:
    return lambda t: place @ motion(t)


def read_pictures(folder: Path) -> Sequence[Texture]:
    """Every picture of a folder, in the order of their names, grey; ValueError when there is none."""
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder of pictures")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES)
    textures = []
    for path in paths:
        picture = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise ValueError(f"{path} cannot be read as a picture")
        textures.append(Texture(np.asarray(picture, np.uint8)))
    if not textures:
        raise ValueError(f"no pictures in {folder} (looked for {', '.join(sorted(PICTURE_SUFFIXES))})")
    return textures
